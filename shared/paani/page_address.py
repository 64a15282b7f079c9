"""Where the page is served, and how whoever asks it reaches it. Nothing is opened here."""

from __future__ import annotations

from paani.config import Config
from paani.port_address import is_loopback

LOGIN_PATH = "/login"
ANYWHERE = {"0.0.0.0": "127.0.0.1", "::": "::1"}  # what listens everywhere is asked at home


def is_page_exposed(config: Config) -> bool:
    """Whether other machines reach the page: it is then encrypted, and asks for the operator's key first."""
    page = config.dashboard
    return page.serve and "dashboard" in config.services and not (is_loopback(page.host) or page.behind_loopback)


def page_host(config: Config) -> str:
    """The address at which a program of this machine asks the page."""
    return ANYWHERE.get(config.dashboard.host, config.dashboard.host)


def page_origin(config: Config) -> str:
    """Scheme, host and port, as a browser on this machine names it."""
    host = page_host(config)
    scheme = "https" if is_page_exposed(config) else "http"
    return f"{scheme}://{f'[{host}]' if ':' in host else host}:{config.dashboard.port}"
