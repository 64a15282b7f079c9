"""Work on a Dask cluster: a scheduler and workers of the test's own, by TLS, and those of `--cluster local`."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

import paani
from paani.cluster import open_workers
from paani.errors import UserError
from paani_models.catalogue import WEIGHTS
from paani_models.commands.evaluate import score_pair
from paani_models.datasets import batches
from paani_models.datasets.selection import PictureSelection
from paani_sim.trials.fingerprint import FingerprintReader
from paani_sim.trials.policies import Policy
from paani_sim.trials.run_suite import (
    DriveOrder,
    drive_order,
    make_result_folders,
    read_stored_result,
    result_path,
    store_drive,
)
from paani_sim.trials.trial_cases import TrialCase
from tests.conftest import find_free_port
from tests.unit.paani_models.datasets.public_sets import own_data

security = pytest.importorskip("distributed.security")
pytestmark = [pytest.mark.integration, pytest.mark.timeout(300)]
DRIVES = 4
SHORT = """
[world]
kind = "lake"
obstacles = false
actors = false
[route]
from_m = 20.0
length_m = 9.0
[task]
time_limit_s = 60.0
"""


class Scheduler:
    """A Dask scheduler without workers."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        temporary = security.Security.temporary()
        for name in ("tls_ca_file", "tls_scheduler_cert", "tls_scheduler_key"):
            (folder / name).write_text(getattr(temporary, name))
        ca, certificate, key = (str(folder / n) for n in ("tls_ca_file", "tls_scheduler_cert", "tls_scheduler_key"))
        self._files = ["--tls-ca-file", ca, "--tls-cert", certificate, "--tls-key", key]
        self.environment = {
            **os.environ,
            "DASK_DISTRIBUTED__COMM__TLS__CA_FILE": ca,
            "DASK_DISTRIBUTED__COMM__TLS__CLIENT__CERT": certificate,
            "DASK_DISTRIBUTED__COMM__TLS__CLIENT__KEY": key,
        }
        self.address = f"tls://127.0.0.1:{find_free_port()}"
        self._processes = list[subprocess.Popen[bytes]]()
        self._start(folder / "scheduler.log", "Scheduler at:", "scheduler", "--host", self.address, "--no-dashboard")

    def start_worker(self, *words: str, environment: dict[str, str] | None = None) -> subprocess.Popen[bytes]:
        """A process that nobody starts again."""
        options = ["--no-nanny", "--no-dashboard", "--nthreads", "1", "--host", "127.0.0.1", *words]
        log = self._folder / f"worker-{len(self._processes)}.log"
        return self._start(log, "Registered to:", "worker", self.address, *options, environment=environment)

    def _start(
        self, log: Path, ready: str, *words: str, environment: dict[str, str] | None = None
    ) -> subprocess.Popen[bytes]:
        with log.open("wb") as file:
            command = [sys.executable, "-m", "dask", *words, *self._files]
            process = subprocess.Popen(command, cwd=self._folder, stderr=file, stdout=file, env=environment)
        self._processes.append(process)
        while ready not in log.read_text():
            assert process.poll() is None, log.read_text()
            time.sleep(0.05)
        return process

    def close(self) -> None:
        """End every process of it."""
        for process in self._processes:
            process.kill()
            process.wait()


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[Scheduler]:
    (tmp_path / "dask").mkdir()
    running = Scheduler(tmp_path / "dask")
    yield running
    running.close()


def trial(
    folder: Path, address: str, *more: str, environment: dict[str, str] | None = None, terminal: bool = False
) -> subprocess.Popen[str]:
    """`paani trial` of oracle drives on a cluster."""
    file = folder / "short.toml"
    file.write_text(SHORT)
    words = ["--scenario", str(file), "--out", str(folder / "run"), "--policy", "oracle", "--seeds", f"1..{DRIVES}"]
    return subprocess.Popen(
        [sys.executable, "-m", "paani", "trial", *words, "--cluster", address, *more],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment, start_new_session=terminal,
    )  # fmt: skip


def stored(folder: Path) -> list[Path]:
    return sorted((folder / "run" / "trials").glob("*.json"))


def wait_for_drives(folder: Path, run: subprocess.Popen[str], count: int) -> None:
    while run.poll() is None and len(stored(folder)) < count:
        time.sleep(0.05)


@pytest.mark.rotating(cpu_s=20)
def test_drives_on_a_cluster_are_those_here_though_a_worker_dies(tmp_path: Path, scheduler: Scheduler) -> None:
    """Killed in a drive of its own, a worker costs time alone: every result is there, with the bytes it has here."""
    workers = [scheduler.start_worker(), scheduler.start_worker()]
    run = trial(tmp_path, scheduler.address, environment=scheduler.environment)
    wait_for_drives(tmp_path, run, 1)
    workers[0].kill()
    output, errors = run.communicate(timeout=240)
    assert run.returncode == 0, errors
    assert re.search(rf"^oracle +paani +{DRIVES} ", output, re.MULTILINE)
    assert workers[1].poll() is None
    reader = FingerprintReader(())
    for seed in range(1, DRIVES + 1):
        case = TrialCase(str(tmp_path / "short.toml"), seed, Policy.ORACLE)
        order = DriveOrder(case, reader.fingerprint(case), ())
        make_result_folders(tmp_path / "here")
        store_drive(tmp_path / "here", order, drive_order(order))
        assert result_path(tmp_path / "run", case).read_bytes() == result_path(tmp_path / "here", case).read_bytes()


