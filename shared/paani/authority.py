"""Who may do what on the bus: credentials, and the routers' access control from the table of keys.

Default deny. A service may write exactly the keys whose producer it is in the graph (`bus.graph`), and read everything
but the simulator's truth, which is for `TRUTH_READERS` alone. `OBSERVER` reads and never writes; the shore of a fleet
hears `topics_ashore` and nothing else, and may write its requests to the operator's process. A process without a place
in the graph has no credential there and is no subject: no simulator joins a hull (A7).
"""

from __future__ import annotations

import hashlib
import os
import secrets
import shutil
from pathlib import Path

from paani import keys
from paani.certificates import BOARD_ROUTER, LISTENERS, Identities, identities_of, listener_of, require_certificates
from paani.config import BusConfig
from paani.errors import UserError
from paani.link_access import LINK, Rule, allow, link_rules
from paani.runtime import runtime_dir, write_private
from paani.sides import ROUTER, Side, pictures_sent, writers_on

OBSERVER = "observer"
TRUTH_READERS = ("eye", "dashboard", "recorder", OBSERVER)
USERS_FILE = ".users"
EVERYBODY = frozenset({*keys.SERVICES, *keys.COMMAND_LINE_CLIENTS, OBSERVER, LINK, USERS_FILE})  # whatever the graph


def users_in(graph: keys.Graph) -> tuple[str, ...]:
    """Who may join the bus of this graph, on either side."""
    return (*keys.services_in(graph), *keys.command_line_clients_in(graph), OBSERVER, LINK)


def certified_in(graph: keys.Graph) -> tuple[str, ...]:
    """Who gets a certificate: every identity of the bus, and what listens on either machine."""
    return (*users_in(graph), *LISTENERS)


def uncertified_in(identities: Identities) -> tuple[str, ...]:
    """Identities of the graph that the folder holds no certificate for; whoever was revoked is none of them."""
    known = {*identities.holders, *identities.revoked}
    return tuple(name for name in certified_in(identities.graph) if name not in known)


def credentials_folder(config: BusConfig) -> Path:
    """Each graph has passwords of its own: those of a simulation open no hull."""
    simulated = config.graph is keys.Graph.SIMULATION
    return runtime_dir(config) / ("credentials" if simulated else f"credentials_{config.graph}")


def ensure_credentials(config: BusConfig) -> Path:
    """One random password file per user (0600), made at the first start, and for other users. Returns the folder.

    Board and host have the same: the board makes it. Raises UserError on a host that has not got it. With certificates
    (`bus.certificates`) nothing is made; raises UserError unless all that this side needs are there and in force.
    """
    if config.certificates:
        linking = (LINK,) if config.side is Side.HOST else ()
        own = (*writers_on(config.side, config.graph), OBSERVER, *linking)
        require_certificates(config, (*own, listener_of(config)))
        return Path(config.certificates)
    folder, users = credentials_folder(config), users_in(config.graph)
    try:
        known = EVERYBODY.intersection(path.name for path in folder.iterdir()) if folder.exists() else frozenset[str]()
        if known != {*users, USERS_FILE}:
            if config.side is Side.HOST:
                raise UserError(f"{folder}: not the board's credentials; copy there the folder that the board has made")
            _make_credentials(folder, users)
    except OSError as error:
        raise UserError(f"{folder}: {error.strerror}") from error
    return folder


def _make_credentials(folder: Path, users: tuple[str, ...]) -> None:
    """New passwords for everybody, in place of what is there. Raises OSError, and leaves nothing half made."""
    beside = folder.with_name(f".{folder.name}.{os.getpid()}")
    shutil.rmtree(beside, ignore_errors=True)
    try:
        beside.mkdir(mode=0o700)
        passwords = {user: secrets.token_urlsafe(24) for user in users}
        for user, password in passwords.items():
            write_private(beside / user, password)
        write_private(beside / USERS_FILE, "".join(f"{user}:{word}\n" for user, word in passwords.items()))
        if folder.exists():
            shutil.rmtree(folder)
        beside.rename(folder)
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def require_place(config: BusConfig, user: str) -> None:
    """Raises UserError for a process that has no place in the graph."""
    if user in keys.ABSENT[config.graph]:
        homes = " or ".join(graph.value for graph in keys.Graph if user not in keys.ABSENT[graph])
        raise UserError(f"bus.graph {config.graph}: {user} has no place in it, only in {homes}")


def password_of(config: BusConfig, user: str) -> str:
    """The user's password. Raises UserError naming the file."""
    require_place(config, user)
    path = credentials_folder(config) / user
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise UserError(f"{path}: {error.strerror} (credentials are made when the router first starts)") from error
    except UnicodeDecodeError as error:
        raise UserError(f"{path}: no password ({error.reason})") from error


