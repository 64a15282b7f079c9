"""Sessions of the page: tokens that end, and that nothing else is."""

from __future__ import annotations

from paani_services.dashboard.sessions import LIFETIME_S, MAX_SESSIONS, Sessions

NOW_US = 1_000_000
LIFETIME_US = round(LIFETIME_S * 1e6)


def test_a_token_opens_until_its_session_ends_or_is_too_old() -> None:
    sessions = Sessions()
    token, other = sessions.begin(NOW_US), sessions.begin(NOW_US)
    assert token != other
    assert sessions.is_valid(token, NOW_US + LIFETIME_US - 1)
    assert not sessions.is_valid(token, NOW_US + LIFETIME_US)
    sessions.end(token)
    assert not sessions.is_valid(token, NOW_US)
    assert sessions.is_valid(other, NOW_US)


def test_what_is_no_token_opens_nothing() -> None:
    sessions = Sessions()
    sessions.begin(NOW_US)
    for text in ("", "guess", "\udcff", "ä" * 1000):
        assert not sessions.is_valid(text, NOW_US)
        sessions.end(text)


def test_sessions_are_bounded_and_the_oldest_gives_way() -> None:
    sessions = Sessions()
    tokens = [sessions.begin(NOW_US) for _ in range(MAX_SESSIONS + 1)]
    assert [sessions.is_valid(token, NOW_US) for token in tokens] == [False] + [True] * MAX_SESSIONS
