"""The paper's table shape as text. Pure."""

from collections.abc import Sequence
from pathlib import Path

from paani.messages import MotionCause
from paani_tools.scenario.stills import Motion, Row, Stale
from paani_tools.scenario.trajectories import Family

HEAD = ("input", "L", "C", "R", "advice", "why", "motion")
FAMILY_HEAD = ("family", "shown", "wanted", "as wanted", "found")
NAMED_TRACKS = 3


def stills_table(rows: Sequence[Row], stale: Stale) -> str:
    """One line for each input, one for the stale probes."""
    cells = [
        (
            Path(row.input).name,
            *(f"{risk:.4f}" if row.usable else "-" for risk in row.risk),
            row.direction.value,
            row.reason.value if row.usable else f"{row.reason.value} ({row.cause.value})",
            motion_text(row.motion),
        )
        for row in rows
    ]
    why = f"{', '.join(stale.reasons)} from {stale.age_s:g} s on"
    cells.append(("stale", "-", "-", "-", f"{stale.stopped}/{stale.probes} STOP", why, "-"))
    return columns((HEAD, *cells))


def families_table(families: Sequence[Family]) -> str:
    """One line for each family of trajectories."""
    cells = [
        (
            family.name,
            str(family.trajectories),
            outcomes_text(family.wanted, family.wanted_cause),
            f"{family.as_wanted}/{family.trajectories}",
            ", ".join(f"{outcome.count} {outcomes_text(outcome.state, outcome.cause)}" for outcome in family.outcomes),
        )
        for family in families
    ]
    return columns((FAMILY_HEAD, *cells))


def motion_text(motion: Sequence[Motion]) -> str:
    """`vessel .86 unknown (clipped_by_frame)`, the surest first."""
    if not motion:
        return "-"
    surest = sorted(motion, key=lambda track: -track.confidence)
    named = [
        f"{track.label} {track.confidence:.2f} {outcomes_text(track.state, track.cause)}"
        for track in surest[:NAMED_TRACKS]
    ]
    more = len(motion) - NAMED_TRACKS
    return ", ".join(named) + (f", {more} more" if more > 0 else "")


def outcomes_text(state: str, cause: MotionCause) -> str:
    """A motion state with the cause of an unknown one."""
    return state if cause is MotionCause.NONE else f"{state} ({cause})"


def columns(rows: Sequence[Sequence[str]]) -> str:
    """Rows of text as aligned columns."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
    return "".join(f"{line.rstrip()}\n" for line in lines)
