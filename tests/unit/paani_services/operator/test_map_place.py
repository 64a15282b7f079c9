"""The order says in which map its target and its mission lie, for a navigator that begins anew in another."""

from __future__ import annotations

from pathlib import Path

from paani import messages as m
from paani.clock import ManualClock
from paani.keys import STATION
from paani.map_origin import MapPlace
from paani_services.operator.console import Console
from paani_services.operator.wheel import Facts
from tests.unit.paani_services.operator.test_console import Published

HERE = Facts(position=m.Waypoint(x_m=3.0, y_m=4.0), map_place=MapPlace(0.0, 0.0, 50.0, 8.0))
ELSEWHERE = Facts(position=m.Waypoint(x_m=0.0, y_m=0.0), map_place=MapPlace(0.0, 0.0, 50.1, 8.0))
NOWHERE = Facts()


async def test_the_map_of_a_target_stays_that_in_which_it_was_placed(tmp_path: Path) -> None:
    orders, facts = Published(), [HERE]
    publishers = Published(), Published(), orders, Published()
    console = Console(*publishers, tmp_path, ManualClock(), lambda: facts[0])  # type: ignore[arg-type]  # the bus's place

    async def map_after(mode: m.DriveMode | None, found: Facts, press: int = 0) -> tuple[float, float]:
        facts[0] = found
        if mode is not None:
            request = m.OperatorRequest(source_us=1, act=m.RequestAct.MODE, press=press, mode=mode)
            await console.answer(STATION, request, 5)
        console.publish()
        order: m.OperatorOrder = orders.messages[-1]
        return order.map_latitude_deg, order.map_longitude_deg

    nothing_placed, placed = (0.0, 0.0), (50.0, 8.0)
    assert await map_after(None, HERE) == nothing_placed
    assert await map_after(m.DriveMode.HOLD, HERE, 1) == placed
    assert await map_after(None, NOWHERE) == placed
    assert await map_after(None, ELSEWHERE) == placed
    assert await map_after(m.DriveMode.IDLE, ELSEWHERE, 2) == nothing_placed
    assert await map_after(m.DriveMode.HOLD, ELSEWHERE, 3) == (50.1, 8.0)
