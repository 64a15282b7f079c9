"""`paani bench water`: speed of the simulator, and its physics and estimates beside reference and truth."""

from __future__ import annotations

import argparse
import concurrent.futures
import dataclasses
import multiprocessing
import os
from collections.abc import Callable

import cv2
import msgspec

from paani.clock import process_cpu_s, stopwatch_ms
from paani.errors import UserError
from paani.option_paths import output_file, require_apart
from paani.statistics.charts import drawing, element, lines
from paani.statistics.figure_table import Cell, FigureTable
from paani.statistics.measured import measure_tables
from paani.whole_file import write_whole
from paani_sim.eye.render_cost import measure_eye
from paani_sim.plant.reference_model import compare_with_reference
from paani_sim.plant.step_cost import measure_physics
from paani_sim.studies.estimation_table import tabulate_estimation
from paani_sim.trials.drive import Drive
from paani_sim.trials.policies import Policy, load_policy_config
from paani_sim.trials.run_suite import THREAD_COUNT_VARIABLES
from paani_sim.trials.run_trial import open_evidence_source
from paani_sim.worlds import Actor, Scenario, Task, load_world

WARM_UP_S, RUN_S, COST_S = 3.0, 30.0, 8.0
ACTORS = (0, 4, 8, 16)
SIZES_PX = ((160, 120), (320, 240), (640, 480))
DEFAULT_CASE = 2, (320, 240)  # actors and picture size that stay while the other one varies


class Cost(msgspec.Struct, frozen=True, kw_only=True):
    """CPU seconds for one simulated second."""

    policy: Policy
    actors: int
    width_px: int
    height_px: int
    cpu_s: float


def main(argv: list[str]) -> int:
    """Measure and print. Raises UserError for a file that cannot be written."""
    costs: list[Cost] = []

    def cost() -> FigureTable:
        costs.extend(measure_costs())
        return tabulate_costs(costs)

    parts: dict[str, Callable[[], FigureTable]] = {
        "physics": measure_physics, "eye": measure_eye, "lockstep": measure_lockstep,
        "cost": cost, "oracle": compare_with_reference, "estimation": tabulate_estimation,
    }  # fmt: skip
    parser = argparse.ArgumentParser(prog="paani bench water", description="How fast the simulator is, and how true.")
    parser.add_argument("--only", nargs="+", choices=tuple(parts), metavar="PART", help=f"of {', '.join(parts)}")
    parser.add_argument("--json", type=output_file("--json"), metavar="FILE", help="write the figures there too")
    parser.add_argument(
        "--svg", type=output_file("--svg"), metavar="FILE", help="plot cost against actors and picture size there"
    )
    options = parser.parse_args(argv)
    require_apart({"--json": options.json, "--svg": options.svg})
    names = options.only or list(parts)
    if options.svg and "cost" not in names:
        raise UserError("--svg needs the part cost")
    report = measure_tables(parts[name] for name in names)
    if options.json:
        write_whole(options.json, msgspec.json.encode(report) + b"\n", "--json")
    if options.svg:
        write_whole(options.svg, plot_costs(costs).encode(), "--svg")
    return 0


def measure_lockstep() -> FigureTable:
    """Whole drives: one with both cores to itself, and two side by side with one each."""
    rows: list[tuple[Cell, ...]] = []
    for policy in (Policy.PAANI, Policy.ORACLE, Policy.BLIND, Policy.PAPER):
        simulated_s, wall_s, cpu_s = time_drive(policy, 2, DEFAULT_CASE[1], RUN_S, threads=True)
        rows.append((policy.value, 1, simulated_s / wall_s, cpu_s / simulated_s))
        rows.append((policy.value, 2, _measure_parallel_speed(policy), None))
    return FigureTable(
        name="lockstep",
        columns=("policy", "drives at once", "x real time, together", "CPU s a simulated s"),
        rows=tuple(rows),
        note=f"river, {RUN_S:.0f} simulated seconds; plant, sensors, estimator, perception, deciders at live rates",
    )


def measure_costs() -> list[Cost]:
    """One core: more actors at the usual picture, and other pictures with the usual actors."""
    cases = [(policy, count, DEFAULT_CASE[1]) for policy in (Policy.PAANI, Policy.ORACLE) for count in ACTORS]
    cases += [(Policy.PAANI, DEFAULT_CASE[0], size) for size in SIZES_PX]
    found = []
    for policy, count, size in cases:
        simulated_s, _, cpu_s = time_drive(policy, count, size, COST_S, threads=False)
        found.append(
            Cost(policy=policy, actors=count, width_px=size[0], height_px=size[1], cpu_s=round(cpu_s / simulated_s, 4))
        )
    return found


