"""Packages that only some commands and services need, and the extra of the distribution that brings each."""

from __future__ import annotations

from importlib.util import find_spec

from paani.errors import UserError

EXTRA_OF = {
    "mujoco": "host",
    "OpenGL": "host",
    "filterpy": "host",
    "scipy": "host",
    "gpxpy": "host",
    "tqdm": "host",
    "torch": "train",
    "onnx": "train",
    "ncnn": "ncnn",
    "shtab": "completion",
    "cryptography": "certs",
    "distributed": "cluster",
    "prometheus_client": "metrics",
    "pmtiles": "charts",
    "pymavlink": "mavlink",
    "rosbags": "ros2",
    "foxglove": "foxglove",
    "rerun": "rerun",
    "playwright": "dev",
}  # module -> extra


def require_modules(who: str, *modules: str) -> None:
    """Raise UserError that says what to install unless all of these can be imported. who: the command or service."""
    missing = [module for module in modules if find_spec(module) is None]
    if missing:
        extras = dict.fromkeys(EXTRA_OF[module] for module in missing)
        raise UserError(_remedy(who, ", ".join(missing), ",".join(extras)))


def missing_module(who: str, error: ModuleNotFoundError) -> UserError | None:
    """What to tell of an import that failed; None where the module belongs to no extra, which is a defect."""
    module = (error.name or "").partition(".")[0]
    return UserError(_remedy(who, module, EXTRA_OF[module])) if module in EXTRA_OF else None


def _remedy(who: str, modules: str, extras: str) -> str:
    return f"{who} needs {modules}, not installed here: pip install 'paani[{extras}]'"
