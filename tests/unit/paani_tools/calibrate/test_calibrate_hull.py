"""`paani calibrate hull`: known hulls are found within the stated intervals; a drive that cannot tell is refused."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest

from paani.cli import main as paani
from paani.config import load_config
from paani.errors import UserError
from paani.messages import ZeroCause
from paani_sim.plant.reference_model import SAMPLE_S, Manoeuvre, solve_reference
from paani_sim.vessels import load_vessel
from paani_tools.calibrate.hull.command import REQUIRED, undetermined
from paani_tools.calibrate.hull.drive import STEP_S, Drive, drive_of
from paani_tools.calibrate.hull.identify import identify
from paani_tools.calibrate.hull.model import initial_parameters, predict
from tests.recorded_drive import FORCE_PER_UNIT_N, Levels, Messages, drive, record, rich_levels
from tests.unit.paani.logs import small_logs

WRONG_FORCE_N = 50.0  # where the search begins
STEADY: Levels = ((120.0, 0.1, 0.1),)
STRAIGHT: Levels = tuple((8.0, level, level) for level in (0.0, 0.05, 0.2, 0.1, 0.0, 0.15, 0.03, 0.2, 0.0, 0.12))
SHORT: Levels = ((20.0, 0.1, 0.05),)


def truth_of(vessel: str) -> dict[str, float]:
    loaded = load_vessel(vessel)
    return {
        **msgspec.structs.asdict(loaded.drag),
        "yaw_inertia": loaded.hull.yaw_inertia_kgm2,
        "thrust_linear": FORCE_PER_UNIT_N,
        "thrust_quadratic": 0.0,
    }


def scaled_drag(vessel: str) -> str:
    """The vessel's file with other drag and inertia: a hull of the same mass that nobody has measured."""
    file = Path(load_vessel.__code__.co_filename).with_name(f"{vessel}.toml")
    lines = []
    for line in file.read_text().splitlines():
        name, equals, value = line.partition(" = ")
        scaled = name.startswith(("surge_linear", "surge_quad", "yaw_linear", "yaw_quad", "yaw_inertia"))
        lines.append(f"{name} = {1.6 * float(value.partition('#')[0])}" if equals and scaled else line)
    return "\n".join(lines) + "\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("vessel", "seed", "quadratic_n"), [("paper", 1, 0.0), pytest.param("otter", 2, 80.0, marks=pytest.mark.long)]
)
def test_w11_a_known_hull_is_found_within_the_stated_intervals(
    vessel: str, seed: int, quadratic_n: float, tmp_path: Path
) -> None:
    """W11: from four minutes in a current, beginning with the drag of another hull and a third less thrust."""
    other = tmp_path / "other.toml"
    other.write_text(scaled_drag(vessel))
    messages = drive(vessel, rich_levels(240.0, seed), seed, quadratic_n)
    found = identify(drive_of(*messages), load_vessel(str(other)), WRONG_FORCE_N)
    for name, truth in (truth_of(vessel) | {"thrust_quadratic": quadratic_n}).items():
        estimate = found.estimates[name]
        if name in REQUIRED:
            assert estimate.low <= truth <= estimate.high, name
            assert estimate.excited, name
            assert estimate.share < 0.1, name
        elif not estimate.fixed:
            assert estimate.low <= truth <= estimate.high, name
    assert undetermined(found) == []
    assert found.force_per_unit_n == pytest.approx(FORCE_PER_UNIT_N + 0.2 * quadratic_n, rel=0.1)


@pytest.fixture(scope="module")
def rich() -> Messages:
    return drive("paper", rich_levels(150.0, 3), seed=3)


