"""The wheel: no sequence of requests gives an old set-point, arms, or drives by another hand than the holder's."""

from __future__ import annotations

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani import messages as m
from paani.keys import SHORE, STATION
from paani.messages import DriveMode, ModeRefusal, OverrideEnd, RequestAct
from paani_services.operator import wheel as w

BEGUN_US = 1_000_000_000
HERE, HOME = m.Waypoint(x_m=3.0, y_m=4.0), m.Waypoint(x_m=0.0, y_m=1.0)
ALL = w.Facts(HERE, HOME, has_mission=True)


class Bridge:
    """A wheel, the time, and whether the boat is armed."""

    def __init__(self, facts: w.Facts = ALL, *, armed: bool = True) -> None:
        self.wheel, self.now_us, self.facts, self.armed, self._press = w.Wheel(), BEGUN_US, facts, armed, 0

    def ask(
        self, act: RequestAct, client: str = STATION, hand: int = 1, mode: DriveMode = DriveMode.IDLE
    ) -> ModeRefusal:
        self._press += 1
        self._tell(client, m.OperatorRequest(source_us=1, act=act, press=self._press, hand=hand, mode=mode))
        assert (self.wheel.answer.client, self.wheel.answer.press) == (client, self._press)
        return self.wheel.answer.refusal

    def mode(self, mode: DriveMode, client: str = STATION, hand: int = 1) -> ModeRefusal:
        return self.ask(RequestAct.MODE, client, hand, mode)

    def drive(self, surge: float, turn: float = 0.0, hand: int = 1, number: int | None = None) -> None:
        self._press += 1
        number = self._press if number is None else number
        request = m.OperatorRequest(source_us=1, act=RequestAct.DRIVE, press=number, hand=hand, surge=surge, turn=turn)
        self._tell(STATION, request)

    def wait(self, waited_s: float) -> None:
        self.now_us += round(waited_s * 1e6)
        self.wheel = w.lapse(self.wheel, self.now_us, armed=self.armed)

    @property
    def order(self) -> m.OperatorOrder:
        return w.order_message(self.wheel, self.now_us, armed=self.armed)

    def _tell(self, client: str, request: m.OperatorRequest) -> None:
        self.wheel = w.answer(self.wheel, client, request, self.facts, self.now_us, armed=self.armed)


def at_the_wheel(surge: float = 0.5) -> Bridge:
    bridge = Bridge()
    assert bridge.mode(DriveMode.MANUAL) is ModeRefusal.NONE
    bridge.drive(surge)
    return bridge


def test_a_boat_that_nobody_has_ordered_follows_its_route() -> None:
    assert (Bridge().order.mode, Bridge().order.by) == (DriveMode.ROUTE, "")


@pytest.mark.parametrize(
    ("mode", "facts", "armed", "refusal"),
    [
        (DriveMode.ROUTE, w.Facts(HERE, HOME), True, ModeRefusal.NO_MISSION),
        (DriveMode.HOLD, w.Facts(None, HOME, has_mission=True), True, ModeRefusal.NO_POSITION),
        (DriveMode.RETURN, w.Facts(None, HOME, has_mission=True), True, ModeRefusal.NO_POSITION),
        (DriveMode.RETURN, w.Facts(HERE, None, has_mission=True), True, ModeRefusal.NO_HOME),
        (DriveMode.MANUAL, ALL, False, ModeRefusal.NOT_ARMED),
        (DriveMode.MANUAL, w.Facts(), True, ModeRefusal.NONE),
        (DriveMode.IDLE, w.Facts(), False, ModeRefusal.NONE),
        *((mode, ALL, True, ModeRefusal.NONE) for mode in DriveMode),
    ],
)
def test_a_mode_starts_or_says_why_not_and_is_barred_beforehand(
    mode: DriveMode, facts: w.Facts, armed: bool, refusal: ModeRefusal
) -> None:
    bridge = Bridge(facts, armed=armed)
    state = w.with_wheel(m.OperatorState(source_us=1, armed=armed, stopped=False), bridge.wheel, facts, bridge.now_us)
    assert {bar.mode: bar.refusal for bar in state.barred}.get(mode, ModeRefusal.NONE) is refusal
    before = bridge.wheel
    assert bridge.mode(mode) is refusal
    if refusal is ModeRefusal.NONE:
        assert (bridge.order.mode, bridge.order.since_us, bridge.order.by) == (mode, BEGUN_US, STATION)
    else:
        assert (bridge.wheel.mode, bridge.wheel.by) == (before.mode, "")


