"""Cases, run folders, figures, and what the command says to mistakes."""

import json
from pathlib import Path

import msgspec
import pytest

from paani.config import load_config
from paani.errors import UserError
from paani_sim.trials import command
from paani_sim.trials.drive_states import DriveOutcome
from paani_sim.trials.fingerprint import Fingerprint, FingerprintReader
from paani_sim.trials.policies import Policy, load_policy_config
from paani_sim.trials.result import Closeness, Reaction
from paani_sim.trials.run_suite import (
    StoredResult,
    encode_stored_result,
    find_stored_results,
    read_stored_result,
    result_path,
)
from paani_sim.trials.seed_parts import SeedPart
from paani_sim.trials.suite_summary import Summary, summarise_drives, summarise_suite
from paani_sim.trials.summary_table import format_summary
from paani_sim.trials.trial_cases import (
    OTHER_FAULTS,
    SUITE_FAULTS,
    SUITES,
    TrialCase,
    build_scenario,
    list_cases,
    parse_case,
)
from paani_sim.worlds import WORLDS, FaultKind
from tests.unit.paani_sim.trials.trial_results import RESULT

CASES = [TrialCase("lake", seed, Policy.PAANI) for seed in (1, 2, 3)]


@pytest.fixture(scope="module")
def reader() -> FingerprintReader:
    return FingerprintReader(())


def test_suites() -> None:
    """`standard` drives 50 times in each world with every policy but the slow one, which drives 5 times in each."""
    quick, standard = (list_cases(SUITES[name], tuple(WORLDS), Policy) for name in ("quick", "standard"))
    assert len(quick) == len(WORLDS) * (2 * (len(Policy) - 1) + 1)
    for policy in Policy:
        plain = [case for case in standard if case.policy is policy and not case.fault]
        missing = 5 if policy is Policy.PAPER else 50
        assert all(sum(case.world == world for case in plain) == missing for world in WORLDS)
    assert {case.fault for case in standard if case.fault} == {kind.value for kind in SUITE_FAULTS}
    assert set(SUITE_FAULTS) | set(OTHER_FAULTS) == set(FaultKind)
    assert len({case.stem for case in standard}) == len(standard) == len({case.name for case in standard})


def test_parsing_a_case_inverts_its_name() -> None:
    for case in (
        TrialCase("lake", 3, Policy.ORACLE),
        TrialCase("river", 1, Policy.PAANI, "camera_black"),
        TrialCase("a.toml", 2, Policy.BLIND),
    ):
        assert parse_case(case.name) == case


@pytest.mark.parametrize(
    ("text", "says"),
    [("sea:1:paani", "no world 'sea'"), ("lake:x:paani", "'x' is no seed"), (f"lake:{'9' * 5000}:paani", "is no seed"),
     ("lake:1:me", "no policy 'me'"),
     ("lake+rain:1:paani", "no fault 'rain'"), ("lake", "no policy"), ("", "no world")],
)  # fmt: skip
def test_a_malformed_case_is_refused(text: str, says: str) -> None:
    with pytest.raises(UserError, match=says):
        parse_case(text)


@pytest.mark.slow
def test_a_fault_begins_while_the_boat_drives() -> None:
    scenario = build_scenario(TrialCase("lake", 4, Policy.PAANI, "camera_frozen"))
    [fault] = scenario.faults
    assert fault.kind is FaultKind.CAMERA_FROZEN
    assert 12.0 <= fault.start_s <= 30.0
    assert build_scenario(TrialCase("lake", 4, Policy.PAANI, "camera_frozen")).faults == scenario.faults


def write(folder: Path, case: TrialCase, fingerprint: Fingerprint) -> None:
    path = result_path(folder, case)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(encode_stored_result(StoredResult(fingerprint=fingerprint, result=RESULT)))


@pytest.mark.slow
def test_an_interrupted_suite_goes_on(tmp_path: Path, reader: FingerprintReader) -> None:
    """Results made alike are kept; one of other code is named and driven again, and so is half a file."""
    write(tmp_path, CASES[0], reader.fingerprint(CASES[0]))
    write(tmp_path, CASES[1], msgspec.structs.replace(reader.fingerprint(CASES[1]), code="0", settings="0"))
    kept = find_stored_results(tmp_path, CASES, reader)
    assert list(kept.results) == [CASES[0]]
    assert kept.missing == (CASES[1], CASES[2])
    assert kept.outdated == {"other code, settings": 1}
    path = result_path(tmp_path, CASES[0])
    path.write_bytes(path.read_bytes()[:100])
    assert find_stored_results(tmp_path, CASES, reader).missing == tuple(CASES)


