"""Mutual TLS at real routers: who gets in, and what rotation and revocation take from whom."""

from __future__ import annotations

import asyncio
import contextlib
import json
import shutil
from pathlib import Path

import msgspec
import pytest
import zenoh
from msgspec.structs import replace

from paani import keys
from paani import messages as m
from paani.authority import OBSERVER, ensure_credentials
from paani.bus import open_bus
from paani.bus.routing import open_router
from paani.bus.session import client_config
from paani.certificates import BOARD_ROUTER, HOST_ROUTER, INDEX_FILE, read_identities
from paani.clock import WallClock
from paani.config import BusConfig
from paani.errors import UserError
from paani.sides import Side
from paani_tools.certs import folder as certificates
from tests.bus_peers import joined, routing, until
from tests.conftest import find_free_port, put_raw
from tests.integration.authority_matrix import bus_in

pytestmark = pytest.mark.integration
CLOCK = WallClock()
JOIN_S = 10.0
ENTER_S = 4.0  # two attempts of a client


def thrust() -> m.Thrust:
    return m.Thrust(source_us=CLOCK.now_us(), left=0.1, right=0.1, enabled=True)


@pytest.fixture
def config(tmp_path: Path) -> BusConfig:
    return bus_in(tmp_path, keys.Graph.SIMULATION, by_certificate=True)


@pytest.fixture
def other(tmp_path: Path) -> BusConfig:
    """Of another boat."""
    return bus_in(tmp_path / "other", keys.Graph.SIMULATION, by_certificate=True)


@pytest.fixture
def old(config: BusConfig) -> BusConfig:
    """The certificates as somebody kept them."""
    return copied(config, "kept")


async def rotate(config: BusConfig, name: str, at_us: int = 0) -> None:
    await asyncio.to_thread(certificates.rotate, Path(config.certificates), name, at_us or CLOCK.now_us(), 1)


def copied(config: BusConfig, name: str) -> BusConfig:
    folder = Path(config.certificates)
    return replace(config, certificates=str(shutil.copytree(folder, folder.with_name(name))))


async def refused(config: BusConfig, user: str) -> None:
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(ENTER_S), joined(config, user):
            pass


async def silent_beside(config: BusConfig, user: str, old: BusConfig) -> None:
    """With the old certificates `user` is not heard, and hears nothing, where the controller of today is heard."""
    async with joined(config, OBSERVER, JOIN_S) as observer, joined(config, "controller", JOIN_S) as controller:
        heard = observer.latest(keys.THRUST)
        own = controller.publisher(keys.THRUST)
        async with joined(old, user, JOIN_S) as stale:
            await until(lambda: heard.received > 2, lambda: own.put(thrust()))
            hidden = stale.latest(keys.THRUST)
            drops = sum(observer.drops.values())
            received = heard.received
            await asyncio.sleep(0.3)  # a subscriber is known to its publisher only a moment after it was declared
            for _ in range(20):
                own.put(thrust())
                put_raw(stale, keys.THRUST.name, b"{}")
                put_raw(stale, f"health/{user}", b"{}")
            own.put(thrust())
            await until(lambda: heard.received > received, lambda: None)
            assert sum(observer.drops.values()) == drops
            assert hidden.received == 0


async def test_strangers_do_not_get_in(config: BusConfig, other: BusConfig) -> None:
    """Passwords, plain TCP, the certificates of another boat: a router lets none in, nor is one of them a router."""
    other = replace(other, router=config.router)
    passwords = replace(config, certificates="")
    await asyncio.to_thread(ensure_credentials, passwords)
    async with routing(config):
        async with joined(config, OBSERVER, JOIN_S):
            pass
        await refused(other, "controller")
        await refused(passwords, "controller")
    async with routing(other):
        await refused(config, "controller")


