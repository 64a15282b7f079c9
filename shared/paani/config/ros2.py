"""Settings of the ROS 2 port."""

from __future__ import annotations

from typing import Annotated

import msgspec

from paani.config.section import Positive, Section
from paani.port_address import is_loopback, tcp_address

TCP = "tcp/"


class Ros2Config(Section, frozen=True):
    """`listen`: where ROS nodes connect (rmw_zenoh), tcp/HOST:PORT. Whoever reaches it may listen, and stop the boat.

    `domain_id`: their ROS_DOMAIN_ID. `frame_prefix`: before the name of every frame, for several boats in one graph.
    `accept_commands`: whether they may also ask for modes, steer in MANUAL and send goals; of this machine alone, since
    ROS knows nobody by name. `full_turn_radps`: `angular.z` of `cmd_vel` at which the helm is hard over; `linear.x` is
    full at `navigator.cruise_mps`.
    """

    listen: str = "tcp/127.0.0.1:7449"  # beside `bus.router`, which has the port that rmw_zenoh looks at by itself
    domain_id: Annotated[int, msgspec.Meta(ge=0, le=232)] = 43  # A6
    accept_commands: bool = False
    full_turn_radps: Positive = 0.35  # Q5: the planner's turn rate
    frame_prefix: Annotated[str, msgspec.Meta(pattern="^[A-Za-z0-9_/]{0,64}$")] = ""

    def __post_init__(self) -> None:
        """The address can be parsed."""
        if not self.listen.startswith(TCP):
            raise ValueError(f"listen '{self.listen}': expected tcp/HOST:PORT")
        host, _ = tcp_address(self.listen.removeprefix(TCP))
        if self.accept_commands and not is_loopback(host):
            raise ValueError(f"accept_commands: not where other machines reach listen '{self.listen}'")


def require_ros_name(vessel: str) -> None:
    """Raises ValueError for a vessel whose name no topic of ROS can contain."""
    if vessel[:1].isdigit():
        raise ValueError(f"bus.vessel '{vessel}' begins with a digit, which no ROS 2 name may")
