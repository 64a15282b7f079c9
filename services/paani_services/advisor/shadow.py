"""Shadow tuning: proposed parameters run beside those in force, until an operator promotes them. Pure.

The shadow is a second advisor with its own state that is given the same evidence; nothing it decides reaches the
advisory. Parameters in force change only while a fresh arming message says that the boat is disarmed, so that moving by
other rules takes an arming of its own. No parameters outlive the process: a restart returns to the configuration.
"""

import functools

import msgspec

from paani import keys
from paani.config import AdvisorConfig, Config, with_settings
from paani.config.tuning import TUNABLE
from paani.decider import Input
from paani.errors import UserError
from paani.messages import (
    Advisory,
    Change,
    Direction,
    Disagreement,
    Evidence,
    Odometry,
    Shadow,
    Tuning,
    TuningAct,
    TuningRefusal,
)
from paani_services.advisor.advise import AdvisorState, advise

MAX_RECENT = 8  # disagreements that the report shows
STANDING_DIRECTIONS = (Direction.STOP, Direction.NO_DATA)


class ParameterSet(msgspec.Struct, frozen=True):
    """The configuration with some changes; `proposal` is empty for the configuration itself."""

    proposal: str = ""
    changes: tuple[Change, ...] = ()


class ShadowTrial(msgspec.Struct, frozen=True):
    """One proposal under trial: its parameters, its own advisor state, and its disagreements so far."""

    parameters: ParameterSet
    since_us: int
    state: AdvisorState
    frames: int = 0
    differing: int = 0
    moves_more: int = 0
    stops_more: int = 0
    recent: tuple[Disagreement, ...] = ()


class RequestResult(msgspec.Struct, frozen=True):
    """The last request that was handled, and its refusal if it was refused."""

    epoch: int = 0
    request: int = 0
    refusal: TuningRefusal = TuningRefusal.NONE
    path: str = ""


class TuningState(msgspec.Struct, frozen=True):
    """Parameters in force, those a rollback returns to, the proposal under trial; `refused` counts since the start."""

    active: ParameterSet = ParameterSet()
    previous: ParameterSet | None = None
    trial: ShadowTrial | None = None
    answer: RequestResult = RequestResult()
    refused: int = 0


def tuned_config(config: Config, parameters: ParameterSet) -> Config:
    """The configuration with the parameters applied; unchanged where both contradict, as in a replay with settings."""
    if not parameters.changes:
        return config
    judged = _advisor_config(config, parameters.changes)
    return config if judged is None else msgspec.structs.replace(config, advisor=judged)


def apply_request(
    state: TuningState, memory: AdvisorState, request: Tuning | None, arming: Input, now_us: int, config: Config
) -> tuple[TuningState, AdvisorState]:
    """Obey or refuse a new request; also returns the state that the active advisor continues with.

    A request is identified by its epoch and number, so that its repeats do nothing. A promoted trial keeps its state.
    """
    if request is None or request.act is TuningAct.NONE or _is_known(state.answer, request):
        return state, memory
    refusal, path = _check_request(state, request, arming, now_us, config)
    answer = RequestResult(request.epoch, request.request, refusal, path)
    if refusal is not TuningRefusal.NONE:
        return msgspec.structs.replace(state, answer=answer, refused=state.refused + 1), memory
    state = msgspec.structs.replace(state, answer=answer)
    trial = state.trial
    if request.act is TuningAct.PROPOSE:
        proposed = ParameterSet(request.proposal, _merge_changes(state.active.changes, request.changes))
        return msgspec.structs.replace(state, trial=ShadowTrial(proposed, now_us, memory)), memory
    if trial is not None and trial.parameters.proposal == request.proposal:
        if request.act is TuningAct.ROLLBACK:
            return msgspec.structs.replace(state, trial=None), memory
        promoted = msgspec.structs.replace(state, active=trial.parameters, previous=state.active, trial=None)
        return promoted, trial.state
    assert state.previous is not None
    return msgspec.structs.replace(state, active=state.previous, previous=None, trial=None), memory


def step_shadow(
    state: TuningState,
    before: AdvisorState,
    after: AdvisorState,
    advisory: Advisory,
    evidence: Evidence | None,
    now_us: int,
    config: Config,
    odometry: Odometry | None = None,
) -> TuningState:
    """Run the proposal under trial on the same evidence, and compare it where the active advisor took a new frame.

    before, after: the active advisor's state before and after its own step, which gave `advisory`.
    """
    trial = state.trial
    if trial is None:
        return state
    memory, shadow, _ = advise(trial.state, evidence, now_us, tuned_config(config, trial.parameters), odometry)
    trial = msgspec.structs.replace(trial, state=memory)
    if after.evidence is not None and _frame_id(after.evidence) != _frame_id(before.evidence):
        trial = _count_disagreement(trial, advisory, shadow)
    return msgspec.structs.replace(state, trial=trial)


