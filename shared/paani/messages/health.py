"""Heartbeats and the one-second report."""

from __future__ import annotations

import msgspec

from paani.messages.header import Count, Message, NonNegative, Stamp, Text


class Pulse(Message, frozen=True, kw_only=True):
    """Ten times a second from the event loop of each vital process: silence means dead or hung.

    `echo_us`: of the process that echoes for its side, the newest `steady_us` heard of the other machine's; `heard_us`:
    when that came, by the clock of `steady_us`. Zeros before any, and from every other process.
    """

    echo_us: Stamp = 0
    heard_us: Stamp = 0


class InputHealth(msgspec.Struct, frozen=True, kw_only=True):
    topic: Text
    alive: bool
    fresh: bool
    rate_ok: bool
    rate_hz: NonNegative
    age_s: NonNegative
    received: Count
    superseded: Count


class DropCount(msgspec.Struct, frozen=True, kw_only=True):
    cause: Text
    count: Count


class Health(Message, frozen=True, kw_only=True):
    """Once a second from every process.

    open_files: descriptors it holds, of files and connections alike. temperature_c: the warmest thermal zone of its
    machine; 0 where it has none. Both are 0 in what an earlier version sent.
    """

    service: Text
    ready: bool
    uptime_s: NonNegative
    cpu_cores: NonNegative
    rss_mib: NonNegative
    inputs: tuple[InputHealth, ...] = ()
    drops: tuple[DropCount, ...] = ()
    note: Text = ""
    open_files: Count = 0
    temperature_c: NonNegative = 0.0
