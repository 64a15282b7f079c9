"""The ledger of drives, and which checkout may draw fresh seeds."""

import resource
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani.errors import UserError
from paani_sim.trials import command
from paani_sim.trials.checkout import LEDGER_NAME, find_checkout, resolve_commit
from paani_sim.trials.fingerprint import FingerprintReader
from paani_sim.trials.ledger import Ledger, LedgerDraw, LedgerResult, read_ledger
from paani_sim.trials.policies import Policy
from paani_sim.trials.run_suite import StoredResult, encode_stored_result, result_path
from paani_sim.trials.seed_parts import SeedPart, draw_fresh_seeds
from paani_sim.trials.trial_cases import TrialCase
from tests.places import ROOT
from tests.unit.paani_sim.trials.trial_results import RESULT

COMMIT = "a" * 40
IDENTITY = ("-c", "user.name=t", "-c", "user.email=t@t", "-c", "commit.gpgsign=false")
CASES = [TrialCase("lake", seed, Policy.PAANI) for seed in draw_fresh_seeds(COMMIT, 3)]
Git = Callable[..., str]

pytestmark = pytest.mark.skipif(shutil.which("git") is None, reason="needs git")


@pytest.fixture
def git(tmp_path: Path) -> Git:
    """Git in a checkout with one commit."""
    root = tmp_path / "checkout"
    root.mkdir()

    def run(*words: str) -> str:
        done = subprocess.run(["git", *IDENTITY, *words], cwd=root, capture_output=True, text=True, check=True)
        return done.stdout.strip()

    run("init", "-q")
    (root / "sim_host").mkdir()
    (root / "code.py").write_text("1")
    run("add", ".")
    run("commit", "-qm", "one")
    return run


def test_a_draw_stays_visible_until_its_drive_has_a_result(tmp_path: Path) -> None:
    file = tmp_path / "ledger.jsonl"
    ledger = Ledger(file, COMMIT, ())
    ledger.enter_draws(CASES)
    ledger.enter_result(CASES[0], RESULT)
    counts = ledger.count(SeedPart.FRESH)
    assert (counts.drawn, counts.with_result, counts.differing) == (3, 1, 0)
    kinds = [type(entry) for entry in read_ledger(file)]
    assert kinds == [LedgerDraw, LedgerDraw, LedgerDraw, LedgerResult]


def test_lines_are_only_appended_and_nothing_is_entered_twice(tmp_path: Path) -> None:
    """A run that goes on adds what is missing; a drive that went otherwise is entered beside its first result."""
    file = tmp_path / "ledger.jsonl"
    first = Ledger(file, COMMIT, ())
    first.enter_draws(CASES[:2])
    first.enter_result(CASES[0], RESULT)
    before = file.read_bytes()
    again = Ledger(file, COMMIT, ())
    again.enter_draws(CASES[:2])
    again.enter_result(CASES[0], RESULT)
    assert file.read_bytes() == before
    again.enter_draws(CASES)
    again.enter_result(CASES[0], msgspec.structs.replace(RESULT, collisions=0, distance_m=1.0))
    assert file.read_bytes().startswith(before)
    assert len(read_ledger(file)) == 5
    assert again.count(SeedPart.FRESH).differing == 1


