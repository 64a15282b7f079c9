"""A decision in words: what it says, and why. Numbers are left out: words change only when the decision does."""

from __future__ import annotations

from paani import messages as m


def decision_text(message: m.Message) -> str:
    """What is decided; empty for a message that only carries numbers."""
    match message:
        case m.Advisory():
            return message.direction.value
        case m.NavCommand():
            return "keep station" if message.keeps_station else f"go {message.direction}" if message.enable else "hold"
        case m.Thrust():
            return "thrust" if message.enabled else "no thrust"
        case m.Tracks():
            return ", ".join(f"{track.label} #{track.id}" for track in message.tracks if track.accepted) or "no track"
    return ""


def reason_text(message: m.Message) -> str:
    """The reason in words, where the message has one."""
    match message:
        case m.Advisory():
            return f"{message.reason}: {message.explanation}"
        case m.NavCommand():
            return ", ".join(message.halt_reasons)
        case m.Thrust(enabled=False):
            return ", ".join(message.inhibits)
    return ""
