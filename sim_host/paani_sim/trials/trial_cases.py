"""The cases of a trial: a scenario, a fault in it, and the policy that drives."""

from __future__ import annotations

import dataclasses
import hashlib
import zlib
from collections.abc import Iterable, Sequence
from pathlib import Path

import msgspec
import numpy as np

from paani.errors import UserError
from paani_sim.trials.conditions import TRAFFIC, parse_setting, traffic_of, with_condition
from paani_sim.trials.policies import Policy
from paani_sim.trials.seed_parts import MAX_SEED_DIGITS, SeedChoice, list_seeds
from paani_sim.worlds import WORLDS, Fault, FaultKind, Scenario
from paani_sim.worlds.generate import DRAWN_WORLDS, draw_random_scenario
from paani_sim.worlds.imazu import IMAZU_SCENARIOS
from paani_sim.worlds.load import SCENARIOS, load_scenario

FIELD_SEPARATOR, FAULT_SEPARATOR, SWEPT_SEPARATOR = ":", "+", "@"
FAULT_START_RANGE_S = (12.0, 30.0)  # s, between which a fault begins, drawn by the seed
# Duration of each fault of the suite [s], and its amount in the unit of its kind.
SUITE_FAULTS = {
    FaultKind.CAMERA_BLACK: (8.0, 0.0),
    FaultKind.CAMERA_FROZEN: (8.0, 0.0),
    FaultKind.CAMERA_BLURRED: (8.0, 8.0),
    FaultKind.CAMERA_DROPPED: (8.0, 0.0),
    FaultKind.GPS_OUTAGE: (15.0, 0.0),
    FaultKind.GPS_JUMP: (20.0, 12.0),
    FaultKind.COMPASS_BIAS: (20.0, 0.2),
    FaultKind.GYRO_BIAS: (20.0, 0.05),
    FaultKind.LINK_LOSS: (3.0, 0.0),
    FaultKind.THRUSTER_LOSS: (20.0, 0.5),
}
# Of a drive that asks for it by name: the boats of the suites carry no sonar.
OTHER_FAULTS = {FaultKind.SONAR_FROZEN: (600.0, 0.0)}
FAULT_ROUTE_LENGTH_M = 25.0  # long enough for a boat under way to meet its fault and to go on after it
CAMERA_FAULTS = tuple(kind for kind in SUITE_FAULTS if kind.name.startswith("CAMERA"))


class TrialCase(msgspec.Struct, frozen=True, order=True):
    """One drive. `world` is a kind of world in which `seed` draws a scenario, or the name or file of a scenario.

    swept: a condition that the world is given, as `current_mps=0.3`; empty: what it has.
    """

    world: str
    seed: int
    policy: Policy
    fault: str = ""
    swept: str = ""

    @property
    def name(self) -> str:
        """The case as `--one` takes it."""
        return f"{self.condition}{FIELD_SEPARATOR}{self.seed}{FIELD_SEPARATOR}{self.policy.value}"

    @property
    def condition(self) -> str:
        """World, swept condition and fault, as in `name`."""
        return self.world + self._changes

    @property
    def stem(self) -> str:
        """Stem of the names of the files that belong to this case."""
        place = Path(self.world).stem if is_fixed_scenario(self.world) else self.world
        if self.world.endswith(".toml"):  # files of one name in two folders are two scenarios
            place += f"-{hashlib.sha256(str(Path(self.world).absolute()).encode()).hexdigest()[:8]}"
        return f"{place}{self._changes}-{self.seed}-{self.policy.value}"

    @property
    def _changes(self) -> str:
        pairs = ((SWEPT_SEPARATOR, self.swept), (FAULT_SEPARATOR, self.fault))
        return "".join(separator + change for separator, change in pairs if change)


class TrialSuite(msgspec.Struct, frozen=True, kw_only=True):
    """`seed_count` seeds in every one of `worlds` for every policy; for `paani` also each fault in each so many times.

    `paper_seed_stride`: distance between the seeds of PAPER, whose drives take four times as long.
    """

    seed_count: int
    worlds: tuple[str, ...] = tuple(WORLDS)
    paper_seed_stride: int = 1
    camera_faults: int = 0
    other_faults: int = 0


SUITES = {
    "quick": TrialSuite(seed_count=2, paper_seed_stride=2),
    "standard": TrialSuite(seed_count=50, paper_seed_stride=10, camera_faults=3, other_faults=1),
    "imazu": TrialSuite(seed_count=1, worlds=IMAZU_SCENARIOS),
}


