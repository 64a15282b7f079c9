"""`paani trial`: drives that are scored."""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import msgspec
from tqdm import tqdm

from paani.cluster import add_cluster_argument, open_workers
from paani.errors import UserError
from paani.idle_options import refuse_options
from paani.option_numbers import whole_number
from paani.option_paths import output_file, output_folder, require_apart
from paani.statistics.figure_table import table_text
from paani.whole_file import indented_json, write_json, write_whole
from paani_sim.trials.checkout import LEDGER_NAME, find_checkout, resolve_commit
from paani_sim.trials.conditions import SWEPT, parse_sweep
from paani_sim.trials.drive_states import DriveOutcome
from paani_sim.trials.fingerprint import SCENARIO_SUFFIX, FingerprintReader
from paani_sim.trials.ledger import Ledger
from paani_sim.trials.policies import PEERS, Policy, load_policy_config
from paani_sim.trials.result import SHOAL, TrialResult
from paani_sim.trials.run_suite import FailedDrive, find_stored_results, run_cases, run_cases_on
from paani_sim.trials.run_trial import load_case_config, require_swept_effect, run_trial
from paani_sim.trials.seed_parts import SeedChoice, SeedPart, parse_seeds, part_of_seed
from paani_sim.trials.suite_summary import summarise_suite
from paani_sim.trials.summary_table import format_summary
from paani_sim.trials.sweep import plot_sweep, tabulate_sweep
from paani_sim.trials.trial_cases import SUITES, TrialCase, is_fixed_scenario, list_cases, parse_case
from paani_sim.worlds.generate import DRAWN_WORLDS
from paani_sim.worlds.imazu import IMAZU_SCENARIOS
from paani_sim.worlds.load import load_scenario
from paani_sim.worlds.shallows import SHALLOWS

WRITTEN = ("--json", "--svg", "--report", "--ledger", "--record")
OF_SUITES = (
    "--suite", "--seeds", "--ledger", "--policy", "--worlds", "--scenario", "--jobs", "--sweep", "--svg", "--cluster",
    "--out", "--report",
)  # fmt: skip


def main(argv: list[str]) -> int:
    """Drive, score, print. Exit codes: 0 it ran, 1 a drive diverged or gave no result, 2 user's mistake, 130 Ctrl-C."""
    parser = _parser()
    options = parser.parse_args(argv)
    written = {name: getattr(options, name[2:]) for name in WRITTEN}
    require_apart(written, [Path(name) for name in options.scenario if name.endswith(SCENARIO_SUFFIX)])
    if options.one is not None:
        refuse_options(parser, options, OF_SUITES, "is of suites; --one drives as it says itself")
        return _run_one(options)
    if options.sweep and options.report:
        raise UserError("--report is not for --sweep (which has --json and --svg)")
    if options.svg and not options.sweep:
        raise UserError("--svg needs --sweep")
    if options.record:
        raise UserError("--record needs --one")
    return _run_suite(options)