@pytest.mark.slow
def test_settings_and_scenario_files_are_part_of_what_made_a_result(tmp_path: Path, reader: FingerprintReader) -> None:
    case = CASES[0]
    other = FingerprintReader(("navigator.cruise_mps=0.5",)).fingerprint(case)
    assert reader.fingerprint(case).list_differences(other) == ["settings"]
    file = tmp_path / "own.toml"
    file.write_text("a")
    before = reader.fingerprint(TrialCase(str(file), 1, Policy.BLIND))
    file.write_text("b")
    assert before.list_differences(reader.fingerprint(TrialCase(str(file), 1, Policy.BLIND))) == ["scenario"]
    vessel = tmp_path / "mine.toml"
    for name in ("settings", "scenario"):
        file.write_text(f"[vessel]\nprofile = '{vessel}'" if name == "scenario" else "")
        sets = ("plant.vessel=" + str(vessel),) if name == "settings" else ()
        vessel.write_text("a")
        made = FingerprintReader(sets).fingerprint(TrialCase(str(file), 1, Policy.BLIND))
        vessel.write_text("b")
        again = FingerprintReader(sets).fingerprint(TrialCase(str(file), 1, Policy.BLIND))
        assert made.list_differences(again) == [name]


@pytest.mark.slow
def test_a_result_names_the_machine_that_made_it_and_files_of_one_name_have_results_of_their_own(
    tmp_path: Path, reader: FingerprintReader
) -> None:
    made = reader.fingerprint(CASES[0])
    assert made.machine
    assert made.list_differences(msgspec.structs.replace(made, machine="")) == ["machine"]
    one, other = (TrialCase(str(tmp_path / folder / "x.toml"), 1, Policy.BLIND) for folder in ("a", "b"))
    assert one.stem != other.stem


@pytest.mark.slow
def test_stored_results_survive_their_file(tmp_path: Path, reader: FingerprintReader) -> None:
    write(tmp_path, CASES[0], reader.fingerprint(CASES[0]))
    record = read_stored_result(result_path(tmp_path, CASES[0]))
    assert record is not None
    assert record.result == RESULT


def test_figures_have_what_the_scoring_reads() -> None:
    """`policies.<name>.{trials,completed,collisions,near_misses,distance_m}`, and intervals."""
    bad = msgspec.structs.replace(
        RESULT, seed=2, completed=False, why=DriveOutcome.TIME_LIMIT, collisions=2, collisions_visible=1, near_misses=0
    )
    blind = msgspec.structs.replace(RESULT, policy=Policy.BLIND, near_misses=4)
    fault = msgspec.structs.replace(
        RESULT,
        reactions=(
            Reaction(fault="camera_black", at_s=9.0, noticed_s=0.1, zero_thrust_s=0.3, rest_s=2.0, in_time=True),
        ),
    )
    results = {
        CASES[0]: RESULT,
        CASES[1]: bad,
        TrialCase("lake", 1, Policy.BLIND): blind,
        TrialCase("lake", 1, Policy.PAANI, "camera_black"): fault,
    }
    summary = summarise_suite("quick", results)
    read = json.loads(msgspec.json.encode(summary))
    paani = read["policies"]["paani"]
    assert [paani[k] for k in ("trials", "completed", "collisions", "near_misses", "distance_m")] == [2, 1, 2, 1, 100.0]
    assert (paani["contacts_per_km"], paani["collisions_visible"], paani["untouched"]) == (20.0, 1, 1)
    assert paani["completed_share"]["low"] < 0.5 < paani["completed_share"]["high"]
    assert paani["encounters"]["tight"] == 2
    assert (paani["part"], paani["seeds"], paani["profile"]) == ("development", 2, "paani")
    assert (paani["encountered"], paani["near_encounter_share"]["share"]) == (2, 1.0)
    assert paani["seen_untouched_share"]["share"] == 0.5
    low, high = paani["contacts_per_km_interval"]
    assert low == pytest.approx(10.0 * 0.2246, abs=0.01)
    assert high == pytest.approx(10.0 * 7.2209, abs=0.01)
    assert (read["seeds"]["part"], read["seeds"]["drives"], read["seeds"]["asked"]) == ("development", 4, 4)
    assert paani["ended"] == {"completed": 1, "time_limit": 1}
    assert paani["stops"]["NO_SAFE_SIDE"] == {"count": 4, "seconds": 8.0}
    assert paani["changes_per_min"] == 3.0
    assert read["policies"]["blind"]["near_misses"] == 4
    assert read["worlds"]["paani"]["lake"]["trials"] == 2
    assert read["faults"]["camera_black"]["in_time"] == read["faults"]["camera_black"]["judged"] == 1
    assert msgspec.json.decode(msgspec.json.encode(summary), type=Summary) == summary
    text = format_summary(summary)
    assert "camera_black" in text
    assert text.startswith("development seeds: 2; drives: 4\n")


