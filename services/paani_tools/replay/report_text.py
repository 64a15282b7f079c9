"""Reports of a replay as text. Pure."""

from __future__ import annotations

from paani_tools.replay.verify import ChangeReport, CheckReport
from paani_tools.replay.whatif import Episode, ServiceChanges

MAX_EPISODES = 20


def check_text(report: CheckReport) -> str:
    """The verdict comes last."""
    lines = [f"{'service':<14} {'steps':>7} {'decisions':>9} {'differ':>6} {'messages':>8} {'states':>6}  not checked"]
    for s in report.services:
        apart = [f"{s.before_start} before the start"] if s.before_start else []
        apart += [f"{s.lost} lost on the way to the recorder"] if s.lost else []
        apart += [f"{s.at_edges} where a recording begins or ends"] if s.at_edges else []
        lines.append(
            f"{s.service:<14} {s.steps:>7} {s.decisions:>9} {s.differ:>6} {s.messages:>8} {s.states:>6}  "
            + (", ".join(apart) or "-")
        )
    for s in report.services:
        lines += [f"{s.service}: not explained: {found.count} x {found.cause}" for found in s.unexplained]
        lines += [
            f"{s.service}: {d.topic} {d.epoch}.{d.seq}: {d.field} was {d.recorded}, is {d.computed}"
            for d in s.differences
        ]
    lines += [f"{name}: no such decider is installed" for name in report.not_installed]
    lines += [f"damaged: {problem}" for problem in report.problems]
    lines += [f"note: {note}" for note in report.notes]
    compared = sum(s.message_bytes for s in report.services)
    speed = report.log_s / report.took_s if report.took_s else 0.0
    lines += [
        f"{report.log_s:.1f} s of log in {report.took_s:.2f} s ({speed:.0f} x real time), {compared} bytes compared",
        f"digest {report.digest}",
        f"{report.decisions} decisions, {report.differ} differ",
    ]
    return "\n".join(lines) + "\n"


def change_text(report: ChangeReport) -> str:
    """Changed decisions in episodes, service by service."""
    lines = [
        f"{report.path} with {', '.join(report.sets)}"
        + (", each service given what the one before now says" if report.chained else "")
    ]
    for service in report.services:
        lines += _changes(service)
    lines += [f"damaged: {problem}" for problem in report.problems]
    lines += [f"note: {note}" for note in report.notes]
    changed = sum(service.changed for service in report.services)
    messages = sum(service.messages for service in report.services)
    lines.append(f"{messages} messages, {changed} say something else")
    return "\n".join(lines) + "\n"


def _changes(service: ServiceChanges) -> list[str]:
    lines = ["", f"{service.service}: {service.changed} of {service.messages} messages say something else"]
    if service.numbers:
        fields = ", ".join(f"{name} {count}" for name, count in service.fields)
        lines.append(f"  {service.numbers} more differ in other fields only: {fields}")
    if service.skipped:
        lines.append(f"  {service.skipped} steps could not be computed")
    for episode in service.episodes[:MAX_EPISODES]:
        lines += _episode(episode)
    if len(service.episodes) > MAX_EPISODES:
        lines.append(f"  and {len(service.episodes) - MAX_EPISODES} more episodes (--json FILE has all)")
    return lines


def _episode(episode: Episode) -> list[str]:
    when = f"{episode.start_s:8.1f} s" + (f" to {episode.end_s:.1f} s" if episode.decisions > 1 else "")
    lines = [f"{when}  {episode.topic}  {episode.recorded or '-'} -> {episode.computed or '-'}  ({episode.decisions})"]
    if episode.recorded_why or episode.computed_why:
        lines += [f"            was: {episode.recorded_why}", f"            now: {episode.computed_why}"]
    return lines
