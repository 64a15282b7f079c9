"""Prints the authority matrix of deploy/README.md: every identity tries everything on every key, at a real router.

python -m tests.integration.authority_matrix [--graph GRAPH] [--certificates]
"""

from __future__ import annotations

import argparse
import contextlib
import sys
import tempfile
import threading
from collections import Counter, defaultdict
from collections.abc import Iterator, Sized
from pathlib import Path
from typing import Any, NamedTuple

import zenoh

from paani import keys
from paani.authority import OBSERVER, TRUTH_READERS, users_in
from paani.bus.routing import router_config
from paani.bus.session import client_config
from paani.clock import WallClock
from paani.config import BusConfig
from paani.keys import SHORE, Graph, Stance
from paani.link_access import LINK
from paani_tools.certs.folder import make
from tests.conftest import find_free_port

SETTLE_S = 2.5  # in which a router on a busy machine knows of what was declared
ANSWER_S = 6.0
QUIET_S = 1.0
WILDCARDS = ("**", "paani/**", "paani/*/*/**", "{prefix}/**", "{prefix}/*/*", "{prefix}/@truth/*", "{prefix}/@truth/**")


class Matrix(NamedTuple):
    """What was tried, and what came of it. Keys are names below the vessel's prefix.

    heard: by reader and key, who was heard with what. stray: what came by a key that is no topic's. answers: by asker
    and key, who answered. tokens: what an observer saw alive, forged and then own.
    """

    graph: Graph
    users: tuple[str, ...]
    names: tuple[str, ...]
    heard: dict[tuple[str, str], set[tuple[str, str]]]
    stray: list[tuple[str, str]]
    answers: dict[tuple[str, str], set[str]]
    wide_answers: int
    forged_tokens: set[str]
    own_tokens: set[str]


def try_everything(config: BusConfig) -> Matrix:
    """Every identity of the graph at a router of its own, in this process."""
    users, topics = users_in(config.graph), keys.every_topic(config.graph)
    trial = _Trial(config, tuple(topic.name for topic in topics))
    with contextlib.ExitStack() as stack:
        stack.enter_context(_closing(zenoh.open(router_config(config))))
        sessions = {user: stack.enter_context(_closing(zenoh.open(client_config(config, user)))) for user in users}
        heard, stray = trial.write(sessions)
        answers, wide_answers = trial.ask(sessions)
        forged, own = trial.claim_alive(sessions)
    return Matrix(config.graph, users, trial.names, heard, stray, answers, wide_answers, forged, own)


def expected_heard(graph: Graph, reader: str, topic: keys.Topic[Any]) -> set[tuple[str, str]]:
    """By the table of keys alone: a topic's producer, and the simulator's truth for its readers only."""
    if reader in {LINK, topic.producer}:
        return set()
    if reader == SHORE:
        return {(topic.producer, "put")} if topic in keys.topics_ashore(graph) else set()
    if topic.name.startswith("@truth/"):
        return {(topic.producer, "put")} if reader in TRUTH_READERS else set()
    return {(topic.producer, "put"), (topic.producer, "delete")}


def expected_answers(asker: str, topic: keys.Topic[Any]) -> set[str]:
    """By the table of keys alone: only pictures are asked for, and only their producer answers."""
    if asker in {LINK, SHORE, topic.producer} or topic.stance is not Stance.PICTURE:
        return set()
    return {topic.producer}


