"""Soundings under the boat: which of them are believed, and what they say of the water ahead. Pure.

A boat moves no faster than it can stop inside what it has sounded. A single beam shows the bottom under the boat alone,
so the bottom ahead is expected to go on as the last soundings rose: a plane is fitted to them by least squares, and
where it comes above `min_depth_m` the water counts as shallow before the boat is there.

Soundings only ever add obstacles. One is believed that can follow from the one before, or once so many in a row follow
from each other; what is not believed marks nothing and frees nothing, and what was marked stays marked.
"""

import itertools
import math
from collections.abc import Iterable

import msgspec

from paani import portable
from paani.clock import has_passed
from paani.config import PlannerConfig
from paani.messages import Depth, Odometry, SoundingStatus
from paani_services.navigator.mapping.bottom_plane import CERTAIN_STD, Bottom, fit_bottom
from paani_services.navigator.mapping.observation import ObservationMemory
from paani_services.navigator.mapping.stamped_pose import StampedPose, interpolate_pose

SHALLOW_CELL_M = 0.4  # two cells of the grid: no hull fits between two neighbours
MAX_SHALLOW_CELLS = 1000  # remembered, the oldest are forgotten first; as a shoal of 14 m across
EXPECTED_S = 120.0  # for which an expectation counts that no sounding refutes, as long as the planner remembers things
EXPECTED_WITHIN_M = 2.5  # how far a slope is carried on: more than a boat at 0.6 m/s needs to turn or to stop
# Of the soundings that say how the bottom goes on: the short way notices a shoal's foot, the long one a gentle rise.
TREND_WAYS_M, TREND_S = (0.8, 1.6), 20.0
TREND_SPACING_M = 0.08  # between two of them: a boat at rest learns no slope
WALL_M = 2.0  # to either side of where the water is expected to be shallow, at most, and as far as that is away
BEYOND_ROWS = 4  # of cells that are shallow beyond that: no way out of a tight place leads through a shoal
MIN_AHEAD_M = 0.8  # of what is expected where the water is too shallow already and rises still: the hull's length
JUMP_M, JUMP_FRAC = 0.3, 0.05  # by which soundings of one place may differ: waves, and five standard deviations
MAX_SLOPE = 1.0  # sand and mud lie less steep than 45 degrees
BORNE_OUT = 3  # soundings in a row that follow from each other are believed
FROZEN_TIMES, FROZEN_S, FROZEN_WAY_M = 10, 3.0, 1.5  # a bottom is not level to the digit over the length of a hull
LOST_DEPTHS = 1.5  # times `min_depth_m`: an echo that is lost over less is lost in the sounder's blind zone


class Sounding(msgspec.Struct, frozen=True, array_like=True):
    """A depth, and where and when the boat measured it, by dead reckoning."""

    stamp_us: int
    x_m: float
    y_m: float
    depth_m: float


class ShallowCell(msgspec.Struct, frozen=True, array_like=True):
    """A square of `SHALLOW_CELL_M` by its number eastward and northward; `is_sounded`: measured, not expected."""

    column: int
    row: int
    stamp_us: int
    is_sounded: bool


class SoundingMemory(msgspec.Struct, frozen=True):
    """What is remembered of the soundings, in the frame of dead reckoning.

    stamp_us: of the newest one. depth_m: the newest that was believed. recent: those believed that say how the bottom
    goes on. doubted: those since one that did not follow. repeats: how many had the depth of `repeated` since that.
    offset_m: of the map against dead reckoning; places are carried over where that begins anew.
    """

    status: SoundingStatus = SoundingStatus.OFF
    stamp_us: int = 0
    depth_m: float = 0.0
    recent: tuple[Sounding, ...] = ()
    doubted: tuple[Sounding, ...] = ()
    repeated: Sounding | None = None
    repeats: int = 0
    cells: tuple[ShallowCell, ...] = ()
    offset_m: tuple[float, float] = (0.0, 0.0)
    reckoned_us: int = 0