def is_fixed_scenario(world: str) -> bool:
    """Whether this names a written scenario, by name or as a file, and not a kind of world to draw one in."""
    return world.endswith(".toml") or world in SCENARIOS or world in IMAZU_SCENARIOS


def list_cases(
    suite: TrialSuite,
    worlds: Sequence[str],
    policies: Iterable[Policy],
    choice: SeedChoice | None = None,
    swept: Sequence[str] = (),
) -> list[TrialCase]:
    """Every case of a suite, in the order of driving. A choice that says which or how many seeds holds for PAPER too.

    Without one the seeds are the first development seeds. swept: each drive under each of these, and none with a fault.
    Raises UserError for a condition that a world cannot have.
    """
    for world in worlds:
        for condition in swept:
            _require_sweepable(world, condition)
    choice = choice or SeedChoice()
    seeds, chosen = list_seeds(choice, suite.seed_count), tuple(policies)
    every = {Policy.PAPER: 1 if choice.span or choice.count else suite.paper_seed_stride}
    found = [
        TrialCase(world, seed, policy, swept=condition)
        for number, seed in enumerate(seeds)
        for world in worlds
        for condition in swept or ("",)
        for policy in chosen
        if number % every.get(policy, 1) == 0
    ]
    if Policy.PAANI in chosen and not swept:
        for kind in SUITE_FAULTS:
            count = suite.camera_faults if kind in CAMERA_FAULTS else suite.other_faults
            found += [
                TrialCase(world, seed, Policy.PAANI, kind.value)
                for seed in seeds[:count]
                for world in worlds
                if not is_fixed_scenario(world)
            ]
    return found


def parse_case(text: str) -> TrialCase:
    """Parse `WORLD[@NAME=VALUE][+FAULT]:SEED:POLICY`. Raises UserError."""
    place, _, rest = text.partition(FIELD_SEPARATOR)
    seed, _, policy = rest.partition(FIELD_SEPARATOR)
    place, _, fault = place.partition(FAULT_SEPARATOR)
    world, _, swept = place.partition(SWEPT_SEPARATOR)
    if not (is_fixed_scenario(world) or world in DRAWN_WORLDS):
        raise UserError(f"--one {text}: no world '{world}' (have: {', '.join((*DRAWN_WORLDS, *SCENARIOS))}; or a file)")
    if fault and fault not in set(FaultKind):
        raise UserError(f"--one {text}: no fault '{fault}' (have: {', '.join(FaultKind)})")
    if policy not in set(Policy):
        raise UserError(f"--one {text}: no policy '{policy}' (have: {', '.join(Policy)})")
    if not seed.isdecimal() or len(seed) > MAX_SEED_DIGITS:
        raise UserError(f"--one {text}: '{seed}' is no seed")
    _require_sweepable(world, swept)
    return TrialCase(world, int(seed), Policy(policy), fault, swept)


def _require_sweepable(world: str, swept: str) -> None:
    """Raises UserError for a condition that is none, or that says what is met in a scenario where that is written."""
    if swept and parse_setting(swept)[0] in TRAFFIC and is_fixed_scenario(world):
        raise UserError(f"--sweep {swept}: {world} says itself what is met")


def build_scenario(case: TrialCase) -> Scenario:
    """Build the scenario of a case, with its fault. Raises UserError for a scenario file that cannot be used."""
    if is_fixed_scenario(case.world):
        scenario = dataclasses.replace(load_scenario(case.world), seed=case.seed)
    else:
        scenario = draw_random_scenario(case.world, case.seed, traffic_of(case.swept))
    if case.swept:
        scenario = dataclasses.replace(scenario, world=with_condition(scenario.world, case.swept))
    if not case.fault:
        return scenario
    kind = FaultKind(case.fault)
    duration_s, amount = (SUITE_FAULTS | OTHER_FAULTS)[kind]
    rng = np.random.default_rng([zlib.crc32(case.condition.encode()), case.seed])
    fault = Fault(kind, round(float(rng.uniform(*FAULT_START_RANGE_S)), 2), duration_s, amount)
    task = dataclasses.replace(
        scenario.task, distance_m=min(scenario.task.distance_m or FAULT_ROUTE_LENGTH_M, FAULT_ROUTE_LENGTH_M)
    )
    return dataclasses.replace(scenario, task=task, faults=(*scenario.faults, fault))
