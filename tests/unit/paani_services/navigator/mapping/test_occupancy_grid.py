"""From the picture to cells of water: projection, grid, lifetimes (Q1-Q3)."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani.config import CalibrationConfig, PlannerConfig, calibration_of, load_config
from paani.errors import UserError
from paani.messages import Detection, Label
from paani_services.navigator.mapping.observation import FootLine, ObservationMemory
from paani_services.navigator.mapping.observed_cells import CELL_M, Camera, own_hull_top
from paani_services.navigator.mapping.occupancy_grid import (
    GRID_CELLS,
    OccupancyGrid,
    blind_zone_radius_m,
    build_occupancy_grid,
)
from paani_services.navigator.mapping.projection import Pose, pinhole_at, pixel_rays, ranges_to_water_m
from paani_sim.eye.camera import BoatPose, project
from paani_sim.eye.camera import Camera as Eye
from tests.synthetic_water import ASTERN, AT_REST, CAMERA, CONFIG, EYE, PLANNER, START_US, observe_from, water_edge_of

ASPECT = 320 / 240
PAPER = load_config(profile="paper").navigator.planner
AHEAD_5_M = ((5.0, -1.0, 5.6, 1.0),)


def grid_of(
    memory: ObservationMemory,
    age_s: float = 0.1,
    position_m: tuple[float, float] = (0.0, 0.0),
    config: PlannerConfig = PLANNER,
) -> OccupancyGrid:
    now_us = memory.observations[-1].stamp_us + round(age_s * 1e6) if memory.observations else START_US
    return build_occupancy_grid(memory.observations, position_m, now_us, CAMERA, config)


def cell(grid: OccupancyGrid, x_m: float, y_m: float) -> str:
    row, column = math.floor((y_m - grid.south_m) / CELL_M), math.floor((x_m - grid.west_m) / CELL_M)
    named = {"occupied": grid.occupied, "free": grid.free, "blind_zone": grid.blind_zone, "unknown": grid.unknown}
    found = [name for name, cells in named.items() if cells[row, column]]
    assert len(found) == 1
    return found[0]


@settings(max_examples=60, deadline=None)
@given(
    ahead_m=st.floats(2.5, 7.5),
    aside=st.floats(-0.5, 0.5),
    yaw=st.floats(-3.1, 3.1),
    roll=st.floats(-0.2, 0.2),
    pitch=st.floats(-0.05, 0.1),
)
@pytest.mark.slow
def test_q1_a_pixel_of_the_water_comes_back_to_its_point(
    ahead_m: float, aside: float, yaw: float, roll: float, pitch: float
) -> None:
    """Q1: r = R K^-1 [u, v, 1], p = o + r (z_w - o_z) / r_z, against the renderer's own projection."""
    boat = BoatPose(12.0, -7.0, yaw, 0.0, roll, pitch)
    east, north = ahead_m, aside * ahead_m
    x_m = boat.x_m + math.cos(yaw) * east - math.sin(yaw) * north
    y_m = boat.y_m + math.sin(yaw) * east + math.cos(yaw) * north
    eye = Eye(up_m=0.9)  # at the body's origin, on the water
    u_px, v_px = project(np.array([[x_m, y_m, 0.0]]), boat, eye)[0]
    camera_model = pinhole_at(Pose(boat.x_m, boat.y_m, yaw, roll, pitch), CAMERA.calibration, ASPECT)
    given_rays = pixel_rays(camera_model, np.array([u_px / 320]), np.array([v_px / 240]))
    range_m = ranges_to_water_m(camera_model, given_rays, 50.0)
    assert camera_model.position_m[0] + float(range_m[0] * given_rays.east[0]) == pytest.approx(x_m, abs=1e-6)
    assert camera_model.position_m[1] + float(range_m[0] * given_rays.north[0]) == pytest.approx(y_m, abs=1e-6)


