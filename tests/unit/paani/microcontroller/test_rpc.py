"""Messages are found in any stream; what is damaged costs itself alone."""

from __future__ import annotations

import random
from itertools import pairwise

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paani.messages import Direction, McuState
from paani.microcontroller.payloads import INDICATION, Guide, McuStatus, append_crc
from paani.microcontroller.rpc import (
    INCOMPLETE,
    MAX_MESSAGE_BYTES,
    MessageScanner,
    Notification,
    Request,
    Response,
    RpcMessage,
    encode_notification,
    encode_request,
    encode_response,
    find_end,
)


def status(seq: int) -> bytes:
    return McuStatus(kind=INDICATION, state=McuState.FRESH, seq=seq, mcu_ms=seq * 100).encode()


def guide(seq: int) -> bytes:
    return Guide(direction=Direction.LEFT, session=7, seq=seq, lease_ms=700).encode()


CALL_IDS = st.one_of(st.integers(0, 300), st.integers(0, 2**32 - 1))
MESSAGES = st.one_of(
    st.builds(lambda i, n: (encode_request(i, "paani_guide", guide(n)), "request"), CALL_IDS, st.integers(1, 9999)),
    st.builds(lambda i: (encode_request(i, "$/register", "paani_guide"), "request"), CALL_IDS),
    st.builds(lambda i, n: (encode_response(i, status(n)), "response"), CALL_IDS, st.integers(1, 9999)),
    st.builds(lambda i: (encode_response(i, True), "response"), CALL_IDS),
    st.builds(lambda n: (encode_notification("paani_mcu", status(n)), "notification"), st.integers(1, 9999)),
    st.just((msgspec.msgpack.encode([1, 5, [2, "method x not available"], None]), "response")),
)
KINDS = {"request": Request, "response": Response, "notification": Notification}
TEXT = st.text(st.characters(max_codepoint=127), max_size=30).map(str.encode)  # boot messages, a sentence of a GPS


def cut(stream: bytes, cuts: list[int]) -> list[bytes]:
    """The stream in pieces."""
    places = sorted({0, len(stream), *(place % (len(stream) + 1) for place in cuts)})
    return [stream[a:b] for a, b in pairwise(places)]


def scan(pieces: list[bytes]) -> list[RpcMessage]:
    scanner = MessageScanner()
    return [message for piece in pieces for message in scanner.feed(piece)]


@given(st.lists(st.tuples(TEXT, MESSAGES), max_size=8), st.lists(st.integers(0, 2000), max_size=30))
@pytest.mark.slow
def test_every_message_is_found_whatever_the_cuts_and_the_text_between(
    stream: list[tuple[bytes, tuple[bytes, str]]], cuts: list[int]
) -> None:
    data = b"".join(text + message for text, (message, _) in stream)
    found = scan(cut(data, cuts))
    assert [type(message) for message in found] == [KINDS[kind] for _, (_, kind) in stream]
    expected = [scan([message])[0] for _, (message, _) in stream]
    assert found == expected


@given(st.binary(max_size=600), st.lists(st.integers(0, 600), max_size=10))
def test_nothing_undecodable_raises_or_is_kept_for_long(data: bytes, cuts: list[int]) -> None:
    scanner = MessageScanner()
    for piece in cut(data, cuts):
        scanner.feed(piece)
        assert len(scanner._buffer) <= MAX_MESSAGE_BYTES
    found = scanner.feed(encode_response(3, status(3)))
    assert found[-1] == Response(3, "", 0, status(3))


@given(st.binary(max_size=300))
def test_a_stream_that_looks_like_messages_raises_nothing(data: bytes) -> None:
    scanner = MessageScanner()
    for head in (b"\x94\x00", b"\x94\x01", b"\x93\x02", b"\x94\x01\x05\xc0", b"\x93\x02\xa9paani_mcu\x91"):
        scanner.feed(head + data)
        assert len(scanner._buffer) <= MAX_MESSAGE_BYTES


@given(st.lists(st.booleans(), min_size=1, max_size=30), st.randoms(use_true_random=False))
@pytest.mark.slow
def test_a_damaged_message_costs_no_other(is_damaged: list[bool], rng: random.Random) -> None:
    """Flipped, lost and doubled bytes; 20,000 of them are tried on the firmware in `tests/firmware`."""
    stream, intact = [], []
    for seq, damaged in enumerate(is_damaged, 1):
        message = bytearray(encode_response(seq, status(seq)))
        if damaged:
            at = rng.randrange(len(message))
            match rng.randrange(3):
                case 0:
                    message[at] ^= rng.randrange(1, 256)
                case 1:
                    del message[at:]
                case _:
                    message[at:at] = message[at : at + 5]
        else:
            intact.append(seq)
        stream.append(bytes(message))
    found = [message for message in scan(stream) if isinstance(message, Response)]
    assert set(intact) <= {message.id for message in found}
    statuses = [McuStatus.decode(message.result) for message in found if isinstance(message.result, bytes)]
    assert all(each is None or each.encode() == status(each.seq) for each in statuses)


