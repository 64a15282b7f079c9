"""Settings of the MAVLink port."""

from __future__ import annotations

from typing import Annotated

import msgspec

from paani.config.section import Section
from paani.port_address import tcp_address

MAX_ADDRESSES = 8


class MavlinkConfig(Section, frozen=True):
    """`udp`: addresses at which ground stations listen, HOST:PORT with commas between them; they get a heartbeat until
    they answer. `tcp`: where ground stations connect, HOST:PORT. Either may be empty. `signing_key_file`: a file, for
    its owner alone, with the passphrase that signs every frame; then nothing is obeyed that is not signed by it.
    Without one, only this machine may command. `video`: where players watch the camera by RTSP, HOST:PORT, or empty;
    whoever reaches it may.
    """

    udp: str = "127.0.0.1:14540,127.0.0.1:14550"  # where MAVSDK and QGroundControl listen unless told otherwise
    tcp: str = ""  # ArduPilot's is port 5760
    video: str = ""  # RTSP's is port 8554
    # By TCP, and players; one more is let go at once, unless one of them has been silent.
    max_clients: Annotated[int, msgspec.Meta(ge=1, le=16)] = 4
    signing_key_file: str = ""
    # A boat that was armed from here is stopped when no station that may command has been heard for so long: five
    # heartbeats of a station, as ArduPilot's FS_GCS_TIMEOUT.
    link_loss_s: Annotated[float, msgspec.Meta(ge=1.0, le=60.0)] = 5.0

    @property
    def udp_addresses(self) -> tuple[tuple[str, int], ...]:
        """Host and port of each. Raises ValueError, in one line."""
        return tuple(tcp_address(address.strip()) for address in self.udp.split(",") if address.strip())

    def __post_init__(self) -> None:
        """The addresses can be parsed."""
        if len(self.udp_addresses) > MAX_ADDRESSES:
            raise ValueError(f"mavlink.udp: more than {MAX_ADDRESSES} addresses")
        for address in (self.tcp, self.video):
            if address:
                tcp_address(address)
