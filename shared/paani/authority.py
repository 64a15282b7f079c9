"""Who may do what on the bus: credentials, and the router's access control from the table of keys.

Default deny. A service may write exactly the keys whose producer it is, and read everything but the
simulator's truth, which is for `TRUTH_READERS` alone. `OBSERVER` reads and never writes.
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
USERS = (*keys.SERVICES, OBSERVER)
USERS_FILE = ".users"


def ensure_credentials(config: BusConfig) -> Path:
    """One random password file per user (0600), made at the first start. Returns the folder."""
    folder = runtime_dir(config) / "credentials"
    if not folder.is_dir() or any(not (folder / user).is_file() for user in USERS):
        beside = folder.with_name(f".credentials.{os.getpid()}")
        shutil.rmtree(beside, ignore_errors=True)
        beside.mkdir(mode=0o700)
        passwords = {user: secrets.token_urlsafe(24) for user in USERS}
        for user, password in passwords.items():
            write_private(beside / user, password)
        write_private(beside / USERS_FILE, "".join(f"{user}:{word}\n" for user, word in passwords.items()))
        shutil.rmtree(folder, ignore_errors=True)
        beside.rename(folder)
    return folder


def password_of(config: BusConfig, user: str) -> str:
    """The user's password. Raises UserError naming the file."""
    path = runtime_dir(config) / "credentials" / user
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise UserError(f"{path}: {error.strerror} (credentials are made when the router first starts)") from error


def access_control(config: BusConfig) -> dict[str, object]:
    """Zenoh's `access_control` object for this vessel's router."""
    prefix = f"paani/{config.domain}/{config.vessel}"
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
    pictures = [f"{prefix}/{topic.name}" for topic in keys.TOPICS if topic.stance is keys.Stance.PICTURE]
    everyone = [
        rule("hear", ["put", "delete"], "egress", [f"{prefix}/**"]),
        rule("subscribe", ["declare_subscriber"], "ingress", [f"{prefix}/**"]),
        rule("see-subscribers", ["declare_subscriber"], "egress", [f"{prefix}/**", f"{prefix}/@truth/**"]),
        rule("see-alive", ["liveliness_token"], "egress", [alive]),
        rule("ask-alive", ["liveliness_query", "declare_liveliness_subscriber"], "ingress", [alive]),
        rule("pull", ["query"], "ingress", pictures),
        rule("pulled", ["reply"], "egress", pictures),
        rule("see-queryables", ["declare_queryable"], "egress", pictures),
    ]
    truth = [
        rule("hear-truth", ["put"], "egress", [f"{prefix}/@truth/**"]),
        rule("subscribe-truth", ["declare_subscriber"], "ingress", [f"{prefix}/@truth/**"]),
    ]
    for user in USERS:
        mine = list(everyone) + (truth if user in TRUTH_READERS else [])
        if user != OBSERVER:
            written = [f"{prefix}/{name}" for name in written_by(user)]
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
        "subjects": [{"id": user, "usernames": [user]} for user in USERS],
        "policies": policies,
    }


def written_by(service: str) -> tuple[str, ...]:
    """Names of the topics that this service alone may write."""
    own = [topic.name for topic in keys.TOPICS if topic.producer == service]
    return (*own, keys.pulse(service).name, keys.health(service).name)
