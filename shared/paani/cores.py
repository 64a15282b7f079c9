"""Interfaces of the perception and localization cores, which lockstep trials call without their processes.

A service registers its core as an entry point in the group `paani.cores`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.metadata import entry_points
from typing import Any, Protocol

from paani import messages as m
from paani.arrays import U8
from paani.config import LocalizationConfig, PerceptionConfig
from paani.errors import UserError


class PerceptionCore(Protocol):
    """Both networks and the image-quality check, as `paani_services.perception` has them."""

    def perceive(
        self, data: bytes | U8, header: m.PictureHeader, age_s: float, roll_rad: float = 0.0
    ) -> tuple[m.Evidence, U8 | None]:
        """Evidence of one distinct picture (encoded, or BGR uint8 [H, W, 3]), and its class mask uint8 [64, 80].

        The mask is None where the picture is unusable.
        """
        ...

    def close(self) -> None:
        """End the threads."""
        ...


class LocalizationCore(Protocol):
    """The filters for local and global odometry, as in `paani_services.localization`."""

    def step(self, samples: Sequence[m.ImuSample], fix: m.GpsFix | None, now_us: int) -> tuple[m.Odometry, m.Odometry]:
        """Local and global odometry after these IMU samples, oldest first, and a GPS fix where there is a new one."""
        ...


def load_perceiver(config: PerceptionConfig, stopwatch_ms: Callable[[], float]) -> PerceptionCore:
    """The perception core that is installed. Raises UserError where none is installed or a model cannot be used."""
    perceiver: PerceptionCore = _load_core("perception")(config, stopwatch_ms)
    return perceiver


def load_estimator(config: LocalizationConfig) -> LocalizationCore:
    """The localization core that is installed. Raises UserError where none is installed."""
    estimator: LocalizationCore = _load_core("localization")(config)
    return estimator


def _load_core(name: str) -> Any:
    for point in entry_points(group="paani.cores"):
        if point.name == name:
            return point.load()
    raise UserError(f"no core named '{name}' is installed (entry points of the group paani.cores)")
