"""A connection of a program on this machine to the page's server."""

from __future__ import annotations

import http.client

from paani.certificates import page_client_tls
from paani.config import Config
from paani.page_address import is_page_exposed, page_host


def connect_to_page(config: Config, timeout_s: float) -> http.client.HTTPConnection:
    """Encrypted where the page is, and then only to a server whose certificate holds. Raises UserError."""
    host, port = page_host(config), config.dashboard.port
    if is_page_exposed(config):
        return http.client.HTTPSConnection(host, port, timeout=timeout_s, context=page_client_tls(config.bus))
    return http.client.HTTPConnection(host, port, timeout=timeout_s)
