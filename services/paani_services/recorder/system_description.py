"""Description of the recorded system, attached to every recording: settings, model checksums, versions."""

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
GIT_TIMEOUT_S = 5.0  # a checkout on a slow disk must not delay the start further


def describe_system(config: Config) -> About:
    """Settings, the models' manifest and the versions of this system; what cannot be read is left empty."""
    manifest = WEIGHTS / MANIFEST
    attachments = {
        "config.json": encode_config(config),
        "models.json": manifest.read_bytes() if manifest.is_file() else b"{}",
        "versions.json": msgspec.json.format(msgspec.json.encode(versions()), indent=1),
    }
    facts = {"domain": str(config.bus.domain), "vessel": config.bus.vessel, "profile": config.profile}
    return About(version=_version("paani"), attachments=attachments, facts=facts)


def versions() -> dict[str, str]:
    """Versions of PAANI, its commit, and the packages, interpreter and platform it runs on."""
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
        return subprocess.run(
            command, capture_output=True, text=True, timeout=GIT_TIMEOUT_S, check=False
        ).stdout.strip()
    except (OSError, subprocess.TimeoutExpired):
        return ""
