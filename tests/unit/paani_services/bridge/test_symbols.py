"""What may leave for the microcontroller."""

from __future__ import annotations

import ast
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

import paani_services.bridge
from paani import keys
from paani import messages as m
from paani.microcontroller.payloads import DIRECTIONS, UNKNOWN_RISK, Guide
from paani_services.bridge.symbols import REASON_CODES, Symbols, guide_of, percent_of, symbols_of

NOW_US = 1_000_000_000
LEASE_MS = 700
UNIT = st.floats(0.0, 1.0)
LANES = st.builds(m.LaneRisk, risk=UNIT, urgency=UNIT, non_water=UNIT)
ADVISORIES = st.builds(
    m.Advisory,
    source_us=st.integers(0, 2 * NOW_US),
    direction=st.sampled_from(m.Direction),
    reason=st.sampled_from(m.Reason),
    left=LANES,
    center=LANES,
    right=LANES,
    evidence_age_s=st.floats(-1e9, 1e9),
    lifetime_s=st.floats(0.0, 1e9),
)
UNKNOWN = (UNKNOWN_RISK, UNKNOWN_RISK, UNKNOWN_RISK)


def advisory(age_ms: float = 200.0, direction: m.Direction = m.Direction.LEFT, **fields: object) -> m.Advisory:
    lanes = {"left": 0.104, "center": 0.905, "right": 1.0}
    known: dict[str, object] = {
        "source_us": NOW_US - round(age_ms * 1000),
        "direction": direction,
        "reason": m.Reason.CENTER_RISK,
        **{lane: m.LaneRisk(risk=risk) for lane, risk in lanes.items()},
    }
    return m.Advisory(**(known | fields))  # type: ignore[arg-type]  # fields of the test's choice


def test_an_advisory_becomes_direction_reason_risks_and_age() -> None:
    symbols = symbols_of(advisory(), NOW_US - 50_000, NOW_US, LEASE_MS)
    assert symbols == Symbols(m.Direction.LEFT, m.Reason.CENTER_RISK, (10, 90, 100), 200)
    assert guide_of(symbols, 7, 9, LEASE_MS) == Guide(
        direction=m.Direction.LEFT, session=7, seq=9, lease_ms=700, reason=2, risks=(10, 90, 100), age_ms=200
    )


def test_without_an_advisory_there_is_no_data() -> None:
    assert symbols_of(None, 0, NOW_US, LEASE_MS) == Symbols(m.Direction.NO_DATA, m.Reason.NO_EVIDENCE, UNKNOWN)


@pytest.mark.parametrize("direction", [d for d in m.Direction if d not in {m.Direction.STOP, m.Direction.NO_DATA}])
def test_a_direction_ends_with_the_lease_of_its_picture(direction: m.Direction) -> None:
    """However often the advisor repeats it."""
    just_received_us = NOW_US - 1000
    assert symbols_of(advisory(699, direction), just_received_us, NOW_US, LEASE_MS).direction is direction
    stale = symbols_of(advisory(700, direction), just_received_us, NOW_US, LEASE_MS)
    assert stale == Symbols(m.Direction.STOP, m.Reason.STALE_EVIDENCE)


def test_a_direction_ends_with_the_advisor_that_gave_it() -> None:
    """Its picture's stamp may lie in the future by what clocks differ."""
    assert symbols_of(advisory(-50), NOW_US - 700_000, NOW_US, LEASE_MS).direction is m.Direction.STOP


def test_stop_is_shown_with_its_reason_as_long_as_the_advisor_repeats_it() -> None:
    stop = advisory(60_000, m.Direction.STOP, reason=m.Reason.STALE_EVIDENCE)
    assert symbols_of(stop, NOW_US - 20_000, NOW_US, LEASE_MS).age_ms == 20
    assert symbols_of(stop, NOW_US - 20_000, NOW_US, LEASE_MS).reason is m.Reason.STALE_EVIDENCE