def test_a_length_that_was_damaged_swallows_no_message_behind_it() -> None:
    """A bin of 52 bytes that says it has 180 would end within the third message."""
    damaged = encode_response(1, status(1)).replace(b"\xc4\x34", b"\xc4\xb4")
    found = scan([damaged + encode_response(2, status(2)) + encode_response(3, status(3))])
    assert [message.id for message in found if isinstance(message, Response)] == [2, 3]


def test_a_request_cut_off_before_its_parameters_swallows_no_message_behind_it() -> None:
    """The message behind it is a list, as parameters are."""
    cut_off = encode_request(1, "paani_guide")[:-1]
    assert scan([cut_off + encode_response(2, status(2))]) == [Response(2, "", 0, status(2))]


def test_a_message_that_contains_a_head_arrives_in_two_pieces() -> None:
    payload = append_crc(b"\x94\x01" * 10)
    message = encode_response(5, payload)
    for place in range(1, len(message)):
        assert scan([message[:place], message[place:]]) == [Response(5, "", 0, payload)]


def test_a_bin_without_its_crc_is_counted_and_no_message() -> None:
    scanner = MessageScanner()
    wrong = encode_response(1, status(1)[:-1] + b"\x00")
    assert scanner.feed(wrong + encode_response(2, True)) == [Response(2, "", 0, True)]
    assert scanner.bad_crc == 1
    assert scanner.junk_bytes == len(wrong)


def test_text_is_counted_as_junk() -> None:
    scanner = MessageScanner()
    scanner.feed(b"$GPGGA,1,2,3*00\r\n")
    assert scanner.junk_bytes == 17


def test_a_router_says_why_there_is_no_result() -> None:
    data = msgspec.msgpack.encode([1, 9, [2, "method paani_guide not available"], None])
    assert scan([data]) == [Response(9, "method paani_guide not available", 2, None)]


@pytest.mark.parametrize(
    "fields",
    [
        [0, 1, "x"],
        [1, 1, None, None, None],
        [3, 1, "x", []],
        [2, 5, []],
        [0, -1, "x", []],
        [1, 1, "no", None],
        {"a": 1},
    ],
    ids=repr,
)
def test_what_has_none_of_the_three_shapes_is_junk(fields: object) -> None:
    data = msgspec.msgpack.encode(fields)
    scanner = MessageScanner()
    assert scanner.feed(data) == []
    assert scanner.feed(encode_response(2, True)) == [Response(2, "", 0, True)]


VALUES = st.recursive(
    st.one_of(
        st.none(),
        st.booleans(),
        st.integers(-(2**63), 2**64 - 1),
        st.floats(allow_nan=False),
        st.text(max_size=40),
        st.binary(max_size=40),
    ),
    lambda below: st.one_of(st.lists(below, max_size=3), st.dictionaries(st.text(max_size=4), below, max_size=3)),
    max_leaves=6,
)


@pytest.mark.rotating(cpu_s=3)
@given(VALUES, st.binary(max_size=20))
@pytest.mark.slow
def test_the_end_of_every_value_is_found(value: object, behind: bytes) -> None:
    data = msgspec.msgpack.encode(value)
    if len(data) > MAX_MESSAGE_BYTES or depth(value) > 3:
        return
    assert find_end(data + behind, 0) == len(data)
    assert all(find_end(data[:length], 0) == INCOMPLETE for length in range(len(data)))


def depth(value: object) -> int:
    match value:
        case list():
            return 1 + max(map(depth, value), default=0)
        case dict():
            return 1 + max(map(depth, value.values()), default=0)
    return 0


@pytest.mark.parametrize(
    "data",
    [
        bytes.fromhex("c70501") + b"extra",
        bytes.fromhex("d6ff") + bytes(4),
        bytes.fromhex("c8000301") + b"abc",
        bytes.fromhex("d9026869"),
        bytes.fromhex("dc0002c0c0"),
        bytes.fromhex("de0001a161c0"),
    ],
    ids=bytes.hex,
)
def test_the_end_of_the_rarer_values_is_found(data: bytes) -> None:
    assert find_end(data + b"\xc0", 0) == len(data)