def test_a_station_is_where_the_mode_was_asked_for_and_home_is_what_is_known_then() -> None:
    bridge = Bridge()
    bridge.mode(DriveMode.HOLD)
    bridge.facts = w.Facts(m.Waypoint(x_m=50.0, y_m=0.0), HOME)
    assert bridge.order.target == (HERE,)
    bridge.mode(DriveMode.RETURN)
    assert bridge.order.target == (HOME,)
    bridge.mode(DriveMode.IDLE)
    assert not bridge.order.target


def test_return_leads_to_a_rally_point_that_is_nearer_and_stays_with_it() -> None:
    near = m.Waypoint(x_m=4.0, y_m=4.0)
    known = msgspec.structs.replace(ALL, mission=m.Mission(source_us=1, name="", legs=(), rally=(near,)))
    bridge = Bridge(known)
    bridge.mode(DriveMode.RETURN)
    assert bridge.order.target == (near,)
    bridge.facts = ALL
    assert bridge.order.target == (near,)
    bridge.mode(DriveMode.RETURN)
    assert bridge.order.target == (HOME,), "a mission that is not known has no rally points"
    bridge.facts = msgspec.structs.replace(known, home=None)
    assert bridge.mode(DriveMode.RETURN) is ModeRefusal.NO_HOME


def test_a_request_whose_answer_gave_way_to_another_s_is_told_the_same_and_does_nothing_again() -> None:
    """The hand that had the wheel for a moment asks again, because it never heard; it does not take it back."""
    bridge = Bridge()
    taken = m.OperatorRequest(source_us=1, act=RequestAct.WHEEL, press=901, hand=2)
    bridge._tell(STATION, taken)
    assert bridge.ask(RequestAct.WHEEL, hand=1) is ModeRefusal.NONE
    assert bridge.mode(DriveMode.MANUAL) is ModeRefusal.NONE
    before = bridge.wheel
    bridge._tell(STATION, taken)
    assert bridge.wheel.answer == w.Answer(STATION, 901, ModeRefusal.NONE)
    assert msgspec.structs.replace(bridge.wheel, answer=before.answer) == before
    for _ in range(3 * w.ANSWERS):
        bridge.ask(RequestAct.OVERRIDE)
    assert len(bridge.wheel.answers) == w.ANSWERS


def test_a_request_that_is_said_again_is_answered_once() -> None:
    bridge = Bridge()
    request = m.OperatorRequest(source_us=1, act=RequestAct.MODE, press=9, hand=1, mode=DriveMode.HOLD)
    first = w.answer(bridge.wheel, STATION, request, ALL, BEGUN_US, armed=True)
    assert w.answer(first, STATION, request, w.Facts(HOME), BEGUN_US + 100_000, armed=True) == first


def test_another_hand_takes_the_wheel_over_or_nothing() -> None:
    bridge = at_the_wheel()
    assert bridge.mode(DriveMode.HOLD, hand=2) is ModeRefusal.NOT_HOLDER
    assert bridge.mode(DriveMode.HOLD, client="arm") is ModeRefusal.NOT_HOLDER
    assert bridge.ask(RequestAct.OVERRIDE, hand=2) is ModeRefusal.NOT_HOLDER
    bridge.drive(-1.0, hand=2)
    assert (bridge.order.mode, bridge.order.surge) == (DriveMode.MANUAL, 0.5)
    assert bridge.ask(RequestAct.WHEEL, hand=2) is ModeRefusal.NONE
    assert (bridge.order.mode, bridge.order.surge, bridge.order.hand) == (DriveMode.IDLE, 0.0, 2)
    bridge.drive(0.5, hand=2)
    assert bridge.order.mode is DriveMode.IDLE, "nobody drives before asking for MANUAL"
    assert bridge.mode(DriveMode.HOLD, hand=2) is ModeRefusal.NONE
    assert bridge.mode(DriveMode.IDLE, hand=1) is ModeRefusal.NOT_HOLDER