def test_sums_over_drives_are_weighted_by_their_time_and_way_and_leave_banks_apart() -> None:
    met = RESULT.encounters[0]
    bank = msgspec.structs.replace(met, what="bank", kind="bank", clearance_m=0.1, closeness=Closeness.GRAZING)
    hit = msgspec.structs.replace(met, clearance_m=0.0, closeness=Closeness.CONTACT)
    far = msgspec.structs.replace(met, clearance_m=2.0, closeness=Closeness.CLEAR)
    short = msgspec.structs.replace(
        RESULT, distance_m=400.0, collisions=1, near_misses=1, near_misses_bank=1, encounters=(met, bank, hit)
    )
    long = msgspec.structs.replace(
        RESULT, seed=2, distance_m=600.0, seconds=300.0, near_misses=1, min_clearance_m=0.2, off_route_rms_m=3.0,
        encounters=(met, far),
    )  # fmt: skip
    found = summarise_drives([short, long])
    assert (found.contacts_per_km, found.near_misses_per_km, found.close_per_km) == (1.0, 2.0, 3.0)
    assert found.near_misses_per_km_interval == pytest.approx((0.242, 7.225), abs=0.03)
    assert (found.encountered, found.near_encounter_share.share, found.touched_encounter_share.share) == (4, 0.5, 0.25)
    assert (found.near_misses_bank, found.encounters["grazing"], found.min_clearance_m) == (1, 0, 0.2)
    assert (found.untouched_share.share, found.seen_untouched_share.share) == (0.5, 1.0)
    assert found.off_route_rms_m == pytest.approx(((1.0 * 100.0 + 9.0 * 300.0) / 400.0) ** 0.5, abs=1e-3)
    assert (found.mean_speed_mps, found.unusable_frac) == (2.5, 0.01)
    tenfold = summarise_drives(
        [msgspec.structs.replace(each, distance_m=10 * each.distance_m) for each in (short, long)]
    )
    assert tenfold.near_misses_per_km_interval == pytest.approx((0.024, 0.722), abs=0.003)


def test_w6_a_drive_that_does_not_recover_from_its_fault_counts_as_none() -> None:
    late = Reaction(fault="camera_black", at_s=9.0, noticed_s=0.1, zero_thrust_s=0.9, rest_s=3.0, in_time=False)
    good = msgspec.structs.replace(late, zero_thrust_s=0.3, rest_s=2.0, in_time=True)
    lost = msgspec.structs.replace(RESULT, completed=False, why=DriveOutcome.TIME_LIMIT, collisions=1)
    drives = {1: (RESULT, good), 2: (lost, late), 3: (lost, late)}
    summary = summarise_suite(
        "quick",
        {
            TrialCase("lake", seed, Policy.PAANI, "camera_black"): msgspec.structs.replace(drive, reactions=(reaction,))
            for seed, (drive, reaction) in drives.items()
        },
    )
    figures = summary.faults["camera_black"]
    assert (figures.trials, figures.completed, figures.collisions) == (3, 1, 2)
    assert (figures.judged, figures.in_time) == (3, 1)
    assert (figures.worst_zero_thrust_s, figures.worst_rest_s) == (0.9, 3.0)