def test_q1_the_mount_s_rotation_is_taken_into_account() -> None:
    """Pitch, roll and yaw of the mount act as the boat's own; the principal point may lie off the middle."""
    turned = CalibrationConfig(
        hfov_deg=70.0,
        height_m=0.9,
        pitch_down_deg=9.0,
        roll_deg=4.0,
        yaw_deg=-12.0,
        centre_frac=(0.45, 0.6),
    )
    level = msgspec.structs.replace(turned, pitch_down_deg=0.0, roll_deg=0.0, yaw_deg=0.0)
    u, v = np.array([0.3, 0.5, 0.8]), np.array([0.9, 0.95, 0.99])
    mounted = pixel_rays(pinhole_at(Pose(0.0, 0.0, 0.0, 0.0, 0.0), turned, ASPECT), u, v)
    carried = pixel_rays(
        pinhole_at(Pose(0.0, 0.0, math.radians(-12.0), math.radians(4.0), math.radians(9.0)), level, ASPECT), u, v
    )
    for one, other in zip(mounted, carried, strict=True):
        assert one == pytest.approx(other)
    middle = pixel_rays(pinhole_at(Pose(0.0, 0.0, 0.0, 0.0, 0.0), turned, ASPECT), np.array([0.45]), np.array([0.6]))
    assert float(middle.descent[0]) == pytest.approx(math.tan(math.radians(9.0)))


def test_q1_rays_at_and_above_the_horizon_and_far_ones_are_rejected() -> None:
    """Q1: horizon and range rejection; no ray ever meets water behind the camera."""
    camera_model = pinhole_at(Pose(0.0, 0.0, 0.0, 0.0, 0.0), CAMERA.calibration, ASPECT)
    horizon = 0.5 - camera_model.focal[1] * math.tan(math.radians(6.0))
    v = np.array([0.0, horizon - 0.01, horizon, horizon + 0.02, horizon + 0.08, 1.0])
    found = ranges_to_water_m(camera_model, pixel_rays(camera_model, np.full(6, 0.5), v), 30.0)
    assert np.isinf(found[:4]).all()  # the fourth meets the water at 43 m
    assert 8.0 < found[4] < 30.0
    assert found[5] == pytest.approx(0.9 / math.tan(math.radians(6.0) + math.atan(0.5 / camera_model.focal[1])))


def test_q2_the_grid_is_unknown_by_default_and_lies_in_the_map() -> None:
    """Q2: 100 x 100 cells of 0.2 m around the boat; its cells stay where they are while the boat moves."""
    grid = grid_of(ObservationMemory(), position_m=(3.17, -8.04))
    assert (GRID_CELLS, CELL_M) == (100, 0.2)
    assert grid.occupied.shape == (100, 100)
    assert grid.unknown.all()
    assert grid.west_m == pytest.approx(-7.0)
    assert grid.south_m == pytest.approx(-18.2)
    moved = grid_of(ObservationMemory(), position_m=(3.45, -8.04))
    assert moved.west_m == pytest.approx(-6.6)


def test_open_water_is_free_from_the_picture_s_lower_end_to_the_range_limit() -> None:
    grid = grid_of(observe_from())
    assert cell(grid, 2.5, 0.0) == cell(grid, 8.3, 0.0) == cell(grid, 5.0, 2.9) == "free"
    assert cell(grid, 8.9, 0.0) == cell(grid, 5.0, 4.5) == cell(grid, -3.0, 0.0) == "unknown"
    assert cell(grid, 1.0, 0.0) == cell(grid, -1.5, -1.0) == "blind_zone"
    assert not grid.occupied.any()


def test_the_water_s_end_is_occupied_and_cells_behind_it_unknown() -> None:
    grid = grid_of(observe_from(edge=water_edge_of(AT_REST, AHEAD_5_M)))
    assert cell(grid, 3.5, 0.0) == "free"
    rows, columns = np.nonzero(grid.occupied)
    x_m, y_m = grid.west_m + CELL_M * (columns + 0.5), grid.south_m + CELL_M * (rows + 0.5)
    assert 4.3 < x_m.min() <= 5.0  # the lower edge of a mask cell lies nearer than what is in it
    assert x_m.max() < 6.0
    assert abs(y_m).max() < 1.3
    assert cell(grid, 6.8, 0.0) == "unknown"
    assert cell(grid, 6.0, 2.5) == "free"


