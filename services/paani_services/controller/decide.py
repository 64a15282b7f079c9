"""The controller as a decider: command and odometry in, thrust out."""

from paani import keys
from paani.config import Config
from paani.decider import Decider, Inputs, Outputs
from paani_services.controller.control import ControlState, Heard, control


def decide(state: ControlState, inputs: Inputs, now_us: int, config: Config) -> tuple[ControlState, Outputs]:
    """One step; see `control`."""
    command, odometry = inputs[keys.COMMAND.name], inputs[keys.ODOMETRY.name]
    heard = Heard(command.message, command.received_us, odometry.message, odometry.received_us)
    state, thrust = control(state, heard, now_us, config.bus.domain, config.controller)
    return state, {keys.THRUST.name: thrust}


DECIDER = Decider(
    service="controller",
    state=ControlState,
    inputs=(keys.COMMAND, keys.ODOMETRY),
    outputs=(keys.THRUST,),
    decide=decide,
)
