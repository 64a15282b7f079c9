"""The advisor as a decider: evidence and the operator's tuning in; advisory, tracks and the shadow's report out."""

import msgspec

from paani import keys
from paani.config import Config
from paani.decider import Decider, Inputs, Outputs
from paani_services.advisor.advise import AdvisorState, advise
from paani_services.advisor.shadow import TuningState, heed, report, try_beside, tuned


class DeciderState(msgspec.Struct, frozen=True):
    """The memory of the policy in force, and what is tried beside it."""

    active: AdvisorState = AdvisorState()
    tuning: TuningState = TuningState()


def decide(state: DeciderState, inputs: Inputs, now_us: int, config: Config) -> tuple[DeciderState, Outputs]:
    """One step; see `advise`. What is tried never reaches the advisory."""
    evidence = inputs[keys.EVIDENCE.name].message
    request, arming = inputs[keys.TUNING.name].message, inputs[keys.ARMING.name]
    tuning, before = heed(state.tuning, state.active, request, arming, now_us, config)
    odometry = inputs[keys.ODOMETRY.name].message
    after, advisory, tracks = advise(before, evidence, now_us, tuned(config, tuning.active), odometry)
    tuning = try_beside(tuning, before, after, advisory, evidence, now_us, config, odometry)
    return DeciderState(after, tuning), {
        keys.ADVISORY.name: advisory,
        keys.TRACKS.name: tracks,
        keys.SHADOW.name: report(tuning, now_us, config),
    }


DECIDER = Decider(
    service="advisor",
    state=DeciderState,
    inputs=(keys.EVIDENCE, keys.ODOMETRY, keys.TUNING, keys.ARMING),
    outputs=(keys.ADVISORY, keys.TRACKS, keys.SHADOW),
    decide=decide,
)