@pytest.mark.parametrize("presented", [None, "another authority's", "our router's", "an expired one"])
async def test_who_trusts_our_authority_must_show_a_clients_certificate_of_it(
    config: BusConfig, other: BusConfig, presented: str | None
) -> None:
    """What an eavesdropper can have: the authority's certificate, which is no secret."""
    ours, theirs = Path(config.certificates), Path(other.certificates)

    def enter(stem: Path | None) -> None:
        settings = client_config(config, "controller")
        tls: dict[str, object] = {"root_ca_certificate": str(ours / "authority.1.pem")}
        if stem is not None:
            tls |= {"connect_certificate": f"{stem}.pem", "connect_private_key": f"{stem}.key", "enable_mtls": True}
        settings.insert_json5("transport/link/tls", json.dumps(tls))
        zenoh.open(settings).close()  # type: ignore[no-untyped-call]  # zenoh's stubs

    expired = copied(config, "expired")
    await rotate(expired, "controller", CLOCK.now_us() - 2 * 86_400_000_000)
    stems = {
        None: None, "another authority's": theirs / "controller.1", "our router's": ours / f"{HOST_ROUTER}.1",
        "an expired one": Path(expired.certificates) / "controller.2",
    }  # fmt: skip
    async with routing(config):
        await asyncio.to_thread(enter, ours / "controller.1")
        with pytest.raises(zenoh.ZError):
            await asyncio.to_thread(enter, stems[presented])


async def test_a_rotated_certificate_retires_the_one_before(config: BusConfig, old: BusConfig) -> None:
    """It still gets in, as its authority does, and has no rights; with a new authority it does not get in."""
    await rotate(config, "controller")
    async with routing(config):
        await silent_beside(config, "controller", old)
    await rotate(config, "all")
    async with routing(config):
        async with joined(config, "controller", JOIN_S):
            pass
        await refused(old, "controller")
        await refused(old, "advisor")


async def test_a_revoked_identity_cannot_start_and_its_old_certificate_has_no_rights(
    config: BusConfig, old: BusConfig
) -> None:
    await asyncio.to_thread(certificates.revoke, Path(config.certificates), "advisor")
    async with routing(config):
        with pytest.raises(UserError, match=r"advisor has no certificate \(revoked\)"):
            await open_bus(config, "advisor", CLOCK)
        async with joined(config, OBSERVER, JOIN_S) as observer, joined(old, "advisor", JOIN_S) as advisor:
            heard = observer.latest(keys.health("advisor"))
            await silent_beside(config, "advisor", old)
            put_raw(advisor, "health/advisor", b"{}")
            assert (heard.received, dict(observer.drops)) == (0, {})


async def test_an_expired_certificate_is_told_before_the_router_starts(config: BusConfig) -> None:
    await rotate(config, "plant", CLOCK.now_us() - 2 * 86_400_000_000)
    with pytest.raises(UserError, match=r"plant\.2\.pem: expired 20\d\d-"):
        await open_router(config)


async def test_board_and_host_know_each_other_by_certificate(config: BusConfig) -> None:
    """Messages cross by TLS; a host's certificate at the board's address is not taken for the board."""
    link = f"tcp/127.0.0.1:{find_free_port()}"
    board = replace(config, side=Side.BOARD, link=link)
    host = replace(config, side=Side.HOST, link=link, router=f"tcp/127.0.0.1:{find_free_port()}")

    async def cross(far: BusConfig) -> bool:
        async with (
            routing(far),
            routing(host),
            joined(far, "advisor", JOIN_S) as advisor,
            joined(host, OBSERVER, JOIN_S) as on_host,
        ):
            seen, written = on_host.latest(keys.TRACKS), advisor.publisher(keys.TRACKS)
            tracks = m.Tracks(source_us=CLOCK.now_us(), frame_seq=0, frame_epoch=0, tracks=())
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(3.0):
                    await until(lambda: seen.received > 0, lambda: written.put(tracks))
            return seen.received > 0

    assert await cross(board)
    assert not await cross(await asyncio.to_thread(impostor_of, board))


def impostor_of(board: BusConfig) -> BusConfig:
    """Somebody with the key of the host's router, who listens where the board would."""
    impostor = copied(board, "impostor")
    folder = Path(impostor.certificates)
    index = read_identities(folder)
    for end in ("key", "pem"):
        shutil.copyfile(folder / f"{HOST_ROUTER}.1.{end}", folder / f"{BOARD_ROUTER}.1.{end}")
    taken = replace(index, holders={**index.holders, BOARD_ROUTER: index.holders[HOST_ROUTER]})
    (folder / INDEX_FILE).write_bytes(msgspec.json.encode(taken))
    return impostor
