"""`paani bench fleet`: processor, memory and network that a shore spends on 1, 10 and 30 vessels with routers."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import multiprocessing
import os
import socket
import struct
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import msgspec

from paani.clock import MonotonicClock, WallClock, process_cpu_s
from paani.config import BusConfig
from paani.errors import UserError
from paani.option_numbers import whole_number
from paani.option_paths import output_file
from paani.whole_file import write_json
from paani_tools.bench.fleet.boats import prepare_boats, run_boats
from paani_tools.fleet.shore import watch_fleet
from paani_tools.fleet.vessel_state import Contact

BOATS = (1, 10, 30)
BOATS_PER_PROCESS = 10  # of those who publish, so that they are not what bends
JOIN_S, SETTLE_S, LOOK_S = 60.0, 2.0, 1.0
FIRST_PORT, LAST_PORT = 20_000, 32_000
BYTES_RECEIVED_AT = 128  # in Linux's struct tcp_info: tcpi_bytes_received, since 4.1
TCP_INFO_BYTES = 192


class ShoreCost(msgspec.Struct, frozen=True, kw_only=True):
    """What a shore of so many vessels took over `seconds`; received_kbps: of TCP, Zenoh's framing included.

    stale: looks, once a second at every vessel, at which one had not been heard for a second.
    """

    vessels: int
    seconds: float
    cpu_cores: float
    rss_mib: float
    received_kbps: float
    messages_per_s: float
    oldest_s: float
    stale: int
    looks: int


def main(argv: list[str]) -> int:
    """Measure and print. Exit codes: 0 done, 1 not all vessels were heard, 2 user's mistake."""
    parser = argparse.ArgumentParser(prog="paani bench fleet", description=__doc__)
    parser.add_argument(
        "--vessels", nargs="+", type=whole_number(1, 300), default=list(BOATS), metavar="N", help="default: 1 10 30"
    )
    parser.add_argument("--for", dest="seconds", type=float, default=10.0, metavar="S", help="each; default: 10")
    parser.add_argument("--json", type=output_file("--json"), metavar="FILE", help="write the figures there too")
    options = parser.parse_args(argv)
    if not 1.0 <= options.seconds <= 3600.0:
        raise UserError("--for: between 1 and 3600 s")
    costs: list[ShoreCost] = []
    try:
        for count in options.vessels:
            costs.append(measure_shore(count, options.seconds))
    finally:
        sys.stdout.write(costs_table(costs))
    if options.json:
        write_json(options.json, costs, "--json")
    return 0


def measure_shore(count: int, seconds: float) -> ShoreCost:
    """One fleet, with a shore in a process of its own. Raises UserError where not all of it is heard within JOIN_S."""
    context = multiprocessing.get_context("spawn")
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        configs = prepare_boats(Path(folder), _free_ports(2 * count))
        for first in range(0, count, BOATS_PER_PROCESS):
            ready = context.Event()
            some = configs[first : first + BOATS_PER_PROCESS]
            boats = context.Process(target=run_boats, args=(some, ready), daemon=True)
            boats.start()
            stack.callback(boats.join)
            stack.callback(boats.terminate)
            if not ready.wait(JOIN_S):
                raise UserError(f"{count} vessels: their routers do not listen")
        receiver, sender = context.Pipe(duplex=False)
        shore = context.Process(target=_run_shore, args=(configs, seconds, sender), daemon=True)
        shore.start()
        stack.callback(shore.join)
        stack.callback(shore.terminate)
        if not receiver.poll(JOIN_S + SETTLE_S + 2.0 * seconds):
            raise UserError(f"{count} vessels: the shore has not answered")
        answer = receiver.recv()
        if not isinstance(answer, ShoreCost):
            raise UserError(f"{count} vessels: {answer}")
        return answer


