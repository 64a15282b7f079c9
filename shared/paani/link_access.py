"""What may cross the link between a boat's board and its host: that part of the routers' access control.

Both routers check it. The board's knows the host by the user `LINK`. The host's, which made the connection, is told no
user by the board; it knows it by its Zenoh id, which the board's router is given for this and nobody else can tell.
Only keys that the other side's processes may write come in, only this side's go out, each by its exact name. Pictures
are not pushed: the host asks for them and offers them as a client of the board's router, on a connection of its own.
"""

from __future__ import annotations

from paani import keys
from paani.sides import ROUTER, Side, pictures_sent, services_on, topics_sent

LINK = "link"
Rule = dict[str, object]


def allow(name: str, messages: list[str], flow: str, key_exprs: list[str]) -> Rule:
    """One rule of Zenoh's access control."""
    return {"id": name, "messages": messages, "flows": [flow], "permission": "allow", "key_exprs": key_exprs}


def link_rules(side: Side, graph: keys.Graph, prefix: str) -> list[Rule]:
    """What the other side, as this side's router knows it, may write, hear and ask for."""

    def sent_by(origin: Side) -> tuple[list[str], list[str], list[str]]:
        topics = topics_sent(origin, graph)
        tokens = [keys.alive_name(name) for name in services_on(origin, graph) if name != ROUTER]
        return (
            [f"{prefix}/{topic.name}" for topic in topics if topic.stance is not keys.Stance.PICTURE],
            [f"{prefix}/{topic.name}" for topic in pictures_sent(origin, graph)],
            [f"{prefix}/{token}" for token in tokens],
        )

    (mine, my_pictures, my_tokens), (theirs, their_pictures, their_tokens) = sent_by(side), sent_by(side.other)
    alive = [f"{prefix}/{keys.alive_name('*')}"]
    asks = ["liveliness_query", "declare_liveliness_subscriber"]
    rules = [
        allow("link-write", ["put", "delete"], "ingress", theirs),
        allow("link-hear", ["put", "delete"], "egress", mine),
        allow("link-subscribe", ["declare_subscriber"], "ingress", mine),
        allow("link-see-subscribers", ["declare_subscriber"], "egress", theirs),
        allow("link-alive", ["liveliness_token"], "ingress", their_tokens),
        allow("link-see-alive", ["liveliness_token"], "egress", my_tokens),
        allow("link-asked-alive", asks, "ingress", alive),
        allow("link-ask-alive", asks, "egress", alive),
    ]
    if side is Side.BOARD:
        rules += [
            allow("link-pull", ["query"], "ingress", my_pictures),
            allow("link-pulled", ["reply"], "egress", my_pictures),
            allow("link-see-queryables", ["declare_queryable"], "egress", my_pictures),
            allow("link-offer", ["declare_queryable", "reply"], "ingress", their_pictures),
            allow("link-asked", ["query"], "egress", their_pictures),
        ]
    return [rule for rule in rules if rule["key_exprs"]]