@pytest.mark.slow
def test_a_recording_becomes_a_vessel_and_settings(
    rich: Messages, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, out, settings = record(tmp_path, rich), tmp_path / "mine.toml", tmp_path / "settings.toml"
    words = ["--vessel", "paper", "--mass-kg", "12.4", "--out", str(out), "--settings", str(settings)]
    assert paani(["calibrate", "hull", str(file), *words]) == 0
    printed = capsys.readouterr().out
    assert "surge_quadratic" in printed
    assert "std error" in printed
    found, base = load_vessel(str(out)), load_vessel("paper")
    assert found.drag.surge_quadratic == pytest.approx(20.0, rel=0.15)
    for name in ("surge_linear", "surge_quadratic", "yaw_linear", "yaw_quadratic"):
        assert getattr(found.drag, name) != getattr(base.drag, name), name
    assert found.hull.yaw_inertia_kgm2 != base.hull.yaw_inertia_kgm2
    assert (found.buoyancy, found.windage, found.hull.mass_kg) == (base.buoyancy, base.windage, 12.4)
    assert "surge_linear" in out.read_text()
    assert "standard error" in out.read_text()
    config = load_config(file=settings)
    assert (config.plant.vessel, config.plant.adapter.force_per_unit_n) == (
        str(out),
        config.controller.force_per_unit_n,
    )
    assert config.plant.adapter.force_per_unit_n == pytest.approx(FORCE_PER_UNIT_N, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("levels", "lacking"),
    [
        pytest.param(
            STEADY, {"surge_linear", "surge_quadratic", "yaw_quadratic", "yaw_inertia"}, marks=pytest.mark.long
        ),
        (STRAIGHT, {"surge_quadratic", "yaw_linear", "yaw_quadratic", "yaw_inertia"}),
    ],
)
def test_a_drive_that_does_not_excite_a_parameter_says_so_and_writes_nothing(
    levels: Levels, lacking: set[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One speed tells no curve; one heading tells no current from speed, and no turn."""
    out = tmp_path / "mine.toml"
    file = record(tmp_path, drive("paper", levels, seed=1))
    assert paani(["calibrate", "hull", str(file), "--vessel", "paper", "--out", str(out)]) == 1
    names = {line.split()[1] for line in capsys.readouterr().err.splitlines()}
    assert lacking <= names
    assert not out.exists()


@pytest.mark.slow
def test_the_thrust_in_a_step_is_its_mean_and_changes_when_the_plant_says(rich: Messages) -> None:
    """A change between two messages lies where `since_us` says: 20 ms into a step is 60 % of it at the new thrust."""
    applied = [msgspec.structs.replace(each, left=0.0, right=0.0) for each in rich.applied]
    change_us = applied[100].source_us + 20_000
    later = [
        msgspec.structs.replace(each, left=0.5, right=-0.1, since_us=change_us) if each.source_us > change_us else each
        for each in applied
    ]
    found = drive_of(later, rich.odometry, rich.fixes, rich.samples)
    begin_us = max(later[0].source_us, rich.odometry[0].source_us, rich.samples[0].source_us)
    step, part = divmod((change_us - begin_us) * 1e-6 / STEP_S, 1.0)
    assert found.thrust[int(step)] == pytest.approx(np.array([0.5, -0.1]) * (1.0 - part), abs=1e-9)
    assert found.thrust[int(step) + 1] == pytest.approx([0.5, -0.1])
    assert found.thrust[int(step) - 1] == pytest.approx([0.0, 0.0])


@pytest.mark.slow
def test_a_drive_by_radio_is_refused_because_its_thrust_is_unknown(rich: Messages) -> None:
    taken = msgspec.structs.replace(rich.applied[600], left=0.0, right=0.0, zero_cause=ZeroCause.RECEIVER)
    with pytest.raises(UserError, match="the radio receiver drove, 30 s into the drive"):
        drive_of([*rich.applied[:600], taken, *rich.applied[601:]], rich.odometry, rich.fixes, rich.samples)


@pytest.mark.slow
def test_a_drive_with_holes_or_without_heading_is_refused(rich: Messages) -> None:
    hole = [*rich.applied[:400], *rich.applied[460:]]
    with pytest.raises(UserError, match=r"no plant/thrust_applied for 3\.\d s, 20 s into the drive"):
        drive_of(hole, rich.odometry, rich.fixes, rich.samples)
    lost = [msgspec.structs.replace(each, healthy=False) for each in rich.odometry]
    with pytest.raises(UserError, match="no healthy localization/odometry"):
        drive_of(rich.applied, lost, rich.fixes, rich.samples)
    blind = [msgspec.structs.replace(each, fix=False) for each in rich.fixes]
    with pytest.raises(UserError, match="at least one a second"):
        drive_of(rich.applied, rich.odometry, blind, rich.samples)


@pytest.mark.rotating(cpu_s=6)
@pytest.mark.slow
def test_a_fix_far_off_is_left_out(rich: Messages) -> None:
    """One fix in thirty claims 5 m/s to the north, in the first half of the drive."""
    half = len(rich.applied) // 2
    spoilt = [
        msgspec.structs.replace(fix, sog_mps=5.0, cog_rad=1.57) if number % 30 == 15 else fix
        for number, fix in enumerate(rich.fixes)
    ]
    found = identify(
        drive_of(rich.applied[:half], rich.odometry, spoilt, rich.samples), load_vessel("paper"), FORCE_PER_UNIT_N
    )
    assert found.outliers >= 15
    assert found.estimates["surge_quadratic"].value == pytest.approx(20.0, rel=0.2)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("absent.mcap", "--vessel", "paper"), "absent.mcap: no such file or folder"),
        (("{log}", "--vessel", "nobody"), "no vessel 'nobody'"),
        (("{log}", "--vessel", "paper", "--settings", "s.toml"), "--out is needed too"),
        (("{log}", "--vessel", "paper", "--mass-kg", "-1"), "--mass-kg"),
        (("{log}", "--vessel", "paper", "--mass-kg", "heavy"), "argument --mass-kg: 'heavy' is no number"),
        (("{log}", "--vessel", "paper"), "no plant/thrust_applied in it"),
    ],
)
@pytest.mark.slow
def test_a_mistake_is_told_in_one_line(
    words: tuple[str, ...], expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = small_logs.finished(tmp_path)
    code = 0
    try:
        code = paani(["calibrate", "hull", *(word.format(log=file) for word in words)])
    except SystemExit as exit_:
        code = int(str(exit_.code))
    assert code == 2
    assert expected in capsys.readouterr().err.splitlines()[-1]


@pytest.mark.slow
def test_twenty_seconds_are_too_few(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = record(tmp_path, drive("paper", SHORT, seed=1))
    assert paani(["calibrate", "hull", str(file), "--vessel", "paper"]) == 2
    assert "at least 60 s" in capsys.readouterr().err


@pytest.mark.parametrize("vessel", ["paper", "otter"])
@pytest.mark.slow
def test_the_model_follows_the_published_one(vessel: str) -> None:
    """A turning circle of a minute in still water: at the same times as Fossen's equations solved by SciPy."""
    turn = Manoeuvre("turning circle", 60.0, 3.0, 9.0)
    track = solve_reference(vessel, turn)
    steps = round(turn.seconds / STEP_S)
    moving = Drive(
        thrust=np.tile([turn.left_n / FORCE_PER_UNIT_N, turn.right_n / FORCE_PER_UNIT_N], (steps, 1)),
        heading_rad=np.interp(np.arange(steps) * STEP_S, np.arange(len(track)) * SAMPLE_S, track[:, 2]),
        rate_at=np.arange(1.0, steps - 1.0),
        yaw_rate_radps=np.zeros(steps - 2),
        fix_at=np.arange(0.0, steps - 2.0, SAMPLE_S / STEP_S),
        velocity_mps=np.zeros((1, 2)),
    )
    loaded = load_vessel(vessel)
    predicted = predict(initial_parameters(loaded, FORCE_PER_UNIT_N)[None], moving, loaded)
    velocity = np.gradient(track[:, :2], SAMPLE_S, axis=0)[: len(moving.fix_at)]
    assert np.abs(predicted.velocity_mps[2:, :, 0] - velocity[2:]).max() < 0.01
    rates = predicted.yaw_rate_radps[1::2, 0]  # at every second step there is a sample of the track
    assert np.abs(rates - np.gradient(track[:, 2], SAMPLE_S)[1 : 1 + len(rates)])[2:].max() < 0.01
