"""The words for why a heading was taken or refused, and the ray that is pointed at, in the engine that runs them."""

from __future__ import annotations

import math
from typing import Any

import pytest

from paani import messages as m

pytestmark = [pytest.mark.browser, pytest.mark.timeout(60)]

ASK = """async ([verdicts, turnRad, points]) => {
  const v = await import("/static/heading_verdicts.js"), { CONSTRAINTS, COSTS } = await import("/static/text.js");
  const taken = v.findTaken(verdicts), order = v.fromPort(verdicts);
  return {
    order: order.map((each) => verdicts.indexOf(each)),
    texts: order.map((each) => v.describeVerdict(each, taken)),
    names: order.map((each) => v.nameVerdict(each, taken)),
    rays: points.map(([right, up]) => verdicts.indexOf(v.rayAt(verdicts, right, up, turnRad))),
    words: [Object.keys(CONSTRAINTS), Object.keys(COSTS)],
  };
}"""
FREE = {"course": 0.0, "progress": 0.0, "heading_change": 0.0, "advice": 0.0, "unknown_water": 0.0, "proximity": 0.0}


def verdict(bearing_deg: float, *refused_by: str, speed_mps: float = 0.0, **costs: float) -> dict[str, Any]:
    optional = {"costs": FREE | {"path_obstacle": 0.0, "margin": 0.0} | costs} if costs else {}
    return {
        "heading_rad": math.remainder(math.radians(90 - bearing_deg), math.tau),
        "refused_by": refused_by,
        "speed_mps": speed_mps,
    } | optional


VERDICTS = [
    verdict(270, "static_obstacle", "static_obstacle", "static_obstacle"),  # the desired course: west
    verdict(250, "none", "none", "none", speed_mps=0.6, course=0.5, advice=0.25),
    verdict(290, "person", "none", "none", speed_mps=0.3, course=0.5, advice=-0.1, progress=0.004),
    verdict(230, "person", "dynamic_obstacle", "turn"),
    verdict(310, "none", "none", "none", speed_mps=0.6, course=1.0, proximity=0.4),
]


async def test_each_heading_says_why_it_was_taken_or_not(scripts_page: Any) -> None:
    found = await scripts_page.evaluate(ASK, [VERDICTS, 0.0, []])
    assert found["order"] == [3, 1, 0, 2, 4], "from port to starboard of a course to the west"
    assert found["texts"] == [
        "230° refused: at the highest speed: too near to a person; at the next: too near to what moves there;"
        " at the lowest: no turn that may be made now.",
        "250° free, dearer by 0.35: not to the advised side +0.35. 0.60 m/s.",
        "270° refused: too near to what stands there.",
        "290° taken, costs 0.40: off the course 0.50, not to the advised side -0.10. 0.30 m/s;"
        " at the highest speed: too near to a person.",
        "310° free, dearer by 1.00: off the course +0.50, near obstacles +0.40, not to the advised side +0.10."
        " 0.60 m/s.",
    ]
    assert found["names"][2:4] == ["270° refused: standing obstacle", "290° taken"]
    nothing = await scripts_page.evaluate(ASK, [[VERDICTS[0], VERDICTS[3]], 0.0, []])
    assert nothing["texts"][1] == "270° refused: too near to what stands there."
    constraints, costs = found["words"]
    assert set(constraints) == {str(each) for each in m.Constraint}
    assert set(costs) == set(m.HeadingCosts.__struct_fields__)


async def test_the_ray_that_is_pointed_at_is_found_whichever_way_is_up(scripts_page: Any) -> None:
    far = [(-40, 0), (-38, -13), (40, 0), (-8, 0), (-90, 0), (0, 0)]  # pixels right of and above the boat
    assert (await scripts_page.evaluate(ASK, [VERDICTS, 0.0, far]))["rays"] == [0, 1, -1, -1, -1, -1]
    east_down = (await scripts_page.evaluate(ASK, [VERDICTS, -math.pi / 2, [(0, 40), (0, -40), (13, 38)]]))["rays"]
    assert east_down == [0, -1, 2]
