"""`paani tune` and the dashboard's part in it: what is said, and mistakes found before anything is asked."""

from __future__ import annotations

import msgspec
import pytest

from paani import messages as m
from paani.cli import main as paani
from paani.config import load_config
from paani.errors import UserError
from paani.tuning_refusals import REFUSED, refusal_text
from paani_services.dashboard.requests import BadRequestError, decode_body
from paani_services.dashboard.tuning import ProposalRequest, ProposeRequest, describe_change, is_answer
from paani_tools.tune.command import changes_from
from paani_tools.tune.shadow_text import status_text
from tests.conftest import find_free_port

CONFIG = load_config()
LOWER = m.Change(path="advisor.policy.center_block_risk", value="0.46")
FOUND = m.Disagreement(
    source_us=1, frame_seq=3, frame_epoch=7, active_direction=m.Direction.STRAIGHT,
    active_reason=m.Reason.CENTER_CLEAR, shadow_direction=m.Direction.LEFT, shadow_reason=m.Reason.CENTER_RISK,
)  # fmt: skip
TRIED = m.Shadow(
    source_us=0, epoch=1, answered_epoch=5, answered=3, proposal="7f3a", changes=(LOWER,), frames=40, frames_needed=50,
    differing=4, differing_frac=0.1, stops_more=1, recent=(FOUND,),
)  # fmt: skip


@pytest.mark.parametrize(
    ("settings", "field"),
    [
        (["advisor.policy.center_block_risk=1.5"], "advisor.policy.center_block_risk"),
        (["advisor.policy.center_block_risk=nan"], "advisor.policy.center_block_risk"),
        (["advisor.policy.center_block_risk=high"], "advisor.policy.center_block_risk"),
        (["advisor.policy.center_block_risk"], "advisor.policy.center_block_risk"),
        (["advisor.policy.center_block_risk="], "advisor.policy.center_block_risk"),
        (["advisor.policy.center_block=0.4"], "advisor.policy.center_block"),
        (["advisor.policy.core_left=0.6"], "advisor.policy.core_left"),
        (["advisor.policy.tie=0.1", "advisor.policy.tie=0.2"], "advisor.policy.tie"),
        (["advisor.policy.tie=0.1 # more"], "advisor.policy.tie"),
        (["perception.rate_hz=3"], "perception.rate_hz"),
        (["advisor.evidence_max_age_s=60"], "advisor.evidence_max_age_s"),
    ],
)
def test_a_mistake_is_named_before_anybody_is_asked(
    settings: list[str], field: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert paani(["tune", "propose", *settings]) == 2
    errors = capsys.readouterr().err
    assert errors.count("\n") == 1
    assert field in errors


def test_changes() -> None:
    both = ["advisor.policy.core_left=0.6", " advisor.policy.core_right = 0.7 "]
    assert [(c.path[15:], c.value) for c in changes_from(both, CONFIG)] == [("core_left", "0.6"), ("core_right", "0.7")]
    with pytest.raises(UserError, match="center_block_risk"):
        changes_from(["advisor.policy.center_block=0.4"], CONFIG)  # names the nearest


@pytest.mark.parametrize("words", [["status"], ["promote", "7f3a"], ["propose", "advisor.policy.tie=0.1"]])
def test_no_dashboard_is_one_line(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    port = find_free_port()
    assert paani(["tune", *words, "--set", f"dashboard.port={port}"]) == 2
    errors = capsys.readouterr().err
    assert errors.count("\n") == 1
    assert f"http://127.0.0.1:{port}" in errors


def test_status() -> None:
    assert status_text(m.Shadow(source_us=0), CONFIG.advisor) == "in force  the configuration\ntried     nothing\n"
    promoted = msgspec.structs.replace(TRIED, active="00aa", active_changes=(LOWER,), refused=2)
    text = status_text(promoted, CONFIG.advisor)
    assert text.splitlines() == [
        "in force  00aa",
        "          advisor.policy.center_block_risk 0.48 -> 0.46",
        "tried     7f3a, on 40 frames (promotion needs 50)",
        "          advisor.policy.center_block_risk 0.48 -> 0.46",
        "differs   on 4 frames (10.0%): would move where the boat now stops on 0, would stop where it now moves on 1",
        "          frame 3: STRAIGHT (CENTER_CLEAR), tried: LEFT (CENTER_RISK)",
        "refused   2 requests since the advisor started",
    ]


def test_every_refusal_has_words() -> None:
    assert set(REFUSED) == set(m.TuningRefusal)
    few = msgspec.structs.replace(TRIED, refusal=m.TuningRefusal.TOO_FEW_FRAMES)
    assert refusal_text(few) == "tried on too few frames (40 of 50)"
    unfit = msgspec.structs.replace(TRIED, refusal=m.TuningRefusal.NOT_TUNABLE, refused_path="a.b")
    assert refusal_text(unfit).startswith("a.b: not a setting")


def test_an_answer_is_to_this_request() -> None:
    asked = m.Tuning(source_us=0, epoch=5, request=3)
    assert is_answer(TRIED, asked)
    assert not is_answer(None, asked)
    assert not is_answer(TRIED, msgspec.structs.replace(asked, request=4))
    assert not is_answer(TRIED, msgspec.structs.replace(asked, epoch=6))


@pytest.mark.parametrize(
    ("before", "now", "text"),
    [
        (None, {}, None),
        ({}, {}, None),
        ({}, {"proposal": "b"}, "tried beside: b"),
        ({"proposal": "b"}, {"active": "b"}, "in force: b"),
        ({"active": "b"}, {}, "in force: the configuration"),
        ({"active": "b"}, {"epoch": 2}, "the advisor restarted: back at its configuration, b is forgotten"),
        ({"proposal": "b"}, {"proposal": "b", "epoch": 2}, None),
        (None, {"active": "b"}, "in force: b"),
    ],
)
def test_what_changes_is_told(before: dict[str, object] | None, now: dict[str, object], text: str | None) -> None:
    plain = m.Shadow(source_us=0, epoch=1)
    was = None if before is None else msgspec.structs.replace(plain, **before)
    event = describe_change(was, msgspec.structs.replace(plain, **now), 9)
    assert (event.text if event else None) == text


@pytest.mark.parametrize(
    ("body", "kind"),
    [
        (b'{"changes":[]}', ProposeRequest),
        (b'{"changes":[{"path":"a"}]}', ProposeRequest),
        (b'{"changes":[{"path":"a","value":"1\\n2"}]}', ProposeRequest),
        (b'{"changes":[],"force":true}', ProposeRequest),
        (b'{"proposal":""}', ProposalRequest),
        (b'{"proposal":"../x"}', ProposalRequest),
        (b"\xff", ProposalRequest),
    ],
)
def test_a_request_is_whole(body: bytes, kind: type[ProposeRequest | ProposalRequest]) -> None:
    with pytest.raises(BadRequestError):
        decode_body(body, kind)
