"""One step of the advisor: state and evidence in; state, advisory and tracks out. Pure."""

import msgspec

from paani.config import Config
from paani.geometry import clip
from paani.messages import (
    Advisory,
    Candidate,
    ChangedBy,
    Counterfactual,
    Detection,
    Direction,
    Evidence,
    Odometry,
    Purpose,
    Reason,
    Tracks,
    UnusableCause,
)
from paani_services.advisor.candidates import candidate_obstacles
from paani_services.advisor.counterfactual import find_counterfactual
from paani_services.advisor.explanation import explain_advisory
from paani_services.advisor.frame_facts import FrameFacts, PolicyState, frame_facts, side_block_risk
from paani_services.advisor.people import (
    may_keep_station,
    may_keep_station_unseen,
    nearest_ahead_m,
    nobody_near_s,
    speed_limit_mps,
)
from paani_services.advisor.policy import Decision, advised_purpose, decide, frame_components
from paani_services.advisor.risk import ALL_EVIDENCE, LANES, Obstacle, lane_water, obstacles_from_tracks, people_aside
from paani_services.advisor.tracker import (
    TrackerState,
    is_valid_box,
    remember_attitude,
    tracks_message,
    update_tracks,
)

MAX_AGE_S = 1e6  # bound of the advisory's `evidence_age_s`
NEEDS_NEW_EVIDENCE = Counterfactual(changed_by=ChangedBy.NEW_EVIDENCE)
NO_DECISION = Decision(Direction.NO_DATA, Reason.NO_EVIDENCE, counterfactual=NEEDS_NEW_EVIDENCE)


class AdvisorState(msgspec.Struct, frozen=True):
    """What one call leaves for the next. `evidence` is the last distinct frame that was processed.

    station_until_us: until when what the last usable picture showed allows to keep the station.
    """

    tracker: TrackerState = TrackerState()
    policy: PolicyState = PolicyState()
    evidence: Evidence | None = None
    decision: Decision | None = None
    station_until_us: int = 0


def advise(
    state: AdvisorState, evidence: Evidence | None, now_us: int, config: Config, odometry: Odometry | None = None
) -> tuple[AdvisorState, Advisory, Tracks]:
    """Advise a direction; called for each new evidence and again to republish.

    now_us: time on the clock that stamped `evidence.source_us`. A frame already processed, or an older one of the same
    epoch, is no new frame: the last decision is given again with the stamp of its own evidence, and becomes STOP once
    that is too old. Unusable, malformed or future evidence advises STOP, whatever else is known; NO_DATA means that
    there has been no evidence at all. Odometry tells how the boat turned between frames; it lowers no risk.
    Never raises.
    """
    state = msgspec.structs.replace(state, tracker=remember_attitude(state.tracker, odometry))
    future = False
    if evidence is not None and _is_new(state, evidence):
        future = (now_us - evidence.source_us) * 1e-6 < -config.advisor.max_future_s
        if not future:
            state = _process_frame(state, evidence, config)
    known = evidence if future else state.evidence
    if known is None:
        advisory = Advisory(
            source_us=now_us,
            direction=Direction.NO_DATA,
            reason=Reason.NO_EVIDENCE,
            counterfactual=NEEDS_NEW_EVIDENCE,
            purpose=Purpose.PASS,
        )
        tracks = Tracks(source_us=now_us, frame_seq=0, frame_epoch=0)
    else:
        decision = _stop_for(NO_DECISION, Reason.FUTURE_EVIDENCE) if future else _decision_at(state, now_us, config)
        tracks = tracks_message(state.tracker, known, config.advisor)
        advisory = _advisory_message(decision, known, now_us, config)
    return state, msgspec.structs.replace(advisory, explanation=explain_advisory(advisory, tracks.tracks)), tracks


def evidence_expiry_us(state: AdvisorState, config: Config) -> int | None:
    """The time at which the last evidence becomes too old; None before there is any."""
    if state.evidence is None:
        return None
    return state.evidence.source_us + round(config.advisor.evidence_max_age_s * 1e6) + 1


def _is_new(state: AdvisorState, evidence: Evidence) -> bool:
    last = state.evidence
    return last is None or evidence.frame_epoch != last.frame_epoch or evidence.frame_seq > last.frame_seq


