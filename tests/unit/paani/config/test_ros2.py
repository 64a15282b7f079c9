"""Settings of the ROS 2 port that cannot be, refused before anything begins."""

from __future__ import annotations

import pytest

from paani.config import load_config
from paani.errors import UserError


@pytest.mark.parametrize(
    ("setting", "named"),
    [
        ("ros2.listen=127.0.0.1:7449", "ros2.*listen"),
        ("ros2.listen=tcp/127.0.0.1", "ros2.*HOST:PORT"),
        ("ros2.listen=tcp/127.0.0.1:port", "ros2.*HOST:PORT"),
        ("ros2.domain_id=233", "ros2.domain_id"),
        ("ros2.frame_prefix=o-", "ros2.frame_prefix"),
    ],
)
def test_a_setting_that_cannot_be_is_named(setting: str, named: str) -> None:
    with pytest.raises(UserError, match=named):
        load_config(sets=(setting,))


def test_commands_are_for_this_machine_alone() -> None:
    """ROS knows nobody by name: whoever reaches the port could steer."""
    assert not load_config().ros2.accept_commands
    load_config(sets=("ros2.accept_commands=true",))
    with pytest.raises(UserError, match=r"accept_commands.*other machines"):
        load_config(sets=("ros2.listen=tcp/0.0.0.0:7449", "ros2.accept_commands=true"))


def test_a_vessel_that_ros_cannot_name_has_no_port_to_it() -> None:
    load_config(sets=("bus.vessel=3otter",))
    with pytest.raises(UserError, match=r"bus\.vessel '3otter' begins with a digit"):
        load_config(sets=("bus.vessel=3otter", 'up.ports=["ros2"]'))


def test_the_port_listens_beside_the_bus() -> None:
    config = load_config()
    assert config.ros2.listen != config.bus.router