def test_q3_lifetimes() -> None:
    """Q3: free for 0.8 s, occupied for 2.0 s; then unknown again."""
    memory = observe_from(edge=water_edge_of(AT_REST, AHEAD_5_M))
    at = memory.observations[-1].stamp_us
    for age_s, free, occupied in (
        (0.79, "free", "occupied"),
        (0.81, "unknown", "occupied"),
        (2.01, "unknown", "unknown"),
    ):
        grid = build_occupancy_grid(memory.observations, (0.0, 0.0), at + round(age_s * 1e6), CAMERA, PAPER)
        assert cell(grid, 3.5, 0.0) == free
        assert cell(grid, 5.0, 0.0) == occupied
    assert (PAPER.free_s, PAPER.occupied_s) == (PLANNER.free_s, PLANNER.occupied_s) == (0.8, 2.0)


def test_a_picture_that_is_still_to_come_shows_nothing() -> None:
    """As one from before the clock was set back is: its age is none."""
    memory = observe_from(edge=water_edge_of(AT_REST, AHEAD_5_M))
    assert cell(grid_of(memory, 0.0), 5.0, 0.0) == "occupied"
    early = grid_of(memory, -0.001)
    assert not early.occupied.any()
    assert not early.free.any()


@pytest.mark.parametrize("config", [PAPER, PLANNER])
def test_q3_occupied_wins_for_its_lifetime(config: PlannerConfig) -> None:
    """Pictures of open water do not free a cell that one picture (Q3), or two, saw occupied less than 2 s ago."""
    vouched_us = 0 if config is PAPER else 200_000
    memory = observe_from(edge=water_edge_of(AT_REST, AHEAD_5_M), at_us=START_US - 200_000)
    memory = observe_from(edge=water_edge_of(AT_REST, AHEAD_5_M), memory=memory)
    for later_us in range(200_000, 2_400_000, 200_000):
        memory = observe_from(at_us=START_US + later_us, memory=memory)
        expected = "occupied" if later_us + vouched_us + 100_000 <= 2_000_000 else "free"
        assert cell(grid_of(memory, config=config), 5.0, 0.0) == expected


def test_an_obstacle_in_one_picture_alone_is_outvoted_by_two_later_ones() -> None:
    """A glint of the sun is gone within two pictures; the paper's lifetimes keep it for 2 s."""
    memory = observe_from(at_us=START_US - 200_000)
    memory = observe_from(edge=water_edge_of(AT_REST, AHEAD_5_M), memory=memory)
    for pictures, expected in enumerate(("occupied", "occupied", "free", "free")):
        assert cell(grid_of(memory), 5.0, 0.0) == expected
        assert cell(grid_of(memory, config=PAPER), 5.0, 0.0) == "occupied"
        memory = observe_from(at_us=START_US + 200_000 * (pictures + 1), memory=memory)


def test_an_obstacle_whose_edge_moves_by_a_cell_is_not_outvoted() -> None:
    """Two pictures that show it a cell apart confirm each other."""
    memory = observe_from(edge=water_edge_of(AT_REST, AHEAD_5_M))
    memory = observe_from(
        edge=water_edge_of(AT_REST, ((5.2, -1.0, 5.8, 1.0),)), at_us=START_US + 200_000, memory=memory
    )
    for later_us in (400_000, 600_000, 800_000):
        memory = observe_from(at_us=START_US + later_us, memory=memory)
        assert cell(grid_of(memory), 5.0, 0.0) == cell(grid_of(memory), 5.4, 0.0) == "occupied"


