"""Signing: what is signed with the key is taken once, and nothing else is."""

from __future__ import annotations

import asyncio
import hashlib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common

from paani.errors import UserError
from paani.runtime import write_private
from paani_services.mavlink import signing
from paani_services.mavlink.codec import Codec
from paani_services.mavlink.signing import (
    MINUTE,
    Signer,
    read_signing_key,
    read_stamp,
    save_stamps,
    stamp_of,
)
from tests.mavlink_peer import NOW_US, Peer, Port, armed, in_order

KEY = hashlib.sha256(b"correct horse").digest()
DISARM = common.MAVLink_command_long_message(1, 1, common.MAV_CMD_COMPONENT_ARM_DISARM, 0, 0, 0, 0, 0, 0, 0, 0)
SECOND = 100_000  # stamps


def signed(key: bytes, stamp: int, link_id: int = 7, system: int = 255) -> bytes:
    """A frame as pymavlink signs it."""
    sender = common.MAVLink(None, system, 190)
    sender.signing.secret_key, sender.signing.sign_outgoing = key, True
    sender.signing.link_id, sender.signing.timestamp = link_id, stamp
    return bytes(DISARM.pack(sender))


def is_taken(signer: Signer, stamp: int, link_id: int = 7) -> bool:
    return signer.is_authentic(signed(KEY, stamp, link_id), 255, 190)


def port() -> tuple[Port, Peer]:
    signer = Signer(KEY, NOW_US)
    made = Port(armed(), is_signed=True)
    return made, Peer(made.gateway, signer=signer)


LATER = stamp_of(NOW_US) + SECOND


def test_a_signed_command_is_obeyed_once() -> None:
    """The same frame again is a replay, and so is an older one, also by another link."""
    made, peer = port()
    other = Peer(made.gateway, 1, signer=peer.station._codec._parser.signer)
    frame = signed(KEY, LATER)
    peer.send_bytes(frame)
    assert len(made.asked) == 1
    for again in (peer, other):
        assert again.send_bytes(frame) == []
        assert again.send_bytes(signed(KEY, LATER - 1)) == []
    assert len(made.asked) == 1
    assert made.counted == ["mavlink_damaged"] * 4
    peer.send_bytes(signed(KEY, LATER + 1))
    assert len(made.asked) == 2


def test_what_was_signed_before_the_start_is_not_obeyed() -> None:
    made, peer = port()
    peer.send_bytes(signed(KEY, stamp_of(NOW_US)))
    assert made.asked == []


def test_what_an_earlier_run_has_heard_is_not_obeyed_by_a_clock_that_was_set_back() -> None:
    before = Signer(KEY, NOW_US)
    station = before.next_stamp(NOW_US) + 7 * MINUTE  # its clock is ahead of ours
    assert is_taken(before, station)
    after = Signer(KEY, NOW_US - 3_600_000_000, before.newest)
    assert not is_taken(after, station)
    assert is_taken(after, station + 1)


def test_what_was_held_back_for_a_minute_begins_no_stream() -> None:
    """Of one that is known it is late and no repetition: a link may be slow."""
    signer = Signer(KEY, NOW_US)
    assert is_taken(signer, LATER, link_id=1)
    held_back = signer.next_stamp(NOW_US + 120_000_000) - MINUTE
    assert not is_taken(signer, held_back, link_id=2)
    assert is_taken(signer, held_back, link_id=1)
    assert is_taken(signer, held_back + 1, link_id=2)


def test_a_station_whose_clock_is_ahead_takes_what_is_sent() -> None:
    """By pymavlink's reader, which takes no new stream that is over a minute behind."""
    signer = Signer(KEY, NOW_US)
    reader = common.MAVLink(None, 255, 190)
    reader.robust_parsing = True
    reader.signing.secret_key, reader.signing.timestamp = KEY, LATER + 60 * MINUTE
    (refused,) = reader.parse_buffer(Codec(1, signer).encode(DISARM, NOW_US))
    assert refused.get_type() == "BAD_DATA"
    assert is_taken(signer, LATER + 60 * MINUTE)
    (taken,) = reader.parse_buffer(Codec(2, signer).encode(DISARM, NOW_US))
    assert taken.get_type() == "COMMAND_LONG"


async def test_the_newest_stamp_is_saved_again_and_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(signing, "SAVE_PERIOD_S", 0.0)
    file, signer = tmp_path / "stamp", Signer(KEY, NOW_US)
    assert await asyncio.to_thread(read_stamp, file) == 0
    saving = asyncio.create_task(save_stamps(file, signer))
    for _ in range(2):
        async with asyncio.timeout(10.0):
            while await asyncio.to_thread(read_stamp, file) != signer.newest:
                pass
        signer.next_stamp(NOW_US)
    saving.cancel()


