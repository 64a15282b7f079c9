"""The bars of the estimator, against the truth of the simulator. Counts and errors, not times."""

from __future__ import annotations

import pytest

from paani_sim.studies.estimation_table import CONDITIONS, EstimationRow, estimation_table, tabulate_rows


@pytest.fixture(scope="module")
def rows() -> dict[str, EstimationRow]:
    return {row.condition: row for row in estimation_table((4,))}


@pytest.mark.timeout(300)
@pytest.mark.parametrize("condition", [step.name for step in CONDITIONS])
def test_the_stated_spread_is_right_in_every_condition(rows: dict[str, EstimationRow], condition: str) -> None:
    """L3, L4: mean NIS about 2, and position errors no larger than published, while GPS and compass are at fault."""
    row = rows[condition]
    assert 1.75 < row.nis < 2.25
    assert row.nees <= 2.5


@pytest.mark.timeout(300)
def test_the_estimate_is_nearer_than_its_sensors(rows: dict[str, EstimationRow]) -> None:
    for row in rows.values():
        assert row.position_m < 1.1 * row.gps_m
    assert rows["compass 0.1 rad off"].heading_deg < 0.75 * rows["compass 0.1 rad off"].compass_deg


@pytest.mark.timeout(300)
def test_l5_rest_is_not_read_as_motion(rows: dict[str, EstimationRow]) -> None:
    """L5: less than 2 % of the time truly at rest, and never for 2 s."""
    for row in rows.values():
        assert (row.false_motion_frac or 0.0) < 0.02
        assert row.false_motion_s < 2.0


@pytest.mark.timeout(300)
def test_faults_of_gps_end_health_and_others_do_not(rows: dict[str, EstimationRow]) -> None:
    assert rows["GPS away for 30 s"].unhealthy_s > 26.0
    assert 2.0 < rows["GPS 8 m off for 60 s"].unhealthy_s < 10.0
    assert rows["GPS 8 m off for 60 s"].refused >= 20
    for name in ("calm", "wind 6 m/s, waves", "compass 0.1 rad off", "gyro 0.02 rad/s off"):
        assert rows[name].unhealthy_s == 0.0


@pytest.mark.timeout(300)
def test_the_part_has_a_row_for_each_course(rows: dict[str, EstimationRow]) -> None:
    part = tabulate_rows(list(rows.values()))
    assert [row[0] for row in part.rows] == [step.name for step in CONDITIONS]
    assert all(len(row) == len(part.columns) for row in part.rows)
