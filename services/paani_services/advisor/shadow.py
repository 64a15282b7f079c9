"""Parameters tried beside those in force, and the two steps that put them there. Pure.

The shadow sees the same evidence as the active policy and has its own memory; nothing it does reaches the advice.
Parameters change only while the operator's fresh word is that the boat is not armed: to move by other rules takes an
arming of its own. Nothing here outlives the process, so a restart is back at the configuration.
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

RECENT = 8
STILL = (Direction.STOP, Direction.NO_DATA)


class Parameters(msgspec.Struct, frozen=True):
    """The configuration with these changes; `proposal` is empty for the configuration itself."""

    proposal: str = ""
    changes: tuple[Change, ...] = ()


class Trial(msgspec.Struct, frozen=True):
    """What is tried, the memory of its own that it judges with, and how it has differed so far."""

    parameters: Parameters
    since_us: int
    state: AdvisorState
    frames: int = 0
    differing: int = 0
    moves_more: int = 0
    stops_more: int = 0
    recent: tuple[Disagreement, ...] = ()


class Answer(msgspec.Struct, frozen=True):
    """The last request that was heeded, and what came of it."""

    epoch: int = 0
    request: int = 0
    refusal: TuningRefusal = TuningRefusal.NONE
    path: str = ""


class TuningState(msgspec.Struct, frozen=True):
    """What is in force, what a rollback returns to, what is tried; `refused` counts since the start."""

    active: Parameters = Parameters()
    previous: Parameters | None = None
    trial: Trial | None = None
    answer: Answer = Answer()
    refused: int = 0


def tuned(config: Config, parameters: Parameters) -> Config:
    """The configuration to judge by; unchanged where it contradicts the changes, as other settings in a replay may."""
    if not parameters.changes:
        return config
    judged = _advisor_config(config, parameters.changes)
    return config if judged is None else msgspec.structs.replace(config, advisor=judged)


def heed(
    state: TuningState, memory: AdvisorState, request: Tuning | None, arming: Input, now_us: int, config: Config
) -> tuple[TuningState, AdvisorState]:
    """Obey or refuse a request that is new; also the memory that the active policy goes on with.

    A request is known by its epoch and number, so that its repeats do nothing. A promoted trial keeps its own memory.
    """
    if request is None or request.act is TuningAct.NONE or _is_known(state.answer, request):
        return state, memory
    refusal, path = _refusal(state, request, arming, now_us, config)
    answer = Answer(request.epoch, request.request, refusal, path)
    if refusal is not TuningRefusal.NONE:
        return msgspec.structs.replace(state, answer=answer, refused=state.refused + 1), memory
    state = msgspec.structs.replace(state, answer=answer)
    trial = state.trial
    if request.act is TuningAct.PROPOSE:
        proposed = Parameters(request.proposal, _merged(state.active.changes, request.changes))
        return msgspec.structs.replace(state, trial=Trial(proposed, now_us, memory)), memory
    if trial is not None and trial.parameters.proposal == request.proposal:
        if request.act is TuningAct.ROLLBACK:
            return msgspec.structs.replace(state, trial=None), memory
        promoted = msgspec.structs.replace(state, active=trial.parameters, previous=state.active, trial=None)
        return promoted, trial.state
    assert state.previous is not None
    return msgspec.structs.replace(state, active=state.previous, previous=None, trial=None), memory


def try_beside(
    state: TuningState,
    before: AdvisorState,
    after: AdvisorState,
    advisory: Advisory,
    evidence: Evidence | None,
    now_us: int,
    config: Config,
    odometry: Odometry | None = None,
) -> TuningState:
    """Let the trial judge the same evidence, and compare where the active policy took in a distinct frame.

    before, after: the active policy's memory around its own step, which gave `advisory`.
    """
    trial = state.trial
    if trial is None:
        return state
    memory, shadow, _ = advise(trial.state, evidence, now_us, tuned(config, trial.parameters), odometry)
    trial = msgspec.structs.replace(trial, state=memory)
    if after.evidence is not None and _frame(after.evidence) != _frame(before.evidence):
        trial = _compared(trial, advisory, shadow)
    return msgspec.structs.replace(state, trial=trial)


def report(state: TuningState, now_us: int, config: Config) -> Shadow:
    """The state of affairs, for the bus."""
    trial, answer = state.trial, state.answer
    said = Shadow(
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
        return said
    return msgspec.structs.replace(
        said,
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


def _is_known(answer: Answer, request: Tuning) -> bool:
    return (request.epoch, request.request) <= (answer.epoch, answer.request)


def _refusal(
    state: TuningState, request: Tuning, arming: Input, now_us: int, config: Config
) -> tuple[TuningRefusal, str]:
    """Why a request cannot be obeyed, with the setting at fault; NONE when it can."""
    if request.act is TuningAct.PROPOSE:
        return _unfit(_merged(state.active.changes, request.changes), request, config)
    limits, trial = config.advisor.tuning, state.trial
    tried = trial is not None and trial.parameters.proposal == request.proposal
    undoes = request.act is TuningAct.ROLLBACK and state.previous is not None
    in_force = undoes and state.active.proposal == request.proposal
    if (now_us - request.source_us) * 1e-6 > limits.max_request_age_s:
        return TuningRefusal.STALE_REQUEST, ""
    if not (tried or in_force):
        return TuningRefusal.NOT_CURRENT, ""
    if request.act is TuningAct.ROLLBACK and tried:
        return TuningRefusal.NONE, ""  # nothing in force changes
    if trial is not None and request.act is TuningAct.PROMOTE:
        if not 0.0 <= (now_us - trial.since_us) * 1e-6 <= limits.max_proposal_age_s:
            return TuningRefusal.STALE_PROPOSAL, ""
        if trial.frames < limits.min_frames:
            return TuningRefusal.TOO_FEW_FRAMES, ""
    if arming.message is None or (now_us - arming.received_us) * 1e-6 > keys.ARMING.fresh_s:
        return TuningRefusal.ARMING_UNKNOWN, ""
    return (TuningRefusal.ARMED if arming.message.armed else TuningRefusal.NONE), ""


def _unfit(merged: tuple[Change, ...], request: Tuning, config: Config) -> tuple[TuningRefusal, str]:
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


def _merged(before: tuple[Change, ...], after: tuple[Change, ...]) -> tuple[Change, ...]:
    """The later value of a setting replaces the earlier."""
    values = {change.path: change for change in (*before, *after)}
    return tuple(values[path] for path in sorted(values))


@functools.lru_cache(maxsize=8)
def _advisor_config(config: Config, changes: tuple[Change, ...]) -> AdvisorConfig | None:
    """None where the changes are out of range or contradict the rest."""
    try:
        return with_settings(config, [f"{change.path}={change.value}" for change in changes]).advisor
    except UserError:
        return None


def _compared(trial: Trial, active: Advisory, shadow: Advisory) -> Trial:
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
    active_still, shadow_still = active.direction in STILL, shadow.direction in STILL
    return msgspec.structs.replace(
        trial,
        differing=trial.differing + 1,
        moves_more=trial.moves_more + (active_still and not shadow_still),
        stops_more=trial.stops_more + (shadow_still and not active_still),
        recent=(*trial.recent, differs)[-RECENT:],
    )


def _frame(evidence: Evidence | None) -> tuple[int, int] | None:
    return None if evidence is None else (evidence.frame_epoch, evidence.frame_seq)