def shadow_report(state: TuningState, now_us: int, config: Config) -> Shadow:
    """The state of the tuning as a message."""
    trial, answer = state.trial, state.answer
    message = Shadow(
        source_us=now_us,
        answered_epoch=answer.epoch,
        answered=answer.request,
        refusal=answer.refusal,
        refused_path=answer.path,
        refused=state.refused,
        active=state.active.proposal,
        active_changes=state.active.changes,
        previous=state.previous is not None,
        frames_needed=config.advisor.tuning.min_frames,
    )
    if trial is None:
        return message
    return msgspec.structs.replace(
        message,
        proposal=trial.parameters.proposal,
        changes=trial.parameters.changes,
        proposed_us=trial.since_us,
        frames=trial.frames,
        differing=trial.differing,
        differing_frac=trial.differing / trial.frames if trial.frames else 0.0,
        moves_more=trial.moves_more,
        stops_more=trial.stops_more,
        recent=trial.recent,
    )


def _is_known(answer: RequestResult, request: Tuning) -> bool:
    return (request.epoch, request.request) <= (answer.epoch, answer.request)


def _check_request(
    state: TuningState, request: Tuning, arming: Input, now_us: int, config: Config
) -> tuple[TuningRefusal, str]:
    """Why a request is refused, with the setting at fault; NONE where it is obeyed."""
    if request.act is TuningAct.PROPOSE:
        return _check_proposal(_merge_changes(state.active.changes, request.changes), request, config)
    limits, trial = config.advisor.tuning, state.trial
    is_trial = trial is not None and trial.parameters.proposal == request.proposal
    is_undo = request.act is TuningAct.ROLLBACK and state.previous is not None
    in_force = is_undo and state.active.proposal == request.proposal
    if (now_us - request.source_us) * 1e-6 > limits.max_request_age_s:
        return TuningRefusal.STALE_REQUEST, ""
    if not (is_trial or in_force):
        return TuningRefusal.NOT_CURRENT, ""
    if request.act is TuningAct.ROLLBACK and is_trial:
        return TuningRefusal.NONE, ""  # no parameter in force changes
    if trial is not None and request.act is TuningAct.PROMOTE:
        if not 0.0 <= (now_us - trial.since_us) * 1e-6 <= limits.max_proposal_age_s:
            return TuningRefusal.STALE_PROPOSAL, ""
        if trial.frames < limits.min_frames:
            return TuningRefusal.TOO_FEW_FRAMES, ""
    if arming.message is None or (now_us - arming.received_us) * 1e-6 > keys.ARMING.fresh_s:
        return TuningRefusal.ARMING_UNKNOWN, ""
    return (TuningRefusal.ARMED if arming.message.armed else TuningRefusal.NONE), ""


def _check_proposal(merged: tuple[Change, ...], request: Tuning, config: Config) -> tuple[TuningRefusal, str]:
    """Why a proposal is refused, with the setting at fault; NONE where it can be tried."""
    if not request.changes or not request.proposal:
        return TuningRefusal.EMPTY, ""
    paths = [change.path for change in request.changes]
    for i, path in enumerate(paths):
        if path not in TUNABLE:
            return TuningRefusal.NOT_TUNABLE, path
        if path in paths[:i]:
            return TuningRefusal.TWICE, path
    if _advisor_config(config, merged) is not None:
        return TuningRefusal.NONE, ""
    alone = (change.path for change in request.changes if _advisor_config(config, (change,)) is None)
    return TuningRefusal.INVALID_VALUE, next(alone, paths[0])


def _merge_changes(before: tuple[Change, ...], after: tuple[Change, ...]) -> tuple[Change, ...]:
    """Merge two lists of changes, sorted by path; the later value of a setting replaces the earlier."""
    values = {change.path: change for change in (*before, *after)}
    return tuple(values[path] for path in sorted(values))


@functools.lru_cache(maxsize=8)
def _advisor_config(config: Config, changes: tuple[Change, ...]) -> AdvisorConfig | None:
    """The advisor's settings with the changes; None where they are out of range or contradict the rest."""
    try:
        return with_settings(config, [f"{change.path}={change.value}" for change in changes]).advisor
    except UserError:
        return None


def _count_disagreement(trial: ShadowTrial, active: Advisory, shadow: Advisory) -> ShadowTrial:
    trial = msgspec.structs.replace(trial, frames=trial.frames + 1)
    if active.direction is shadow.direction:
        return trial
    differs = Disagreement(
        source_us=active.source_us,
        frame_seq=active.frame_seq,
        frame_epoch=active.frame_epoch,
        active_direction=active.direction,
        active_reason=active.reason,
        shadow_direction=shadow.direction,
        shadow_reason=shadow.reason,
    )
    active_still, shadow_still = active.direction in STANDING_DIRECTIONS, shadow.direction in STANDING_DIRECTIONS
    return msgspec.structs.replace(
        trial,
        differing=trial.differing + 1,
        moves_more=trial.moves_more + (active_still and not shadow_still),
        stops_more=trial.stops_more + (shadow_still and not active_still),
        recent=(*trial.recent, differs)[-MAX_RECENT:],
    )


def _frame_id(evidence: Evidence | None) -> tuple[int, int] | None:
    return None if evidence is None else (evidence.frame_epoch, evidence.frame_seq)
