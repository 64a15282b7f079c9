"""Settings of the port for Foxglove and Lichtblick."""

from __future__ import annotations

from typing import Annotated

import msgspec

from paani.config.section import Section
from paani.port_address import is_loopback

TcpPort = Annotated[int, msgspec.Meta(ge=1, le=65535)]


class FoxgloveConfig(Section, frozen=True):
    """Where viewers connect, and the certificate shown to them.

    `tls_pem`: a PEM file with a certificate, its chain, and its private key (PKCS #8); empty: not encrypted. The
    protocol knows no password: whoever reaches the address sees everything but the simulator's truth, and nobody can
    change anything.
    """

    host: str = "127.0.0.1"  # this machine alone
    port: TcpPort = 8765  # where viewers look first
    tls_pem: str = ""
    # Lets other machines look on unencrypted: for a container, of which the port published to loopback is the one door.
    open_to_network: bool = False
    # Messages that wait for one viewer; beyond it the oldest go. At 8, a viewer that stalls for 1.5 s is disconnected.
    backlog_messages: Annotated[int, msgspec.Meta(ge=16, le=10_000)] = 256

    def __post_init__(self) -> None:
        """What leaves this machine is encrypted, unless `open_to_network` says that it need not be."""
        if not self.tls_pem and not self.open_to_network and not is_loopback(self.host):
            raise ValueError(
                f"host {self.host}: other machines reach it, and viewers need no password; set tls_pem before it, or"
                " keep 127.0.0.1"
            )
