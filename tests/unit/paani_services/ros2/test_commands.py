"""`cmd_vel` as a stick: scaled by what MANUAL gives, cut at it, refused where it is no number."""

from __future__ import annotations

import asyncio
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani.bus import Queue
from paani.clock import ManualClock
from paani_services.ros2 import schemas
from paani_services.ros2.commands import batches, stick_of
from tests.at_work import at_work

FULL_MPS, FULL_RADPS = 0.6, 0.35


def twist(**axes: float) -> Any:
    numbers = {"linear_x": 0.0, "linear_y": 0.0, "linear_z": 0.0, "angular_x": 0.0, "angular_y": 0.0, "angular_z": 0.0}
    numbers |= axes
    parts = {
        part: schemas.make("geometry_msgs/Vector3", **{axis: numbers[f"{part}_{axis}"] for axis in "xyz"})
        for part in ("linear", "angular")
    }
    return schemas.make("geometry_msgs/Twist", **parts)


@pytest.mark.parametrize(
    ("linear_x", "angular_z", "stick"),
    [
        (0.0, 0.0, (0.0, 0.0)),
        (0.3, 0.0, (0.5, 0.0)),
        (-0.15, 0.175, (-0.25, 0.5)),  # back, and to port
        (5.0, -9.0, (1.0, -1.0)),  # more than there is
    ],
)
def test_speed_and_turn(linear_x: float, angular_z: float, stick: tuple[float, float]) -> None:
    found = stick_of(twist(linear_x=linear_x, angular_z=angular_z), FULL_MPS, FULL_RADPS)
    assert found == pytest.approx(stick)


@given(st.floats(allow_nan=False, allow_infinity=False), st.floats(allow_nan=False, allow_infinity=False))
def test_a_stick_is_never_out_of_range(linear_x: float, angular_z: float) -> None:
    stick = stick_of(twist(linear_x=linear_x, angular_z=angular_z), FULL_MPS, FULL_RADPS)
    assert all(-1.0 <= each <= 1.0 for each in stick)


@pytest.mark.parametrize("axis", ["linear_x", "linear_y", "angular_x", "angular_z"])
@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_is_refused(axis: str, number: float) -> None:
    with pytest.raises(ValueError, match="finite"):
        stick_of(twist(**{axis: number}), FULL_MPS, FULL_RADPS)


class Flood(Queue[bytes]):
    """A node that writes faster than anybody reads."""

    async def get(self) -> bytes:
        return b""


@pytest.mark.timeout(20)
async def test_a_flood_leaves_the_loop_to_others() -> None:
    """A reader that never waits would keep every other task from running, for ever."""

    async def read() -> None:
        async for _ in batches(Flood(ManualClock(), 16)):
            pass

    async with at_work(read()):
        await asyncio.sleep(0)


async def test_a_batch_is_what_waits_in_its_order() -> None:
    inbox: Queue[bytes] = Queue(ManualClock(), 2)
    for data in (b"1", b"2", b"3"):
        inbox.offer(data)
    assert await anext(batches(inbox)) == [b"2", b"3"], "the oldest gave way"
