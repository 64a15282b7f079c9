"""A container engine: the one of this machine that runs, or one started from Debian's packages and ended again."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import re
import shutil
import subprocess
import tempfile
import threading
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from tests.places import ROOT

BASE_IMAGE = "paani/base:bookworm"
PACKAGES = "docker.io iptables debootstrap"  # as DEBIAN_DEPLOY of the Makefile
START_S = 30.0
KEPT = Path(tempfile.gettempdir()) / "paani-deploy"  # plugins, and images of an engine that was started here


class NoEngine(Exception):
    """Why there are no containers on this machine."""


class Engine:
    """Commands to a running engine; `environment` is what they and Compose see."""

    def __init__(self, environment: Mapping[str, str]) -> None:
        self.environment = dict(environment)

    def docker(self, *words: str, check: bool = True) -> str:
        """Output of `docker WORDS`. Raises AssertionError with what it said where it fails and `check`."""
        return self.pipe(b"", *words, check=check).decode()

    def pipe(self, stdin: bytes, *words: str, check: bool = True) -> bytes:
        """As `docker`, with input, in bytes."""
        done = subprocess.run(
            ["docker", *words], env=self.environment, cwd=ROOT, input=stdin, capture_output=True, check=False
        )
        assert done.returncode == 0 or not check, f"docker {' '.join(words)}: {done.stderr.decode()[-2000:]}"
        return done.stdout

    def compose(self, side: str, *words: str, check: bool = True) -> str:
        """Output of `docker compose WORDS` on the file of a side."""
        return self.docker("compose", "-f", f"deploy/compose.{side}.yaml", *words, check=check)

    def container(self, side: str, service: str) -> str:
        """Name of a service's container."""
        return f"paani-{side}-{service}-1"

    def containers(self, side: str) -> list[dict[str, Any]]:
        """What the engine knows of each running container of a side."""
        names = self.docker("ps", "-q", "--filter", f"label=com.docker.compose.project=paani-{side}").split()
        return list(json.loads(self.docker("inspect", *names))) if names else []

    def processes(self, name: str) -> list[int]:
        """Process numbers in a container, as this machine sees them; a health check's among them."""
        return [int(word) for word in self.docker("top", name, "-eo", "pid").split()[1:]]

    def service_process(self, name: str) -> int:
        """Number of the one process in a container that is neither its init nor a health check."""
        lines = [line.split(maxsplit=1) for line in self.docker("top", name, "-eo", "pid,args").splitlines()[1:]]
        (found,) = (int(pid) for pid, command in lines if re.match(r"\S*python\S* .*\brun\b", command))
        return found

    def cable(self, name: str, network: str) -> str:
        """This machine's end of what joins a container to a network; taken down, it is a cable that was pulled out."""
        address = f'{{{{(index .NetworkSettings.Networks "{network}").MacAddress}}}}'
        mac = self.docker("inspect", "-f", address, name).strip()
        find = "grep -l $0 /sys/class/net/*/address | xargs dirname"
        inside = self.docker("exec", name, "sh", "-c", find, mac).strip()
        ends = {Path(end, "ifindex").read_text(): end.name for end in Path("/sys/class/net").iterdir()}
        return ends[self.docker("exec", name, "cat", f"{inside}/iflink")]

    def ensure_base_image(self) -> None:
        """A base image without a registry, made once."""
        if not self.docker("images", "-q", BASE_IMAGE).strip():
            self.run("sh", "deploy/base-image.sh", BASE_IMAGE)

    def run(self, *command: str) -> None:
        """Run a program that speaks to this engine. Raises NoEngine with what it said where it fails."""
        _run(command, self.environment)


@contextlib.contextmanager
def running_engine() -> Iterator[Engine]:
    """One user at a time, as two engines would share the kept images. Raises NoEngine, with what is missing."""
    if shutil.which("docker") is None:
        raise NoEngine(f"needs a container engine (Debian: {PACKAGES})")
    KEPT.mkdir(mode=0o700, exist_ok=True)
    with (KEPT / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with _running() as engine:
            yield engine


@contextlib.contextmanager
def _running() -> Iterator[Engine]:
    environment = {**os.environ, "BASE_IMAGE": os.environ.get("BASE_IMAGE", BASE_IMAGE)}
    if not _answers(["docker", "compose", "version"], environment):
        environment["DOCKER_CONFIG"] = str(KEPT)
        if not _answers(["docker", "compose", "version"], environment):
            _run(["sh", "tests/deploy/compose_plugin.sh", str(KEPT)], environment)
    if _answers(["docker", "info"], environment):
        yield Engine(environment)
        return
    if os.geteuid() != 0 or shutil.which("dockerd") is None:
        raise NoEngine("needs a container engine that runs, or root to start one")
    with _started(environment) as engine:
        yield engine


@contextlib.contextmanager
def _started(environment: Mapping[str, str]) -> Iterator[Engine]:
    forwarding = Path("/proc/sys/net/ipv4/ip_forward").read_text(encoding="ascii")
    with tempfile.TemporaryDirectory() as folder, (KEPT / "dockerd.log").open("w") as log:
        environment = {**environment, "DOCKER_HOST": f"unix://{folder}/docker.sock"}
        places = [f"--data-root={KEPT}/data", f"--exec-root={folder}/exec", f"--pidfile={folder}/docker.pid"]
        daemon = subprocess.Popen(["dockerd", *places, "-H", environment["DOCKER_HOST"]], stdout=log, stderr=log)
        try:
            for _ in range(round(START_S / 0.2)):
                if _answers(["docker", "info"], environment) or daemon.poll() is not None:
                    break
                threading.Event().wait(0.2)
            if not _answers(["docker", "info"], environment):
                raise NoEngine(f"dockerd does not start here: {(KEPT / 'dockerd.log').read_text()[-300:]}")
            yield Engine(environment)
        finally:
            daemon.terminate()
            daemon.wait(30.0)
            # What the engine changed on this machine and leaves behind.
            subprocess.run(["iptables", "-P", "FORWARD", "ACCEPT"], check=False)
            subprocess.run(["ip", "link", "delete", "docker0"], capture_output=True, check=False)
            Path("/proc/sys/net/ipv4/ip_forward").write_text(forwarding, encoding="ascii")


def _answers(command: Sequence[str], environment: Mapping[str, str]) -> bool:
    try:
        done = subprocess.run(command, env=environment, capture_output=True, check=False, timeout=30.0)
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0


def _run(command: Sequence[str], environment: Mapping[str, str]) -> None:
    done = subprocess.run(command, env=environment, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise NoEngine(f"{' '.join(command)}: {done.stderr[-500:]}")
