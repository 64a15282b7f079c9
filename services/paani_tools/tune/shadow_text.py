"""What the advisor's report says, for people. Pure."""

from __future__ import annotations

from paani.config import AdvisorConfig
from paani.config.tuning import TUNABLE, setting_text
from paani.messages import Change, Disagreement, Shadow


def status_text(shadow: Shadow, config: AdvisorConfig) -> str:
    """What is in force, what is tried, and where the two differ; several lines.

    config: as configured here, to show what a change replaces.
    """
    lines = [f"in force  {shadow.active or 'the configuration'}"]
    lines += _changes(shadow.active_changes, config)
    if not shadow.proposal:
        lines.append("tried     nothing")
    else:
        lines.append(f"tried     {shadow.proposal}, on {shadow.frames} frames (promotion needs {shadow.frames_needed})")
        lines += _changes(shadow.changes, config)
        lines.append(
            f"differs   on {shadow.differing} frames ({shadow.differing_frac:.1%}): would move where the boat now stops"
            f" on {shadow.moves_more}, would stop where it now moves on {shadow.stops_more}"
        )
        lines += [f"          {disagreement_text(found)}" for found in shadow.recent]
    if shadow.refused:
        lines.append(f"refused   {shadow.refused} requests since the advisor started")
    return "".join(f"{line}\n" for line in lines)


def disagreement_text(found: Disagreement) -> str:
    """One frame, what is advised and what would be."""
    return (
        f"frame {found.frame_seq}: {found.active_direction} ({found.active_reason}),"
        f" tried: {found.shadow_direction} ({found.shadow_reason})"
    )


def _changes(changes: tuple[Change, ...], config: AdvisorConfig) -> list[str]:
    return [f"          {change.path} {_configured(change.path, config)} -> {change.value}" for change in changes]


def _configured(path: str, config: AdvisorConfig) -> str:
    return setting_text(config, path) if path in TUNABLE else "?"
