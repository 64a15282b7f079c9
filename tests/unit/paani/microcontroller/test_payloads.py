"""Golden bytes are computed here by hand from `mcu/README.md`, with a CRC of the test's own."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani.messages import Direction, McuState, McuVerdict, ResetCause
from paani.microcontroller.payloads import (
    DIRECTIONS,
    INDICATION,
    RESET_CAUSES,
    STATES,
    THRUST,
    UNKNOWN_RISK,
    VERDICTS,
    EscSettings,
    Guide,
    McuStatus,
    Refusals,
    ThrustCall,
    crc16,
)

U16 = st.integers(0, 0xFFFF)
U32 = st.integers(0, 0xFFFF_FFFF)
SESSION = st.integers(1, 0xFFFF)
GUIDES = st.builds(
    Guide,
    direction=st.sampled_from(DIRECTIONS),
    session=SESSION,
    seq=U32,
    lease_ms=st.integers(50, 4000),
    reason=U16,
    risks=st.tuples(*[st.one_of(st.integers(0, 100), st.just(UNKNOWN_RISK))] * 3),
    age_ms=U16,
)
THRUSTS = st.builds(
    ThrustCall,
    armed=st.booleans(),
    session=SESSION,
    seq=U32,
    lease_ms=st.integers(50, 300),
    left=st.integers(-10_000, 10_000).map(lambda n: n / 10_000),
    right=st.integers(-10_000, 10_000).map(lambda n: n / 10_000),
    age_ms=U16,
)
ESCS = st.builds(
    EscSettings,
    session=SESSION,
    left_reversed=st.booleans(),
    right_reversed=st.booleans(),
    trim_left_us=st.integers(-200, 200),
    trim_right_us=st.integers(-200, 200),
    neutral_us=st.integers(1400, 1600),
    span_us=st.integers(100, 500),
    deadband_left_us=st.integers(0, 100),
    deadband_right_us=st.integers(0, 100),
    slew_per_s=st.integers(100, 10_000).map(lambda n: n / 1000),
    min_battery_v=st.integers(0, 65_535).map(lambda n: n / 1000),
    max_current_a=st.integers(0, 65_535).map(lambda n: n / 100),
)
COMMON = {
    "state": st.sampled_from(STATES),
    "verdict": st.sampled_from(McuVerdict),
    "session": U16,
    "boot_count": U16,
    "seq": U32,
    "mcu_ms": U32,
    "reset_cause": st.sampled_from(RESET_CAUSES),
    "lease_left_ms": U16,
    "accepted": U16,
    "refusals": st.builds(Refusals, **dict.fromkeys(Refusals.__struct_fields__, U16)),
    "pulse_left_us": U16,
    "pulse_right_us": U16,
    "battery_v": U16.map(lambda n: n / 1000),
    "current_a": st.integers(-32_768, 32_767).map(lambda n: n / 100),
    "enabled": st.booleans(),
    "rc": st.integers(0, 2),
}
STATUSES = st.one_of(
    st.builds(McuStatus, kind=st.just(INDICATION), display=st.sampled_from(DIRECTIONS), **COMMON),
    st.builds(McuStatus, kind=st.just(THRUST), holds=st.integers(0, 31), **COMMON),
)
Payload = Guide | ThrustCall | EscSettings | McuStatus


def crc_bit_by_bit(data: bytes) -> int:
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021) & 0xFFFF if crc & 0x8000 else crc << 1
    return crc


def with_crc(data: bytes) -> bytes:
    return data + struct.pack("<H", crc_bit_by_bit(data))


@given(st.binary(max_size=64))
def test_the_crc_is_ccitt_false(data: bytes) -> None:
    assert crc16(b"123456789") == 0x29B1
    assert crc16(data) == crc_bit_by_bit(data)


def test_guidance_is_the_documented_twenty_bytes() -> None:
    guide = Guide(
        direction=Direction.LEFT,
        session=0x1234,
        seq=0x89ABCDEF,
        lease_ms=700,
        reason=3,
        risks=(10, 90, UNKNOWN_RISK),
        age_ms=0x0102,
    )
    expected = bytes.fromhex("01 04 3412 efcdab89 bc02 0300 0a 5a ff 00 0201")
    assert guide.encode() == with_crc(expected)
    assert len(guide.encode()) == 20


def test_thrust_is_the_documented_eighteen_bytes() -> None:
    call = ThrustCall(armed=True, session=0x1234, seq=1, lease_ms=300, left=-1.0, right=0.5, age_ms=2)
    assert call.encode() == with_crc(bytes.fromhex("01 01 3412 01000000 2c01 f0d8 8813 0200"))
    assert len(call.encode()) == 18


def test_speed_controller_settings_are_the_documented_twenty_six_bytes() -> None:
    settings = EscSettings(
        session=0x1234,
        right_reversed=True,
        trim_left_us=-2,
        trim_right_us=3,
        neutral_us=1500,
        span_us=400,
        deadband_left_us=25,
        deadband_right_us=26,
        slew_per_s=1.5,
        min_battery_v=10.5,
        max_current_a=20.0,
    )
    expected = bytes.fromhex("01 02 3412 feff 0300 dc05 9001 1900 1a00 dc05 0429 d007 0000")
    assert settings.encode() == with_crc(expected)
    assert len(settings.encode()) == 26


def test_a_status_is_the_documented_fifty_two_bytes() -> None:
    data = with_crc(
        bytes([1, 1, 2, 5])
        + struct.pack("<HHII", 0x1234, 7, 0x01020304, 0xFFFFFFFE)
        + bytes([2, 6])
        + struct.pack("<H10H", 450, *range(100, 110))
        + struct.pack("<HHHhBB", 1500, 1600, 11_100, -250, 1, 2)
    )
    assert len(data) == 52
    assert McuStatus.decode(data) == McuStatus(
        kind=INDICATION,
        state=McuState.STALE,
        verdict=McuVerdict.FOREIGN_SESSION,
        session=0x1234,
        boot_count=7,
        seq=0x01020304,
        mcu_ms=0xFFFFFFFE,
        reset_cause=ResetCause.WATCHDOG,
        display=Direction.STOP,
        lease_left_ms=450,
        accepted=100,
        refusals=Refusals(
            crc=101,
            version=102,
            range=103,
            replayed=104,
            foreign_session=105,
            expired=106,
            lease=107,
            not_ready=108,
            framing=109,
        ),
        pulse_left_us=1500,
        pulse_right_us=1600,
        battery_v=11.1,
        current_a=-2.5,
        enabled=True,
        rc=2,
    )


def test_the_codes_of_words_never_change() -> None:
    """The microcontroller has them burnt in."""
    assert [str(word) for word in DIRECTIONS] == [
        "NO_DATA",
        "STRAIGHT",
        "SLIGHT_LEFT",
        "SLIGHT_RIGHT",
        "LEFT",
        "RIGHT",
        "STOP",
    ]
    assert [str(word) for word in STATES] == ["boot", "fresh", "stale", "safe"]
    assert [str(word) for word in RESET_CAUSES] == ["power_on", "pin", "watchdog", "software", "unknown"]
    assert [str(word) for word in VERDICTS] == (
        [
            "accepted",
            "crc",
            "version",
            "range",
            "replayed",
            "foreign_session",
            "expired",
            "lease",
            "not_configured",
            "locked",
            "framing",
        ]
    )


@given(st.one_of(GUIDES, THRUSTS, ESCS, STATUSES))
def test_what_was_encoded_is_decoded(payload: Payload) -> None:
    assert type(payload).decode(payload.encode()) == payload


@given(st.one_of(GUIDES, THRUSTS, ESCS, STATUSES), st.data())
def test_a_payload_with_damaged_bytes_is_none(payload: Payload, data: st.DataObject) -> None:
    """Every burst of up to 16 bits is found by a CRC of 16."""
    encoded = bytearray(payload.encode())
    at = data.draw(st.integers(0, len(encoded) - 2))
    flip = data.draw(st.integers(1, 0xFFFF))
    encoded[at] ^= flip >> 8
    encoded[at + 1] ^= flip & 0xFF
    assert type(payload).decode(bytes(encoded)) is None
    assert type(payload).decode(payload.encode()[:-1]) is None


@given(st.binary(max_size=60), st.sampled_from([Guide, ThrustCall, EscSettings, McuStatus]))
def test_whatever_the_bytes_decoding_raises_nothing(data: bytes, kind: type[Payload]) -> None:
    for junk in (data, with_crc(data), with_crc(b"\x01" + data[:1].ljust(kind.FORMAT.size - 1, b"\xff"))):
        kind.decode(junk)


@pytest.mark.parametrize("at", [1, 2, 3, 16])
def test_a_status_with_a_code_of_no_word_is_none(at: int) -> None:
    data = bytearray(McuStatus(kind=INDICATION, state=McuState.FRESH).encode()[:-2])
    data[at] = 99
    assert McuStatus.decode(with_crc(bytes(data))) is None


def test_another_version_is_none() -> None:
    data = b"\x02" + McuStatus(kind=INDICATION, state=McuState.FRESH).encode()[1:-2]
    assert McuStatus.decode(with_crc(data)) is None


@pytest.mark.parametrize(
    "payload",
    [
        Guide(direction=Direction.STOP, session=0, seq=1, lease_ms=700),
        Guide(direction=Direction.STOP, session=1, seq=1, lease_ms=49),
        Guide(direction=Direction.STOP, session=1, seq=1, lease_ms=4001),
        Guide(direction=Direction.STOP, session=1, seq=2**32, lease_ms=700),
        Guide(direction=Direction.STOP, session=1, seq=1, lease_ms=700, risks=(0, 101, 0)),
        Guide(direction=Direction.STOP, session=1, seq=1, lease_ms=700, age_ms=65_536),
        ThrustCall(armed=True, session=1, seq=1, lease_ms=301, left=0.0, right=0.0),
        ThrustCall(armed=True, session=1, seq=1, lease_ms=300, left=1.001, right=0.0),
        ThrustCall(armed=True, session=1, seq=1, lease_ms=300, left=0.0, right=float("nan")),
        EscSettings(session=1, trim_left_us=201),
        EscSettings(session=1, neutral_us=1399),
        EscSettings(session=1, slew_per_s=0.05),
        EscSettings(session=1, min_battery_v=70.0),
    ],
    ids=repr,
)
def test_what_no_field_holds_is_not_encoded(payload: Payload) -> None:
    with pytest.raises(ValueError, match=r"range|format"):
        payload.encode()
