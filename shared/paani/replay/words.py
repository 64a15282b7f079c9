"""A decision in words: what it says, and why. Numbers are left out, so that words change only when the decision does."""

from __future__ import annotations

from paani import messages as m


def words(message: m.Message) -> str:
    """What is decided; empty for a message that only carries numbers."""
    match message:
        case m.Advisory():
            return f"{message.direction} ({message.reason})"
        case m.NavCommand(enable=True):
            return f"go {message.direction}"
        case m.NavCommand():
            return f"hold ({', '.join(message.inhibits)})"
        case m.Thrust(enabled=True):
            return "thrust"
        case m.Thrust():
            return f"no thrust ({', '.join(message.inhibits)})"
        case m.Tracks():
            return ", ".join(f"{track.label} #{track.id}" for track in message.tracks if track.accepted) or "no track"
    return ""


def why(message: m.Message) -> str:
    """The reason in a sentence, where the message has one."""
    return message.explanation if isinstance(message, m.Advisory) else ""