@given(st.lists(st.tuples(st.booleans(), st.sampled_from(CASES), st.sampled_from([0, 1, None])), max_size=12))
def test_two_runs_at_once_enter_each_line_once(steps: list[tuple[bool, TrialCase, int | None]]) -> None:
    """Both have read the ledger before either writes; a result with None is a draw alone."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "ledger.jsonl"
        runs = Ledger(file, COMMIT, ()), Ledger(file, COMMIT, ())
        went: dict[TrialCase, set[int]] = {}
        for is_second, case, collisions in steps:
            runs[is_second].enter_draws([case])
            went.setdefault(case, set())
            if collisions is not None:
                runs[is_second].enter_result(case, msgspec.structs.replace(RESULT, collisions=collisions))
                went[case].add(collisions)
        lines = file.read_bytes().splitlines() if steps else []
        assert len(lines) == len(set(lines)) == len(went) + sum(map(len, went.values()))
        counts = Ledger(file, COMMIT, ()).count(SeedPart.FRESH)
    assert counts.drawn == len(went)
    assert counts.with_result == sum(map(bool, went.values()))
    assert counts.differing == sum(len(each) > 1 for each in went.values())


def test_a_line_written_twice_is_no_drive_that_went_otherwise(tmp_path: Path) -> None:
    file = tmp_path / "ledger.jsonl"
    ledger = Ledger(file, COMMIT, ())
    ledger.enter_draws(CASES[:1])
    ledger.enter_result(CASES[0], RESULT)
    file.write_bytes(2 * file.read_bytes())
    assert Ledger(file, COMMIT, ()).count(SeedPart.FRESH).differing == 0


def test_a_last_line_without_its_end_stays_a_line_of_its_own(tmp_path: Path) -> None:
    file = tmp_path / "ledger.jsonl"
    Ledger(file, COMMIT, ()).enter_draws(CASES[:1])
    file.write_bytes(file.read_bytes().rstrip())
    Ledger(file, COMMIT, ()).enter_draws(CASES)
    assert len(read_ledger(file)) == len(CASES)


def test_a_full_disk_leaves_no_part_of_a_line(tmp_path: Path) -> None:
    file = tmp_path / "ledger.jsonl"
    ledger = Ledger(file, COMMIT, ())
    ledger.enter_draws(CASES[:1])
    before, limits = file.read_bytes(), resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(before) + 10, limits[1]))
    try:
        with pytest.raises(UserError, match="--ledger"):
            ledger.enter_draws(CASES)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert file.read_bytes() == before
    ledger.enter_draws(CASES)
    assert len(read_ledger(file)) == len(CASES)


def test_settings_and_commits_are_counted_apart(tmp_path: Path) -> None:
    file = tmp_path / "ledger.jsonl"
    Ledger(file, COMMIT, ()).enter_draws(CASES)
    other = Ledger(file, COMMIT, ("navigator.cruise_mps=0.5",))
    assert other.count(SeedPart.FRESH).drawn == 0
    other.enter_draws(CASES[:1])
    assert other.count(SeedPart.FRESH).drawn == 1
    later = Ledger(file, "b" * 40, ())
    later.enter_draws(CASES[:1])
    assert (later.count(SeedPart.FRESH).drawn, later.count(SeedPart.FRESH).commits) == (1, 2)
    assert later.count(SeedPart.VALIDATION).commits == 0


def test_a_line_that_is_no_entry_is_named(tmp_path: Path) -> None:
    file = tmp_path / "ledger.jsonl"
    Ledger(file, COMMIT, ()).enter_draws(CASES[:1])
    with file.open("ab") as out:
        out.write(b'{"entry": "drawn"')
    with pytest.raises(UserError, match="line 2 is no entry"):
        Ledger(file, COMMIT, ())


def test_the_code_under_test_is_one_checkout() -> None:
    assert find_checkout() == ROOT


@pytest.mark.slow
def test_only_what_is_checked_out_is_measured(tmp_path: Path, git: Git) -> None:
    """HEAD, its digits, or an ancestor from which only the ledger differs."""
    root = tmp_path / "checkout"
    ledger, one = root / LEDGER_NAME, git("rev-parse", "HEAD")
    assert resolve_commit(root, "HEAD", ledger) == resolve_commit(root, one[:9], ledger) == one
    ledger.write_text("")
    assert resolve_commit(root, "HEAD", ledger) == one
    git("add", ".")
    git("commit", "-qm", "entries")
    assert resolve_commit(root, one, ledger) == one
    (root / "code.py").write_text("2")
    git("commit", "-qam", "other code")
    with pytest.raises(UserError, match=rf"not {one[:12]}; check that out"):
        resolve_commit(root, one, ledger)
    git("checkout", "-qb", "side", one)
    with pytest.raises(UserError, match="check that out"):
        resolve_commit(root, git("rev-parse", "HEAD@{1}"), ledger)


@pytest.mark.slow
def test_a_tree_that_was_changed_is_refused_by_name(tmp_path: Path, git: Git) -> None:
    root = tmp_path / "checkout"
    ledger = root / "own.jsonl"
    ledger.write_text("")
    assert resolve_commit(root, "HEAD", ledger) == git("rev-parse", "HEAD")
    with pytest.raises(UserError, match="no commit 'nothing'"):
        resolve_commit(root, "nothing", ledger)
    (root / "new.py").write_text("")
    with pytest.raises(UserError, match=r"is not commit .*new\.py; commit it"):
        resolve_commit(root, "HEAD", ledger)
    (root / "new.py").unlink()
    (root / "code.py").write_text("2")
    with pytest.raises(UserError, match=r"is not commit .*code\.py"):
        resolve_commit(root, "HEAD", ledger)


def test_nobody_points_git_at_another_place(tmp_path: Path, git: Git, monkeypatch: pytest.MonkeyPatch) -> None:
    one = git("rev-parse", "HEAD")
    monkeypatch.setenv("GIT_DIR", str(ROOT / ".git"))
    assert resolve_commit(tmp_path / "checkout", "HEAD", tmp_path / "ledger.jsonl") == one


def test_a_place_without_git_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(UserError, match=r"of several places|no checkout under git"):
        find_checkout()
    with pytest.raises(UserError, match="no commit"):
        resolve_commit(tmp_path, "HEAD", tmp_path / "ledger.jsonl")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--seeds", "fresh:2@HEAD", "--scenario", "river_swimmer"], "written scenarios are for development"),
        (["--seeds", "fresh:2@HEAD", "--suite", "imazu"], "written scenarios are for development"),
        (["--seeds", "1..2", "--ledger", "ledger.jsonl"], "--ledger is for validation and fresh"),
        (["--seeds", "fresh:2@deadbeef"], "no commit 'deadbeef'"),
        (["--one", "lake:10001:paani"], "never looked into"),
        (["--seeds", "x"], "is none of"),
    ],
)
def test_mistakes_with_parts_are_named_before_anything_is_written(
    words: list[str], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match=says):
        command.main(words)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_fresh_drives_are_entered_counted_and_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], git: Git
) -> None:
    """With stored results nothing is driven; draws and results are in the ledger, and the figures name their part."""
    root, commit, out = tmp_path / "checkout", git("rev-parse", "HEAD"), tmp_path / "run"
    monkeypatch.setattr(command, "find_checkout", lambda: root)
    reader = FingerprintReader(())
    for seed in draw_fresh_seeds(commit, 2):
        case = TrialCase("lake", seed, Policy.BLIND)
        result = msgspec.structs.replace(RESULT, seed=seed, part=SeedPart.FRESH, policy=Policy.BLIND)
        path = result_path(out, case)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(encode_stored_result(StoredResult(fingerprint=reader.fingerprint(case), result=result)))
    words = ["--worlds", "lake", "--policy", "blind", "--seeds", "fresh:2@HEAD", "--out", str(out)]
    assert command.main(words) == 0
    entries = read_ledger(root / LEDGER_NAME)
    assert [type(entry) for entry in entries] == [LedgerDraw, LedgerDraw, LedgerResult, LedgerResult]
    assert {(entry.commit, entry.part, entry.policy) for entry in entries} == {(commit, SeedPart.FRESH, Policy.BLIND)}
    text = capsys.readouterr().out
    assert text.startswith(f"fresh seeds: 2; drives: 2; commit {commit[:12]}; ledger: 2 drawn, 2 with a result, 1 ")
