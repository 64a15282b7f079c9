"""The Imazu cases for the local planner alone: no picture, no plant, vessels tracked as far as a tracker would.

`python -m tests.kinematic_imazu` prints the figures of every case and the means of each class. The boat moves as the
planner's own rollout says. A vessel is tracked while it is within the lens and `TRACKED_M`; its velocity comes with the
error that its deviation says, and is known once it is significant.
"""

from __future__ import annotations

import argparse
import math
import sys
from typing import NamedTuple

import msgspec
import numpy as np

from paani.config import PlannerConfig, load_config
from paani.geometry import wrap_rad
from paani.messages import EncounterClass, Label
from paani_services.navigator.avoidance.planner import plan_motion
from paani_services.navigator.avoidance.request import PlanRequest
from paani_services.navigator.avoidance.rollout import (
    STEERING_SATURATION_RAD,
    BoatState,
    GuidanceSetpoint,
    Plan,
)
from paani_services.navigator.mapping.dynamic_obstacles import DynamicObstacle
from paani_services.navigator.mapping.observed_cells import CELL_M
from paani_services.navigator.mapping.occupancy_grid import GRID_CELLS, OccupancyGrid
from paani_services.navigator.mapping.velocity_fit import MIN_SIGNIFICANCE, Velocity
from paani_sim.trials.hull_clearance import HullPath
from paani_sim.trials.rule_encounters import RuleEncounter, mean_own_score, measure_rule_encounters
from paani_sim.trials.rule_scores import score_by_rule
from paani_sim.vessels import load_vessel
from paani_sim.worlds import Actor
from paani_sim.worlds.footprint import build_outline
from paani_sim.worlds.imazu import DEPARTURE_S, IMAZU_SCENARIOS, ROUTE_LENGTH_M, build_imazu_scenario, is_fair

PLANNER = load_config().navigator.planner
STEP_S, TIME_LIMIT_S = 0.2, 240.0
LENS_DEG, TRACKED_M = 70.0, PLANNER.mover_range_m
NEAR_DEVIATION_MPS, FAR_DEVIATION_MPS = 0.03, 0.2  # of a velocity beside the boat, and more at `TRACKED_M`
ACROSS_FRAC = 0.3  # of that, across the line of sight: bearings are known better than ranges
ERROR_TIME_S = 2.5  # of the fit: after it the error of a velocity is another


class Coverage(NamedTuple):
    """What is tracked. error: of each velocity, in its standard deviations."""

    lens_deg: float = LENS_DEG
    range_m: float = PLANNER.mover_range_m
    error: float = 1.0


AS_CAMERA, ALL_ROUND = Coverage(), Coverage(360.0, 60.0, 0.0)


class KinematicDrive(NamedTuple):
    """How it went: when the boat was past (inf: not within the limit), and what it did about each vessel."""

    seconds: float
    encounters: tuple[RuleEncounter, ...]
    path: tuple[BoatState, ...]


def open_water(start: BoatState) -> OccupancyGrid:
    """A grid of free water around the boat."""
    none, half_m = np.zeros((GRID_CELLS, GRID_CELLS), bool), 0.5 * CELL_M * GRID_CELLS
    return OccupancyGrid(start.x_m - half_m, start.y_m - half_m, none, none, ~none, none, none, none, none)


def moved(boat: BoatState, plan: Plan, config: PlannerConfig) -> BoatState:
    """The boat a step later, by the laws of `roll_out`."""
    helm = min(1.0, max(-1.0, wrap_rad(plan.heading_rad - boat.yaw_rad) / STEERING_SATURATION_RAD))
    most = config.accel_mps2 * STEP_S
    surge_mps = boat.surge_mps + min(most, max(-most, plan.speed_mps - boat.surge_mps))
    most = config.yaw_accel_radps2 * STEP_S
    rate_radps = boat.yaw_rate_radps + min(most, max(-most, helm * config.yaw_rate_radps - boat.yaw_rate_radps))
    yaw_rad = wrap_rad(boat.yaw_rad + STEP_S * rate_radps)
    x_m = boat.x_m + STEP_S * surge_mps * math.cos(yaw_rad)
    return BoatState(x_m, boat.y_m + STEP_S * surge_mps * math.sin(yaw_rad), yaw_rad, surge_mps, rate_radps)


