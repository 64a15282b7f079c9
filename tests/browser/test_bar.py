"""The bar that never scrolls: what the boat does and why, the link, STOP and its confirmation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from paani import messages as m
from paani.config import Config
from tests.browser.conftest import Boat
from tests.browser.guidance import ORDER, guiding
from tests.browser.test_page import hold_to_arm, until, wait_for_arming, watch
from tests.conftest import OpenAs, Spawn

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]

# What the processes said last -> what the boat does, by the page's own function.
DESCRIBE = """async ([mode, messages, stale]) => {
  const { describeActivity } = await import("/static/activity.js");
  const { Store } = await import("/static/store.js");
  const store = new Store();
  store.put("dashboard/settings", { mode, topics: [] }, 0, 0);
  for (const [key, text] of Object.entries(messages)) {
    store.put(key, JSON.parse(text), stale.includes(key) ? 9000 : 0, 0);
  }
  const { id, word, reason } = describeActivity(store, 10);
  return [id, word, reason];
}"""
INHIBITS = """async ([messages, stale]) => {
  const { findInhibits } = await import("/static/inhibits.js");
  const { Store } = await import("/static/store.js");
  const store = new Store();
  store.put("dashboard/settings", { mode: "sim", topics: [] }, 0, 0);
  for (const [key, text] of Object.entries(messages)) {
    store.put(key, JSON.parse(text), stale.includes(key) ? 9000 : 0, 0);
  }
  return findInhibits(store, 10).map(({ stage, code }) => `${stage} ${code}`);
}"""
APPLIED = m.ThrustApplied(source_us=1, left=0.1, right=0.1, left_n=7.0, right_n=7.0, zero_cause=m.ZeroCause.NONE)
ARMED = m.OperatorState(source_us=1, armed=True, stopped=False, by="dashboard")
PERSON = m.Track(
    id=3, label=m.Label.PERSON, hazard=m.Hazard.SWIMMER, confidence=0.9, box_xyxy=(0.4, 0.4, 0.6, 0.6), hits=5,
    confirmed=True, immediate_danger=False, accepted=True, held=False, age_s=1.0, urgency=0.0,
)  # fmt: skip
UNDER_WAY: dict[str, m.Message] = {
    "camera/picture": m.PictureHeader(source_us=1, frame_seq=1, frame_epoch=1, width_px=4, height_px=4),
    "perception/evidence": m.Evidence(
        source_us=1, frame_seq=1, frame_epoch=1, width_px=4, height_px=4, usable=True, navigation_eligible=True,
        segmentation=m.SegmentationSource.LEARNED,
    ),
    "advisor/advisory": m.Advisory(source_us=1, direction=m.Direction.STRAIGHT, reason=m.Reason.CENTER_CLEAR),
    "advisor/tracks": m.Tracks(source_us=1, frame_seq=1, frame_epoch=1, tracks=(PERSON,)),
    "localization/odometry": m.Odometry(source_us=1, x_m=0.0, y_m=0.0, yaw_rad=0.0, surge_mps=0.5, healthy=True),
    "operator/state": ARMED,
    "navigator/command": ORDER,
    "navigator/route": m.Route(source_us=1, name="r", waypoints=(m.Waypoint(x_m=0.0, y_m=0.0),) * 4),
    "controller/thrust": m.Thrust(source_us=1, left=0.1, right=0.1, enabled=True),
    "plant/thrust_applied": APPLIED,
}  # fmt: skip


def turning(purpose: m.Purpose, *track_ids: int) -> dict[str, m.Message | None]:
    """A turn to the right that is advised for this purpose, and would not be without these tracks."""
    without = m.Counterfactual(
        changed_by=m.ChangedBy.EVIDENCE, removals=(m.Removal(direction=m.Direction.STRAIGHT, track_ids=track_ids),)
    )
    advisory = m.Advisory(
        source_us=1,
        direction=m.Direction.RIGHT,
        reason=m.Reason.CENTER_OCCUPIED,
        purpose=purpose,
        counterfactual=without,
    )
    return {"advisor/advisory": advisory, "navigator/command": replace(ORDER, direction=m.Direction.RIGHT)}


def still(cause: m.ZeroCause, *inhibits: m.Inhibit, leg: str = ORDER.leg) -> dict[str, m.Message | None]:
    """Zero thrust for this cause, with these inhibits in the order."""
    return {
        "navigator/command": replace(ORDER, enable=False, inhibits=inhibits, speed_mps=0.0, leg=leg),
        "plant/thrust_applied": replace(APPLIED, left=0.0, right=0.0, zero_cause=cause),
    }


NOT_ENABLED, NOT_ARMED = m.ZeroCause.NOT_ENABLED, m.ZeroCause.NOT_ARMED
STOPPED = m.OperatorState(source_us=1, armed=False, stopped=True, by="stop")
BY_HAND = m.OperatorState(source_us=1, armed=True, stopped=False, mode=m.DriveMode.MANUAL, wheel_by="dashboard")
MEETING = m.Prediction(source_us=1, courtesy="Give way: person #3 head on, turning away from it")
STOP_ADVISED = m.Advisory(source_us=1, direction=m.Direction.STOP, reason=m.Reason.NO_SAFE_SIDE)
SILENT_OPERATOR: dict[str, m.Message | None] = {"operator/state": None}
CASES: list[tuple[dict[str, m.Message | None], tuple[str, ...], list[str]]] = [
    ({}, (), ["ROUTE", "FOLLOWING ROUTE", "lap 2, waypoint 2 of 4"]),
    ({"navigator/command": replace(ORDER, obstacle_track_ids=(3,))}, (),
     ["ROUTE", "FOLLOWING ROUTE", "lap 2, waypoint 2 of 4, planned for person #3"]),
    # Whom it meets is said for as long as the prediction is of now.
    ({"navigator/command": replace(ORDER, obstacle_track_ids=(3,)), "navigator/prediction": MEETING}, (),
     ["ROUTE", "FOLLOWING ROUTE", "lap 2, waypoint 2 of 4, give way: person #3 head on, turning away from it"]),
    ({"navigator/command": replace(ORDER, obstacle_track_ids=(3,)), "navigator/prediction": MEETING},
     ("navigator/prediction",), ["ROUTE", "FOLLOWING ROUTE", "lap 2, waypoint 2 of 4, planned for person #3"]),
    ({"navigator/command": replace(ORDER, speed_mps=0.0, obstacle_track_ids=(3,))}, (),
     ["WAITING", "WAITING", "for person #3"]),
    ({"navigator/command": replace(ORDER, leg="return home")}, (), ["HOME", "RETURNING", ""]),
    ({"navigator/command": replace(ORDER, leg="hold station")}, (), ["STATION", "GOING TO STATION", ""]),
    (turning(m.Purpose.PASS, 3), (), ["AVOIDING", "AVOIDING #3", "person #3: turning right"]),
    (turning(m.Purpose.PASS), (), ["AVOIDING", "AVOIDING", "centre occupied: turning right"]),
    (turning(m.Purpose.LOOK, 3), (), ["LOOKING", "LOOKING FOR A WAY", "turning right: centre occupied"]),
    (still(NOT_ENABLED, m.Inhibit.HOLDING, leg="hold station"), (), ["HOLDING", "HOLDING", "hold station"]),
    (still(NOT_ENABLED, m.Inhibit.ROUTE_FINISHED), (), ["DONE", "MISSION DONE", "route finished"]),
    (still(NOT_ENABLED, m.Inhibit.HOLDING, m.Inhibit.OUTSIDE_FENCE), (),
     ["NO_THRUST", "NO THRUST", "outside the fence or on land, or too close to its edge"]),
    (still(NOT_ENABLED, m.Inhibit.ADVISED_STOP) | {"advisor/advisory": STOP_ADVISED}, (),
     ["NO_THRUST", "NO THRUST", "the advisor advises STOP: no safe side"]),
    # Thrust that works against the drift alone is no way on.
    ({"navigator/command": replace(ORDER, speed_mps=0.0, direction=m.Direction.STOP, keeps_station=True,
      vetoes=(m.Inhibit.ADVISED_STOP,)), "advisor/advisory": STOP_ADVISED}, (),
     ["KEEPING_STATION", "KEEPING STATION", "the advisor advises STOP: no safe side"]),
    # Advice that has changed since the order is not said to be why.
    (still(NOT_ENABLED, m.Inhibit.ADVISED_STOP), (), ["NO_THRUST", "NO THRUST", "the advisor advises STOP"]),
    (still(NOT_ARMED, m.Inhibit.NOT_ARMED), (), ["NOT_ARMED", "NOT ARMED", "nothing else keeps the boat still"]),
    (still(NOT_ARMED, m.Inhibit.NOT_ARMED, m.Inhibit.NO_ROUTE), (), ["NOT_ARMED", "NOT ARMED", "no route"]),
    # A STOP comes before all else: standing, nothing that looks like driving is said.
    (still(NOT_ARMED, m.Inhibit.NOT_ARMED, m.Inhibit.HOLDING) | {"operator/state": STOPPED}, (),
     ["STOPPED", "STOPPED", "by paani stop; arming releases it"]),
    # A boat that drives although it is stopped is not said to be still.
    ({"operator/state": STOPPED}, (), ["ROUTE", "FOLLOWING ROUTE", "lap 2, waypoint 2 of 4"]),
    # By hand: who, and what the advice has to say in it; without a mode that moves the boat, that.
    ({"navigator/command": replace(ORDER, leg="manual"), "operator/state": BY_HAND}, (),
     ["MANUAL", "DRIVEN BY HAND", "by the page"]),
    ({"navigator/command": replace(ORDER, leg="manual", direction=m.Direction.LEFT),
      "operator/state": replace(BY_HAND, override_ms=4000.0)}, (),
     ["MANUAL", "DRIVEN BY HAND", "by the page, the advice is overridden"]),
    ({"navigator/command": replace(ORDER, leg="manual", speed_mps=0.0, vetoes=(m.Inhibit.BLOCKED_AHEAD,)),
      "operator/state": BY_HAND}, (), ["MANUAL", "DRIVEN BY HAND", "by the page, the advice gives no thrust ahead"]),
    (still(NOT_ENABLED, m.Inhibit.NEUTRAL, leg="manual"), (), ["MANUAL", "DRIVEN BY HAND", "the stick is in neutral"]),
    (still(NOT_ENABLED, m.Inhibit.IDLE, leg="idle"), (), ["IDLE", "IDLE", "nothing else keeps the boat still"]),
    (still(NOT_ENABLED, m.Inhibit.IDLE, m.Inhibit.STALE_ODOMETRY), (), ["IDLE", "IDLE", "position too old"]),
    ({}, ("plant/thrust_applied",), ["UNKNOWN", "UNKNOWN", "no recent report of thrust"]),
    (still(m.ZeroCause.PULSE_LOST), ("camera/picture",), ["NO_THRUST", "NO THRUST", "no recent picture"]),
    (still(m.ZeroCause.ARMING_LOST) | SILENT_OPERATOR, (),
     ["NO_THRUST", "NO THRUST", "no word from the operator's process"]),
]  # fmt: skip


EVERYTHING = still(
    m.ZeroCause.PULSE_LOST, m.Inhibit.OUTSIDE_FENCE, m.Inhibit.NO_FREE_PATH, m.Inhibit.NO_ROUTE, m.Inhibit.NOT_ARMED,
    m.Inhibit.STALE_ODOMETRY, m.Inhibit.ADVISED_NO_DATA, m.Inhibit.CLOCK_STOPPED,
) | {"operator/state": STOPPED, "controller/thrust": m.Thrust(
    source_us=1, left=0.0, right=0.0, enabled=False, inhibits=(m.Inhibit.NOT_ARMED, m.Inhibit.STALE_COMMAND),
)}  # fmt: skip
IN_ORDER = [
    "camera SILENT", "advisor ADVISED_NO_DATA", "localization STALE_ODOMETRY", "operator NOT_ARMED", "mission NO_ROUTE",
    "planner NO_FREE_PATH", "fence OUTSIDE_FENCE", "navigator CLOCK_STOPPED", "controller STALE_COMMAND",
    "gate pulse_lost",
]  # fmt: skip


def encoded(changes: dict[str, m.Message | None]) -> dict[str, str]:
    """The messages of a boat under way with these changes, as JSON by key."""
    messages = UNDER_WAY | changes
    return {key: msgspec.json.encode(value).decode() for key, value in messages.items() if value is not None}


@pytest.mark.rotating(cpu_s=6)
async def test_what_the_boat_does_comes_first(
    browser: Any, boat: Boat, open_as: OpenAs, spawn: Spawn, config: Config, tmp_path: Path
) -> None:
    """Every activity from messages, by the page's own function; then the page itself, from the bus."""
    async with spawn("operator"), spawn("dashboard"), guiding(open_as) as guidance:
        watched = await watch(browser, config)
        page = watched.page
        for changes, stale, expected in CASES:
            assert await page.evaluate(DESCRIBE, ["sim", encoded(changes), list(stale)]) == expected, expected
        assert await page.evaluate(INHIBITS, [encoded(EVERYTHING), ["camera/picture"]]) == IN_ORDER
        assert await page.evaluate(INHIBITS, [encoded({}), ["camera/picture"]]) == [], "thrust is applied"
        recorded = {"plant/thrust_applied": msgspec.json.encode(APPLIED).decode()}
        replayed = await page.evaluate(DESCRIBE, ["replay", recorded, []])
        assert replayed == ["REPLAY", "RECORDING", "the boat was under way"]

        word = "document.querySelector('#activity-word').textContent"
        await until(page, f"{word} === 'STOPPED'")
        assert await page.inner_text("#mode") == "SIM"
        await hold_to_arm(page)
        await wait_for_arming(boat, armed=True, stopped=False)
        await until(page, f"{word} === 'FOLLOWING ROUTE'")
        assert "Follow route, lap 2, waypoint 2 of 4 of survey" in await page.inner_text("#stages")
        assert await page.inner_text("#inhibits") == "Nothing inhibits thrust"
        await page.screenshot(path=tmp_path / "route.png")
        guidance.order = replace(ORDER, enable=False, inhibits=(m.Inhibit.HOLDING,), leg="hold station")
        boat.zero_cause = m.ZeroCause.NOT_ENABLED
        await until(page, f"{word} === 'HOLDING'")
        assert (await page.inner_text("#inhibits .first")).split("\n") == ["Mission", "Holding station"]
        assert (
            await page.evaluate("document.querySelector('#stages [data-state=failed] span').textContent") == "Mission"
        )
        await until(page, "document.querySelector('#announcer').textContent === 'HOLDING. Advice: RIGHT.'")
        assert watched.errors == []