def test_a_wheel_taken_over_leaves_every_other_mode_as_it_is() -> None:
    bridge = Bridge()
    bridge.mode(DriveMode.HOLD)
    bridge.ask(RequestAct.WHEEL, client="arm", hand=7)
    assert (bridge.order.mode, bridge.order.target, bridge.order.by) == (DriveMode.HOLD, (HERE,), "arm")


def test_a_client_that_may_only_stop_takes_no_wheel() -> None:
    bridge = Bridge()
    for act in (RequestAct.WHEEL, RequestAct.MODE, RequestAct.OVERRIDE):
        assert bridge.ask(act, client=SHORE) is ModeRefusal.NOT_ALLOWED
    assert (bridge.order.mode, bridge.order.by) == (DriveMode.ROUTE, "")


@pytest.mark.parametrize(("surge", "limit_s"), [(0.5, w.DEFLECTED_MAX_S), (-0.1, w.DEFLECTED_MAX_S), (0.0, 2.0)])
def test_a_silent_hand_has_let_go_and_its_return_drives_nothing(surge: float, limit_s: float) -> None:
    bridge = at_the_wheel(surge)
    bridge.wait(limit_s)
    assert (bridge.order.mode, bridge.order.surge) == (DriveMode.MANUAL, surge)
    late = w.order_message(bridge.wheel, bridge.now_us + 1, armed=True)
    assert (late.mode, late.target, late.override) == (DriveMode.IDLE, (), False), "before anybody has noticed"
    bridge.wait(1e-6)
    bridge.drive(surge)
    assert (bridge.order.mode, bridge.order.surge, bridge.order.since_us) == (DriveMode.IDLE, 0.0, bridge.now_us)


def test_a_boat_that_is_disarmed_or_stopped_has_no_hand_at_the_stick_when_it_is_armed_again() -> None:
    bridge = at_the_wheel()
    bridge.armed = False
    bridge.wait(0.0)
    bridge.armed = True
    bridge.drive(1.0)
    assert (bridge.order.mode, bridge.order.surge) == (DriveMode.IDLE, 0.0)


def test_words_that_waited_while_the_process_was_held_up_are_none_of_now() -> None:
    """Of a hand that is gone meanwhile: the silence before them has ended MANUAL."""
    bridge = at_the_wheel()
    bridge.now_us += 3_000_000
    bridge.drive(1.0)
    assert (bridge.order.mode, bridge.order.surge) == (DriveMode.IDLE, 0.0)


def test_a_set_point_that_was_overtaken_is_passed_over_also_after_manual_began_again() -> None:
    bridge = at_the_wheel()
    bridge.drive(0.0, number=1000)
    bridge.drive(0.5, number=999)
    assert bridge.order.surge == 0.0
    bridge.mode(DriveMode.IDLE)
    bridge.mode(DriveMode.MANUAL)
    bridge.drive(0.5, number=1000)
    assert bridge.order.surge == 0.0
    bridge.drive(0.5, 0.25, number=1001)
    assert (bridge.order.surge, bridge.order.turn) == (0.5, 0.25)


def test_a_hand_that_takes_the_wheel_numbers_its_set_points_from_the_first() -> None:
    bridge = at_the_wheel()
    bridge.drive(0.5, number=1000)
    bridge.ask(RequestAct.WHEEL, hand=2)
    bridge.mode(DriveMode.MANUAL, hand=2)
    bridge.drive(0.25, hand=2, number=1)
    assert bridge.order.surge == 0.25