class Tracker:
    """Of one vessel: what the boat knows of it. The error of the velocity is drawn anew as the fit forgets."""

    def __init__(self, actor: Actor, rng: np.random.Generator, coverage: Coverage) -> None:
        self._actor, self._rng, self._coverage = actor, rng, coverage
        self._draw = rng.normal(size=2)
        self._seen: tuple[float, np.ndarray, Velocity] | None = None
        self.first_m: float | None = None  # range at which its velocity was first known

    def track(self, boat: BoatState, time_s: float) -> DynamicObstacle | None:
        """The obstacle, while it is seen and as it is predicted afterwards."""
        (x0, y0), (x1, y1) = self._actor.path_m[:2].tolist()
        course_rad, along_m = math.atan2(y1 - y0, x1 - x0), self._actor.speed_mps * time_s
        cos, sin = math.cos(course_rad), math.sin(course_rad)
        x_m, y_m = x0 + along_m * cos, y0 + along_m * sin
        range_m = math.hypot(x_m - boat.x_m, y_m - boat.y_m)
        keep = math.exp(-STEP_S / ERROR_TIME_S)
        self._draw = keep * self._draw + math.sqrt(1.0 - keep * keep) * self._rng.normal(size=2)
        bearing_rad = wrap_rad(math.atan2(y_m - boat.y_m, x_m - boat.x_m) - boat.yaw_rad)
        if range_m <= self._coverage.range_m and abs(bearing_rad) <= math.radians(0.5 * self._coverage.lens_deg):
            std_mps = NEAR_DEVIATION_MPS + FAR_DEVIATION_MPS * min(1.0, range_m / TRACKED_M) ** 2
            line_of_sight = np.array([[x_m - boat.x_m, boat.y_m - y_m], [y_m - boat.y_m, x_m - boat.x_m]]) / range_m
            deviations_mps = std_mps * np.array([1.0, ACROSS_FRAC])
            velocity = self._actor.speed_mps * np.array([cos, sin])
            velocity = velocity + self._coverage.error * (line_of_sight @ (deviations_mps * self._draw))
            covariance = (line_of_sight * deviations_mps**2) @ line_of_sight.T
            if velocity @ np.linalg.solve(covariance, velocity) >= MIN_SIGNIFICANCE**2:
                self.first_m = range_m if self.first_m is None else self.first_m
                points = np.array([x_m, y_m]) + build_outline(self._actor) @ np.array([[cos, sin], [-sin, cos]])
                (east_east, east_north), (_, north_north) = covariance.tolist()
                most_mps = math.sqrt(max(east_east, north_north))
                east_mps, north_mps = velocity.tolist()
                fit = Velocity(east_mps, north_mps, most_mps, (east_east, east_north, north_north))
                self._seen = (time_s, points, fit)
        if self._seen is None:
            return None
        seen_s, points, fit = self._seen
        age_s = time_s - seen_s
        east_m, north_m = points[:, 0] + age_s * fit.east_mps, points[:, 1] + age_s * fit.north_mps
        return DynamicObstacle(east_m, north_m, PLANNER.vessel_near_m, fit, age_s, frozenset(), 1, Label.VESSEL)