def _run_suite(options: argparse.Namespace) -> int:
    choice, ledger = _open_ledger(options)
    cases = _list_suite_cases(options, choice)
    out: Path = options.out or output_folder("--out")(f"runs/trial-{options.suite}")
    if options.report:
        from paani_sim.trials.report import drives_folder  # noqa: PLC0415

        output_folder("--report")(str(drives_folder(options.report)))
    reader = FingerprintReader(options.sets)
    for policy in options.policy:
        load_policy_config(policy, options.sets)
    for case in {each.world: each for each in cases}.values():
        require_swept_effect(case, options.sets)
    kept = find_stored_results(out, cases, reader)
    if kept.results:
        sys.stderr.write(f"{out}: {len(kept.results)} of {len(cases)} drives are there already\n")
    for why, count in kept.outdated.items():
        sys.stderr.write(f"{out}: {count} drives were made with {why}, and are driven again\n")
    if ledger is not None:
        ledger.enter_draws(cases)
        for case, stored in kept.results.items():
            ledger.enter_result(case, stored)
    results, failures, code = dict(kept.results), list[FailedDrive](), 0
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # or the processes that drive would go on without it
    try:
        with (
            tqdm(total=len(cases), initial=len(kept.results), unit="drive", desc="trial") as bar,
            _drives(options, out, kept.missing, reader) as drives,
        ):
            for case, result in drives:
                if isinstance(result, TrialResult):
                    results[case] = result
                    if ledger is not None:
                        ledger.enter_result(case, result)
                else:
                    failures.append(result)
                drives_with_contact = sum(r.collisions > 0 for c, r in results.items() if c.policy is Policy.PAANI)
                bar.set_postfix_str(f"paani touched something in {drives_with_contact}", refresh=False)
                bar.update()
    except KeyboardInterrupt:
        results, code = dict(find_stored_results(out, cases, reader).results), 130
        if ledger is not None:
            for case, stored in results.items():
                ledger.enter_result(case, stored)
        sys.stderr.write(f"\n{out}: {len(results)} of {len(cases)} drives done; the same command goes on\n")
    for failure in failures:
        sys.stderr.write(f"{failure.case.name}: {failure.reason}\n")
    diverged = [case for case in sorted(results) if results[case].why is DriveOutcome.DIVERGED]
    for case in diverged:
        sys.stderr.write(f"{case.name}: {results[case].error}\n")
    if not results:
        return code or 1
    if options.sweep:
        table = tabulate_sweep(results)
        sys.stdout.write(table_text(table))
        if options.json:
            write_json(options.json, table, "--json")
        if options.svg:
            write_whole(options.svg, plot_sweep(results).encode(), "--svg")
        return code or int(bool(failures or diverged))
    counts = ledger.count(choice.part) if ledger is not None else None
    summary = summarise_suite(options.suite, results, len(cases), choice.commit, counts)
    sys.stdout.write(format_summary(summary))
    if options.json:
        write_json(options.json, summary, "--json")
    if options.report and not code:
        from paani_sim.trials.report import write_report  # noqa: PLC0415

        write_report(options.report, summary, results, options.sets, options.jobs)
    return code or int(bool(failures or diverged))


def _open_ledger(options: argparse.Namespace) -> tuple[SeedChoice, Ledger | None]:
    """The choice of seeds with all digits of its commit, and the ledger of a part that has one. Raises UserError."""
    choice: SeedChoice = options.seeds or SeedChoice()
    if not choice.is_ledgered:
        if options.ledger:
            raise UserError("--ledger is for validation and fresh seeds")
        return choice, None
    worlds = options.scenario or options.worlds or SUITES[options.suite].worlds
    if any(is_fixed_scenario(world) for world in worlds):
        raise UserError(f"--seeds: written scenarios are for development, not for {choice.part.value} seeds")
    root = find_checkout()
    path: Path = options.ledger or root / LEDGER_NAME
    choice = msgspec.structs.replace(choice, commit=resolve_commit(root, choice.commit or "HEAD", path))
    return choice, Ledger(path, choice.commit, options.sets)


@contextlib.contextmanager
def _drives(
    options: argparse.Namespace, out: Path, cases: Sequence[TrialCase], reader: FingerprintReader
) -> Iterator[Iterator[tuple[TrialCase, TrialResult | FailedDrive]]]:
    """The cases as they are driven, by processes of this command or by a cluster; on leaving, what is ready is kept."""
    if not cases:
        yield iter(())
    elif options.cluster is None:
        with contextlib.closing(run_cases(out, cases, reader, options.sets, options.jobs)) as drives:
            yield drives
    else:
        with (
            open_workers(options.cluster, options.jobs) as workers,
            contextlib.closing(run_cases_on(workers, out, cases, reader, options.sets)) as drives,
        ):
            yield drives


def _run_one(options: argparse.Namespace) -> int:
    """One drive in this process, its result printed."""
    case = parse_case(options.one)
    if part_of_seed(case.seed) is SeedPart.VALIDATION:
        raise UserError(f"--one {options.one}: a validation seed, which is measured and never looked into")
    require_swept_effect(case, options.sets)
    if options.record:
        from paani_sim.trials.drive_recorder import DriveRecorder  # noqa: PLC0415

        with DriveRecorder(options.record, load_case_config(case, options.sets)) as recorder:
            result, effort = run_trial(case, options.sets, threads=True, tap=recorder.record_message)
    else:
        result, effort = run_trial(case, options.sets, threads=True)
    if options.json:
        write_json(options.json, result, "--json")
    else:
        sys.stdout.write(indented_json(result).decode())
    sys.stderr.write(
        f"{case.name} ({result.part.value} seed): {result.why.value}, "
        f"{result.collisions} contacts{_groundings(result)}, {result.near_misses} near misses, "
        f"{result.progress_m:.1f} of {result.goal_m:.1f} m in {result.seconds:.0f} s; "
        f"{effort.simulated_s / effort.wall_s:.1f} x real time\n"
    )
    return 1 if result.why is DriveOutcome.DIVERGED else 0


