"""A drive computed again: the same bytes, or named what differs and what cannot be computed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import msgspec
import pytest

from paani import keys
from paani import messages as m
from paani.config import with_settings
from paani.decider import decider_of
from paani.keys import Graph
from paani.logs.reader import Record
from paani.sides import ON_BOARD
from paani_tools.replay.check import ServiceCheck, check_service
from paani_tools.replay.difference import as_recorded
from paani_tools.replay.ledger import Ledger
from paani_tools.replay.recompute import RecordingFacts
from paani_tools.replay.whatif import changes_of
from tests.unit.paani_tools.replay.recorded_drive import CONFIG, T0_US, TARGET, drive

pytestmark = pytest.mark.slow

DRIVE = drive(32.0)
SERVICES = keys.DECIDING_SERVICES


def check(
    service: str,
    records: list[Record],
    lost: dict[str, int] | None = None,
    recordings: tuple[tuple[int, int], ...] = (),
) -> ServiceCheck:
    """Checked as one recording from the first record to the last, unless they are said to be several."""
    decider = decider_of(service)
    wanted = Ledger(decider).topics
    whole = ((min(r.log_us for r in records), max(r.log_us for r in records)),)
    facts = RecordingFacts(lost or {}, recordings or whole)
    return check_service(decider, CONFIG, [r for r in records if r.topic in wanted], facts)


def changed(records: list[Record], where: Callable[[Record], bool], change: Callable[[Any], Any]) -> list[Record]:
    """The same records, but one: the first that fits has its decoded payload changed."""
    first = next(record for record in records if where(record))
    other = first._replace(data=msgspec.json.encode(change(msgspec.json.decode(first.data))))
    return [other if record is first else record for record in records]


def without(records: list[Record], where: Callable[[Record], bool]) -> list[Record]:
    kept = [record for record in records if not where(record)]
    assert len(kept) < len(records)
    return kept


def at_s(record: Record) -> float:
    return (record.log_us - T0_US) * 1e-6


@pytest.mark.parametrize("service", SERVICES)
def test_every_decision_is_the_same_to_the_byte(service: str) -> None:
    result = check(service, DRIVE)
    assert result.is_exact
    assert result.differ == result.differing_states == result.before_start == result.at_edges == 0
    assert not result.unexplained
    assert not result.differences
    assert result.decisions > 150
    assert result.steps >= result.decisions
    assert result.states >= 14  # recorded every two seconds, and the same as the one computed up to there
    outputs = {topic.name for topic in decider_of(service).outputs}
    recorded = [r for r in DRIVE if r.topic in outputs]
    assert result.messages == len(recorded)
    assert result.message_bytes == sum(len(r.data) for r in recorded)


def as_of_two_machines(records: list[Record]) -> list[Record]:
    """The drive as board and host record it: the board's wall clock is 5 s ahead, and every message says when it left.

    The host's steps write down the stamps of the board's messages as they were given them, by the host's clock.
    """
    on_board = {topic.name: topic.producer in ON_BOARD[Graph.SIMULATION] for topic in keys.TOPICS}
    ahead_us, stamps_us, moved = 5_000_000, dict[tuple[str, int, int], int](), list[Record]()
    for record in records:
        message = msgspec.json.decode(record.data)
        stamps_us[record.topic, message["epoch"], message["seq"]] = message["source_us"]
        message["steady_us"] = 77 + record.seq
        if on_board[record.topic]:
            message["source_us"] += ahead_us
            message["sent_us"] += ahead_us
        if message.get("advisory_sent_us"):
            message["advisory_sent_us"] += ahead_us
        if record.topic == keys.STEPS["navigator"].name:
            for heard in message["heard"]:
                heard["source_us"] = stamps_us[heard["topic"], heard["epoch"], heard["seq"]]
            for sent in message["sent"]:
                sent["steady_us"] = 77 + sent["seq"]
        data = msgspec.json.encode(msgspec.json.decode(msgspec.json.encode(message), type=keys_type(record.topic)))
        moved.append(record._replace(data=data))
    return moved


def keys_type(name: str) -> type[m.Message]:
    return next(topic.type for topic in keys.TOPICS if topic.name == name)


def test_a_drive_of_two_machines_is_decided_again_by_the_stamps_that_the_steps_were_given() -> None:
    """The navigator, on the host, hears advice of a board whose clock is 5 s ahead."""
    alone, apart = drive(14.0), as_of_two_machines(drive(14.0))
    navigator = decider_of("navigator")
    topics = Ledger(navigator).topics
    before, after = (
        check_service(navigator, CONFIG, [r for r in records if r.topic in topics], RecordingFacts({}, ()))
        for records in (alone, apart)
    )
    assert after.is_exact, after.differences[:3]
    assert after.decisions == before.decisions


def test_the_drive_has_decisions_of_every_kind() -> None:
    advice = [msgspec.json.decode(r.data, type=m.Advisory) for r in DRIVE if r.topic == keys.ADVISORY.name]
    assert {a.direction for a in advice} >= {m.Direction.STRAIGHT, m.Direction.STOP, m.Direction.LEFT}
    orders = [msgspec.json.decode(r.data, type=m.NavCommand) for r in DRIVE if r.topic == keys.COMMAND.name]
    assert {True, False} == {order.enable for order in orders}


@pytest.mark.parametrize("service", SERVICES)
def test_a_restarted_process_begins_again(service: str) -> None:
    records = drive(14.0, restart_at_s=6.0)
    result = check(service, records)
    assert result.is_exact, result
    assert result.before_start == 0


@pytest.mark.parametrize(
    ("service", "topic", "field", "value"),
    [
        ("advisor", "advisor/advisory", "evidence_age_s", 9.5),
        ("advisor", "advisor/tracks", "frame_seq", 1000),
        ("navigator", "navigator/command", "heading_rad", 3.0),
        ("controller", "controller/thrust", "left", 0.9),
    ],
)
def test_one_changed_number_is_found_and_named(service: str, topic: str, field: str, value: float) -> None:
    records = changed(DRIVE, lambda r: r.topic == topic and at_s(r) > 5, lambda tree: tree | {field: value})
    result = check(service, records)
    assert not result.is_exact
    assert (result.differ, result.differing_messages) == (1, 1)
    (difference,) = result.differences
    assert (difference.topic, difference.field, difference.recorded) == (topic, field, str(value))


def test_a_changed_input_shows_in_the_decisions_after_it() -> None:
    def nearer(tree: dict[str, Any]) -> dict[str, Any]:
        return tree | {"surge_mps": 0.1}

    records = changed(DRIVE, lambda r: r.topic == keys.ODOMETRY.name and at_s(r) > 5, nearer)
    assert check("controller", records).differ > 0
    assert check("advisor", records).is_exact


def test_a_tampered_state_is_a_difference() -> None:
    def other(tree: dict[str, Any]) -> dict[str, Any]:
        state = msgspec.json.decode(tree["state"])
        progress = state["progress"] | {"reached": 41}
        return tree | {"state": msgspec.json.encode(state | {"progress": progress}).decode()}

    records = changed(DRIVE, lambda r: r.topic == "navigator/step" and b'"state":"{' in r.data and at_s(r) > 5, other)
    result = check("navigator", records)
    assert result.differing_states == 2  # it is not what was computed, and the next is not what follows from it
    assert result.differ > 2
    assert not result.is_exact


def test_a_lost_input_is_named_and_ends_with_the_next_state() -> None:
    gone = next(r for r in DRIVE if r.topic == keys.ODOMETRY.name and at_s(r) > 5)
    result = check("controller", without(DRIVE, lambda r: r == gone))
    assert result.differ == 0
    assert not result.is_exact
    causes = " ".join(found.cause for found in result.unexplained)
    assert "localization/odometry it had heard is not in the log" in causes
    assert "no state since a break" in causes
    whole = check("controller", DRIVE)
    assert 0 < whole.decisions - result.decisions < 30  # at most the two seconds until the next state


def test_what_the_recorder_counted_as_lost_is_explained() -> None:
    gone = next(r for r in DRIVE if r.topic == keys.ODOMETRY.name and at_s(r) > 5)
    sent = next(r for r in DRIVE if r.topic == keys.THRUST.name and at_s(r) > 20)
    step = next(r for r in DRIVE if r.topic == "controller/step" and at_s(r) > 25)
    records = without(DRIVE, lambda r: r in {gone, sent, step})
    counted = {keys.ODOMETRY.name: 1, keys.THRUST.name: 1, "controller/step": 1}
    result = check("controller", records, counted)
    assert result.is_exact, result.unexplained
    assert result.lost > 3
    for topic in counted:
        assert not check("controller", records, counted | {topic: 0}).is_exact


def test_a_missing_step_an_orphan_and_an_unrecorded_output_are_not_explained() -> None:
    def causes(records: list[Record]) -> str:
        result = check("controller", records)
        assert result.differ == 0
        assert not result.is_exact
        return " ".join(found.cause for found in result.unexplained)

    step = next(r for r in DRIVE if r.topic == "controller/step" and at_s(r) > 5)
    text = causes(without(DRIVE, lambda r: r == step))
    assert "steps are not in the log" in text
    assert "controller/thrust belongs to no step in the log" in text
    thrust = next(r for r in DRIVE if r.topic == keys.THRUST.name and at_s(r) > 5)
    assert "controller/thrust it had sent is not in the log" in causes(without(DRIVE, lambda r: r == thrust))


@pytest.mark.parametrize("service", SERVICES)
def test_a_log_that_begins_later_is_explained_and_checked_from_its_first_state(service: str) -> None:
    result = check(service, [r for r in DRIVE if at_s(r) > 3.3])
    assert result.is_exact, result.unexplained
    assert result.before_start > 2
    assert result.decisions > 100


@pytest.mark.parametrize("service", SERVICES)
@pytest.mark.parametrize("end_s", [7.0012, 7.0031, 7.0044])
def test_a_log_cut_anywhere_is_explained(service: str, end_s: float) -> None:
    assert check(service, [r for r in DRIVE if at_s(r) < end_s]).is_exact


@pytest.mark.parametrize("service", SERVICES)
def test_messages_that_come_to_the_recorder_in_another_order_change_nothing(service: str) -> None:
    delay_us = {topic: number * 150_000 for number, topic in enumerate(sorted({r.topic for r in DRIVE}))}
    late = sorted(DRIVE, key=lambda r: r.log_us + delay_us[r.topic])
    late = [r._replace(log_us=T0_US + i * 1000) for i, r in enumerate(late)]
    assert check(service, late).digest == check(service, DRIVE).digest


def test_undecodable_messages_and_unknown_fields_are_named_not_fatal() -> None:
    text = next(r for r in DRIVE if r.topic == keys.ODOMETRY.name and at_s(r) > 5)
    records = [r._replace(data=b"{") if r == text else r for r in DRIVE]
    result = check("controller", records)
    assert any("localization/odometry does not decode" in found.cause for found in result.unexplained)
    newer = [
        r._replace(data=r.data[:-1] + b',"of_a_newer_version":{"a":[1,2]}}') if r.topic == keys.ODOMETRY.name else r
        for r in DRIVE
    ]
    assert check("controller", newer).is_exact
    unknown = changed(
        DRIVE,
        lambda r: r.topic == keys.COMMAND.name and at_s(r) > 5,
        lambda tree: tree | {"direction": "UP"},
    )
    result = check("controller", unknown)
    assert any("navigator/command it had heard does not decode" in found.cause for found in result.unexplained)


def test_a_state_that_does_not_decode_is_named() -> None:
    records = changed(
        DRIVE,
        lambda r: r.topic == "controller/step" and b'"state":"{' in r.data,
        lambda tree: tree | {"state": '{"integral":"much"}'},
    )
    result = check("controller", records)
    assert any("its state does not decode" in found.cause for found in result.unexplained)
    assert result.decisions > 100  # from the next state on
    assert not result.is_exact


def test_other_settings_change_decisions_in_episodes_with_their_reasons() -> None:
    decider = decider_of("advisor")
    wanted = Ledger(decider).topics
    records = [r for r in DRIVE if r.topic in wanted]
    settings = with_settings(CONFIG, ("advisor.policy.center_block_risk=0.35",))
    result = changes_of(decider, settings, records, T0_US, RecordingFacts({}, ()), {})
    assert 0 < result.changed < result.messages
    assert result.numbers > 0
    assert "center_block_risk" in dict(result.fields)
    first = result.episodes[0]
    assert (first.recorded, first.topic) == ("STRAIGHT", keys.ADVISORY.name)
    assert first.computed in {"LEFT", "RIGHT", "STOP"}
    assert "CENTER_CLEAR" in first.recorded_why
    assert "(limit 0.35)" in first.computed_why
    assert sum(e.decisions for e in result.episodes) == result.changed
    assert all(0 <= e.start_s <= e.end_s <= 33 for e in result.episodes)
    same = changes_of(decider, CONFIG, records, T0_US, RecordingFacts({}, ()), {})
    assert (same.changed, same.numbers, same.episodes) == (0, 0, ())


def test_changed_advice_reaches_the_services_after_it() -> None:
    settings = with_settings(CONFIG, ("advisor.policy.center_block_risk=0.35",))
    advisor, navigator = decider_of("advisor"), decider_of("navigator")
    instead: dict[tuple[str, int, int], bytes] = {}
    facts = RecordingFacts({}, ())
    changes_of(advisor, settings, [r for r in DRIVE if r.topic in Ledger(advisor).topics], T0_US, facts, instead)
    records = [r for r in DRIVE if r.topic in Ledger(navigator).topics]
    assert changes_of(navigator, settings, records, T0_US, RecordingFacts({}, ()), {}).changed == 0
    assert changes_of(navigator, settings, records, T0_US, RecordingFacts({}, ()), instead).changed > 0


def test_memory_is_bounded() -> None:
    ledger = Ledger(decider_of("controller"))
    held = 0
    records = [Record(keys.ODOMETRY.name, T0_US + i * 50_000, i, b'{"epoch":1,"seq":%d}' % i) for i in range(20_000)]
    for _ in ledger.steps(records):
        raise AssertionError("no steps in this log")
    ledger = Ledger(decider_of("controller"))

    def watched() -> Any:
        nonlocal held
        for record in records:
            held = max(held, len(ledger._messages))
            yield record

    list(ledger.steps(watched()))
    assert held <= 1230  # a minute at 20 Hz, of 17 minutes


def test_a_restart_whose_first_steps_are_missing_is_not_explained() -> None:
    records = drive(24.0, restart_at_s=6.0)
    epoch = max(msgspec.json.decode(r.data)["epoch"] for r in records if r.topic == "advisor/step")
    first = next(r for r in records if r.topic == "advisor/step" and b'"epoch":%d' % epoch in r.data and r.seq == 0)
    result = check("advisor", without(records, lambda r: r is first))
    assert not result.is_exact
    causes = {found.cause: found.count for found in result.unexplained}
    assert causes["steps are not in the log"] == 1
    assert causes["no state since a break"] == 10  # at 5 Hz, up to the next state
    assert result.differ == 0


@pytest.mark.parametrize("service", SERVICES)
def test_a_recorder_that_began_again_leaves_an_explained_gap(service: str) -> None:
    records = without(DRIVE, lambda r: 6.0 < at_s(r) < 7.5)
    recordings = ((DRIVE[0].log_us, T0_US + 6_000_000), (T0_US + 7_500_000, DRIVE[-1].log_us))
    assert not check(service, records).is_exact
    result = check(service, records, None, recordings)
    assert result.is_exact, result.unexplained
    assert result.decisions > 80


def test_a_field_added_since_the_recording_is_left_out_and_a_changed_one_is_not() -> None:
    recorded = b'{"seq":1,"left":{"risk":0.5},"tracks":[{"id":1}]}'
    computed = b'{"seq":1,"left":{"risk":0.5,"limit":0.58},"tracks":[{"id":1,"urgency":0.0}],"purpose":"PASS"}'
    assert as_recorded(computed, recorded) == recorded
    assert as_recorded(computed.replace(b"0.5,", b"0.25,"), recorded) != recorded
    assert as_recorded(b'{"seq":1}', recorded) != recorded
    assert as_recorded(computed, None) == computed
    assert as_recorded(computed, b"{") == computed


def test_a_drive_through_every_mode_is_computed_to_the_byte() -> None:
    """The order of the mode is an input like any other; without it every leg of these orders would be the route's."""
    records = drive(15.0, modes=(*m.DriveMode, m.DriveMode.ROUTE))
    found = check("navigator", records)
    assert (found.is_exact, found.differing_states) == (True, 0)
    commands = [
        msgspec.json.decode(each.data, type=m.NavCommand) for each in records if each.topic == keys.COMMAND.name
    ]
    legs = [command.leg for command in commands]
    assert {"return home", "manual", "idle"} <= set(legs)
    assert any(leg.startswith("hold station") for leg in legs)
    assert legs[-1].startswith("follow route")
    unordered = [each for each in records if each.topic != keys.OPERATOR_ORDER.name]
    assert not check("navigator", unordered).is_exact