@pytest.mark.slow
def test_cells_out_of_sight_stay_occupied_longer() -> None:
    """A boat that turned away remembers a bar for `hidden_s`; the paper's lifetimes forget it."""
    memory = observe_from(edge=water_edge_of(AT_REST, AHEAD_5_M))
    away = BoatPose(0.0, 0.0, 1.5)
    hidden_us = round(PLANNER.hidden_s * 1e6)
    for later_us in range(200_000, hidden_us + 1_000_000, 200_000):
        memory = observe_from(away, at_us=START_US + later_us, memory=memory)
        hidden = cell(grid_of(memory, 0.0), 5.0, 0.0)
        assert hidden == ("occupied" if later_us <= hidden_us else "unknown")
        paper = build_occupancy_grid(memory.observations, (0.0, 0.0), memory.observations[-1].stamp_us, CAMERA, PAPER)
        assert cell(paper, 5.0, 0.0) == ("occupied" if later_us <= 2_000_000 else "unknown")


def test_a_small_obstacle_stands_at_the_lower_end_of_its_box() -> None:
    """It occupies the width of its box, though the mask shows water there."""
    corners = np.array([[4.0, -0.4, 0.0], [4.0, 0.4, 0.0]])
    (left, low), (right, _) = project(corners, AT_REST, EYE) / (320, 240)
    box = (min(left, right), low - 0.2, max(left, right), low)
    buoy = Detection(label=Label.BUOY, confidence=0.9, box_xyxy=tuple(map(float, box)))  # type: ignore[arg-type]
    grid = grid_of(observe_from(detections=(buoy,)))
    assert cell(grid, 4.05, 0.0) == cell(grid, 4.05, 0.3) == cell(grid, 4.5, -0.3) == "occupied"
    assert cell(grid, 4.05, 0.8) == cell(grid, 3.5, 0.0) == "free"


def test_people_are_given_more_room() -> None:
    """Cells within 0.8 m of a swimmer are occupied too; around a buoy with the same box they are not."""
    corners = np.array([[4.0, -0.3, 0.0], [4.0, 0.3, 0.0]])
    (left, low), (right, _) = project(corners, AT_REST, EYE) / (320, 240)
    box = (min(left, right), low - 0.1, max(left, right), low)
    found = {}
    for label in (Label.PERSON, Label.BUOY):
        thing = Detection(label=label, confidence=0.9, box_xyxy=tuple(map(float, box)))  # type: ignore[arg-type]
        grid = grid_of(observe_from(detections=(thing,)))
        found[label] = [cell(grid, 4.05, 0.0), cell(grid, 4.05, 0.9), cell(grid, 3.5, 0.0), cell(grid, 4.05, 1.5)]
    assert found[Label.PERSON] == ["occupied", "occupied", "occupied", "free"]
    assert found[Label.BUOY] == ["occupied", "free", "free", "free"]


def test_a_hull_that_lies_aslant_stands_where_the_mask_ends_the_water() -> None:
    """The lower end of its box is that of its near end; it counts only where the mask misses the hull."""
    aslant = tuple(0.45 + 0.005 * column for column in range(80))
    box = (0.0, 0.42, 1.0, aslant[-1])
    vessel = Detection(label=Label.VESSEL, confidence=0.9, box_xyxy=box)
    with_box, by_mask = (grid_of(observe_from(edge=aslant, detections=boxes)) for boxes in ((vessel,), ()))
    assert (with_box.occupied >= by_mask.occupied).all()
    assert (with_box.free | with_box.occupied == by_mask.free | with_box.occupied).all()
    holed = (*aslant[:30], *([0.4] * 20), *aslant[50:])
    assert observe_from(edge=holed, detections=(vessel,)).observations[-1].feet == (
        FootLine(192, 320, math.ceil(aslant[-1] * 512)),
    )


