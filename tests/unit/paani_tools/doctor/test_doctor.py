"""The doctor and things that are really broken."""

from __future__ import annotations

import json
import os
import pty
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace

from paani.certificates import INDEX_FILE, read_identities
from paani.clock import WallClock
from paani.config import Config, load_config
from paani.keys import Graph
from paani_models import catalogue
from paani_tools.certs import folder as certificates
from paani_tools.doctor.command import CHECKS, main
from paani_tools.doctor.finding import Finding, State, Verdict, run_check
from paani_tools.doctor.machine import TIME_ERROR, judge_clock

IN_NAMESPACE = ("unshare", "--map-root-user", "--mount", "sh", "-c")


def examine(check: str, sets: tuple[str, ...], profile: str | None = None) -> list[Finding]:
    return list(run_check(check, CHECKS[check], load_config(profile=profile, sets=sets)))


def only(findings: list[Finding]) -> Finding:
    (finding,) = findings
    return finding


@pytest.fixture
def listener() -> Iterator[int]:
    """The port of a program that takes connections and says nothing."""
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        server.listen()
        yield server.getsockname()[1]


def test_a_port_that_another_program_has_is_no_routers(listener: int, private_sets: tuple[str, ...]) -> None:
    sets = (*private_sets, f"bus.router=tcp/127.0.0.1:{listener}")
    finding = only(examine("router", sets))
    assert finding.state is State.FAIL
    assert f"127.0.0.1:{listener}: in use by another program" in finding.text
    assert f"--set bus.router=tcp/127.0.0.1:{listener + 1}" in finding.text


@pytest.mark.slow
def test_a_taken_page_is_named(listener: int, private_sets: tuple[str, ...]) -> None:
    finding = only(examine("page", (*private_sets, f"dashboard.port={listener}")))
    assert (finding.state, finding.remedy) == (State.FAIL, "stop that program, or --set dashboard.port=...")


def test_free_ports_are_well(private_sets: tuple[str, ...]) -> None:
    assert only(examine("router", private_sets)).state is State.OK
    assert only(examine("page", private_sets)).state is State.OK


def test_a_folder_that_takes_no_files_is_told_and_not_made() -> None:
    finding = only(examine("disk", ("bus.runtime_dir=/proc/paani",)))
    assert finding.state is State.FAIL
    assert finding.remedy.endswith("(--set bus.runtime_dir=...)")
    assert only(examine("permissions", ("bus.runtime_dir=/proc/paani",))).state is State.OK


@pytest.mark.slow
def test_a_full_disk_is_told_before_the_logs_fill_it(tmp_path: Path) -> None:
    if subprocess.run([*IN_NAMESPACE, "true"], capture_output=True, check=False).returncode:
        pytest.skip("no mount namespace of one's own here (unshare)")
    mount = f'mount -t tmpfs -o size=1m none {tmp_path} && exec "$@"'
    command = [sys.executable, "-m", "paani", "doctor", "disk", "--set", f"bus.runtime_dir={tmp_path}"]
    done = subprocess.run(
        [*IN_NAMESPACE, mount, "sh", *command], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stderr) == (1, "")
    assert "1 MiB free" in done.stdout
    assert "make room" in done.stdout


def test_too_little_space_for_the_recorder_is_told(tmp_path: Path) -> None:
    sets = (f"bus.runtime_dir={tmp_path}", f"recorder.folder={tmp_path}", "recorder.min_free_mib=1e9")
    runtime, recorder = examine("disk", sets)
    assert runtime.state is not State.FAIL
    assert recorder.state is State.FAIL
    assert "1,000,000,000 needed" in recorder.text


