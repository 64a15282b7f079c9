"""`paani replay --check` as a user runs it: verdicts, exit codes, one line for a mistake."""

from __future__ import annotations

import json
from pathlib import Path

import msgspec
import pytest

from paani import cli
from paani.config import encode_config, with_settings
from paani.logs.reader import Record
from paani_tools.replay.compatibility import _installed_manifest
from tests.unit.paani_tools.replay.recorded_drive import CONFIG, drive, write_log

DRIVE = drive(12.0)


def paani(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    code = cli.main([str(word) for word in words])
    out, errors = capsys.readouterr()
    return code, out, errors


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return write_log(tmp_path / "drive.mcap", DRIVE)


@pytest.mark.slow
def test_an_exact_log(capsys: pytest.CaptureFixture[str], log: Path, tmp_path: Path) -> None:
    code, out, errors = paani(capsys, "replay", log, "--check", "--json", tmp_path / "r.json")
    assert (code, errors) == (0, "")
    assert out.splitlines()[-1].endswith(" decisions, 0 differ")
    report = json.loads((tmp_path / "r.json").read_text())
    assert [service["service"] for service in report["services"]] == ["advisor", "navigator", "controller"]
    decisions = sum(service["decisions"] for service in report["services"])
    assert out.splitlines()[-1] == f"{decisions} decisions, 0 differ"
    assert f"digest {report['digest']}" in out
    assert len(report["digest"]) == 64
    assert list(tmp_path.glob(".*beside")) == []


@pytest.mark.slow
def test_a_log_that_differs(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    thrust = next(r for r in DRIVE if r.topic == "controller/thrust" and b'"enabled":true' in r.data)
    other = thrust._replace(data=thrust.data.replace(b'"enabled":true', b'"enabled":false'))
    file = write_log(tmp_path / "drive.mcap", [other if r is thrust else r for r in DRIVE])
    code, out, _ = paani(capsys, "replay", file, "--check")
    assert code == 1
    assert out.splitlines()[-1].endswith(" decisions, 1 differ")
    assert "enabled was false, is true" in out


@pytest.mark.slow
def test_other_settings_print_what_changes(capsys: pytest.CaptureFixture[str], log: Path, tmp_path: Path) -> None:
    setting = "advisor.policy.center_block_risk=0.35"
    code, out, _ = paani(capsys, "replay", log, "--check", "--set", setting, "--json", tmp_path / "r.json")
    assert code == 0
    assert "advisor/advisory  STRAIGHT -> " in out
    assert "was: CENTER_CLEAR" in out
    assert "now: CENTER_" in out
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["sets"] == [setting]
    assert report["services"][1]["changed"] == 0
    _, out, _ = paani(capsys, "replay", log, "--check", "--chain", "--set", setting)
    assert "navigator/command  go STRAIGHT -> " in out


@pytest.mark.slow
def test_services_that_are_not_installed_are_named(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    step = next(r for r in DRIVE if r.topic == "controller/step")
    file = write_log(tmp_path / "drive.mcap", [*DRIVE, step._replace(topic="helmsman/step")])
    code, out, _ = paani(capsys, "replay", file, "--check")
    assert code == 1
    assert "helmsman: no such decider is installed" in out
    assert out.splitlines()[-1].endswith(" decisions, 0 differ")


def test_a_log_without_decisions_is_not_exact(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = write_log(tmp_path / "drive.mcap", [Record("sensors/gps", 1_800_000_000_000_000, 0, b"{}")])
    code, out, _ = paani(capsys, "replay", file, "--check")
    assert code == 1
    assert out.splitlines()[-1] == "0 decisions, 0 differ"


@pytest.mark.slow
def test_settings_of_a_newer_version_need_force(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    tree = json.loads(encode_config(CONFIG))
    tree["advisor"]["policy"]["clairvoyance"] = 0.5
    tree["teleport"] = {"enabled": True}
    file = write_log(
        tmp_path / "drive.mcap",
        DRIVE,
        None,
        attached={"config.json": json.dumps(tree).encode(), "versions.json": b'{"paani":"9.9"}'},
    )
    code, _, errors = paani(capsys, "replay", file, "--check")
    assert code == 2
    assert len(errors.splitlines()) == 1
    assert "clairvoyance" in errors or "teleport" in errors
    assert "--force" in errors
    code, out, _ = paani(capsys, "replay", file, "--check", "--force")
    assert code == 0
    assert "left out: advisor.policy.clairvoyance, teleport" in out
    assert "recorded by paani 9.9" in out
    tree["advisor"]["policy"]["tie"] = "much"
    file = write_log(tmp_path / "drive.mcap", DRIVE, None, attached={"config.json": json.dumps(tree).encode()})
    code, _, errors = paani(capsys, "replay", file, "--check", "--force")
    assert (code, len(errors.splitlines())) == (2, 1)


@pytest.mark.slow
def test_other_weights_need_force_and_say_what_it_means(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    installed = _installed_manifest()
    assert installed is not None
    file = write_log(tmp_path / "same.mcap", DRIVE, attached={"models.json": installed})
    assert paani(capsys, "replay", file, "--check")[0] == 0
    tree = json.loads(installed)
    tree["models"][0]["sha256"] = "0" * 64
    name = tree["models"][0]["name"]
    file = write_log(tmp_path / "other.mcap", DRIVE, attached={"models.json": json.dumps(tree).encode()})
    code, _, errors = paani(capsys, "replay", file, "--check")
    assert code == 2
    assert f"other weights than those installed ({name})" in errors
    assert "decisions can be computed from the recorded evidence" in errors
    code, out, _ = paani(capsys, "replay", file, "--check", "--force")
    assert code == 0
    assert f"note: the evidence was made by other weights than those installed ({name})" in out


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("--check", "--set", "advisor.policy.center_block=0.4"), "center_block"),
        (("--check", "--set", "advisor.policy.tie=2"), "advisor.policy.tie"),
        (("--check", "--json", "no/such/folder/r.json"), "--json no/such/folder/r.json"),
        (("--set", "advisor.policy.tie=0.1"), "takes only bus and dashboard settings"),
        (("--only", "no/such"), "--only no/such"),
        (("--only", "controller/thrust"), "--commands"),
        (("--set", "bus.router=nowhere"), "router nowhere: expected"),
        (("--from", "9999"), "--from 9999: "),
        (("--check", "--speed", "2"), "--speed: republishes"),
        (("--force",), "--force: goes with --check"),
        (("--set", "bus.router=tcp/192.0.2.1:7"), "bus.router tcp/192.0.2.1:7"),
    ],
    ids=[
        "unknown setting",
        "bad value",
        "folder",
        "no use",
        "topic",
        "command",
        "address",
        "foreign address",
        "beyond the end",
        "republishing",
        "deciding",
    ],
)
@pytest.mark.slow
def test_a_mistake_is_one_line(
    capsys: pytest.CaptureFixture[str], log: Path, words: tuple[str, ...], named: str
) -> None:
    code, _, errors = paani(capsys, "replay", log, *words)
    assert code == 2
    assert len(errors.splitlines()) == 1
    assert named in errors


@pytest.mark.parametrize("what", ["missing", "empty", "foreign", "no config"])
@pytest.mark.slow
def test_what_is_no_log_is_one_line(capsys: pytest.CaptureFixture[str], tmp_path: Path, what: str) -> None:
    file = tmp_path / "a.mcap"
    if what == "no config":
        write_log(file, DRIVE, None)
    elif what != "missing":
        file.write_bytes(b"" if what == "empty" else b"\x89PNG\r\n\x1a\n" * 40)
    for command in (("replay", file, "--check"), ("replay", file), ("explain", file)):
        code, out, errors = paani(capsys, *command)
        assert (code, out, len(errors.splitlines())) == (2, "", 1)
        assert str(file) in errors


@pytest.mark.slow
def test_settings_can_be_those_of_the_paper(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    config = with_settings(CONFIG, ("advisor.tracker.held_decay_s=1e9", "navigator.latch_turns=false"))
    file = write_log(tmp_path / "drive.mcap", drive(6.0, config), config)
    code, out, _ = paani(capsys, "replay", file, "--check")
    assert code == 0, out
    assert msgspec.json.decode(encode_config(config)) != msgspec.json.decode(encode_config(CONFIG))


@pytest.mark.slow
def test_the_bench_gives_the_speed_of_a_check(capsys: pytest.CaptureFixture[str], log: Path, tmp_path: Path) -> None:
    file = tmp_path / "b.json"
    code, out, _ = paani(capsys, "bench", "judgement", "--only", "replay", "--drive", log, "--json", file)
    assert code == 0
    assert "x real time" in out
    (part,) = json.loads(file.read_text())["parts"]
    row = dict(zip(part["columns"], part["rows"][0], strict=True))
    assert row["drive"] == log.name
    assert row["decisions"] > 300
    assert row["differ"] == 0
    assert row["log [s]"] / row["took [s]"] == pytest.approx(row["x real time"], rel=0.2, abs=1)
