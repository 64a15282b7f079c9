"""Cells of a grid survive the message that carries them."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani import messages as m
from paani.occupancy_cells import pack_cells, unpack_cells


def grid_of(rows: int, columns: int, cells: bytes) -> m.OccupancyGrid:
    return m.OccupancyGrid(
        source_us=1, west_m=0.0, south_m=0.0, cell_m=0.2, columns=columns, rows=rows, cells=cells
    )  # fmt: skip


@given(st.integers(1, 12), st.integers(1, 12), st.integers(0, 2**32))
def test_cells_come_back(rows: int, columns: int, seed: int) -> None:
    cells = np.random.default_rng(seed).integers(0, 4, (rows, columns), np.uint8)
    sent = msgspec.json.encode(grid_of(rows, columns, pack_cells(cells)))
    np.testing.assert_array_equal(unpack_cells(msgspec.json.decode(sent, type=m.OccupancyGrid)), cells)


def test_the_first_cell_is_in_the_lowest_bits() -> None:
    assert pack_cells(np.array([[1, 0, 2, 3], [2, 0, 0, 0]], np.uint8)) == bytes([0b11100001, 0b10])


@pytest.mark.parametrize(
    ("field", "value"), [("rows", 0), ("columns", 257), ("cell_m", 0.0), ("cells", bytes(256 * 256 // 4 + 1))]
)
def test_a_grid_that_cannot_be_is_refused_where_it_arrives(field: str, value: object) -> None:
    fields = msgspec.to_builtins(grid_of(2, 2, b"\x00"))
    fields[field] = value if isinstance(value, int | float) else msgspec.to_builtins(value)
    with pytest.raises(msgspec.ValidationError, match=field):
        msgspec.json.decode(msgspec.json.encode(fields), type=m.OccupancyGrid)