def _process_frame(state: AdvisorState, evidence: Evidence, config: Config) -> AdvisorState:
    """Track and judge one distinct frame."""
    fits = is_well_formed(evidence)
    tracker = update_tracks(state.tracker, evidence, config)
    policy, station_until_us = state.policy, 0
    if evidence.usable and fits:
        water = {lane: lane_water(evidence, lane, config) for lane in LANES}
        obstacles = obstacles_from_tracks(
            tracker, config, evidence.width_px / max(1, evidence.height_px), water, evidence.water_edge
        )
        obstacles += candidate_obstacles(evidence, tracker, config)
        aside = people_aside(tracker, evidence.width_px / max(1, evidence.height_px), config)
        facts = frame_facts(state.policy, water, obstacles, config, aside)
        policy, decision = decide(state.policy, facts, frame_components(facts, ALL_EVIDENCE, config), config)
        decision = msgspec.structs.replace(decision, counterfactual=find_counterfactual(facts, decision, config))
        decision = _add_people(decision, facts, aside, config)
        station_until_us = evidence.source_us + round(nobody_near_s((*facts.obstacles, *aside), config) * 1e6)
    else:
        policy = msgspec.structs.replace(policy, clear_frames=0)  # an unusable frame interrupts a run of clear ones
        decision = _stop_for(NO_DECISION, Reason.MALFORMED_EVIDENCE if evidence.usable else Reason.UNUSABLE_IMAGE)
        if fits and _remembers_station(state, evidence, tracker, config):
            station_until_us = state.station_until_us
            decision = msgspec.structs.replace(decision, may_keep_station=True)
    return AdvisorState(tracker, policy, evidence, decision, station_until_us)


def _remembers_station(state: AdvisorState, evidence: Evidence, tracker: TrackerState, config: Config) -> bool:
    """Whether the station may be kept in an unusable picture that was looked at for people, by what was seen before."""
    last = state.evidence
    if last is None or evidence.frame_epoch != last.frame_epoch or evidence.source_us < last.source_us:
        return False
    if evidence.candidates is msgspec.UNSET:
        return False
    candidates = candidate_obstacles(evidence, tracker, config)
    return may_keep_station_unseen(evidence.cause, state.station_until_us, evidence.source_us, candidates, config)


def _add_people(decision: Decision, facts: FrameFacts, aside: tuple[Obstacle, ...], config: Config) -> Decision:
    """The decision with who is ahead and how fast the boat may go; the same decision where nobody is near.

    aside: people whom the boat has turned away from.
    """
    limit_mps, ahead = speed_limit_mps(facts.obstacles, config), facts.lanes["center"].people
    people = [i for i in ahead if facts.obstacles[i].candidate is None]
    candidates = tuple(n for i in ahead if (n := facts.obstacles[i].candidate) is not None)
    distance_m = nearest_ahead_m(facts.obstacles, people or ahead)
    return msgspec.structs.replace(
        decision,
        speed_limit_mps=msgspec.UNSET if limit_mps is None else limit_mps,
        people_ahead=tuple(facts.obstacles[i].id for i in people) if config.advisor.people.use else msgspec.UNSET,
        candidates_ahead=candidates or msgspec.UNSET,
        person_distance_m=msgspec.UNSET if distance_m is None else distance_m,
        may_keep_station=may_keep_station(decision.reason, (*facts.obstacles, *aside), config) or msgspec.UNSET,
    )


def is_well_formed(evidence: Evidence) -> bool:
    """Whether the picture has a size, every fraction lies in [0, 1] and every box has an area.

    NaN fails each comparison.
    """
    lanes = (evidence.left, evidence.center, evidence.right)
    boxed: tuple[Detection | Candidate, ...] = (*evidence.detections, *(evidence.candidates or ()))
    fractions = [value for lane in lanes for value in (lane.non_water, lane.uncertainty, lane.clear_width)]
    fractions += [lane.open_width for lane in lanes if not isinstance(lane.open_width, msgspec.UnsetType)]
    fractions += evidence.water_edge
    has_size = evidence.width_px > 0 and evidence.height_px > 0
    return has_size and all(0.0 <= value <= 1.0 for value in fractions) and all(map(is_valid_box, boxed))


def _decision_at(state: AdvisorState, now_us: int, config: Config) -> Decision:
    assert state.evidence is not None
    assert state.decision is not None
    age_s = (now_us - state.evidence.source_us) * 1e-6
    if age_s > config.advisor.evidence_max_age_s:
        return _stop_for(state.decision, Reason.STALE_EVIDENCE)
    if age_s < -config.advisor.max_future_s:
        return _stop_for(state.decision, Reason.FUTURE_EVIDENCE)
    return state.decision


def _stop_for(decision: Decision, reason: Reason) -> Decision:
    return msgspec.structs.replace(
        decision,
        direction=Direction.STOP,
        reason=reason,
        counterfactual=NEEDS_NEW_EVIDENCE,
        may_keep_station=msgspec.UNSET,
    )


def _advisory_message(decision: Decision, evidence: Evidence, now_us: int, config: Config) -> Advisory:
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
        purpose=advised_purpose(decision),
        speed_limit_mps=decision.speed_limit_mps,
        people_ahead=decision.people_ahead,
        person_distance_m=decision.person_distance_m,
        candidates_ahead=decision.candidates_ahead,
        may_keep_station=decision.may_keep_station,
    )