@pytest.mark.parametrize("content", [b"", b"-1", b"x", b"\xff", b"1" * 5000])
def test_a_file_that_holds_no_stamp_is_refused(content: bytes, tmp_path: Path) -> None:
    file = tmp_path / "stamp"
    file.write_bytes(content)
    with pytest.raises(UserError, match=r"stamp: holds no stamp"):
        read_stamp(file)


async def test_a_stamp_that_cannot_be_saved_is_told_once_and_tried_again(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(signing, "SAVE_PERIOD_S", 0.0)
    file, tries = tmp_path / "later" / "stamp", 0

    def write(path: Path, text: str) -> None:
        nonlocal tries
        tries += 1
        write_private(path, text)

    monkeypatch.setattr(signing, "write_private", write)
    saving = asyncio.create_task(save_stamps(file, Signer(KEY, NOW_US)))
    async with asyncio.timeout(10.0):
        while tries < 4:
            await asyncio.sleep(0)
        file.parent.mkdir()
        while not file.exists():
            await asyncio.sleep(0)
    saving.cancel()
    assert caplog.text.count("No such file") == 1


@pytest.mark.parametrize("frame", [signed(b"x" * 32, LATER), Peer.pack(None, DISARM)])  # type: ignore[arg-type]
def test_another_key_or_none_has_no_effect_and_no_answer(frame: bytes) -> None:
    made, peer = port()
    assert peer.send_bytes(frame) == []
    assert made.asked == []
    assert made.gateway.commander_us is None


def test_a_forged_stamp_of_the_future_shuts_nobody_out() -> None:
    made, peer = port()
    peer.send_bytes(signed(b"x" * 32, LATER + 1000 * SECOND))
    peer.send_bytes(signed(KEY, LATER))
    assert len(made.asked) == 1


@given(st.integers(0, 10_000), st.integers(1, 255))
def test_one_changed_byte_is_enough(at: int, change: int) -> None:
    made, peer = port()
    frame = bytearray(signed(KEY, LATER))
    frame[at % len(frame)] ^= change
    peer.send_bytes(bytes(frame))
    assert made.asked == []


def test_what_is_sent_is_signed_and_its_stamps_never_go_back() -> None:
    signer = Signer(KEY, NOW_US)
    codec = Codec(3, signer)
    reader = common.MAVLink(None, 255, 190)
    reader.signing.secret_key = KEY
    for now_us in (NOW_US, NOW_US, NOW_US - 5_000_000, NOW_US + 1):  # a clock may be set back
        (message,) = reader.parse_buffer(codec.encode(DISARM, now_us))
        assert message.get_signed()
        assert message.get_link_id() == 3


def test_an_unsigned_heartbeat_is_heard_but_commands_nothing() -> None:
    made, peer = port()
    heartbeat = common.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3)
    peer.send(heartbeat)
    assert peer.station.is_present(NOW_US)
    assert made.gateway.commander_us is None


def test_the_key_is_read_from_a_file_of_its_owner(tmp_path: Path) -> None:
    file = tmp_path / "key"
    file.write_text("correct horse\n")
    file.chmod(0o600)
    assert read_signing_key(str(file)) == KEY
    file.chmod(0o640)
    with pytest.raises(UserError, match=r"signing_key_file .*others can read it"):
        read_signing_key(str(file))
    file.chmod(0o600)
    file.write_text(" \n")
    with pytest.raises(UserError, match="holds no passphrase"):
        read_signing_key(str(file))
    with pytest.raises(UserError, match=r"signing_key_file .*No such file"):
        read_signing_key(str(tmp_path / "absent"))


def test_without_a_key_a_station_elsewhere_may_read_and_not_command() -> None:
    made = Port(in_order())
    peer = Peer(made.gateway, local=False)
    kinds = [message.get_type() for message in peer.command(common.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)]
    assert kinds == ["STATUSTEXT", "COMMAND_ACK"]
    peer.command(common.MAV_CMD_COMPONENT_ARM_DISARM, 0.0)
    assert made.asked == []
    assert made.gateway.commander_us is None
    answers = peer.command(common.MAV_CMD_REQUEST_MESSAGE, 148.0)
    assert [message.get_type() for message in answers] == ["AUTOPILOT_VERSION", "COMMAND_ACK"]