def test_an_override_is_of_manual_alone_and_ends_by_itself() -> None:
    bridge = Bridge()
    assert bridge.ask(RequestAct.OVERRIDE) is ModeRefusal.NOT_MANUAL
    bridge.mode(DriveMode.MANUAL)
    assert bridge.ask(RequestAct.OVERRIDE) is ModeRefusal.NONE
    for _ in range(100):
        assert bridge.order.override
        bridge.wait(0.1)
        bridge.drive(0.2)
    assert not bridge.order.override
    assert bridge.order.mode is DriveMode.MANUAL
    bridge.ask(RequestAct.OVERRIDE)
    bridge.mode(DriveMode.MANUAL)
    assert not bridge.order.override, "it belongs to the MANUAL it was asked for in"


def test_the_cause_of_an_overrides_end_is_kept_until_the_next_one_begins() -> None:
    def lose_hand(bridge: Bridge) -> None:
        bridge.wait(w.DEFLECTED_MAX_S + 1e-6)

    def disarm(bridge: Bridge) -> None:
        bridge.armed = False
        bridge.wait(0.0)

    def let_time_pass(bridge: Bridge) -> None:
        for _ in range(100):
            bridge.wait(0.1)
            bridge.drive(0.5)

    for ends, cause in (
        (let_time_pass, OverrideEnd.EXPIRED),
        (lambda bridge: bridge.mode(DriveMode.HOLD), OverrideEnd.ORDERED),
        (lambda bridge: bridge.mode(DriveMode.IDLE), OverrideEnd.ORDERED),
        (lambda bridge: bridge.ask(RequestAct.WHEEL, hand=2), OverrideEnd.TAKEN),
        (lose_hand, OverrideEnd.SILENT),
        (disarm, OverrideEnd.DISARMED),
    ):
        bridge = at_the_wheel()
        bridge.mode(DriveMode.MANUAL)
        assert bridge.wheel.override_end is OverrideEnd.NONE, "none was in force"
        bridge.ask(RequestAct.OVERRIDE)
        bridge.drive(0.5)
        ends(bridge)
        assert (bridge.wheel.override_until_us, bridge.wheel.override_end) == (0, cause)
        state = w.with_wheel(m.OperatorState(source_us=5, armed=True, stopped=False), bridge.wheel, ALL, bridge.now_us)
        assert (state.override_ms, state.override_end) == (0.0, cause)
        bridge.armed = True
        bridge.ask(RequestAct.WHEEL)
        bridge.mode(DriveMode.MANUAL)
        assert bridge.wheel.override_end is cause
        bridge.ask(RequestAct.OVERRIDE)
        assert bridge.wheel.override_end is OverrideEnd.NONE


REQUESTS = st.builds(
    m.OperatorRequest,
    source_us=st.just(1),
    act=st.sampled_from(RequestAct),
    press=st.integers(0, 5),
    hand=st.integers(0, 2),
    mode=st.sampled_from(DriveMode),
    surge=st.sampled_from((-1.0, 0.0, 0.4)),
    turn=st.sampled_from((0.0, 1.0)),
)
STEPS = st.tuples(
    st.sampled_from((STATION, "arm", SHORE)), REQUESTS, st.integers(0, 400_000), st.sampled_from((True, True, False))
)


@given(st.lists(STEPS, max_size=40))
def test_no_sequence_of_requests_gives_an_old_set_point_or_one_of_another_hand(
    steps: list[tuple[str, m.OperatorRequest, int, bool]],
) -> None:
    wheel, now_us = w.Wheel(), BEGUN_US
    received_us: dict[tuple[str, int, float, float], int] = {}
    asked_manual: set[tuple[str, int]] = set()
    for client, request, waited_us, armed in steps:
        now_us += waited_us
        wheel = w.lapse(wheel, now_us, armed=armed)
        if request.act in {RequestAct.MODE, RequestAct.WHEEL, RequestAct.DRIVE, RequestAct.OVERRIDE}:
            wheel = w.answer(wheel, client, request, ALL, now_us, armed=armed)
        if request.act is RequestAct.DRIVE:
            received_us[client, request.hand, request.surge, request.turn] = now_us
        if request.act is RequestAct.MODE and request.mode is DriveMode.MANUAL:
            asked_manual.add((client, request.hand))
        order = w.order_message(wheel, now_us, armed=armed)
        if order.mode is not DriveMode.MANUAL:
            assert (order.surge, order.turn, order.override) == (0.0, 0.0, False)
            continue
        assert armed
        assert (order.by, order.hand) in asked_manual
        if (order.surge, order.turn) != (0.0, 0.0):
            age_us = now_us - received_us[order.by, order.hand, order.surge, order.turn]
            assert age_us <= now_us - order.source_us <= w.DEFLECTED_MAX_S * 1e6