@pytest.mark.rotating(cpu_s=10)
def test_what_interrupts_a_cluster_loses_no_drive(tmp_path: Path) -> None:
    """Ctrl-C at a terminal, which the workers get as well: what is done is stored and counted, and they end."""
    handler = signal.signal(signal.SIGINT, signal.SIG_DFL)  # a shell in the background ignores it, and so would a child
    run = trial(tmp_path, "local", "--jobs", "1", "--seeds", "1..40", terminal=True)
    signal.signal(signal.SIGINT, handler)
    wait_for_drives(tmp_path, run, 2)
    os.killpg(run.pid, signal.SIGINT)
    _, errors = run.communicate(timeout=120)
    assert run.returncode == 130, errors
    assert "Traceback" not in errors
    done = len(stored(tmp_path))
    assert 2 <= done < 40
    assert f"{done} of 40 drives done; the same command goes on" in errors
    assert all(read_stored_result(file) is not None for file in stored(tmp_path))
    with contextlib.suppress(ProcessLookupError):  # the last of them may still be ending; the time limit judges
        while True:
            os.killpg(run.pid, 0)
            time.sleep(0.05)


READY = """
import contextlib, pathlib, sys
from distributed import default_client
from paani.cluster import open_workers

kept = {}
paths = [pathlib.Path(sys.argv[1]) / str(number) for number in range(3)]
with open_workers("local", 1) as workers:
    run = workers.run(pathlib.Path.touch, paths, kept.__setitem__)
    first = next(run)
    while not all(state.status == "finished" for state in default_client().futures.values()):
        pass
    assert list(kept) == [first]
    run.close()
print(sorted(kept), sorted(path.name for path in paths if path.exists()))
"""


def test_what_was_ready_is_kept_when_nobody_takes_more(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", f"if __name__ == '__main__':\n    exec({READY!r})", str(tmp_path)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.stdout == "[0, 1, 2] ['0', '1', '2']\n", done.stderr


@pytest.mark.rotating(cpu_s=5)
def test_networks_are_scored_on_a_cluster_as_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The evaluation of both networks is that of one process to the last bit, though batches come back in any order."""
    pictures = PictureSelection(own_data(tmp_path, 6), ["tbiseg_dasha", "mcoe_boats"], None)
    monkeypatch.setattr(batches, "BATCH_PICTURES", 2)
    with open_workers("local", 2) as workers:
        far, near = (score_pair(WEIGHTS, pictures, who) for who in (workers, None))
    assert far.evaluation.estimates
    assert msgspec.json.encode(far.evaluation) == msgspec.json.encode(near.evaluation)
    for one, other in ((far.masks, near.masks), (far.boxes, near.boxes)):
        assert [each.sample.picture for each in one] == [each.sample.picture for each in other]


@pytest.mark.rotating(cpu_s=6)
def test_a_cluster_that_cannot_work_is_told_in_a_line(tmp_path: Path, scheduler: Scheduler) -> None:
    """Nobody there, no certificates, no workers; and no folder is made for results."""
    nobody = f"tcp://127.0.0.1:{find_free_port()}"
    runs = {
        f"paani: --cluster {nobody}: no scheduler answers": trial(tmp_path, nobody),
        f"paani: --cluster {scheduler.address}: no scheduler answers": trial(tmp_path, scheduler.address),
        f"paani: --cluster {scheduler.address}: its scheduler has no workers": trial(
            tmp_path, scheduler.address, environment=scheduler.environment
        ),
    }
    for line, run in runs.items():
        output, errors = run.communicate(timeout=120)
        assert (run.returncode, output) == (2, ""), errors
        assert errors.splitlines()[-1].startswith(line)
        assert "Traceback" not in errors
    assert not (tmp_path / "run").exists()


@pytest.mark.rotating(cpu_s=4)
def test_a_worker_with_other_code_gets_no_work(tmp_path: Path, scheduler: Scheduler) -> None:
    copy = tmp_path / "other" / "paani"
    shutil.copytree(Path(paani.__file__).parent, copy, ignore=shutil.ignore_patterns("__pycache__"))
    (copy / "errors.py").write_text((copy / "errors.py").read_text() + "# changed\n")
    scheduler.start_worker(environment={**os.environ, "PYTHONPATH": str(copy.parent)})
    run = trial(tmp_path, scheduler.address, environment=scheduler.environment)
    output, errors = run.communicate(timeout=120)
    assert (run.returncode, output) == (2, ""), errors
    line = errors.splitlines()[-1]
    assert line.startswith(f"paani: --cluster {scheduler.address}: worker tls://127.0.0.1:")
    assert "has another paani: paani " in line
    assert "Traceback" not in errors
    assert not stored(tmp_path)


def test_a_worker_with_another_scenario_file_is_told() -> None:
    """A file under the same path with other content, as on another machine."""
    case = TrialCase("lake", 1, Policy.ORACLE)
    order = DriveOrder(case, FingerprintReader(("navigator.cruise_mps=0.4",)).fingerprint(case), ())
    with pytest.raises(UserError, match=r"trial lake:1:oracle: other settings on "):
        drive_order(order)