@pytest.mark.slow
def test_a_damaged_model_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    weights = tmp_path / "weights"
    shutil.copytree(catalogue.WEIGHTS, weights)
    data = bytearray((weights / "detector.onnx").read_bytes())
    data[len(data) // 2] ^= 1
    (weights / "detector.onnx").write_bytes(data)
    monkeypatch.setattr(catalogue, "WEIGHTS", weights)
    detector, segmenter, gate = examine("models", ())
    assert detector.state is State.FAIL
    assert f"{weights / 'detector.onnx'}: corrupt" in detector.text
    assert detector.remedy
    assert (segmenter.state, gate.state) == (State.OK, State.OK)


@pytest.mark.slow
def test_a_model_of_ones_own_that_is_none_is_named(tmp_path: Path) -> None:
    mine = tmp_path / "mine.onnx"
    mine.write_bytes(b"no model")
    detector = examine("models", (f"perception.detector={mine}",))[0]
    assert detector.state is State.FAIL
    assert f"paani models check {mine}" in detector.remedy


@pytest.mark.gl
@pytest.mark.slow
def test_a_driver_that_is_not_there_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    assert only(examine("gl", ())).state is State.OK
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", "/nowhere.json")
    finding = only(examine("gl", ()))
    assert finding.state is State.FAIL
    assert "libegl1" in finding.remedy


def test_a_camera_that_is_not_there_is_told(tmp_path: Path) -> None:
    finding = only(examine("camera", ("camera.source=webcam:97",)))
    assert finding.state is State.FAIL
    assert "/dev/video97" in finding.text
    assert finding.remedy
    assert only(examine("camera", (f"camera.source={tmp_path}",))).state is State.FAIL
    assert only(examine("camera", ())).state is State.OK


def test_a_line_that_is_not_there_is_told_and_one_that_is_there_is_well(tmp_path: Path, listener: int) -> None:
    ours, theirs = pty.openpty()
    (tmp_path / "file").touch()
    sets = (
        f"bridge.line=socket://127.0.0.1:{listener}",
        f"sensors.gps.line=serial:{os.ttyname(theirs)}",
        f"sensors.imu.line=serial:{tmp_path / 'nothing'}",
        f"sensors.heading.line=serial:{tmp_path / 'file'}",
    )
    states = {finding.text.split()[0]: finding.state for finding in examine("serial", sets)}
    assert states == {
        "bridge.line": State.OK,
        "sensors.gps.line": State.OK,
        "sensors.imu.line": State.FAIL,
        "sensors.heading.line": State.FAIL,
    }
    os.close(ours)
    os.close(theirs)


def test_secrets_that_others_may_read_are_told(tmp_path: Path) -> None:
    sets, secret = (f"bus.runtime_dir={tmp_path}",), tmp_path / "credentials" / "operator"
    tmp_path.chmod(0o700)
    secret.parent.mkdir(mode=0o700)
    secret.touch(mode=0o600)
    assert only(examine("permissions", sets)).state is State.OK
    secret.chmod(0o644)
    finding = only(examine("permissions", sets))
    assert (finding.state, finding.remedy) == (State.FAIL, f"chmod -R go-rwx {tmp_path}")
    assert str(secret) in finding.text


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a folder away")
def test_a_runtime_folder_of_another_user_is_told(tmp_path: Path) -> None:
    folder = tmp_path / "theirs"
    folder.mkdir(mode=0o700)
    os.chown(folder, 12345, 12345)
    assert "belongs to user 12345" in only(examine("permissions", (f"bus.runtime_dir={folder}",))).text


@pytest.mark.parametrize(
    ("now_s", "kernel_state", "state"),
    [(99.0, 0, State.FAIL), (101.0, 0, State.OK), (101.0, TIME_ERROR, State.WARN), (101.0, -1, State.OK)],
)
def test_a_clock_is_later_than_the_program(now_s: float, kernel_state: int, state: State) -> None:
    assert judge_clock(now_s, 100.0, kernel_state).state is state


def test_what_a_check_raises_is_a_finding() -> None:
    def stumble(config: Config) -> Iterator[Verdict]:
        yield Verdict(State.OK, "so far")
        raise RuntimeError("two\nlines")

    first, last = run_check("stumble", stumble, Config())
    assert first.state is State.OK
    assert (last.state, last.text) == (State.FAIL, "cannot be checked: RuntimeError: two lines")


def test_the_exit_code_says_whether_something_fails(
    private_sets: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    sets = [word for setting in private_sets for word in ("--set", setting)]
    assert main(["page", "clock", *sets]) == 0
    capsys.readouterr()
    assert main(["camera", "page", "--json", *sets, "--set", "camera.source=webcam:97"]) == 1
    camera, page = json.loads(capsys.readouterr().out)
    assert (camera["check"], camera["state"], page["state"]) == ("camera", "fail", "ok")


@pytest.mark.slow
def test_every_line_is_one_line_and_says_what_to_do(capsys: pytest.CaptureFixture[str]) -> None:
    main(["camera", "disk", "versions", "--set", "camera.source=webcam:97", "--set", "bus.runtime_dir=/proc/paani"])
    lines = capsys.readouterr().out.splitlines()
    assert {line.split()[1] for line in lines} == {"camera", "disk", "versions"}
    assert all(" -> " in line for line in lines if not line.startswith("ok"))


@pytest.mark.parametrize(
    ("name", "state"), [("controller", State.FAIL), ("host_router", State.FAIL), ("nmea", State.WARN)]
)
@pytest.mark.slow
def test_an_identity_without_certificate_is_told_with_what_makes_one(tmp_path: Path, name: str, state: State) -> None:
    folder = tmp_path / "certs"
    certificates.make(folder, Graph.SIMULATION, (), WallClock().now_us(), 30)
    known = read_identities(folder)
    holders = {each: holder for each, holder in known.holders.items() if each != name}
    (folder / INDEX_FILE).write_bytes(msgspec.json.encode(replace(known, holders=holders)))
    finding = examine("certificates", (f"bus.certificates={folder}",))[0]
    assert (finding.state, finding.text) == (state, f"bus.certificates {folder}: none for {name}")
    assert f"paani certs complete --folder {folder}" in finding.remedy


@pytest.mark.parametrize(("days", "state"), [(30, State.OK), (7, State.WARN)])
@pytest.mark.slow
def test_certificates_that_expire_soon_are_told(tmp_path: Path, days: int, state: State) -> None:
    folder = tmp_path / "certs"
    certificates.make(folder, Graph.SIMULATION, (), WallClock().now_us(), days)
    sets = (f"bus.certificates={folder}",)
    assert only(examine("certificates", sets)).state is state
    (folder / "controller.1.key").unlink()
    finding = only(examine("certificates", sets))
    assert finding.state is State.FAIL
    assert "controller.1.key: No such file" in finding.text
