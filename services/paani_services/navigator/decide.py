"""The navigator as a decider: what it heard, the mode ordered, and its own mission in; one order out."""

import functools

import msgspec

from paani import keys
from paani.config import Config
from paani.decider import Decider, Inputs, Outputs
from paani.messages import Mission, Route
from paani.missions import mission_of_route
from paani.motion_planning import MotionPlanner
from paani_services.navigator.interlocks import NavigatorInputs
from paani_services.navigator.mapping.observed_cells import Camera
from paani_services.navigator.modes import follow_order
from paani_services.navigator.navigate import NavigatorState


def decide(
    state: NavigatorState, inputs: Inputs, now_us: int, config: Config, planner: MotionPlanner | None = None
) -> tuple[NavigatorState, Outputs]:
    """One step; see `follow_order`."""
    advisory, odometry = inputs[keys.ADVISORY.name], inputs[keys.ODOMETRY.name]
    clock, arming = inputs[keys.SIM_TIME.name], inputs[keys.ARMING.name]
    ordered = inputs[keys.OPERATOR_ORDER.name]
    navigator_inputs = NavigatorInputs(
        advisory=advisory.message,
        advisory_us=advisory.received_us,
        odometry=odometry.message,
        odometry_us=odometry.received_us,
        clock=clock.message,
        clock_us=clock.received_us,
        arming=arming.message,
        arming_us=arming.received_us,
        evidence=inputs[keys.EVIDENCE.name].message,
        tracks=inputs[keys.TRACKS.name].message,
        order=ordered.message,
        order_us=ordered.received_us,
        ais=inputs[keys.AIS.name].message,
        scan=inputs[keys.SCAN.name].message,
        depth=inputs[keys.DEPTH.name].message,
    )
    camera = Camera(config.calibration, config.perception.ego_polygon)
    state, command = follow_order(
        state, navigator_inputs, _mission(inputs), now_us, config.bus.domain, config.navigator, camera, planner
    )
    return state, {keys.COMMAND.name: command}


def _mission(inputs: Inputs) -> Mission | None:
    """The mission, or one made of the route alone; None without either."""
    for topic in (keys.MISSION, keys.ROUTE):
        message = inputs[topic.name].message if topic.name in inputs else None
        if isinstance(message, Mission):
            return message
        if isinstance(message, Route):
            return mission_of_route(message)
    return None


def _with_planner(planner: MotionPlanner) -> Decider[NavigatorState]:
    return msgspec.structs.replace(DECIDER, decide=functools.partial(decide, planner=planner))


DECIDER = Decider(
    service="navigator",
    state=NavigatorState,
    inputs=(
        keys.ADVISORY,
        keys.TRACKS,
        keys.EVIDENCE,
        keys.ODOMETRY,
        keys.SIM_TIME,
        keys.ARMING,
        keys.OPERATOR_ORDER,
        keys.AIS,
        keys.SCAN,
        keys.DEPTH,
    ),
    own=(keys.ROUTE, keys.MISSION),
    outputs=(keys.COMMAND,),
    decide=decide,
    with_planner=_with_planner,
)