def has_password(config: BusConfig, user: str) -> bool:
    """Whether this machine has the user's password of the graph."""
    return (credentials_folder(config) / user).is_file()


def board_router_id(config: BusConfig) -> str:
    """The Zenoh id by which the host knows the board's router; only the credential of the link tells it."""
    return "1" + hashlib.sha256(password_of(config, LINK).encode()).hexdigest()[:31]


def access_control(config: BusConfig) -> dict[str, object]:
    """Zenoh's `access_control` object for this vessel's router on this side."""
    prefix = f"paani/{config.domain}/{config.vessel}"
    topics, users = keys.topics_in(config.graph), (*writers_on(config.side, config.graph), OBSERVER)
    rules: list[Rule] = []
    policies: list[dict[str, object]] = []
    names = _names_of(config)
    users = tuple(user for user in users if user in names)
    subjects: list[dict[str, object]] = [{"id": user, **names[user]} for user in users]

    def rule(name: str, messages: list[str], flow: str, key_exprs: list[str]) -> str:
        rules.append(allow(name, messages, flow, key_exprs))
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
    heard_ashore = [f"{prefix}/{topic.name}" for topic in keys.topics_ashore(config.graph)]
    requests = [f"{prefix}/{keys.REQUESTS[keys.SHORE].name}"]
    ashore = [
        rule("hear-ashore", ["put"], "egress", heard_ashore),
        rule("subscribe-ashore", ["declare_subscriber"], "ingress", heard_ashore),
        rule("see-subscribers-ashore", ["declare_subscriber"], "egress", requests),
    ]
    for user in users:
        mine = list(ashore) if user == keys.SHORE else list(everyone) + (truth if user in TRUTH_READERS else [])
        if user != OBSERVER:
            written = [f"{prefix}/{name}" for name in written_at(config.side, user, config.graph)]
            mine.append(rule(f"write-{user}", ["put", "delete"], "ingress", written))
            if user not in keys.COMMAND_LINE_CLIENTS:
                mine.append(
                    rule(f"alive-{user}", ["liveliness_token"], "ingress", [f"{prefix}/{keys.alive_name(user)}"])
                )
            offered = [key for key in written if key in pictures]
            if offered:
                mine.append(rule(f"offer-{user}", ["declare_queryable", "reply"], "ingress", offered))
                mine.append(rule(f"asked-{user}", ["query"], "egress", offered))
        policies.append({"rules": mine, "subjects": [user]})
    if config.side is not Side.BOTH:
        crossing = link_rules(config.side, config.graph, prefix)
        rules += crossing
        known = _other_router(config, names)
        if known:
            policies.append({"rules": [each["id"] for each in crossing], "subjects": [LINK]})
            subjects.append({"id": LINK, **known})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def _names_of(config: BusConfig) -> dict[str, dict[str, list[str]]]:
    """By what a router knows each user; a user whose certificate was revoked is missing."""
    users = users_in(config.graph)
    if not config.certificates:
        return {user: {"usernames": [user]} for user in users}
    identities = identities_of(config)
    names = {user: identities.common_name(user) for user in users}
    return {user: {"cert_common_names": [name]} for user, name in names.items() if name}


def _other_router(config: BusConfig, names: dict[str, dict[str, list[str]]]) -> dict[str, list[str]]:
    """By what this side's router knows the other side's; empty where that was revoked."""
    if config.side is Side.BOARD:
        return names.get(LINK, {})
    if not config.certificates:
        return {"zids": [board_router_id(config)]}
    name = identities_of(config).common_name(BOARD_ROUTER)
    return {"cert_common_names": [name]} if name else {}


def written_at(side: Side, user: str, graph: keys.Graph) -> tuple[str, ...]:
    """Names of the topics that this user may write at the router of this side.

    The host's router hands out the board's pictures that it has pulled, as they are.
    """
    pulled = pictures_sent(Side.BOARD, graph) if side is Side.HOST and user == ROUTER else ()
    return (*written_by(user, graph), *(topic.name for topic in pulled))


def written_by(service: str, graph: keys.Graph) -> tuple[str, ...]:
    """Names of the topics that this user alone may write in this graph; none where it has no place."""
    if service in keys.ABSENT[graph]:
        return ()
    own = [topic.name for topic in keys.topics_in(graph) if topic.producer == service]
    if service in keys.COMMAND_LINE_CLIENTS:
        return tuple(own)
    return (*own, keys.pulse(service).name, keys.health(service).name)
