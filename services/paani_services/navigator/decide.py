"""The navigator as a decider: advisory, odometry, clock, arming and its own route in; one order out."""

from paani import keys
from paani.config import Config
from paani.decider import Decider, Inputs, Outputs
from paani_services.navigator.navigate import Heard, NavState, navigate


def decide(state: NavState, inputs: Inputs, now_us: int, config: Config) -> tuple[NavState, Outputs]:
    """One step; see `navigate`."""
    advisory, odometry = inputs[keys.ADVISORY.name], inputs[keys.ODOMETRY.name]
    clock, arming = inputs[keys.SIM_TIME.name], inputs[keys.ARMING.name]
    heard = Heard(
        advisory=advisory.message,
        advisory_us=advisory.received_us,
        odometry=odometry.message,
        odometry_us=odometry.received_us,
        clock=clock.message,
        clock_us=clock.received_us,
        arming=arming.message,
        arming_us=arming.received_us,
    )
    route = inputs[keys.ROUTE.name].message if keys.ROUTE.name in inputs else None
    state, order = navigate(state, heard, route, now_us, config.bus.domain, config.navigator)
    return state, {keys.COMMAND.name: order}


DECIDER = Decider(
    service="navigator",
    state=NavState,
    inputs=(keys.ADVISORY, keys.ODOMETRY, keys.SIM_TIME, keys.ARMING),
    own=(keys.ROUTE,),
    outputs=(keys.COMMAND,),
    decide=decide,
)
