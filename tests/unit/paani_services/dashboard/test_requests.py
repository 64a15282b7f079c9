"""Bad requests name the field at fault; strangers are told from our own page."""

from __future__ import annotations

import pytest

from paani_services.dashboard.requests import (
    BadRequestError,
    NoQuery,
    PressRequest,
    SnapshotQuery,
    decode_body,
    decode_query,
    is_own_host,
    is_same_origin,
)


@pytest.mark.parametrize(
    ("body", "field"),
    [
        (b"", "body"),
        (b"{", "body"),
        (b"[]", "body"),
        (b"\xff", "body"),
        (b"{}", "press"),
        (b'{"press":0}', "press"),
        (b'{"press":9007199254740992}', "press"),
        (b'{"press":"7"}', "press"),
        (b'{"press":NaN}', "body"),
        (b'{"press":7,"held_ms":1500}', "held_ms"),
    ],
)
def test_a_bad_arm_request_names_its_field(body: bytes, field: str) -> None:
    with pytest.raises(BadRequestError) as caught:
        decode_body(body, PressRequest)
    assert caught.value.field == field


def test_a_press_has_a_number_and_claims_nothing_else() -> None:
    assert decode_body(b'{"press":7}', PressRequest).press == 7


@pytest.mark.parametrize(
    ("query", "field"), [({"max_age_s": "soon"}, "max_age_s"), ({"max_age_s": "0"}, "max_age_s"), ({"w": "9"}, "w")]
)
def test_a_bad_query_names_its_parameter(query: dict[str, str], field: str) -> None:
    with pytest.raises(BadRequestError) as caught:
        decode_query(query, SnapshotQuery)
    assert caught.value.field == field


def test_good_queries() -> None:
    assert decode_query({"max_age_s": "2.5"}, SnapshotQuery).max_age_s == 2.5
    assert decode_query({}, NoQuery) == NoQuery()


@pytest.mark.parametrize(
    ("host", "ours"),
    [
        ("127.0.0.1:8043", True),
        ("localhost:8043", True),
        ("[::1]:8043", True),
        ("192.168.4.1:8043", True),
        ("otter.lan:8043", True),
        ("elsewhere.example:8043", False),
        ("", False),
    ],
)
def test_a_name_that_is_not_ours_is_refused(host: str, ours: bool) -> None:
    assert is_own_host(host, ("192.0.2.1", "Otter.lan")) is ours


@pytest.mark.parametrize("host", ["[", "[x]", "[::1", "a]", "[127.0.0.1].x", "\x00"])
def test_a_name_that_is_none_is_refused(host: str) -> None:
    assert not is_own_host(host, ("192.0.2.1", "Otter.lan"))


def test_same_origin_is_exact() -> None:
    assert is_same_origin("http://127.0.0.1:8043", "127.0.0.1:8043")
    assert not is_same_origin("http://127.0.0.1:8044", "127.0.0.1:8043")
    assert not is_same_origin("null", "127.0.0.1:8043")
    assert not is_same_origin(None, "127.0.0.1:8043")
