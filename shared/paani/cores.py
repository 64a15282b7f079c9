"""Cores of processes that decide nothing but are needed in lockstep: what sees, and what estimates.

A service registers its own as an entry point in the group `paani.cores`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.metadata import entry_points
from typing import Any, Protocol

from paani import messages as m
from paani.arrays import U8
from paani.config import LocalizationConfig, PerceptionConfig
from paani.errors import UserError


class Perceiving(Protocol):
    """Both networks and the image-quality check, as `paani_services.perception` has them."""

    def perceive(
        self, data: bytes | U8, header: m.PictureHeader, age_s: float, roll_rad: float = 0.0
    ) -> tuple[m.Evidence, U8 | None]:
        """Evidence of one distinct picture (encoded, or BGR uint8 [H, W, 3]), and its class mask uint8 [64, 80]."""
        ...

    def close(self) -> None:
        """Ends its threads."""
        ...


class Estimating(Protocol):
    """Both filters, as `paani_services.localization` has them."""

    def step(self, samples: Sequence[m.ImuSample], fix: m.GpsFix | None, now_us: int) -> tuple[m.Odometry, m.Odometry]:
        """Local and global odometry after these samples, oldest first, and perhaps a new fix."""
        ...


def perceiver_of(config: PerceptionConfig, stopwatch_ms: Callable[[], float]) -> Perceiving:
    """The installed perception. Raises UserError where none is installed or a model cannot be used."""
    perceiver: Perceiving = _core("perception")(config, stopwatch_ms)
    return perceiver


def estimator_of(config: LocalizationConfig) -> Estimating:
    """The installed localization. Raises UserError where none is installed."""
    estimator: Estimating = _core("localization")(config)
    return estimator


def _core(name: str) -> Any:
    for point in entry_points(group="paani.cores"):
        if point.name == name:
            return point.load()
    raise UserError(f"no core named '{name}'")