def costs_table(costs: Sequence[ShoreCost]) -> str:
    """A row for each fleet, and what each vessel more takes."""
    lines = [
        "| vessels | s | CPU [cores] | RSS [MiB] | received [kbit/s] | messages/s | each: CPU [%], kbit/s, messages/s"
        " | oldest news [s] | stale looks |",
        "|" + "---|" * 9,
    ]
    for cost in costs:
        n = cost.vessels
        lines.append(
            f"| {n} | {cost.seconds:.0f} | {cost.cpu_cores:.3f} | {cost.rss_mib:.0f} | {cost.received_kbps:.0f}"
            f" | {cost.messages_per_s:.0f}"
            f" | {100.0 * cost.cpu_cores / n:.2f}, {cost.received_kbps / n:.0f}, {cost.messages_per_s / n:.0f}"
            f" | {cost.oldest_s:.2f} | {cost.stale} of {cost.looks} |"
        )
    return "".join(f"{line}\n" for line in lines)


def _run_shore(configs: Sequence[BusConfig], seconds: float, answer: multiprocessing.connection.Connection) -> None:
    answer.send(asyncio.run(_watch(configs, seconds)))


async def _watch(configs: Sequence[BusConfig], seconds: float) -> ShoreCost | str:
    """The cost, or why there is none."""
    clock = MonotonicClock()
    fleet = [msgspec.structs.replace(config, router=config.shore) for config in configs]
    async with watch_fleet(fleet, WallClock()) as vessels:
        silent = len(vessels)
        for _ in range(round(JOIN_S / LOOK_S)):
            silent = sum(vessel.state.contact is not Contact.LIVE for vessel in vessels)
            if not silent:
                break
            await asyncio.sleep(LOOK_S)
        else:
            return f"{silent} of them are not heard"
        await asyncio.sleep(SETTLE_S)
        begun_us, cpu_s, bytes_before = clock.now_us(), process_cpu_s(), received_bytes()
        messages, oldest_s, stale, looks = sum(vessel.received for vessel in vessels), 0.0, 0, 0
        while (clock.now_us() - begun_us) * 1e-6 < seconds:
            await asyncio.sleep(LOOK_S)
            for state in (vessel.state for vessel in vessels):
                oldest_s = max(oldest_s, state.age_s or 0.0)
                stale += state.contact is not Contact.LIVE
                looks += 1
        elapsed_s = (clock.now_us() - begun_us) * 1e-6
        return ShoreCost(
            vessels=len(vessels),
            seconds=elapsed_s,
            cpu_cores=(process_cpu_s() - cpu_s) / elapsed_s,
            rss_mib=_rss_mib(),
            received_kbps=(received_bytes() - bytes_before) * 8e-3 / elapsed_s,
            messages_per_s=(sum(vessel.received for vessel in vessels) - messages) / elapsed_s,
            oldest_s=oldest_s,
            stale=stale,
            looks=looks,
        )


def received_bytes() -> int:
    """Bytes that this process's TCP connections have received, as the kernel counts them."""
    total = 0
    for entry in Path("/proc/self/fd").iterdir():
        with contextlib.suppress(OSError), contextlib.closing(socket.socket(fileno=os.dup(int(entry.name)))) as one:
            if one.type == socket.SOCK_STREAM and one.family in {socket.AF_INET, socket.AF_INET6}:
                data = one.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, TCP_INFO_BYTES)
                if len(data) >= BYTES_RECEIVED_AT + 8:
                    total += struct.unpack_from("=Q", data, BYTES_RECEIVED_AT)[0]
    return total


def _rss_mib() -> float:
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def _free_ports(count: int) -> list[int]:
    """Below those that the kernel gives to connections, which would take one before its router listens."""
    ports: list[int] = []
    for port in range(FIRST_PORT, LAST_PORT):
        with contextlib.suppress(OSError), socket.create_server(("127.0.0.1", port)):
            ports.append(port)
        if len(ports) == count:
            return ports
    raise UserError(f"of the ports {FIRST_PORT} to {LAST_PORT}, fewer than {count} are free")
