"""`paani replay FILE`."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import math
import signal
import sys
import tempfile

from paani import keys
from paani.config import Config, with_settings
from paani.errors import UserError
from paani.idle_options import refuse_options
from paani.logs.reader import Log, open_log
from paani.option_numbers import quantity
from paani.option_paths import input_path, output_file, require_apart
from paani.page_address import page_origin
from paani.whole_file import write_json
from paani_tools.progress import Progress
from paani_tools.replay.compatibility import provenance_of
from paani_tools.replay.report_text import change_text, check_text
from paani_tools.replay.republish import RepublishOptions, RepublishResult, replay_config, republish, topics_of
from paani_tools.replay.verify import ChangeReport, CheckReport, change_log, check_log

ROUTER = "bus.router=tcp/127.0.0.1:7448"  # beside the live bus
_SINCE_START = quantity("seconds since the start", with_low=True)
LISTENING = ("bus.", "dashboard.")  # settings that matter to a republished drive
DECIDING = ("--json", "--force", "--chain")
REPUBLISHING = ("--speed", "--from", "--to", "--loop", "--only", "--commands", "--dashboard")


def main(argv: list[str]) -> int:
    """Exit codes: 0 done (with `--check`: every decision is the same), 1 not the same, 2 user's mistake."""
    parser = _parser()
    options = parser.parse_args(argv)
    if options.check:
        refuse_options(parser, options, REPUBLISHING, "republishes; --check decides")
    else:
        refuse_options(parser, options, DECIDING, "goes with --check")
    if options.chain and not options.sets:
        raise UserError("--chain: goes with --set, of which each service is given the consequences")
    if options.to_s <= options.from_s:
        raise UserError(f"--to {options.to_s:g}: is not after --from {options.from_s:g}")
    log = open_log(options.file)
    require_apart({"--json": options.json}, log.files)
    provenance = provenance_of(log, force=options.force or not options.check)
    if not options.check:
        return _republish(log, provenance.config, options)
    report: CheckReport | ChangeReport
    if options.sets:
        report = change_log(log, provenance.config, tuple(options.sets), provenance.notes, chained=options.chain)
        sys.stdout.write(change_text(report))
    else:
        report = check_log(log, provenance.config, provenance.notes)
        sys.stdout.write(check_text(report))
    if options.json is not None:
        write_json(options.json, report, "--json")
    return 1 if isinstance(report, CheckReport) and not report.is_exact else 0


def _republish(log: Log, recorded: Config, options: argparse.Namespace) -> int:
    span_s = (log.end_us - log.start_us) * 1e-6
    if options.from_s > span_s:
        raise UserError(f"--from {options.from_s:g}: {log.path} ends after {span_s:.1f} s")
    for text in options.sets:
        if not text.startswith(LISTENING):
            raise UserError(f"--set {text}: a republished drive takes only bus and dashboard settings (see --check)")
    what = RepublishOptions(
        from_s=options.from_s,
        to_s=options.to_s,
        speed=options.speed,
        loop=options.loop,
        only=tuple(options.only) if options.only else None,
        commands=options.commands,
        dashboard=options.dashboard,
    )
    topics = topics_of(log, what, recorded.bus.graph)
    if not topics:
        raise UserError(f"{log.path}: nothing to republish")
    with tempfile.TemporaryDirectory(prefix="paani-replay-") as folder, Progress("replaying") as progress:
        config = with_settings(replay_config(recorded, log), (ROUTER, f"bus.runtime_dir={folder}", *options.sets))
        bus = config.bus
        profile = "" if bus.graph is keys.Graph.SIMULATION else f" --profile {config.profile}"
        sys.stdout.write(
            f"{len(topics)} topics of {span_s:.1f} s, vessel {bus.vessel}; listen with\n"
            f"  paani echo TOPIC --set bus.router={bus.router} --set bus.runtime_dir={bus.runtime_dir}"
            f" --set bus.vessel={bus.vessel}{profile}\n"
        )
        if what.dashboard:
            begin = f"#at={what.from_s:g}" if what.from_s else ""
            sys.stdout.write(f"  {page_origin(config)}/{begin}\nplay, pause, step and seek there; Ctrl-C ends it\n")
        sys.stdout.flush()
        for problem in log.problems:
            sys.stderr.write(f"damaged: {problem}\n")
        asyncio.run(_until_told(log, config, what, progress))
    return 0


async def _until_told(log: Log, config: Config, what: RepublishOptions, progress: Progress) -> None:
    """Republish; a signal ends it in order."""
    work = asyncio.create_task(republish(log, config, what, progress.at, _tell_end))
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, work.cancel)
    with contextlib.suppress(asyncio.CancelledError):
        await work


def _tell_end(done: RepublishResult) -> None:
    sys.stdout.write(
        f"{done.messages} messages republished; late by {done.late_ms[0]:.1f} ms (median), "
        f"{done.late_ms[1]:.1f} ms (95th percentile)\n"
    )
    sys.stdout.flush()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="paani replay",
        description="Republish a recorded drive on a bus of its own; or, with --check, decide everything again.",
    )
    parser.add_argument("file", type=input_path(), metavar="FILE", help="a recording, or a folder of its parts")
    again = parser.add_argument_group("deciding again")
    again.add_argument("--check", action="store_true", help="compute every decision again and compare it to the byte")
    again.add_argument(
        "--chain", action="store_true", help="with --set: each service is given what the one before says"
    )
    again.add_argument("--json", type=output_file("--json"), metavar="FILE", help="write the report as JSON too")
    again.add_argument("--force", action="store_true", help="go on with a log of other settings or weights")
    play = parser.add_argument_group("republishing")
    play.add_argument(
        "--speed", type=quantity("times", 0.01, 1000.0, with_low=True), default=1.0, metavar="X", help="X times as fast"
    )
    play.add_argument(
        "--from",
        type=_SINCE_START,
        default=0.0,
        metavar="S",
        dest="from_s",
        help="seconds since its start",
    )
    play.add_argument(
        "--to",
        type=_SINCE_START,
        default=math.inf,
        metavar="S",
        dest="to_s",
        help="seconds since its start",
    )
    play.add_argument("--loop", action="store_true", help="again and again")
    play.add_argument("--only", nargs="+", metavar="TOPIC", help="only these topics")
    play.add_argument("--commands", action="store_true", help="commands, arming and heartbeats too")
    play.add_argument("--dashboard", action="store_true", help="play it on the dashboard, until Ctrl-C")
    parser.add_argument(
        "--set", action="append", default=[], dest="sets", metavar="SECTION.FIELD=VALUE",
        help="with --check: decide with this setting; else: a bus or dashboard setting; may be repeated",
    )  # fmt: skip
    return parser