def update_soundings(
    memory: SoundingMemory,
    depth: Depth | None,
    boat: ObservationMemory,
    odometry: Odometry | None,
    now_us: int,
    config: PlannerConfig,
) -> SoundingMemory:
    """Take the newest sounding, where the boat was then. Without any the memory stays as it is."""
    here = boat.odom_pose
    if depth is None or here is None or config.min_depth_m <= 0.0:
        return memory
    memory = _carry_over(memory, boat, here, odometry)
    if has_passed(depth.source_us, config.sounding_max_age_s * 1e6, now_us):
        return msgspec.structs.replace(memory, status=SoundingStatus.STALE)
    pose = interpolate_pose(boat.poses, depth.source_us, config.max_pose_gap_s)
    if depth.source_us == memory.stamp_us or pose is None:
        return memory
    memory = msgspec.structs.replace(memory, stamp_us=depth.source_us)
    if not depth.available:
        return _take_lost_echo(memory, pose, config)
    if not 0.0 < depth.depth_m < math.inf:
        return msgspec.structs.replace(memory, status=SoundingStatus.IMPLAUSIBLE)
    return _take_sounding(memory, Sounding(depth.source_us, pose.x_m, pose.y_m, depth.depth_m), pose.yaw_rad, config)


def name_doubts(memory: SoundingMemory) -> tuple[str, ...]:
    """Why soundings do not count now, as people read it in the health report; empty where they do, and without any."""
    doubted = memory.status not in {SoundingStatus.OFF, SoundingStatus.OK, SoundingStatus.NO_ECHO}
    return (f"sonar {memory.status}",) if doubted else ()


def _take_sounding(memory: SoundingMemory, sounding: Sounding, yaw_rad: float, config: PlannerConfig) -> SoundingMemory:
    memory = _count_repeats(memory, sounding)
    if _is_frozen(memory, sounding):
        return msgspec.structs.replace(memory, status=SoundingStatus.FROZEN, recent=(), doubted=())
    recent = _keep_recent(memory.recent, sounding)
    if recent and _may_follow(recent[-1], sounding):
        believed: tuple[Sounding, ...] = (sounding,)
        has_moved = len(recent) < 2 or _way_m(recent[-2], sounding) >= TREND_SPACING_M
        recent = recent if has_moved else recent[:-1]
    else:
        doubted = memory.doubted if memory.doubted and _may_follow(memory.doubted[-1], sounding) else ()
        believed = (*doubted, sounding)
        if len(believed) < BORNE_OUT:
            status = SoundingStatus.JUMPED if recent else memory.status
            return msgspec.structs.replace(memory, status=status, doubted=believed)
        recent, has_moved = (), True
    memory = msgspec.structs.replace(
        memory, status=SoundingStatus.OK, depth_m=sounding.depth_m, recent=(*recent, *believed), doubted=()
    )
    return _mark(memory, believed, yaw_rad, config, has_moved=has_moved)


def _mark(
    memory: SoundingMemory, believed: Iterable[Sounding], yaw_rad: float, config: PlannerConfig, *, has_moved: bool
) -> SoundingMemory:
    """Mark what is sounded or expected to be shallow; what was expected and is deep by now is not any more.

    A boat that stands expects nothing new: the noise of its soundings would turn the slope to and fro.
    """
    cells = _by_place(memory.cells)
    for each in believed:
        if each.depth_m < config.min_depth_m:
            _put(cells, ShallowCell(*_cell_at(each.x_m, each.y_m), each.stamp_us, True))
        else:
            cells = {at: cell for at, cell in cells.items() if cell.is_sounded or not _lies_at(cell, each)}
    last = memory.recent[-1]
    bottoms = _fit_bottoms(memory.recent)
    if bottoms:
        kept = [each for each in cells.values() if not all(_is_refuted(each, fit, last, config) for fit in bottoms)]
        cells = _by_place(kept)
    heading = portable.cos(yaw_rad), portable.sin(yaw_rad)
    for bottom in bottoms if has_moved else []:
        for x_m, y_m in _expected_places(bottom, last, heading, config):
            _put(cells, ShallowCell(*_cell_at(x_m, y_m), last.stamp_us, False))
    if last.depth_m < config.min_depth_m and not any(_falls_along(fit, heading) for fit in bottoms):
        _close(cells, last, heading)
    return msgspec.structs.replace(memory, cells=_keep_cells(cells.values(), last.stamp_us))