def _groundings(result: TrialResult) -> str:
    """How many of the contacts were with the ground; "" without one."""
    count = sum(each.kind == SHOAL for each in result.contacts)
    return f" ({count} aground)" if count else ""


def _list_suite_cases(options: argparse.Namespace, choice: SeedChoice) -> list[TrialCase]:
    worlds = list(dict.fromkeys(options.scenario or options.worlds or SUITES[options.suite].worlds))
    known = (*DRAWN_WORLDS, *IMAZU_SCENARIOS)
    for world in worlds:
        if options.scenario and not is_fixed_scenario(world):
            raise UserError(f"--scenario {world}: is no written scenario (its drawn kin: --worlds)")
        if options.scenario:
            load_scenario(world)
        elif world not in known:
            raise UserError(f"--worlds {world}: no such world (have: {', '.join(DRAWN_WORLDS)})")
    return list_cases(SUITES[options.suite], worlds, dict.fromkeys(options.policy), choice, options.sweep)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="paani trial",
        description="Drive seeded scenarios in lockstep, faster than real time, and score them.",
    )
    parser.add_argument("--suite", choices=tuple(SUITES), default="quick", help="default: quick")
    parser.add_argument(
        "--seeds", type=parse_seeds, metavar="A..B|PART",
        help="instead of the suite's: A..B, development[:N], validation[:N], or fresh:N@COMMIT, which the commit's hash"
        " draws",
    )  # fmt: skip
    parser.add_argument(
        "--ledger", type=output_file("--ledger"), metavar="FILE",
        help=f"where validation and fresh drives are entered, before and after (default: {LEDGER_NAME})",
    )  # fmt: skip
    parser.add_argument(
        "--policy", nargs="+", type=Policy, choices=tuple(Policy), metavar="POLICY",
        default=[policy for policy in Policy if policy not in PEERS],
        help=f"who drives: {', '.join(Policy)} (default: all but the peers {', '.join(PEERS)})",
    )  # fmt: skip
    places = parser.add_mutually_exclusive_group()
    places.add_argument(
        "--worlds", nargs="+", metavar="WORLD", help=f"of {', '.join(DRAWN_WORLDS)} (default: all but {SHALLOWS})"
    )
    places.add_argument("--scenario", nargs="+", default=[], metavar="NAME|FILE", help="instead of worlds")
    parser.add_argument(
        "--jobs", type=whole_number(), default=os.cpu_count() or 1, metavar="N", help="drives side by side"
    )
    parser.add_argument(
        "--sweep", type=parse_sweep, default=(), metavar="NAME=V,V,...",
        help=f"each drive under each value of one condition: {', '.join(SWEPT)}",
    )  # fmt: skip
    parser.add_argument("--svg", type=output_file("--svg"), metavar="FILE", help="plot the sweep there")
    add_cluster_argument(parser)
    parser.add_argument(
        "--out", type=output_folder("--out"), metavar="DIR", help="where results are kept (default: runs/trial-SUITE)"
    )
    parser.add_argument("--json", type=output_file("--json"), metavar="FILE", help="also write the figures there")
    parser.add_argument(
        "--report", type=output_file("--report"), metavar="FILE", help="also write a page with plots there"
    )
    parser.add_argument(
        "--set", action="append", default=[], metavar="SECTION.FIELD=VALUE", dest="sets",
        help="one setting, for every policy; may be repeated",
    )  # fmt: skip
    parser.add_argument("--one", metavar="WORLD[@NAME=VALUE][+FAULT]:SEED:POLICY", help="this drive alone, here")
    parser.add_argument(
        "--record", type=output_file("--record"), metavar="FILE", help="write the one drive there as MCAP"
    )
    return parser