def test_a_wheel_that_is_taken_over_in_manual_rests_from_then_on() -> None:
    bridge = at_the_wheel()
    bridge.now_us += 50_000
    assert bridge.ask(RequestAct.WHEEL, hand=2) is ModeRefusal.NONE
    assert (bridge.wheel.mode, bridge.wheel.since_us) == (DriveMode.IDLE, bridge.now_us)


@pytest.mark.parametrize(("left_us", "is_in_force"), [(0, False), (1, True), (10_000_000, True), (10_000_001, False)])
def test_an_override_lasts_to_the_microsecond_and_never_longer_than_asked(left_us: int, is_in_force: bool) -> None:
    """What lies further ahead than an override lasts is of a clock that was set back."""
    wheel = w.Wheel(mode=DriveMode.MANUAL, override_until_us=BEGUN_US + left_us)
    assert w.is_overridden(wheel, BEGUN_US) is is_in_force
    begun = msgspec.structs.replace(wheel, override_until_us=left_us)
    assert w.order_message(begun, 0, armed=True).override is is_in_force


def test_a_hands_order_is_dated_by_its_word_and_any_other_by_now() -> None:
    """So that the navigator may judge how old the word of a hand is."""
    bridge = at_the_wheel()
    said_us = bridge.now_us
    bridge.now_us += 200_000
    assert bridge.order.source_us == said_us
    assert bridge.mode(DriveMode.HOLD) is ModeRefusal.NONE
    assert (bridge.order.by, bridge.order.hand, bridge.order.since_us) == (STATION, 1, bridge.now_us)
    bridge.now_us += 200_000
    assert bridge.order.source_us == bridge.now_us


def test_everybody_hears_who_holds_the_wheel_and_what_was_answered() -> None:
    bridge = at_the_wheel()
    assert bridge.ask(RequestAct.OVERRIDE) is ModeRefusal.NONE
    assert bridge.ask(RequestAct.OVERRIDE, hand=2) is ModeRefusal.NOT_HOLDER
    bridge.now_us += 100_000
    state = w.with_wheel(
        m.OperatorState(source_us=5, armed=True, stopped=False), bridge.wheel, w.Facts(), bridge.now_us
    )
    assert (state.source_us, state.armed, state.mode, state.mode_since_us) == (5, True, DriveMode.MANUAL, BEGUN_US)
    assert (state.wheel_by, state.wheel_hand) == (STATION, 1)
    assert state.override_ms == pytest.approx(1e3 * w.OVERRIDE_S - 100.0)
    answered = (state.answered_by, state.answered, state.mode_refusal)
    assert answered == (STATION, bridge.wheel.answer.press, ModeRefusal.NOT_HOLDER)
    assert {(each.mode, each.refusal) for each in state.barred} == {
        (DriveMode.ROUTE, ModeRefusal.NO_MISSION),
        (DriveMode.HOLD, ModeRefusal.NO_POSITION),
        (DriveMode.RETURN, ModeRefusal.NO_POSITION),
    }
    plain = w.with_wheel(m.OperatorState(source_us=5, armed=False, stopped=True), w.Wheel(), ALL, bridge.now_us)
    assert (plain.override_ms, [each.mode for each in plain.barred]) == (0.0, [DriveMode.MANUAL])