def drive(name: str, seed: int = 0, coverage: Coverage = AS_CAMERA) -> KinematicDrive:
    """Drive one case."""
    world = build_imazu_scenario(name).world
    boat, previous, waiting_since_s = BoatState(0.0, 0.0, 0.0), None, None
    rng = np.random.default_rng([seed, IMAZU_SCENARIOS.index(name)])
    trackers = [Tracker(actor, rng, coverage) for actor in world.actors]
    path, time_s = [], DEPARTURE_S
    while boat.x_m < ROUTE_LENGTH_M - 4.0 and time_s < TIME_LIMIT_S:
        course_rad = math.atan2(-boat.y_m, 6.0)  # back to the route, as line-of-sight guidance does
        tracked = [each.track(boat, time_s) for each in trackers]
        request = PlanRequest(
            grid=open_water(boat),
            start=boat,
            setpoint=GuidanceSetpoint(course_rad, 0.6),
            config=PLANNER,
            obstacles=tuple(each for each in tracked if each is not None),
            previous=previous,
            may_wait=waiting_since_s is None or time_s - waiting_since_s < PLANNER.patience_s,
        )
        previous = plan_motion(request)
        held_up = previous.is_waiting or previous.speed_mps == 0.0
        waiting_since_s = (time_s if waiting_since_s is None else waiting_since_s) if held_up else None
        boat = moved(boat, previous, PLANNER)
        time_s += STEP_S
        path.append((time_s, boat))
    states = [each for _, each in path]
    along_m = np.array([[actor.speed_mps * at_s for actor in world.actors] for at_s, _ in path])
    x_m, y_m, yaw_rad = np.array([each[:3] for each in states]).T
    hull_path = HullPath(load_vessel("otter").hull, x_m, y_m, yaw_rad, along_m)
    surge_mps = np.array([each.surge_mps for each in states])
    measured = measure_rule_encounters(world, hull_path, surge_mps, PLANNER.speed_mps, coverage.lens_deg)
    found = tuple(_since_known(each, t.first_m) for each, t in zip(measured, trackers, strict=True))
    done = boat.x_m >= ROUTE_LENGTH_M - 4.0
    return KinematicDrive(time_s - DEPARTURE_S if done else math.inf, found, tuple(states))


def _since_known(met: RuleEncounter, known_m: float | None) -> RuleEncounter:
    """The encounter with its delay counted from where the planner knew of it."""
    manoeuvre = msgspec.structs.replace(met.manoeuvre, detected_m=known_m)
    scores = score_by_rule(met.encounter_class, manoeuvre)
    return msgspec.structs.replace(met, manoeuvre=manoeuvre, scores=scores)


def main() -> None:
    """Print a line for each case, and means."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--all-round", action="store_true")
    parser.add_argument("--cases", nargs="*", default=list(IMAZU_SCENARIOS))
    options = parser.parse_args()
    for fair in (False, True):
        drives = [
            (name, drive(name, options.seed, ALL_ROUND if options.all_round else AS_CAMERA))
            for name in options.cases
            if is_fair(name) is fair
        ]
        lines = [f"{name:15} {each.seconds:6.1f} s {' '.join(map(_tell, each.encounters))}" for name, each in drives]
        sys.stdout.write("\n".join((*lines, *_tell_means("camera-fair" if fair else "plain", dict(drives)))) + "\n")


def _tell(met: RuleEncounter) -> str:
    """Class, score, clearance, D: domain entered, turn to starboard, range at which it was known and acted upon."""
    score, did = next(iter(met.scores.values()), math.nan), met.manoeuvre
    return (
        f"{met.encounter_class.value}:{score:.2f}/{met.clearance_m:.1f}m{'D' if met.is_domain_entered else ''}"
        f"(t{did.starboard_turn_deg:.0f} d{did.detected_m or 0:.0f} a{did.acted_m or 0:.0f})"
    )


def _tell_means(form: str, drives: dict[str, KinematicDrive]) -> list[str]:
    met = [each for drive in drives.values() for each in drive.encounters]
    lines = []
    for kind in EncounterClass:
        mean = mean_own_score(met, kind)
        if mean is not None:
            lines.append(f"  {form} {kind.value:20} n={sum(e.encounter_class is kind for e in met):3} mean {mean:.3f}")
    contacts, near = sum(e.clearance_m <= 0.0 for e in met), sum(0.0 < e.clearance_m < 0.5 for e in met)
    entered = sum(any(e.is_domain_entered for e in each.encounters) for each in drives.values())
    done = [each.seconds for each in drives.values() if math.isfinite(each.seconds)]
    if not drives:
        return []
    return [
        *lines,
        f"  {form} drives {len(drives)}: contacts {contacts}, near {near}, domain {entered}, done {len(done)},"
        f" mean time {sum(done) / max(1, len(done)):.1f} s",
    ]


if __name__ == "__main__":
    main()