def tabulate_costs(costs: list[Cost]) -> FigureTable:
    """The costs as a table."""
    return FigureTable(
        name="cost",
        columns=("policy", "actors", "picture", "CPU s a simulated s"),
        rows=tuple((c.policy.value, c.actors, f"{c.width_px} x {c.height_px}", c.cpu_s) for c in costs),
        note="river, one core; actors within sight of the boat",
    )


def plot_costs(costs: list[Cost]) -> str:
    """Two charts side by side as one SVG."""
    usual = [c for c in costs if (c.width_px, c.height_px) == DEFAULT_CASE[1]]
    by_actors = {
        policy.value: [(float(c.actors), c.cpu_s) for c in usual if c.policy is policy and c.actors in ACTORS]
        for policy in (Policy.PAANI, Policy.ORACLE)
    }
    by_size = {
        "paani": sorted(
            {
                (c.width_px * c.height_px * 1e-3, c.cpu_s)
                for c in costs
                if c.policy is Policy.PAANI and c.actors == DEFAULT_CASE[0]
            }
        )
    }
    top = 1.1 * max(c.cpu_s for c in costs)
    most = max(w * h for w, h in SIZES_PX) * 1e-3
    charts = [
        lines(by_actors, "actors in sight", "CPU s a simulated s", (0.0, float(max(ACTORS))), (0.0, top)),
        lines(by_size, "thousand pixels", "CPU s a simulated s", (0.0, most), (0.0, top)),
    ]
    parts = [
        element("style", ".grid{stroke:#dde4e8}.tick,.label,.name{font:11px sans-serif;fill:#1c2b33}"),
        element("rect", width=880, height=270, fill="#ffffff"),
        *(f'<g transform="translate({440 * k} 0)">{chart}</g>' for k, chart in enumerate(charts)),
    ]
    title = "CPU time by actors and by picture size"
    return drawing(880, 270, title, parts, xmlns="http://www.w3.org/2000/svg", width=880, height=270) + "\n"


def time_drive(
    policy: Policy, actors: int, size_wh: tuple[int, int], seconds: float, *, threads: bool
) -> tuple[float, float, float]:
    """Simulated, wall and CPU seconds of a drive under way, after a warm-up."""
    sets = (f"eye.width_px={size_wh[0]}", f"eye.height_px={size_wh[1]}")
    config, scenario = load_policy_config(policy, sets, threads=threads), _build_scenario(actors)
    drive = Drive(scenario, config, open_evidence_source(policy, scenario, config))
    try:
        _advance_drive(drive, WARM_UP_S)
        wall_ms, cpu_s, from_us = stopwatch_ms(), process_cpu_s(), drive.plant.sim_us
        _advance_drive(drive, WARM_UP_S + seconds)
        simulated_s = (drive.plant.sim_us - from_us) * 1e-6
        return simulated_s, (stopwatch_ms() - wall_ms) * 1e-3, process_cpu_s() - cpu_s
    finally:
        drive.close()


def _measure_parallel_speed(policy: Policy) -> float:
    """How many times faster than real time two drives in processes of their own are together."""
    for name in THREAD_COUNT_VARIABLES:
        os.environ[name] = "1"
    with concurrent.futures.ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as executor:
        futures = [executor.submit(_time_single_drive, policy) for _ in range(2)]
        return sum(simulated_s / wall_s for simulated_s, wall_s, _ in (future.result() for future in futures))


def _time_single_drive(policy: Policy) -> tuple[float, float, float]:
    cv2.setNumThreads(1)
    return time_drive(policy, *DEFAULT_CASE, RUN_S, threads=False)


def _advance_drive(drive: Drive, until_s: float) -> None:
    while drive.plant.sim_us < until_s * 1e6:
        drive.step()


def _build_scenario(actors: int) -> Scenario:
    """The river with so many boats on the path of its first one, all near the start."""
    world = load_world("river")
    lead = world.actors[0]
    fleet = tuple(_place_behind(lead, number) for number in range(actors))
    return Scenario("bench", dataclasses.replace(world, actors=fleet), task=Task(0.0, 1e4))


def _place_behind(lead: Actor, number: int) -> Actor:
    return dataclasses.replace(lead, id=f"boat_{number}", start_m=lead.start_m + 9.0 * number, speed_mps=0.4)
