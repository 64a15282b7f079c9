"""The advisor as a decider: evidence in; advisory and tracks out."""

from paani import keys
from paani.config import Config
from paani.decider import Decider, Inputs, Outputs
from paani_services.advisor.advise import AdvisorState, advise


def decide(state: AdvisorState, inputs: Inputs, now_us: int, config: Config) -> tuple[AdvisorState, Outputs]:
    """One step; see `advise`."""
    state, advisory, tracks = advise(state, inputs[keys.EVIDENCE.name].message, now_us, config)
    return state, {keys.ADVISORY.name: advisory, keys.TRACKS.name: tracks}


DECIDER = Decider(
    service="advisor",
    state=AdvisorState,
    inputs=(keys.EVIDENCE,),
    outputs=(keys.ADVISORY, keys.TRACKS),
    decide=decide,
)
