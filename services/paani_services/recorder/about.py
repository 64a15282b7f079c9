"""What a recording says of the system that made it: settings, models, versions."""

from __future__ import annotations

import platform
import shutil
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import msgspec

import paani
from paani.config import Config, encode_config
from paani.logs.writer import About
from paani_models.catalogue import MANIFEST, WEIGHTS

PACKAGES = ("paani", "numpy", "onnxruntime", "eclipse-zenoh", "msgspec", "mcap", "opencv-python-headless")
GIT_S = 5.0


def make_about(config: Config) -> About:
    """Reads the manifest of the models and asks Git; what is not there is left empty."""
    manifest = WEIGHTS / MANIFEST
    attachments = {
        "config.json": encode_config(config),
        "models.json": manifest.read_bytes() if manifest.is_file() else b"{}",
        "versions.json": msgspec.json.format(msgspec.json.encode(versions()), indent=1),
    }
    facts = {"domain": str(config.bus.domain), "vessel": config.bus.vessel, "profile": config.profile}
    return About(version=_version("paani"), attachments=attachments, facts=facts)


def versions() -> dict[str, str]:
    """Of this program and of what it computes with."""
    return {
        **{package: _version(package) for package in PACKAGES},
        "python": platform.python_version(),
        "platform": platform.platform(),
        "commit": _commit(Path(paani.__file__).parents[2]),
    }


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""


def _commit(checkout: Path) -> str:
    git = shutil.which("git")
    if git is None or not (checkout / ".git").exists():
        return ""
    command = [git, "-C", str(checkout), "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
    try:
        return subprocess.run(command, capture_output=True, text=True, timeout=GIT_S, check=False).stdout.strip()
    except (OSError, subprocess.TimeoutExpired):
        return ""
