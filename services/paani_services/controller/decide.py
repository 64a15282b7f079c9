"""The controller as a decider: order and odometry in, thrust out."""

from paani import keys
from paani.config import Config
from paani.decider import Decider, Inputs, Outputs
from paani_services.controller.control import ControllerInputs, ControllerState, compute_thrust


def decide(state: ControllerState, inputs: Inputs, now_us: int, config: Config) -> tuple[ControllerState, Outputs]:
    """One step; see `compute_thrust`."""
    command, odometry = inputs[keys.COMMAND.name], inputs[keys.ODOMETRY.name]
    controller_inputs = ControllerInputs(command.message, command.received_us, odometry.message, odometry.received_us)
    state, thrust = compute_thrust(state, controller_inputs, now_us, config.bus.domain, config.controller)
    return state, {keys.THRUST.name: thrust}


DECIDER = Decider(
    service="controller",
    state=ControllerState,
    inputs=(keys.COMMAND, keys.ODOMETRY),
    outputs=(keys.THRUST,),
    decide=decide,
)
