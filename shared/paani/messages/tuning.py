"""Tuning the policy of a running boat: the operator's request, and the report on the shadow policy on trial."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import msgspec

from paani.messages.advisor import Direction, Reason
from paani.messages.header import Count, Message, Stamp, Text, Unit

ProposalId = Annotated[str, msgspec.Meta(pattern=r"^[a-z0-9]{0,32}$")]


class Change(msgspec.Struct, frozen=True, kw_only=True):
    """One setting: `advisor.policy.center_block_risk` and its value as text."""

    path: Annotated[str, msgspec.Meta(pattern=r"^[a-z0-9_.]{1,80}$")]
    value: Annotated[str, msgspec.Meta(pattern=r"^[A-Za-z0-9_.+-]{1,40}$")]


Changes = Annotated[tuple[Change, ...], msgspec.Meta(max_length=32)]


class TuningAct(StrEnum):
    """What the operator requests. NONE: nothing since the dashboard started."""

    NONE = "NONE"
    PROPOSE = "PROPOSE"
    PROMOTE = "PROMOTE"
    ROLLBACK = "ROLLBACK"


class Tuning(Message, frozen=True, kw_only=True):
    """The operator's last request, repeated for subscribers that join late; `source_us` is the time of the request.

    `request` counts within an epoch; each is obeyed once. `proposal` is the one proposed, promoted or rolled back.
    """

    act: TuningAct = TuningAct.NONE
    request: Count = 0
    proposal: ProposalId = ""
    changes: Changes = ()


class TuningProposal(Message, frozen=True, kw_only=True):
    """Changes that a client of the page asks to be tried beside those in force, and nothing else can be asked by it.

    proposal: the client's name, and what tells it from the client's others.
    """

    proposal: Annotated[str, msgspec.Meta(pattern=r"^[a-z0-9]{1,32}$")]
    changes: Annotated[tuple[Change, ...], msgspec.Meta(min_length=1, max_length=32)]


class TuningRefusal(StrEnum):
    """Why a request was refused; NONE when it was obeyed."""

    NONE = "NONE"
    EMPTY = "EMPTY"
    NOT_TUNABLE = "NOT_TUNABLE"
    TWICE = "TWICE"
    INVALID_VALUE = "INVALID_VALUE"
    NOT_CURRENT = "NOT_CURRENT"
    STALE_REQUEST = "STALE_REQUEST"
    STALE_PROPOSAL = "STALE_PROPOSAL"
    TOO_FEW_FRAMES = "TOO_FEW_FRAMES"
    ARMED = "ARMED"
    ARMING_UNKNOWN = "ARMING_UNKNOWN"


class Disagreement(msgspec.Struct, frozen=True, kw_only=True):
    """One distinct frame on which the two policies advise differently."""

    source_us: Stamp
    frame_seq: Count
    frame_epoch: Count
    active_direction: Direction
    active_reason: Reason
    shadow_direction: Direction
    shadow_reason: Reason


class Shadow(Message, frozen=True, kw_only=True):
    """The policy in force, the shadow policy on trial, and where their advice differs. Only the active one is obeyed.

    active: the proposal in force, empty for the configured parameters; `previous` says whether it can be rolled back.
    proposal: the one on trial, empty for none. Counts are of distinct frames since it was proposed:
    `moves_more`, the shadow advises motion where the active policy does not; `stops_more`, the reverse.
    recent: the last disagreements, oldest first.
    """

    answered_epoch: Count = 0
    answered: Count = 0
    refusal: TuningRefusal = TuningRefusal.NONE
    refused_path: Text = ""
    refused: Count = 0
    active: ProposalId = ""
    active_changes: tuple[Change, ...] = ()
    previous: bool = False
    proposal: ProposalId = ""
    changes: tuple[Change, ...] = ()
    proposed_us: Stamp = 0
    frames: Count = 0
    frames_needed: Count = 0
    differing: Count = 0
    differing_frac: Unit = 0.0
    moves_more: Count = 0
    stops_more: Count = 0
    recent: tuple[Disagreement, ...] = ()
