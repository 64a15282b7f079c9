"""The table of keys as people read it."""

from __future__ import annotations

import pytest

from paani import keys
from paani.errors import UserError
from paani_tools.inspect.command import Arrivals
from paani_tools.inspect.topic_table import topic_named, topics_markdown, topics_text


def test_markdown_has_a_row_for_each_topic() -> None:
    lines = topics_markdown().splitlines()
    assert len(lines) == 2 + len(keys.TOPICS)
    assert len({line.count("|") for line in lines}) == 1
    assert all(f"| `{topic.name}` |" in topics_markdown() for topic in keys.TOPICS)


def test_live_rates_are_a_column_of_their_own() -> None:
    live = {topic.name: 4.25 for topic in keys.TOPICS}
    assert topics_text(live).count("4.2") >= len(keys.TOPICS)
    assert "now [Hz]" not in topics_text(None)


def test_topics_are_found_by_name_and_mistakes_are_told() -> None:
    assert topic_named("advisor/advisory") is keys.ADVISORY
    assert topic_named("health/plant").producer == "plant"
    with pytest.raises(UserError, match="advisor/advisory"):
        topic_named("advisor/advisery")


def test_arrivals_state_mean_and_spread() -> None:
    arrivals = Arrivals()
    assert arrivals.text(5e3, 5.0) == "0 messages (nominal 5 Hz)"
    arrivals.add(0.0)
    assert arrivals.text(100.0, 5.0) == "1 messages (nominal 5 Hz)"
    for at_ms in (100.0, 300.0):
        arrivals.add(at_ms)
    assert arrivals.text(500.0, 5.0) == "6.67 Hz (nominal 5 Hz), gaps 100 to 200 ms, 3 messages"


def test_a_topic_that_fell_silent_has_no_rate_of_before() -> None:
    arrivals = Arrivals()
    for at_ms in (0.0, 100.0, 200.0):
        arrivals.add(at_ms)
    silent = "1.00 Hz (nominal 10 Hz), gaps 100 to 100 ms, 3 messages, silent for 1.8 s"
    assert arrivals.text(2e3, 10.0) == silent
    arrivals.add(2e3)
    assert arrivals.text(2e3, 10.0) == "1.50 Hz (nominal 10 Hz), gaps 100 to 1800 ms, 4 messages"
