"""`paani replay FILE --check`: every decision of a log, computed again and compared."""

from __future__ import annotations

import hashlib

import msgspec

from paani import keys
from paani.clock import stopwatch_ms
from paani.config import Config
from paani.decider import deciders
from paani.logs.reader import Log
from paani.replay.check import ServiceCheck, check_service
from paani.replay.ledger import Ledger
from paani.replay.progress import Progress
from paani.replay.recompute import Again


class CheckReport(msgspec.Struct, frozen=True, kw_only=True):
    """A whole log. digest: SHA-256 over the digests of the services, in their order."""

    path: str
    log_s: float
    took_s: float
    services: tuple[ServiceCheck, ...]
    not_installed: tuple[str, ...]
    problems: tuple[str, ...]
    notes: tuple[str, ...]
    digest: str

    @property
    def decisions(self) -> int:
        return sum(service.decisions for service in self.services)

    @property
    def differ(self) -> int:
        return sum(service.differ for service in self.services)

    @property
    def is_exact(self) -> bool:
        """Every service whose steps are in the log is exact, there is at least one, and the log was read whole."""
        return (
            bool(self.services) and all(s.is_exact for s in self.services) and not (self.not_installed or self.problems)
        )


def check_log(log: Log, config: Config, notes: tuple[str, ...] = ()) -> CheckReport:
    """Compute every service's decisions again. Steps of services that are not installed are named."""
    began_ms = stopwatch_ms()
    installed, recorded, lost = deciders(), services_in(log), losses(log)
    chosen = [name for name in recorded if name in installed and name in keys.STEPS]
    checks = []
    with Progress("checking") as progress:
        for number, name in enumerate(chosen):

            def show(again: Again, number: int = number, name: str = name) -> None:
                done = (again.given.log_us - log.start_us) / max(1, log.end_us - log.start_us)
                progress.at((number + done) / len(chosen), name)

            records = log.records(Ledger(installed[name]).topics)
            checks.append(check_service(installed[name], config, records, log.end_us, lost, show))
    return CheckReport(
        path=str(log.path),
        log_s=(log.end_us - log.start_us) * 1e-6,
        took_s=(stopwatch_ms() - began_ms) * 1e-3,
        services=tuple(checks),
        not_installed=tuple(name for name in recorded if name not in chosen),
        problems=tuple(log.problems),
        notes=notes,
        digest=hashlib.sha256("".join(check.digest for check in checks).encode()).hexdigest(),
    )


def services_in(log: Log) -> list[str]:
    """Services that left steps in the log, in the order of the chain, unknown ones last."""
    suffix = "/step"
    found = [topic.removesuffix(suffix) for topic in log.topics if topic.endswith(suffix)]
    order = {name: number for number, name in enumerate(keys.STEPS)}
    return sorted(found, key=lambda name: (order.get(name, len(order)), name))


def losses(log: Log) -> dict[str, int]:
    """Messages of each topic that the recorder has counted as dropped or missing, in all parts together."""
    lost: dict[str, int] = {}
    for counts in log.metadata_by_part("recorder"):
        for topic, text in counts.items():
            for word in text.split():
                name, _, number = word.partition("=")
                if name in {"dropped", "missing"} and number.isdecimal():
                    lost[topic] = lost.get(topic, 0) + int(number)
    return lost


def text_of(report: CheckReport) -> str:
    """For people, the verdict last."""
    lines = [f"{'service':<14} {'steps':>7} {'decisions':>9} {'differ':>6} {'messages':>8} {'states':>6}  not checked"]
    for s in report.services:
        apart = [f"{s.before_start} before the start"] if s.before_start else []
        apart += [f"{s.lost} lost on the way to the recorder"] if s.lost else []
        apart += [f"{s.at_end} cut off at the end"] if s.at_end else []
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