def _close(cells: dict[tuple[int, int], ShallowCell], here: Sounding, heading: tuple[float, float]) -> None:
    """Close the way ahead of a boat on shallow water: what it has not sounded may be shallower still."""
    east, north = heading
    for row, side in itertools.product(range(BEYOND_ROWS), range(-2, 3)):
        ahead_m, side_m = MIN_AHEAD_M + SHALLOW_CELL_M * row, SHALLOW_CELL_M * side
        x_m = here.x_m + ahead_m * east - side_m * north
        y_m = here.y_m + ahead_m * north + side_m * east
        _put(cells, ShallowCell(*_cell_at(x_m, y_m), here.stamp_us, False))


def _falls_along(bottom: Bottom, heading: tuple[float, float]) -> bool:
    slope, east, north = bottom.upward
    return slope > 0.0 and east * heading[0] + north * heading[1] < 0.0


def _lies_at(cell: ShallowCell, sounding: Sounding) -> bool:
    x_m, y_m = _middle_m(cell)
    return math.hypot(x_m - sounding.x_m, y_m - sounding.y_m) < SHALLOW_CELL_M


def _fit_bottoms(recent: tuple[Sounding, ...]) -> list[Bottom]:
    """The bottom by the last soundings over each way of `TREND_WAYS_M` that there are enough of."""
    fits = [
        fit_bottom([(each.x_m, each.y_m, each.depth_m) for each in recent if _way_m(each, recent[-1]) <= way_m])
        for way_m in TREND_WAYS_M
    ]
    return [fit for fit in fits if fit is not None]


def _is_refuted(cell: ShallowCell, bottom: Bottom, last: Sounding, config: PlannerConfig) -> bool:
    """Whether a place that was only expected to be shallow is deep, as the bottom goes on by now."""
    x_m, y_m = _middle_m(cell)
    if cell.is_sounded or math.hypot(x_m - last.x_m, y_m - last.y_m) > EXPECTED_WITHIN_M:
        return False
    depth_m, std_m = bottom.depth_at(x_m, y_m)
    return depth_m - CERTAIN_STD * std_m > config.min_depth_m


def _expected_places(
    bottom: Bottom, last: Sounding, heading: tuple[float, float], config: PlannerConfig
) -> list[tuple[float, float]]:
    """Where the water will be shallow if the bottom goes on as it rose, ahead of the boat or beside it."""
    slope, east, north = bottom.upward
    if slope == 0.0 or _falls_along(bottom, heading):
        return []
    depth_m, _ = bottom.depth_at(last.x_m, last.y_m)
    away_m = max((depth_m - config.min_depth_m) / slope, MIN_AHEAD_M)
    if away_m > EXPECTED_WITHIN_M:
        return []
    sides_m = [0.1 * min(away_m, WALL_M) * k for k in range(-10, 11)]
    return [
        (last.x_m + ahead_m * east - side_m * north, last.y_m + ahead_m * north + side_m * east)
        for ahead_m in (away_m + SHALLOW_CELL_M * row for row in range(BEYOND_ROWS))
        for side_m in sides_m
    ]


def _take_lost_echo(memory: SoundingMemory, pose: StampedPose, config: PlannerConfig) -> SoundingMemory:
    """No echo says nothing of deep water; over water that was becoming shallow it says that it is shallower still."""
    memory = msgspec.structs.replace(memory, status=SoundingStatus.NO_ECHO)
    last = memory.recent[-1] if memory.recent else None
    lost_s = math.inf if last is None else (memory.stamp_us - last.stamp_us) * 1e-6
    if last is None or not 0.0 <= lost_s <= TREND_S or last.depth_m > LOST_DEPTHS * config.min_depth_m:
        return memory
    cells = _by_place(memory.cells)
    _put(cells, ShallowCell(*_cell_at(pose.x_m, pose.y_m), memory.stamp_us, True))
    here = Sounding(memory.stamp_us, pose.x_m, pose.y_m, last.depth_m)
    _close(cells, here, (portable.cos(pose.yaw_rad), portable.sin(pose.yaw_rad)))
    return msgspec.structs.replace(memory, cells=_keep_cells(cells.values(), memory.stamp_us))