class _Trial:
    def __init__(self, config: BusConfig, names: tuple[str, ...]) -> None:
        self.names = names
        self._prefix = f"paani/{config.domain}/{config.vessel}"

    def write(
        self, sessions: dict[str, zenoh.Session]
    ) -> tuple[dict[tuple[str, str], set[tuple[str, str]]], list[tuple[str, str]]]:
        """Everybody subscribes to every key and to everything, then puts and deletes every key, wildcards too."""
        samples: list[tuple[str, str, str, str]] = []
        subscribers = []
        for reader, session in sessions.items():

            def receive(sample: zenoh.Sample, reader: str = reader) -> None:
                attachment = sample.attachment.to_string() if sample.attachment is not None else "?"
                samples.append(
                    (
                        reader,
                        str(sample.key_expr),
                        attachment,
                        "put" if sample.kind == zenoh.SampleKind.PUT else "delete",
                    )
                )

            wide = [f"{self._prefix}/**", f"{self._prefix}/@truth/**", "**"]
            for key in (*self._keys(), *wide):
                callback = zenoh.handlers.Callback(receive, indirect=False)
                subscribers.append(session.declare_subscriber(key, callback))
        _wait(SETTLE_S)
        options: dict[str, Any] = {
            "allowed_destination": zenoh.Locality.REMOTE,
            "congestion_control": zenoh.CongestionControl.BLOCK,
        }
        wildcards = [word.format(prefix=self._prefix) for word in WILDCARDS]
        for writer, session in sessions.items():
            for key in (*wildcards, *self._keys()):
                session.put(key, b"tried", attachment=writer, **options)
                session.delete(key, attachment=writer, **options)
        _wait_until_quiet(samples)
        for subscriber in subscribers:
            subscriber.undeclare()  # type: ignore[no-untyped-call]  # zenoh's stubs
        heard: dict[tuple[str, str], set[tuple[str, str]]] = defaultdict(set)
        stray = []
        for reader, key, writer, kind in samples:
            name = key.removeprefix(f"{self._prefix}/")
            if name in self.names:
                heard[reader, name].add((writer, kind))
            else:
                stray.append((writer, key))
        return dict(heard), stray

    def ask(self, sessions: dict[str, zenoh.Session]) -> tuple[dict[tuple[str, str], set[str]], int]:
        """Everybody offers to answer for every key, then asks for every key and for all at once."""
        offered = []
        for user, session in sessions.items():
            for key in self._keys():

                def answer(query: zenoh.Query, user: str = user, key: str = key) -> None:
                    with query:
                        query.reply(key, user)

                callback = zenoh.handlers.Callback(answer, indirect=False)
                offered.append(session.declare_queryable(key, callback))
        _wait(SETTLE_S)
        answers: dict[tuple[str, str], set[str]] = defaultdict(set)
        wide: list[str] = []
        pending = threading.Semaphore(0)
        asked = 0
        for asker, session in sessions.items():
            for name in (*self.names, "**"):

                def take(reply: zenoh.Reply, asker: str = asker, name: str = name) -> None:
                    if reply.ok is not None:
                        user = reply.ok.payload.to_string()
                        wide.append(user) if name == "**" else answers[asker, name].add(user)

                session.get(
                    f"{self._prefix}/{name}",
                    zenoh.handlers.Callback(take, pending.release, indirect=False),
                    target=zenoh.QueryTarget.ALL,
                    consolidation=zenoh.ConsolidationMode.NONE,
                    allowed_destination=zenoh.Locality.REMOTE,
                    timeout=ANSWER_S,
                )
                asked += 1
        for _ in range(asked):
            assert pending.acquire(timeout=2.0 * ANSWER_S), "a question does not end"
        for queryable in offered:
            queryable.undeclare()  # type: ignore[no-untyped-call]  # zenoh's stubs
        return dict(answers), len(wide)

    def claim_alive(self, sessions: dict[str, zenoh.Session]) -> tuple[set[str], set[str]]:
        """Everybody declares everybody else alive, then itself."""
        seen: set[str] = set()

        def see(sample: zenoh.Sample) -> None:
            seen.add(str(sample.key_expr).rpartition("/")[2])

        alive = f"{self._prefix}/{keys.alive_name('*')}"
        callback = zenoh.handlers.Callback(see, indirect=False)
        watching = sessions[OBSERVER].liveliness().declare_subscriber(alive, callback, history=True)
        tokens = [
            session.liveliness().declare_token(f"{self._prefix}/{keys.alive_name(other)}")
            for user, session in sessions.items()
            if user != OBSERVER
            for other in sessions
            if other != user
        ]
        _wait(SETTLE_S)
        forged = set(seen)
        for token in tokens:
            token.undeclare()  # type: ignore[no-untyped-call]  # zenoh's stubs
        seen.clear()
        tokens = [
            session.liveliness().declare_token(f"{self._prefix}/{keys.alive_name(user)}")
            for user, session in sessions.items()
            if user != OBSERVER
        ]
        _wait(SETTLE_S)
        watching.undeclare()  # type: ignore[no-untyped-call]  # zenoh's stubs
        return forged, set(seen)

    def _keys(self) -> list[str]:
        return [f"{self._prefix}/{name}" for name in self.names]


@contextlib.contextmanager
def _closing(session: zenoh.Session) -> Iterator[zenoh.Session]:
    try:
        yield session
    finally:
        session.close()  # type: ignore[no-untyped-call]  # zenoh's stubs


def _wait(seconds: float) -> None:
    threading.Event().wait(seconds)


def _wait_until_quiet(samples: Sized) -> None:
    """Until nothing has come for a while."""
    came = -1
    while len(samples) > came:
        came = len(samples)
        _wait(QUIET_S)


def table(matrix: Matrix) -> str:
    """Markdown, one row for each identity: what it tried, and what was heard or answered of it by anybody."""
    topics = keys.every_topic(matrix.graph)
    own = Counter(topic.producer for topic in topics)
    effects: Counter[tuple[str, str, bool]] = Counter()
    for topic in topics:
        written = {pair for (_, name), pairs in matrix.heard.items() if name == topic.name for pair in pairs}
        answered = {user for (_, name), users in matrix.answers.items() if name == topic.name for user in users}
        for user, what in (*written, *((user, "answer") for user in answered)):
            effects[user, what, user == topic.producer] += 1
    strays = Counter(writer for writer, _ in matrix.stray)
    lines = [
        "| identity | own keys | put, deleted, answered | others' keys | put, deleted, answered | by wildcards |",
        "|---|---|---|---|---|---|",
    ]
    for user in matrix.users:
        counts = {
            is_own: ", ".join(str(effects[user, what, is_own]) for what in ("put", "delete", "answer"))
            for is_own in (True, False)
        }
        others = len(topics) - own[user]
        lines.append(f"| {user} | {own[user]} | {counts[True]} | {others} | {counts[False]} | {strays[user]} |")
    return "\n".join(lines) + "\n"


def bus_in(folder: Path, graph: Graph, *, by_certificate: bool) -> BusConfig:
    """A bus of its own, by certificates or passwords that are made in the folder."""
    certificates = folder / "certificates"
    folder.mkdir(exist_ok=True)
    if by_certificate:
        make(certificates, graph, (), WallClock().now_us(), 1)
    return BusConfig(
        router=f"tcp/127.0.0.1:{find_free_port()}",
        runtime_dir=str(folder / "runtime"),
        certificates=str(certificates) if by_certificate else "",
        graph=graph,
    )


def main() -> None:
    """Try and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--graph", type=Graph, choices=tuple(Graph), default=Graph.SIMULATION)
    parser.add_argument("--certificates", action="store_true", help="by certificates instead of passwords")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        matrix = try_everything(bus_in(Path(folder), options.graph, by_certificate=options.certificates))
    sys.stdout.write(table(matrix))


if __name__ == "__main__":
    main()
