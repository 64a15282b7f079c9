"""Requests of players and their answers."""

from __future__ import annotations

import pytest

from paani_services.mavlink.rtsp import Answer, Request, Session, interleaved, split_request

TCP = "RTP/AVP/TCP;unicast;interleaved=2-3"


def session() -> Session:
    return Session("abc", "10.0.0.2", "otter")


def ask(player: Session, method: str, path: str = "/camera", **headers: str) -> Answer:
    return player.answer(Request(method, path, {"cseq": "7", **headers}))


def status(answer: Answer) -> str:
    first, number, *_ = answer.data.decode().split("\r\n")
    assert number == "CSeq: 7"
    return first.removeprefix("RTSP/1.0 ")


def test_a_player_is_told_what_there_is_and_gets_it_once_it_plays() -> None:
    player = session()
    assert b"Public: OPTIONS, DESCRIBE, SETUP, PLAY" in ask(player, "OPTIONS", "*").data
    described = ask(player, "DESCRIBE").data
    head, _, body = described.partition(b"\r\n\r\n")
    assert f"Content-Length: {len(body)}".encode() in head
    assert b"m=video 0 RTP/AVP 26\r\na=control:track\r\n" in body
    assert b"Session: abc" in ask(player, "SETUP", "/camera/track", transport=TCP).data
    assert player.channel == 2
    answers = [ask(player, method, "/camera/", session="abc;timeout=60") for method in ("PLAY", "PAUSE", "TEARDOWN")]
    assert [(status(each), each.is_playing, each.is_last) for each in answers] == [
        ("200 OK", True, False), ("200 OK", False, False), ("200 OK", False, True),
    ]  # fmt: skip
    assert (status(ask(player, "GET_PARAMETER", "")), ask(player, "GET_PARAMETER").is_playing) == ("200 OK", None)


@pytest.mark.parametrize(
    ("method", "path", "headers", "refusal"),
    [
        ("DESCRIBE", "/other", {}, "404 Not Found"),
        ("RECORD", "/camera", {}, "405 Method Not Allowed"),
        ("SETUP", "/camera/track", {"transport": "RTP/AVP;unicast;client_port=5000-5001"}, "461 Unsupported Transport"),
        ("SETUP", "/camera/track", {"transport": "RTP/AVP/TCP;interleaved=256-257"}, "461 Unsupported Transport"),
        ("SETUP", "/camera/track", {}, "461 Unsupported Transport"),
        ("PLAY", "/camera", {"session": "abc"}, "454 Session Not Found"),
    ],
)
def test_refusals(method: str, path: str, headers: dict[str, str], refusal: str) -> None:
    answer = ask(session(), method, path, **headers)
    assert (status(answer), answer.is_playing, answer.is_last) == (refusal, None, False)


def test_another_players_session_begins_nothing() -> None:
    player = session()
    ask(player, "SETUP", transport=TCP)
    answer = ask(player, "PLAY", session="abd")
    assert (status(answer), answer.is_playing) == ("454 Session Not Found", None)


def test_requests_are_split_whatever_pieces_they_come_in() -> None:
    text = b"SETUP rtsp://boat:8554/camera/track RTSP/1.0\r\nCSeq: 3\r\nContent-Length: 2\r\n\r\nhi"
    report = interleaved(3, b"receiver report")
    for cut in range(len(report)):
        assert split_request(report[:cut]) == (None, 0)
    assert split_request(report + text) == (None, len(report))
    for cut in range(len(text)):
        assert split_request(text[:cut]) == (None, 0)
    wanted = Request("SETUP", "/camera/track", {"cseq": "3", "content-length": "2"})
    assert split_request(text + b"more") == (wanted, len(text))


@pytest.mark.parametrize(
    "data",
    [
        b"GET / HTTP/1.1\r\n\r\n",
        b"\r\n\r\n",
        b"OPTIONS rtsp://boat/camera RTSP/2.0\r\n\r\n",
        b"OPTIONS * RTSP/1.0\r\nContent-Length: 99999\r\n\r\n",
        b"OPTIONS * RTSP/1.0\r\nContent-Length: -1\r\n\r\n",
        b"x" * 8193,
    ],
)
def test_what_is_no_request_is_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match=r"no RTSP|too long"):
        split_request(data)
