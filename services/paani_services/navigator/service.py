"""Navigator process: advisory, evidence, odometry, clock, arming and the mode ordered in, one order out."""

import asyncio
import contextlib
from typing import Any

import msgspec

from paani import keys
from paani import messages as m
from paani.bus import Bus, Latest, Stepper
from paani.clock import Clock, has_passed
from paani.config import Config
from paani.runtime import runtime_dir
from paani_services.navigator.decide import DECIDER
from paani_services.navigator.files.mission_file import load_route_and_mission, next_route
from paani_services.navigator.mapping.observed_cells import Camera
from paani_services.navigator.mapping.soundings import name_doubts
from paani_services.navigator.mission_in_force import MissionInForce
from paani_services.navigator.occupancy import occupancy_around
from paani_services.navigator.predict import predict

EARLY_US = 5_000  # a step this much before the end of its period counts as on time: timers are not exact


async def run(bus: Bus, clock: Clock, config: Config) -> None:
    """Publish an order at `rate_hz`, and at once when the evidence, the advice or an inhibit changes."""
    route, mission = await asyncio.to_thread(
        load_route_and_mission, config.navigator, config.localization.origin_lat_lon_deg
    )
    stepper = Stepper(bus, clock, config, DECIDER)
    current = MissionInForce(bus, await asyncio.to_thread(runtime_dir, config.bus), route, mission)
    arming, ordered = stepper.inboxes[keys.ARMING.name], stepper.inboxes[keys.OPERATOR_ORDER.name]
    period_s = 1.0 / config.navigator.rate_hz
    wake = asyncio.Event()
    sent: m.NavCommand | None = None
    ahead: m.Prediction | None = None
    sent_us = route_us = predicted_us = 0
    predictions, grids = bus.publisher(keys.PREDICTION), bus.publisher(keys.OCCUPANCY)
    camera = Camera(config.calibration, config.perception.ego_polygon)
    with bus.alive():
        async with asyncio.TaskGroup() as group:
            progress = await current.resume(arming, ordered)
            stepper.state = msgspec.structs.replace(stepper.state, progress=progress, legs_us=current.legs_us)
            group.create_task(current.journal.write_changes())
            for topic in (keys.ADVISORY, keys.ODOMETRY, keys.ARMING, keys.OPERATOR_ORDER):
                group.create_task(_wake_on(stepper.inboxes[topic.name], wake))
            while True:
                now_us = clock.now_us()
                if current.take_ordered(ordered.value) or has_passed(route_us, 1e6 / keys.ROUTE.rate_hz, now_us):
                    if current.mission is not None:
                        stepper.publish_own(keys.MISSION, msgspec.structs.replace(current.mission, source_us=now_us))
                        current.route = next_route(current.mission, stepper.state.progress.leg_index) or current.route
                    if current.route is not None:
                        stepper.publish_own(keys.ROUTE, msgspec.structs.replace(current.route, source_us=now_us))
                    route_us = now_us
                now_us, outputs = stepper.decide()
                current.journal.record(stepper.state.progress, arming.value)
                order = outputs[keys.COMMAND.name]
                assert isinstance(order, m.NavCommand)
                if has_passed(sent_us, period_s * 1e6 - EARLY_US, now_us) or order.is_news_after(sent):
                    published, sent_us = stepper.conclude(outputs)[keys.COMMAND.name], now_us
                    assert isinstance(published, m.NavCommand)
                    sent = published
                    bus.note(", ".join([*order.inhibits, *name_doubts(stepper.state.planner_state.soundings)]))
                else:
                    stepper.conclude({})
                if has_passed(predicted_us, 1e6 / keys.PREDICTION.rate_hz, now_us):
                    odometry = stepper.inboxes[keys.ODOMETRY.name].value
                    ahead = predict(
                        stepper.state, order, odometry, current.mission, now_us, camera, config.navigator, ahead
                    )
                    predictions.put(ahead)
                    planner_state = stepper.state.planner_state
                    grid = occupancy_around(planner_state, odometry, now_us, camera, config.navigator)
                    if grid is not None:
                        grids.put(grid)
                    predicted_us = now_us
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(period_s):
                        await wake.wait()
                wake.clear()


async def _wake_on(inbox: Latest[Any], wake: asyncio.Event) -> None:
    while True:
        await inbox.next()
        wake.set()