async def test_a_stop_without_an_answer_is_not_confirmed(
    browser: Any, boat: Boat, open_as: OpenAs, spawn: Spawn, config: Config, tmp_path: Path
) -> None:
    """Nobody latches it, then somebody latches it and the thrust adapter says nothing, then it reports zero."""
    async with spawn("dashboard"):
        page = (await watch(browser, config)).page
        word, detail = (f"document.querySelector('#order-{part}').textContent" for part in ("word", "detail"))
        await until(page, "paani.link === 'live'")
        await page.keyboard.press("Escape")
        await until(page, f"{word} === 'NOT CONFIRMED' && {detail}.startsWith('nobody answers')")
        await page.screenshot(path=tmp_path / "unanswered.png")
        boat.zero_cause = m.ZeroCause.TIMEOUT
        async with spawn("operator"):
            await wait_for_arming(boat, armed=False, stopped=True)
            await until(page, f"{word} !== 'STOP ASKED' && !{detail}.startsWith('nobody answers')")  # it goes on asking
            await page.keyboard.press("Space")
            await until(page, f"{word} === 'NOT CONFIRMED' && {detail}.includes('thrust adapter')")
            boat.zero_cause = None
            await until(page, f"{word} === 'STOPPED' && {detail}.startsWith('confirmed by the thrust adapter in')")
