"""The navigator's map of the water around the boat, for people and programs to look at."""

from __future__ import annotations

from enum import IntEnum
from typing import Annotated

import msgspec

from paani.messages.header import Finite, Message

MAX_GRID_SIDE = 256  # cells

GridSide = Annotated[int, msgspec.Meta(ge=1, le=MAX_GRID_SIDE)]
PackedCells = Annotated[bytes, msgspec.Meta(max_length=MAX_GRID_SIDE * MAX_GRID_SIDE // 4)]
CellSize = Annotated[float, msgspec.Meta(gt=0.0, le=10.0)]


class Occupancy(IntEnum):
    """What the navigator knows of a cell. BLIND_ZONE: too near for the camera, and taken to be free by whoever arms."""

    UNKNOWN = 0
    FREE = 1
    OCCUPIED = 2
    BLIND_ZONE = 3


class OccupancyGrid(Message, frozen=True, kw_only=True):
    """Cells of `cell_m` a side around the boat, along the map's axes; nothing is decided by this message.

    west_m, south_m: the grid's south-west corner in the map. columns, rows: how many cells it has eastwards and
    northwards. cells: an `Occupancy` in two bits each, the first in the lowest bits of the first byte, from west to
    east and row after row from south to north. What moves is occupied where it was seen last; the fence is not in it.
    """

    west_m: Finite
    south_m: Finite
    cell_m: CellSize
    columns: GridSide
    rows: GridSide
    cells: PackedCells