def test_a_return_to_a_rally_point_is_computed_to_the_byte_while_rally_points_change() -> None:
    """As the operator's process lets them: the legs stay, so that the way that is under way goes on."""
    leg = m.MissionLeg(kind=m.LegKind.FOLLOW_ROUTE, waypoints=(m.Waypoint(x_m=60.0, y_m=0.0), TARGET))
    rallies = ((TARGET,), (TARGET, m.Waypoint(x_m=0.1, y_m=1 / 3)), ())
    missions = tuple(
        m.Mission(source_us=T0_US, name="a", legs=(leg,), rally=rally, accepted_us=T0_US + number, legs_us=T0_US)
        for number, rally in enumerate(rallies)
    )
    records = drive(12.0, modes=(m.DriveMode.RETURN,), missions=missions)
    found = check("navigator", records)
    assert (found.is_exact, found.differing_states) == (True, 0)
    sent = [msgspec.json.decode(each.data, type=m.Mission) for each in records if each.topic == keys.MISSION.name]
    assert [len(mission.rally) for mission in sent] == [1, 1, 2, 2, 0, 0]
    commands = [
        msgspec.json.decode(each.data, type=m.NavCommand) for each in records if each.topic == keys.COMMAND.name
    ]
    assert {command.leg for command in commands} == {"return home"}
