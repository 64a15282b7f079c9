"""Why the advisor refused to try a parameter, or to put it in force, in words."""

from __future__ import annotations

from paani.messages import Shadow, TuningRefusal

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