def test_w7_a_policy_differs_from_the_default_one_in_its_evidence_and_planner_alone() -> None:
    for policy in (Policy.ORACLE, Policy.BENDY_RULER, Policy.DWA, Policy.VO):
        assert load_policy_config(policy) == load_policy_config(Policy.PAANI)
    without = load_policy_config(Policy.PAANI, ["navigator.planner.use=false"])
    assert load_policy_config(Policy.BLIND) == without != load_policy_config(Policy.PAANI)


def test_figures_of_people_and_of_several_parts_say_so() -> None:
    met = msgspec.structs.replace(RESULT.encounters[0], kind="person")
    near = msgspec.structs.replace(RESULT, encounters=(met, msgspec.structs.replace(met, clearance_m=1.5)))
    other = msgspec.structs.replace(RESULT, part=SeedPart.VALIDATION)
    summary = summarise_suite("quick", {CASES[0]: near, CASES[1]: other}, asked=5)
    figures = summary.policies["paani"]
    assert (figures.encountered_people, figures.person_clear_share.share) == (2, 0.5)
    assert (summary.seeds.part, figures.part) == (SeedPart.MIXED, SeedPart.MIXED)
    assert "mixed seeds: 2; drives: 2; 3 without a result" in format_summary(summary)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--worlds", "sea"], "no such world"),
        (["--scenario", "none.toml"], "none.toml"),
        (["--scenario", "lake"], "lake: is no written scenario"),
        (["--scenario", "random:lake:3"], "random:lake:3: is no written scenario"),
        (["--set", "navigator.cruise_mps=fast"], "cruise_mps"),
        (["--record", "a.mcap"], "--record needs --one"),
        (["--json", "/nowhere/at/all.json"], "no such folder"),
        (["--report", "/nowhere/at/all.html"], "no such folder"),
        (["--one", "lake:1:paani", "--record", "/nowhere/a.mcap"], "no such folder"),
        (["--one", "lake:1:blind"], "--out: is of suites"),
        (["--one", "lake:1:blind", "--seeds", "1..4"], "--seeds: is of suites"),
        (["--one", "lake:1:blind", "--suite", "imazu"], "--suite: is of suites"),
        (["--policy", "blind", "--report", "taken.html"], "--report .*taken-drives is a file, not a folder"),
    ],
)
@pytest.mark.slow
def test_mistakes_are_named(words: list[str], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("taken-drives").touch()
    with pytest.raises(UserError, match=says):
        command.main([*words, "--out", str(tmp_path / "run")])
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("words", [["--jobs", "0"], ["--policy", "me"], ["--worlds", "lake", "--scenario", "imazu-01"]])
def test_malformed_options_are_refused(words: list[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        command.main(words)
    assert stop.value.code == 2


@pytest.mark.slow
def test_a_finished_suite_is_only_read(
    tmp_path: Path, reader: FingerprintReader, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing is driven where every result is there; format_summary and figures are written."""
    for case in list_cases(SUITES["quick"], ["lake"], [Policy.BLIND]):
        write(tmp_path, case, reader.fingerprint(case))
    figures = tmp_path / "figures.json"
    words = ["--worlds", "lake", "lake", "--policy", "blind", "blind", "--out", str(tmp_path), "--json", str(figures)]
    assert command.main(words) == 0
    assert json.loads(figures.read_bytes())["policies"]["blind"]["trials"] == 2
    assert "blind" in capsys.readouterr().out


@pytest.mark.parametrize("policy", [Policy.PAANI, Policy.ORACLE, Policy.BLIND])
def test_trials_drive_what_ships(policy: Policy) -> None:
    """`paani` drives the settings of `paani up`, the paper's policy the paper's, and the wide lens is asked for."""
    config = load_policy_config(policy)
    assert (config.profile, config.eye) == ("paani", load_config().eye)
    assert config.navigator.planner.use is (policy is not Policy.BLIND)
    assert load_policy_config(policy, ["profile=wide"]).eye.hfov_deg == 102.0
    assert load_policy_config(Policy.PAPER, ["profile=paani"]).profile == "paper"
    wide = load_policy_config(Policy.PAANI_WIDE, ["profile=paani", "navigator.cruise_mps=0.5"])
    assert (wide.profile, wide.eye.hfov_deg, wide.navigator.cruise_mps) == ("wide", 102.0, 0.5)