@pytest.mark.parametrize(("source_us", "received_us"), [(NOW_US + 100_001, NOW_US), (NOW_US, NOW_US + 100_001)])
def test_a_stamp_in_the_future_shows_stop(source_us: int, received_us: int) -> None:
    symbols = symbols_of(advisory(source_us=source_us), received_us, NOW_US, LEASE_MS)
    assert symbols == Symbols(m.Direction.STOP, m.Reason.FUTURE_EVIDENCE)


def test_every_reason_has_a_number_of_its_own_that_never_changes() -> None:
    assert set(REASON_CODES) == set(m.Reason)
    assert [str(reason) for reason, code in sorted(REASON_CODES.items(), key=lambda item: item[1])] == [
        "CENTER_CLEAR",
        "CENTER_RISK",
        "CENTER_OCCUPIED",
        "CENTER_VESSEL",
        "CENTER_EDGE_INCURSION",
        "TURN_RETAINED",
        "TIE_KEPT_SIDE",
        "TIE_STARBOARD",
        "NO_SAFE_SIDE",
        "NO_SIDE_UNOCCUPIED",
        "NO_SIDE_FOR_LONG",
        "STALE_EVIDENCE",
        "FUTURE_EVIDENCE",
        "UNUSABLE_IMAGE",
        "MALFORMED_EVIDENCE",
        "NO_EVIDENCE",
    ]
    assert sorted(REASON_CODES.values()) == list(range(1, 17))


@pytest.mark.parametrize("risk", [float("nan"), float("inf"), -0.01, 1.01])
def test_a_risk_that_is_no_fraction_is_unknown(risk: float) -> None:
    """The bus refuses such a message; the lights show none all the same."""
    assert percent_of(risk) == UNKNOWN_RISK


@given(ADVISORIES, st.integers(0, 2 * NOW_US), st.integers(0, 2 * NOW_US), st.integers(500, 4000))
def test_whatever_the_advisory_only_bounded_symbols_leave(
    given_advisory: m.Advisory, received_us: int, now_us: int, lease_ms: int
) -> None:
    """A4 O5 B13: of each field all values are known, and a payload has no others."""
    payload = guide_of(symbols_of(given_advisory, received_us, now_us, lease_ms), 1, 1, lease_ms).encode()
    guide = Guide.decode(payload)
    assert guide is not None
    assert guide.direction in DIRECTIONS
    assert guide.reason in range(17)
    assert all(risk in range(101) or risk == UNKNOWN_RISK for risk in guide.risks)
    assert guide.age_ms < guide.lease_ms
    assert len(payload) == 20
    if guide.direction not in {m.Direction.STOP, m.Direction.NO_DATA}:
        assert guide.direction is given_advisory.direction


def test_no_field_of_a_payload_has_the_unit_of_a_force_or_a_speed() -> None:
    """O5 B13: who adds a field has to say here why no thruster can be driven by it."""
    assert set(Guide.__struct_fields__) == {"direction", "session", "seq", "lease_ms", "reason", "risks", "age_ms"}
    assert set(Symbols.__struct_fields__) == {"direction", "reason", "risks_percent", "age_ms"}
    assert {field.type for field in msgspec.structs.fields(Symbols)} == {
        m.Direction,
        m.Reason,
        tuple[int, int, int],
        int,
    }


def test_the_bridge_knows_no_topic_and_no_call_that_moves_a_boat() -> None:
    """O5 B13: it reads the advisory, writes its own state, and calls one method of the microcontroller."""
    topics, names = set[str](), set[str]()
    for path in Path(paani_services.bridge.__path__[0]).glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            match node:
                case ast.Attribute(value=ast.Name(id="keys"), attr=attr):
                    topics.add(attr)
                case ast.Constant(value=str(text)) if text.startswith("paani_"):
                    names.add(text)
                case ast.Name(id=name) | ast.alias(name=name):
                    names.add(name)
    assert topics == {"ADVISORY", "BRIDGE_STATE"}
    assert {name for name in names if name.startswith("paani_") and "." not in name} == {"paani_guide"}
    assert not names & {"ThrustCall", "EscSettings", "Thrust", "NavCommand"}
    assert keys.BRIDGE_STATE.producer == "bridge"
