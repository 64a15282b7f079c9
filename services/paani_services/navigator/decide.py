"""The navigator as a decider: advisory, evidence, odometry, clock, arming and its own mission in; one order out."""

from paani import keys
from paani.config import Config
from paani.decider import Decider, Inputs, Outputs
from paani.messages import Mission, Route
from paani_services.navigator.guidance.mission import route_alone
from paani_services.navigator.mapping.observed_cells import Camera
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
        evidence=inputs[keys.EVIDENCE.name].message,
    )
    camera = Camera(config.calibration, config.perception.ego_polygon)
    state, order = navigate(state, heard, _mission(inputs), now_us, config.bus.domain, config.navigator, camera)
    return state, {keys.COMMAND.name: order}


def _mission(inputs: Inputs) -> Mission | None:
    """The mission, or the route alone; None without either."""
    for topic in (keys.MISSION, keys.ROUTE):
        message = inputs[topic.name].message if topic.name in inputs else None
        if isinstance(message, Mission):
            return message
        if isinstance(message, Route):
            return route_alone(message)
    return None


DECIDER = Decider(
    service="navigator",
    state=NavState,
    inputs=(keys.ADVISORY, keys.EVIDENCE, keys.ODOMETRY, keys.SIM_TIME, keys.ARMING),
    own=(keys.ROUTE, keys.MISSION),
    outputs=(keys.COMMAND,),
    decide=decide,
)
