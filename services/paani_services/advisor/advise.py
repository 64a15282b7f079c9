"""The advisor's one entry: state and evidence in, state and advice out. Pure: no clock, no bus, no logging."""

import msgspec

from paani.config import Config
from paani.geometry import clip
from paani.messages import (
    Advisory,
    ChangedBy,
    Counterfactual,
    Direction,
    Evidence,
    Odometry,
    Reason,
    Tracks,
    UnusableCause,
)
from paani_services.advisor.counterfactual import counterfactual
from paani_services.advisor.explanation import explain
from paani_services.advisor.policy import Decision, PolicyState, decide, side_block_risk
from paani_services.advisor.risk import LANES, components, obstacles_of, water_of
from paani_services.advisor.tracker import TrackerState, hear, is_sound, published, update

MAX_AGE_S = 1e6
ONLY_NEW_EVIDENCE = Counterfactual(changed_by=ChangedBy.NEW_EVIDENCE)
NOTHING_JUDGED = Decision(Direction.NO_DATA, Reason.NO_EVIDENCE, counterfactual=ONLY_NEW_EVIDENCE)


class AdvisorState(msgspec.Struct, frozen=True):
    """Everything between two calls. `evidence` is the last distinct frame that was digested."""

    tracker: TrackerState = TrackerState()
    policy: PolicyState = PolicyState()
    evidence: Evidence | None = None
    decision: Decision | None = None


def advise(
    state: AdvisorState, evidence: Evidence | None, now_us: int, config: Config, odometry: Odometry | None = None
) -> tuple[AdvisorState, Advisory, Tracks]:
    """Advise a direction; called for each new evidence and again to republish.

    now_us: time on the clock that stamped `evidence.source_us`. A frame already digested, or one older than it in
    the same epoch, counts as no frame: the last decision is given again, dated by its own evidence, and turns into
    STOP once that is too old. Unusable, malformed or future evidence advises STOP, whatever else is known; NO_DATA
    is for having had no evidence at all. Odometry tells how the boat turned between frames; it moves no risk down.
    Never raises.
    """
    state = msgspec.structs.replace(state, tracker=hear(state.tracker, odometry))
    future = False
    if evidence is not None and _is_new(state, evidence):
        future = (now_us - evidence.source_us) * 1e-6 < -config.advisor.max_future_s
        if not future:
            state = _digest(state, evidence, config)
    known = evidence if future else state.evidence
    if known is None:
        advisory = Advisory(
            source_us=now_us,
            direction=Direction.NO_DATA,
            reason=Reason.NO_EVIDENCE,
            counterfactual=ONLY_NEW_EVIDENCE,
        )
        tracks = Tracks(source_us=now_us, frame_seq=0, frame_epoch=0)
    else:
        decision = (
            _stopped(NOTHING_JUDGED, Reason.FUTURE_EVIDENCE) if future else _fresh_decision(state, now_us, config)
        )
        tracks = published(state.tracker, known, config.advisor)
        advisory = _advisory(decision, known, now_us, config)
    return state, msgspec.structs.replace(advisory, explanation=explain(advisory, tracks.tracks)), tracks


def stale_at_us(state: AdvisorState, config: Config) -> int | None:
    """When the evidence in hand becomes too old; None before there is any."""
    if state.evidence is None:
        return None
    return state.evidence.source_us + round(config.advisor.evidence_max_age_s * 1e6) + 1


def _is_new(state: AdvisorState, evidence: Evidence) -> bool:
    last = state.evidence
    return last is None or evidence.frame_epoch != last.frame_epoch or evidence.frame_seq > last.frame_seq


def _digest(state: AdvisorState, evidence: Evidence, config: Config) -> AdvisorState:
    """Take in one distinct frame."""
    fits = is_well_formed(evidence)
    tracker = update(state.tracker, evidence, config)
    policy = state.policy
    if evidence.usable and fits:
        water = {lane: water_of(evidence, lane, config) for lane in LANES}
        obstacles = obstacles_of(tracker, config, evidence.width_px / max(1, evidence.height_px), water)
        lanes = {lane: components(water[lane], obstacles, lane, config) for lane in LANES}
        policy, decision = decide(state.policy, lanes, obstacles, config)
        why = counterfactual(state.policy, decision, water, obstacles, config)
        decision = msgspec.structs.replace(decision, counterfactual=why)
    else:
        policy = msgspec.structs.replace(policy, clear_frames=0)  # no clear frame
        decision = _stopped(NOTHING_JUDGED, Reason.MALFORMED_EVIDENCE if evidence.usable else Reason.UNUSABLE_IMAGE)
    return AdvisorState(tracker, policy, evidence, decision)


def is_well_formed(evidence: Evidence) -> bool:
    """Every fraction is one and every box has an area. NaN fails each comparison."""
    lanes = (evidence.left, evidence.center, evidence.right)
    return all(
        0.0 <= value <= 1.0 for lane in lanes for value in (lane.non_water, lane.uncertainty, lane.clear_width)
    ) and all(map(is_sound, evidence.detections))


def _fresh_decision(state: AdvisorState, now_us: int, config: Config) -> Decision:
    assert state.evidence is not None
    assert state.decision is not None
    age_s = (now_us - state.evidence.source_us) * 1e-6
    if age_s > config.advisor.evidence_max_age_s:
        return _stopped(state.decision, Reason.STALE_EVIDENCE)
    if age_s < -config.advisor.max_future_s:
        return _stopped(state.decision, Reason.FUTURE_EVIDENCE)
    return state.decision


def _stopped(decision: Decision, reason: Reason) -> Decision:
    return msgspec.structs.replace(decision, direction=Direction.STOP, reason=reason, counterfactual=ONLY_NEW_EVIDENCE)


def _advisory(decision: Decision, evidence: Evidence, now_us: int, config: Config) -> Advisory:
    lanes = (decision.left, decision.center, decision.right)
    return Advisory(
        source_us=evidence.source_us,
        direction=decision.direction,
        reason=decision.reason,
        cause=evidence.cause if decision.reason is Reason.UNUSABLE_IMAGE else UnusableCause.NONE,
        left=decision.left,
        center=decision.center,
        right=decision.right,
        center_block_risk=config.advisor.policy.center_block_risk,
        side_block_risk=side_block_risk(config),
        contributing_track_ids=tuple(sorted({i for lane in lanes for i in lane.track_ids})),
        evidence_age_s=clip((now_us - evidence.source_us) * 1e-6, -MAX_AGE_S, MAX_AGE_S),
        lifetime_s=config.advisor.lifetime_s,
        frame_seq=evidence.frame_seq,
        frame_epoch=evidence.frame_epoch,
        evidence_sent_us=evidence.sent_us,
        counterfactual=decision.counterfactual,
    )
