"""Graphs over a real router: who has no place in one cannot open its bus, nor write there in another's name."""

from __future__ import annotations

import asyncio

import pytest

from paani import keys
from paani import messages as m
from paani.authority import credentials_folder, ensure_credentials
from paani.bus import open_bus
from paani.bus.routing import open_router
from paani.clock import WallClock
from paani.config import load_config
from paani.errors import UserError
from tests.at_work import at_work
from tests.conftest import put_raw
from tests.paani_command import paani

pytestmark = pytest.mark.integration
CLOCK = WallClock()


async def test_no_simulator_joins_a_hull(private_sets: tuple[str, ...]) -> None:
    """A7: the user `plant` has no credential there; with the simulation's, or one of its own making, it stays out."""
    hull = load_config(profile="hull", sets=private_sets).bus
    simulation = load_config(sets=private_sets).bus
    await asyncio.to_thread(ensure_credentials, simulation)
    router = await open_router(hull)
    try:
        with pytest.raises(UserError, match=r"bus\.graph hull: plant has no place in it, only in simulation or hil"):
            await open_bus(hull, "plant", CLOCK)
        with pytest.raises(TimeoutError):  # its own password of the simulation, the hull's router
            async with asyncio.timeout(2.5):
                await open_bus(simulation, "plant", CLOCK)
        password = await asyncio.to_thread(credentials_folder, simulation) / "plant"
        await asyncio.to_thread(password.write_text, "a word that nobody gave out")
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(2.5):
                await open_bus(simulation, "plant", CLOCK)
    finally:
        await asyncio.to_thread(router.close)


async def test_a_hulls_clock_and_fixes_have_their_own_writers(private_sets: tuple[str, ...]) -> None:
    """A7: a subject of the hull's graph that is not the writer is not heard, whatever producer it claims."""
    hull = load_config(profile="hull", sets=private_sets).bus
    router = await open_router(hull)
    buses = {user: await open_bus(hull, user, CLOCK) for user in ("thrusters", "sensors", "navigator", "controller")}
    try:
        clock, imu = buses["navigator"].latest(keys.SIM_TIME), buses["navigator"].latest(keys.IMU)
        times, samples = buses["thrusters"].publisher(keys.SIM_TIME), buses["sensors"].publisher(keys.IMU)
        forged = buses["controller"].publisher(keys.SIM_TIME)
        sample = m.ImuSample(
            source_us=1, gyro_x_radps=0, gyro_y_radps=0, gyro_z_radps=0, accel_x_mps2=0, accel_y_mps2=0, accel_z_mps2=0
        )  # fmt: skip
        async with asyncio.timeout(10):
            while clock.value is None or imu.value is None:
                times.put(m.SimTime(source_us=CLOCK.now_us(), sim_us=0, stamp_us=1))
                samples.put(sample)
                await asyncio.sleep(0.02)
            last = times.put(m.SimTime(source_us=CLOCK.now_us(), sim_us=0, stamp_us=2))
            while clock.value.seq != last.seq:  # none is on its way after this
                await asyncio.sleep(0.01)
        assert (clock.value.producer, imu.value.producer) == ("thrusters", "sensors")
        before = clock.received
        for _ in range(5):
            forged.put(m.SimTime(source_us=CLOCK.now_us(), sim_us=0, stamp_us=2**40))
            put_raw(buses["controller"], "plant/clock", b"{}")
            put_raw(buses["sensors"], "controller/thrust", b"{}")
            put_raw(buses["sensors"], "@truth/pose", b"{}")
        last = times.put(m.SimTime(source_us=CLOCK.now_us(), sim_us=0, stamp_us=7))
        async with asyncio.timeout(5):
            while clock.value.seq != last.seq:
                await asyncio.sleep(0.01)
        assert clock.received == before + 1
        assert not buses["navigator"].drops
    finally:
        for bus in buses.values():
            await bus.close()
        await asyncio.to_thread(router.close)


async def test_paani_stop_reaches_a_hull_whose_profile_is_not_named(private_sets: tuple[str, ...]) -> None:
    """Also on a machine that has simulated before, and so has the passwords of both."""
    hull = load_config(profile="hull", sets=private_sets).bus
    await asyncio.to_thread(ensure_credentials, load_config(sets=private_sets).bus)
    router = await open_router(hull)
    boat, desk = await open_bus(hull, "thrusters", CLOCK), await open_bus(hull, "operator", CLOCK)
    applied, states = boat.publisher(keys.THRUST_APPLIED), desk.publisher(keys.OPERATOR_STATE)
    asked = desk.latest(keys.REQUESTS["stop"])

    async def answer_forever() -> None:
        while True:
            now_us, is_asked = CLOCK.now_us(), asked.value is not None
            states.put(m.OperatorState(source_us=now_us, armed=False, stopped=is_asked, by="stop" if is_asked else ""))
            applied.put(
                m.ThrustApplied(
                    source_us=now_us, left=0.0, right=0.0, left_n=0.0, right_n=0.0, zero_cause=m.ZeroCause.NOT_ARMED
                )
            )
            await asyncio.sleep(0.05)

    try:
        async with at_work(answer_forever()):
            code, out, errors = await paani(private_sets, "stop")
    finally:
        await boat.close()
        await desk.close()
        await asyncio.to_thread(router.close)
    assert (code, out.startswith("stopped: zero thrust after ")) == (0, True), out + errors
    assert asked.value is not None
    assert asked.value.act is m.RequestAct.STOP
