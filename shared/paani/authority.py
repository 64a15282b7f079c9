"""Who may do what on the bus: credentials, and the router's access control from the table of keys.

Default deny. A service may write exactly the keys whose producer it is in the graph (`bus.graph`), and read everything
but the simulator's truth, which is for `TRUTH_READERS` alone. `OBSERVER` reads and never writes. A process without a
place in the graph has no credential there and is no subject: no simulator joins a hull (A7).
"""

from __future__ import annotations

import os
import secrets
import shutil
from pathlib import Path

from paani import keys
from paani.config import BusConfig
from paani.errors import UserError
from paani.runtime import runtime_dir, write_private

OBSERVER = "observer"
TRUTH_READERS = ("eye", "dashboard", "recorder", OBSERVER)
USERS_FILE = ".users"


def users_in(graph: keys.Graph) -> tuple[str, ...]:
    """Who may join the bus of this graph."""
    return (*keys.services_in(graph), OBSERVER)


def credentials_folder(config: BusConfig) -> Path:
    """Each graph has passwords of its own: those of a simulation open no hull."""
    simulated = config.graph is keys.Graph.SIMULATION
    return runtime_dir(config) / ("credentials" if simulated else f"credentials_{config.graph}")


def ensure_credentials(config: BusConfig) -> Path:
    """One random password file per user (0600), made at the first start. Returns the folder."""
    folder, users = credentials_folder(config), users_in(config.graph)
    if not folder.is_dir() or {path.name for path in folder.iterdir()} != {*users, USERS_FILE}:
        beside = folder.with_name(f".{folder.name}.{os.getpid()}")
        shutil.rmtree(beside, ignore_errors=True)
        beside.mkdir(mode=0o700)
        passwords = {user: secrets.token_urlsafe(24) for user in users}
        for user, password in passwords.items():
            write_private(beside / user, password)
        write_private(beside / USERS_FILE, "".join(f"{user}:{word}\n" for user, word in passwords.items()))
        shutil.rmtree(folder, ignore_errors=True)
        beside.rename(folder)
    return folder


def require_place(config: BusConfig, user: str) -> None:
    """Raises UserError for a process that has no place in the graph."""
    if user in keys.ABSENT[config.graph]:
        homes = " or ".join(graph.value for graph in keys.Graph if user in keys.services_in(graph))
        raise UserError(f"bus.graph {config.graph}: {user} has no place in it, only in {homes}")


def password_of(config: BusConfig, user: str) -> str:
    """The user's password. Raises UserError naming the file."""
    require_place(config, user)
    path = credentials_folder(config) / user
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise UserError(f"{path}: {error.strerror} (credentials are made when the router first starts)") from error


def access_control(config: BusConfig) -> dict[str, object]:
    """Zenoh's `access_control` object for this vessel's router."""
    prefix = f"paani/{config.domain}/{config.vessel}"
    topics, users = keys.topics_in(config.graph), users_in(config.graph)
    rules: list[dict[str, object]] = []
    policies: list[dict[str, object]] = []

    def rule(name: str, messages: list[str], flow: str, key_exprs: list[str]) -> str:
        rules.append(
            {
                "id": name,
                "messages": messages,
                "flows": [flow],
                "permission": "allow",
                "key_exprs": key_exprs,
            }
        )
        return name

    alive = f"{prefix}/@alive/*"
    pictures = [f"{prefix}/{topic.name}" for topic in topics if topic.stance is keys.Stance.PICTURE]
    truth_keys = [f"{prefix}/@truth/**"] if any(topic.name.startswith("@truth/") for topic in topics) else []
    everyone = [
        rule("hear", ["put", "delete"], "egress", [f"{prefix}/**"]),
        rule("subscribe", ["declare_subscriber"], "ingress", [f"{prefix}/**"]),
        rule("see-subscribers", ["declare_subscriber"], "egress", [f"{prefix}/**", *truth_keys]),
        rule("see-alive", ["liveliness_token"], "egress", [alive]),
        rule("ask-alive", ["liveliness_query", "declare_liveliness_subscriber"], "ingress", [alive]),
        rule("pull", ["query"], "ingress", pictures),
        rule("pulled", ["reply"], "egress", pictures),
        rule("see-queryables", ["declare_queryable"], "egress", pictures),
    ]
    truth = []
    if truth_keys:
        truth = [
            rule("hear-truth", ["put"], "egress", truth_keys),
            rule("subscribe-truth", ["declare_subscriber"], "ingress", truth_keys),
        ]
    for user in users:
        mine = list(everyone) + (truth if user in TRUTH_READERS else [])
        if user != OBSERVER:
            written = [f"{prefix}/{name}" for name in written_by(user, config.graph)]
            mine.append(rule(f"write-{user}", ["put", "delete"], "ingress", written))
            mine.append(rule(f"alive-{user}", ["liveliness_token"], "ingress", [f"{prefix}/{keys.alive_name(user)}"]))
            offered = [key for key in written if key in pictures]
            if offered:
                mine.append(rule(f"offer-{user}", ["declare_queryable", "reply"], "ingress", offered))
                mine.append(rule(f"asked-{user}", ["query"], "egress", offered))
        policies.append({"rules": mine, "subjects": [user]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": user, "usernames": [user]} for user in users],
        "policies": policies,
    }


def written_by(service: str, graph: keys.Graph) -> tuple[str, ...]:
    """Names of the topics that this service alone may write in this graph; none where it has no place."""
    if service in keys.ABSENT[graph]:
        return ()
    own = [topic.name for topic in keys.topics_in(graph) if topic.producer == service]
    return (*own, keys.pulse(service).name, keys.health(service).name)
