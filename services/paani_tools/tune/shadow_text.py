"""What the advisor's report says, for people. Pure."""

from __future__ import annotations

from paani.config import AdvisorConfig
from paani.config.tuning import TUNABLE, setting_text
from paani.messages import Change, Disagreement, Shadow, TuningRefusal

REFUSED = {
    TuningRefusal.NONE: "obeyed",
    TuningRefusal.EMPTY: "nothing proposed",
    TuningRefusal.NOT_TUNABLE: "not a setting that can be tried",
    TuningRefusal.TWICE: "named twice",
    TuningRefusal.INVALID_VALUE: "not a value that this boat's configuration takes",
    TuningRefusal.NOT_CURRENT: "not the proposal being tried, nor the one last promoted",
    TuningRefusal.STALE_REQUEST: "the request lay too long before the advisor heard it",
    TuningRefusal.STALE_PROPOSAL: "tried too long ago; propose it again",
    TuningRefusal.TOO_FEW_FRAMES: "tried on too few frames",
    TuningRefusal.ARMED: "the boat is armed; press STOP first",
    TuningRefusal.ARMING_UNKNOWN: "the advisor does not hear whether the boat is armed",
}


def refusal_text(shadow: Shadow) -> str:
    """Why the last request was refused."""
    text = REFUSED[shadow.refusal]
    if shadow.refusal is TuningRefusal.TOO_FEW_FRAMES:
        text += f" ({shadow.frames} of {shadow.frames_needed})"
    return f"{shadow.refused_path}: {text}" if shadow.refused_path else text


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
