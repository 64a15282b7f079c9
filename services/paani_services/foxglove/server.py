"""The WebSocket server that viewers connect to. Needs the extra `foxglove`; nothing else imports its SDK."""

from __future__ import annotations

import collections
import logging
import threading
from collections.abc import Mapping

import foxglove
from foxglove.websocket import Capability, Client, Parameter, ServerListener

from paani.config import FoxgloveConfig
from paani.errors import UserError
from paani_services.foxglove.channels import Channel
from paani_services.foxglove.parameters import Value

SDK_LOG = logging.getLogger("foxglove")
CLIENT_LOG = "foxglove.websocket.connected_client"
PREFIX = "FoxgloveError: "


class Refusals(logging.Handler):
    """Counts what viewers asked for in vain. The SDK's threads add to it, the process takes it."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self._counts: collections.Counter[str] = collections.Counter()
        self._counts_lock = threading.Lock()

    def add(self, cause: str) -> None:
        with self._counts_lock:
            self._counts[cause] += 1

    def take(self) -> collections.Counter[str]:
        """The counts since the last time."""
        with self._counts_lock:
            taken, self._counts = self._counts, collections.Counter()
        return taken

    def emit(self, record: logging.LogRecord) -> None:
        """The SDK answers a message that it does not take with the protocol's error, and says so in its log alone."""
        self.add("viewer_message_refused")


class ReadOnlyParameters(ServerListener):  # type: ignore[misc]  # the SDK's types are not checked
    """Answers from what was there at the start. Called on threads of the SDK, so it returns at once."""

    def __init__(self, values: Mapping[str, Value], refusals: Refusals) -> None:
        self._parameters = {name: Parameter(name, value=value) for name, value in values.items()}
        self._refusals = refusals

    def on_get_parameters(
        self, client: Client, param_names: list[str], request_id: str | None = None
    ) -> list[Parameter]:
        """Those asked for, or all; a name that there is not gets no value."""
        if not param_names:
            return list(self._parameters.values())
        return [self._parameters[name] for name in param_names if name in self._parameters]

    def on_set_parameters(
        self, client: Client, parameters: list[Parameter], request_id: str | None = None
    ) -> list[Parameter]:
        """Nothing is set: the answer holds the values as they are."""
        self._refusals.add("viewer_set_refused")
        return [self._parameters[each.name] for each in parameters if each.name in self._parameters]


class ViewerServer:
    """Channels and who watches them. It offers viewers no way to publish, to call or to set anything."""

    def __init__(
        self,
        config: FoxgloveConfig,
        name: str,
        offered: Mapping[str, Channel],
        values: Mapping[str, Value],
        tls_pem: bytes | None = None,
    ) -> None:
        """Serves until `stop`. Raises UserError naming the address, or the certificate.

        tls_pem: what `foxglove.tls_pem` holds, certificate and key; None: not encrypted.
        """
        self.refusals = Refusals()
        logging.getLogger(CLIENT_LOG).addHandler(self.refusals)
        logging.getLogger(CLIENT_LOG).propagate = False
        foxglove.set_log_level("WARNING")
        self._context = context = foxglove.Context()  # its channels are gone with it
        self._channels = {
            topic: foxglove.Channel(
                topic,
                message_encoding=each.encoding,
                schema=foxglove.Schema(name=each.kind, encoding=each.language, data=each.schema),
                context=context,
            )
            for topic, each in offered.items()
        }
        try:
            self._server = foxglove.start_server(
                name=name, host=config.host, port=config.port, capabilities=[Capability.Parameters],
                server_listener=ReadOnlyParameters(values, self.refusals), context=context,
                message_backlog_size=config.backlog_messages, tls_cert=tls_pem, tls_key=tls_pem,
            )  # fmt: skip
        except RuntimeError as error:
            is_pem = "TLS" in str(error)
            where = f"tls_pem {config.tls_pem}" if is_pem else f"host, foxglove.port {config.host}:{config.port}"
            raise UserError(f"foxglove.{where}: {str(error).removeprefix(PREFIX)}") from error

    def is_watched(self, topic: str) -> bool:
        """Whether a viewer has asked for this channel."""
        return bool(self._channels[topic].has_sinks())

    @property
    def watched(self) -> int:
        """Channels that a viewer has asked for."""
        return sum(channel.has_sinks() for channel in self._channels.values())

    def send(self, topic: str, data: bytes, now_us: int) -> None:
        """To each viewer that asked for the channel; queued, never waited for."""
        self._channels[topic].log(data, log_time=now_us * 1000)

    def stop(self) -> None:
        """Disconnect everybody. It waits for the SDK's threads."""
        self._server.stop()
        logging.getLogger(CLIENT_LOG).removeHandler(self.refusals)
