"""The advisor as a decider: evidence and the operator's tuning in; advisory, tracks and the shadow's report out."""

import msgspec

from paani import keys
from paani.config import Config
from paani.decider import Decider, Inputs, Outputs
from paani_services.advisor.advise import AdvisorState, advise
from paani_services.advisor.shadow import TuningState, apply_request, shadow_report, step_shadow, tuned_config


class DeciderState(msgspec.Struct, frozen=True):
    """The state of the advisor in force, and of the tuning beside it."""

    active: AdvisorState = AdvisorState()
    tuning: TuningState = TuningState()


def decide(state: DeciderState, inputs: Inputs, now_us: int, config: Config) -> tuple[DeciderState, Outputs]:
    """One step; see `advise`. The shadow never reaches the advisory."""
    evidence = inputs[keys.EVIDENCE.name].message
    request, arming = inputs[keys.TUNING.name].message, inputs[keys.ARMING.name]
    tuning, before = apply_request(state.tuning, state.active, request, arming, now_us, config)
    odometry = inputs[keys.ODOMETRY.name].message
    after, advisory, tracks = advise(before, evidence, now_us, tuned_config(config, tuning.active), odometry)
    tuning = step_shadow(tuning, before, after, advisory, evidence, now_us, config, odometry)
    return DeciderState(after, tuning), {
        keys.ADVISORY.name: advisory,
        keys.TRACKS.name: tracks,
        keys.SHADOW.name: shadow_report(tuning, now_us, config),
    }


DECIDER = Decider(
    service="advisor",
    state=DeciderState,
    inputs=(keys.EVIDENCE, keys.ODOMETRY, keys.TUNING, keys.ARMING),
    outputs=(keys.ADVISORY, keys.TRACKS, keys.SHADOW),
    decide=decide,
)