def _count_repeats(memory: SoundingMemory, sounding: Sounding) -> SoundingMemory:
    if memory.repeated is not None and memory.repeated.depth_m == sounding.depth_m:
        return msgspec.structs.replace(memory, repeats=memory.repeats + 1)
    return msgspec.structs.replace(memory, repeated=sounding, repeats=1)


def _is_frozen(memory: SoundingMemory, sounding: Sounding) -> bool:
    """Whether the same digits came for so long while the boat moved on."""
    first = memory.repeated
    if first is None or memory.repeats < FROZEN_TIMES:
        return False
    return (sounding.stamp_us - first.stamp_us) * 1e-6 >= FROZEN_S and _way_m(first, sounding) >= FROZEN_WAY_M


def _may_follow(before: Sounding, sounding: Sounding) -> bool:
    """Whether a bottom can rise or fall so much over the way between."""
    allowed_m = JUMP_M + JUMP_FRAC * min(before.depth_m, sounding.depth_m) + MAX_SLOPE * _way_m(before, sounding)
    return abs(sounding.depth_m - before.depth_m) <= allowed_m


def _keep_recent(recent: tuple[Sounding, ...], sounding: Sounding) -> tuple[Sounding, ...]:
    """Those that are near enough in time and place to say how the bottom goes on."""
    return tuple(
        each
        for each in recent
        if 0.0 < (sounding.stamp_us - each.stamp_us) * 1e-6 <= TREND_S and _way_m(each, sounding) <= TREND_WAYS_M[-1]
    )


def _carry_over(
    memory: SoundingMemory, boat: ObservationMemory, here: StampedPose, odometry: Odometry | None
) -> SoundingMemory:
    """Where dead reckoning begins anew, places go on by the map, and the trend ends."""
    if memory.reckoned_us and not boat.poses[0].stamp_us <= memory.reckoned_us <= here.stamp_us:
        east_m, north_m = memory.offset_m
        moved = []
        for cell in memory.cells:
            x_m, y_m = _middle_m(cell)
            column, row = _cell_at(x_m + east_m, y_m + north_m)
            moved.append(msgspec.structs.replace(cell, column=column, row=row))
        memory = msgspec.structs.replace(memory, cells=tuple(moved), recent=(), doubted=(), repeated=None, repeats=0)
    offset_m = memory.offset_m
    if odometry is not None and odometry.source_us == here.stamp_us:
        offset_m = odometry.x_m - here.x_m, odometry.y_m - here.y_m
    return msgspec.structs.replace(memory, offset_m=offset_m, reckoned_us=here.stamp_us)


def _by_place(cells: Iterable[ShallowCell]) -> dict[tuple[int, int], ShallowCell]:
    return {(cell.column, cell.row): cell for cell in cells}


def _put(cells: dict[tuple[int, int], ShallowCell], cell: ShallowCell) -> None:
    """What was sounded stays so, with the newer time."""
    before = cells.pop((cell.column, cell.row), None)
    is_sounded = cell.is_sounded or (before is not None and before.is_sounded)
    cells[cell.column, cell.row] = msgspec.structs.replace(cell, is_sounded=is_sounded)


def _keep_cells(cells: Iterable[ShallowCell], now_us: int) -> tuple[ShallowCell, ...]:
    kept = [each for each in cells if each.is_sounded or abs(now_us - each.stamp_us) * 1e-6 <= EXPECTED_S]
    return tuple(kept[-MAX_SHALLOW_CELLS:])


def _cell_at(x_m: float, y_m: float) -> tuple[int, int]:
    return math.floor(x_m / SHALLOW_CELL_M), math.floor(y_m / SHALLOW_CELL_M)


def _middle_m(cell: ShallowCell) -> tuple[float, float]:
    return (cell.column + 0.5) * SHALLOW_CELL_M, (cell.row + 0.5) * SHALLOW_CELL_M


def _way_m(one: Sounding, other: Sounding) -> float:
    return math.hypot(one.x_m - other.x_m, one.y_m - other.y_m)