def test_a_column_that_a_box_covers_in_part_is_not_missed_by_the_mask() -> None:
    """The near end of this hull is at the left; beside its right end the mask shows the water behind it."""
    aslant = (*(0.99 - 0.012 * column for column in range(26)), *([0.3] * 54))
    vessel, wider = (
        Detection(label=Label.VESSEL, confidence=0.9, box_xyxy=(0.0, 0.5, right, 0.99)) for right in (0.33, 0.35)
    )
    assert observe_from(edge=aslant, detections=(vessel,)).observations[-1].feet == ()
    (foot,) = observe_from(edge=aslant, detections=(wider,)).observations[-1].feet
    assert (foot.left, foot.right) == (26 * 512 // 80, -(-28 * 512 // 80))
    thin = Detection(label=Label.PIER, confidence=0.9, box_xyxy=(0.505, 0.5, 0.511, 0.9))
    assert len(observe_from(edge=aslant, detections=(thin,)).observations[-1].feet) == 1


def test_a_hull_is_whole_and_as_deep_as_it_is_wide() -> None:
    """The mask takes its bow for water and shows its side alone: 2 m wide at 4 m, it is 2 m deep."""
    side = water_edge_of(AT_REST, ((4.0, -1.0, 4.4, 1.0),))
    columns = [column for column, end in enumerate(side) if end > 0.5]
    bow = columns[: len(columns) // 3]
    far = water_edge_of(AT_REST)[bow[0]]
    holed = tuple(far if column in bow else end for column, end in enumerate(side))
    box = (columns[0] / 80, 0.0, (columns[-1] + 1) / 80, max(side))  # the box includes the mast
    vessel = Detection(label=Label.VESSEL, confidence=0.9, box_xyxy=box)
    grid = grid_of(observe_from(edge=holed, detections=(vessel,)))
    for x_m, y_m, expected in ((4.2, 0.7, "occupied"), (4.2, -0.7, "occupied"), (5.7, 0.0, "occupied")):
        assert cell(grid, x_m, y_m) == expected
    assert cell(grid_of(observe_from(edge=holed)), 4.2, 0.7) == "free"
    assert cell(grid, 3.4, 0.7) == cell(grid, 4.2, 1.5) == "free"


def test_an_obstacle_before_a_vessel_is_no_part_of_it() -> None:
    """A post stands 3 m ahead, and a ship far behind it or one 6 m away: neither is drawn to the post."""
    post = ((3.0, -0.1, 3.2, 0.1),)
    for x_m, low in ((6.0, None), (60.0, 0.42)):
        corners = np.array([[x_m, -1.5, 0.0], [x_m, 1.5, 0.0]])
        (right, foot), (left, _) = project(corners, AT_REST, EYE) / [EYE.width_px, EYE.height_px]
        box = (0.1, 0.0, 0.9, low) if low else (left, 0.0, right, foot)
        vessel = Detection(label=Label.VESSEL, confidence=0.9, box_xyxy=box)
        behind = ((6.0, -1.5, 6.4, 1.5),) if low is None else ()
        grid = grid_of(observe_from(edge=water_edge_of(AT_REST, (*post, *behind)), detections=(vessel,)))
        assert cell(grid, 3.1, 0.0) == "occupied"
        assert cell(grid, 3.1, 0.7) == cell(grid, 3.1, -0.7) == "free"


def test_a_hull_that_the_mask_misses_stands_at_the_end_of_its_box() -> None:
    corners = np.array([[4.0, -0.8, 0.0], [4.0, 0.8, 0.0]])
    (right, low), (left, _) = project(corners, AT_REST, EYE) / [EYE.width_px, EYE.height_px]
    vessel = Detection(label=Label.VESSEL, confidence=0.9, box_xyxy=(left, 0.0, right, low))
    grid = grid_of(observe_from(detections=(vessel,)))
    assert cell(grid, 4.1, 0.0) == cell(grid, 4.1, 0.6) == "occupied"
    assert cell(grid, 3.4, 0.0) == "free"


def test_a_box_cut_below_stands_nearer_than_the_picture_shows() -> None:
    box = Detection(label=Label.PERSON, confidence=0.9, box_xyxy=(0.45, 0.6, 0.55, 1.0))
    grid = grid_of(observe_from(detections=(box,)))
    assert cell(grid, 1.4, 0.0) == "occupied"


def test_a_picture_without_water_occupies_the_cells_nearest_to_the_boat() -> None:
    grid = grid_of(observe_from(edge=(1.0,) * 80))
    assert not grid.free.any()
    assert cell(grid, 2.0, 0.0) == "occupied"


def test_water_above_the_horizon_is_no_water() -> None:
    """A meadow taken for water reaches above the horizon, and its columns do not count. Two degrees are tolerated."""
    horizon = min(water_edge_of(AT_REST)) - 1 / 64
    assert cell(grid_of(observe_from(edge=(horizon - 0.04,) * 80)), 4.0, 0.0) == "free"
    assert not grid_of(observe_from(edge=(horizon - 0.12,) * 80)).free.any()
    assert not grid_of(observe_from(edge=(0.0,) * 80)).free.any()


@pytest.mark.parametrize("roll", [-0.15, 0.15])
@pytest.mark.parametrize("pitch", [-0.03, 0.06])
def test_roll_and_pitch_do_not_move_obstacles(roll: float, pitch: float) -> None:
    boat = BoatPose(0.0, 0.0, 0.0, roll_rad=roll, pitch_rad=pitch)
    grid = grid_of(observe_from(boat, water_edge_of(boat, AHEAD_5_M)))
    rows, columns = np.nonzero(grid.occupied)
    x_m, y_m = grid.west_m + CELL_M * (columns + 0.5), grid.south_m + CELL_M * (rows + 0.5)
    assert 4.2 < x_m.min() <= 5.1
    assert -1.4 < y_m.min() < -0.6
    assert 0.6 < y_m.max() < 1.4


def test_a_camera_that_is_blind_too_far_has_no_blind_zone() -> None:
    """A camera that looks level, or from high up, is blind beyond `blind_m`, and unknown cells stay unknown."""
    assert 1.9 < blind_zone_radius_m(ASPECT, CAMERA, PLANNER) < 2.6
    for sets in (["eye.pitch_down_deg=-30"], ["eye.camera_height_m=3"]):
        camera = Camera(calibration_of(load_config(sets=sets).eye))
        assert blind_zone_radius_m(ASPECT, camera, PLANNER) == 0.0


def test_the_own_hull_occludes_the_water_below_it() -> None:
    """Free cells begin above the hull's upper edge in each column."""
    hull = ((0.3, 1.0), (0.4, 0.8), (0.6, 0.8), (0.7, 1.0))
    assert own_hull_top(hull, np.array([0.1, 0.35, 0.5, 0.9])) == pytest.approx([1.0, 0.9, 0.8, 1.0])
    memory = observe_from()
    now_us = memory.observations[-1].stamp_us
    camera = Camera(CAMERA.calibration, hull)
    grid = build_occupancy_grid(
        memory.observations, (0.0, 0.0), now_us, camera, msgspec.structs.replace(PLANNER, blind_m=0.0)
    )
    assert cell(grid, 2.2, 0.0) == "unknown"
    assert cell(grid, 3.2, 0.0) == "free"


def test_a_valid_calibration_is_complete() -> None:
    with pytest.raises(UserError, match="valid: height_m is not known"):
        load_config(sets=["calibration.hfov_deg=60", "calibration.valid=true"])
    assert not CONFIG.calibration.valid


def test_q1_q3_the_range_limit_and_both_lifetimes_to_the_hundredth() -> None:
    camera = pinhole_at(Pose(0.0, 0.0, 0.0, 0.0, 0.0), CAMERA.calibration, ASPECT)
    rays = pixel_rays(camera, np.array([0.5]), np.array([1.0]))
    (at_m,) = ranges_to_water_m(camera, rays, 30.0)
    assert [bool(np.isfinite(ranges_to_water_m(camera, rays, at_m + d))[0]) for d in (0.01, -0.01)] == [True, False]
    memory = observe_from(edge=water_edge_of(AT_REST, AHEAD_5_M))
    at_us = memory.observations[-1].stamp_us
    grid = build_occupancy_grid(memory.observations, (0.0, 0.0), at_us + 1_990_000, CAMERA, PAPER)
    assert cell(grid, 5.0, 0.0) == "occupied"
    # What the next picture does not show stays free as long as if none had come.
    memory = observe_from(ASTERN, at_us=START_US + 300_000, memory=memory)
    for age_us, found in ((790_000, "free"), (810_000, "unknown")):
        grid = build_occupancy_grid(memory.observations, (0.0, 0.0), at_us + age_us, CAMERA, PAPER)
        assert cell(grid, 3.5, 0.0) == found
