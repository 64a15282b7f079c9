"""Scores a finished drive: contacts, encounters, stops, latency and progress. Pure."""

from __future__ import annotations

import collections
import math
from collections.abc import Iterable, Sequence

import numpy as np

from paani.arrays import F64
from paani.config import EyeConfig
from paani.statistics.dithering import dithering
from paani.statistics.order_statistics import nearest_rank
from paani_sim.plant.plant import Touch
from paani_sim.trials.drive import SAMPLE_HZ, Drive
from paani_sim.trials.drive_history import DriveSample, StopInterval, ThrustChange
from paani_sim.trials.drive_states import DriveOutcome
from paani_sim.trials.fault_reactions import measure_reactions
from paani_sim.trials.hull_clearance import (
    BANK,
    MAX_CLEARANCE_M,
    HullPath,
    compute_clearances_m,
    list_waterborne,
    was_visible,
)
from paani_sim.trials.policies import Policy, processed_frame_rate_hz
from paani_sim.trials.result import (
    CLOSENESS_LIMIT_M,
    SHOAL,
    Closeness,
    Contact,
    Encounter,
    Latency,
    StopTotals,
    TrialResult,
    is_near_miss,
)
from paani_sim.trials.rule_encounters import RuleEncounter, measure_rule_encounters
from paani_sim.trials.seed_parts import part_of_seed
from paani_sim.vessels.vessel import Hull
from paani_sim.worlds import Kind, World
from paani_sim.worlds.bathymetry import SHOAL_GEOM_PREFIX
from paani_sim.worlds.imazu import IMAZU_SCENARIOS

ENCOUNTER_RANGE_M = {
    "thing": 5.0,
    BANK: CLOSENESS_LIMIT_M[Closeness.CLOSE],
}  # of a thing; nearer of a bank, which is always in sight
ENCOUNTER_GAP_S = 3.0  # two approaches to one thing with a shorter gap are one encounter
VISIBLE_BEFORE_S, VISIBLE_RANGE_M = 5.0, 15.0
CONTACT_GAP_S = 5.0
BANK_GEOM_PREFIX = "bank_"  # prefix of the bank's geoms in the plant
TRACK_INTERVAL_S = 2.0


def score_drive(drive: Drive, policy: Policy) -> TrialResult:
    """Score a drive that has ended."""
    scenario, history, eye = drive.scenario, drive.history, drive.config.eye
    world, samples = scenario.world, history.samples
    hull_path = build_hull_path(world, drive.plant.vessel.hull, samples)
    clearances_m = compute_clearances_m(world, hull_path)
    contacts = find_contacts(world, drive.plant.touches, samples, hull_path, eye)
    encounters = find_encounters(world, samples, clearances_m, contacts)
    cross_track_m = np.array([sample.cross_track_m for sample in samples] or [0.0])
    things = [encounter for encounter in encounters if encounter.what != BANK]
    banks = [encounter for encounter in encounters if encounter.what == BANK]
    rule_encounters: tuple[RuleEncounter, ...] = ()
    if scenario.name in IMAZU_SCENARIOS:
        surge_mps = np.array([sample.surge_mps for sample in samples])
        cruise_mps = drive.config.navigator.cruise_mps
        rule_encounters = measure_rule_encounters(world, hull_path, surge_mps, cruise_mps, eye.hfov_deg)
    every = round(TRACK_INTERVAL_S * SAMPLE_HZ)
    return TrialResult(
        scenario=scenario.name,
        seed=scenario.seed,
        part=part_of_seed(scenario.seed),
        policy=policy,
        profile=drive.config.profile,
        hfov_deg=eye.hfov_deg,
        world=world.name,
        why=drive.outcome,
        completed=drive.outcome is DriveOutcome.COMPLETED,
        error=drive.error,
        goal_m=round(drive.goal_m, 3),
        progress_m=round(drive.progress.best_progress_m, 3),
        distance_m=round(drive.plant.distance_m, 3),
        seconds=round(drive.elapsed_s, 3),
        limit_s=round(drive.time_limit_s, 3),
        collisions=len(contacts),
        collisions_visible=sum(contact.visible for contact in contacts),
        collisions_bank=sum(contact.what == BANK for contact in contacts),
        near_misses=sum(map(is_near_miss, things)),
        near_misses_bank=sum(map(is_near_miss, banks)),
        min_clearance_m=_min_clearance_m(gaps for what, gaps in clearances_m.items() if what != BANK),
        min_bank_clearance_m=_min_clearance_m([clearances_m[BANK]]),
        off_route_rms_m=round(float(np.sqrt((cross_track_m * cross_track_m).mean())), 3),
        off_route_max_m=round(float(np.abs(cross_track_m).max()), 3),
        energy_j=round(drive.plant.energy_j, 1),
        frames=drive.frames,
        unusable=len(history.unusable_frames),
        encounters=encounters,
        contacts=contacts,
        stops=summarise_stops(history.stops, samples[-1].t_s if samples else 0.0),
        reactions=measure_reactions(scenario.faults, history, 1.0 / processed_frame_rate_hz(drive.config)),
        latency=summarise_latency(history.thrust_changes) if policy is not Policy.BLIND else Latency(),
        dithering=dithering(history.advisories),
        track=tuple((round(s.t_s, 1), round(s.x_m, 2), round(s.y_m, 2)) for s in samples[::every]),
        state_hash=drive.plant.state_hash(),
        rule_encounters=rule_encounters,
    )


def build_hull_path(world: World, hull: Hull, samples: Sequence[DriveSample]) -> HullPath:
    """The samples as a path of the hull."""
    progress = [sample.actors_along_m for sample in samples]
    return HullPath(
        hull,
        np.array([sample.x_m for sample in samples]),
        np.array([sample.y_m for sample in samples]),
        np.array([sample.yaw_rad for sample in samples]),
        np.array(progress, np.float64).reshape(len(samples), len(world.actors)),
    )


def find_contacts(
    world: World,
    touches: Sequence[Touch],
    samples: Sequence[DriveSample],
    hull_path: HullPath,
    eye: EyeConfig,
) -> tuple[Contact, ...]:
    """Find each time the hull began to touch something, and whether the camera could have seen it before.

    A touch that begins within `CONTACT_GAP_S` of the end of those before of the same thing is one contact with them, as
    of a hull that scrapes. touches: in the order in which they began.
    """
    kinds, found, until_s = map_kinds(world), list[Contact](), dict[str, float]()
    half_fov_rad = math.radians(0.5 * eye.hfov_deg)
    for touch in touches:
        k = next((k for k, sample in enumerate(samples) if sample.t_s >= touch.began_s), len(samples) - 1)
        if k < 0:
            continue
        what = BANK if touch.name.startswith(BANK_GEOM_PREFIX) else touch.name
        before_s = until_s.get(what, -math.inf)
        until_s[what] = max(before_s, touch.ended_s)
        if touch.began_s - before_s <= CONTACT_GAP_S:
            continue
        before = hull_path.slice_moments(slice(max(0, k - round(VISIBLE_BEFORE_S * SAMPLE_HZ)), k + 1, 2))
        found.append(
            Contact(
                what=what,
                kind=kinds.get(what, Kind.OTHER.value),
                at_s=round(touch.began_s, 2),
                x_m=round(samples[k].x_m, 2),
                y_m=round(samples[k].y_m, 2),
                speed_mps=round(abs(samples[max(0, k - 2)].surge_mps), 3),
                visible=kinds.get(what) != SHOAL
                and was_visible(
                    world, what, before, half_fov_rad, VISIBLE_RANGE_M, eye.camera_forward_m, eye.camera_height_m
                ),
            )
        )
    return tuple(found)


def find_encounters(
    world: World, samples: Sequence[DriveSample], clearances_m: dict[str, F64], contacts: Sequence[Contact]
) -> tuple[Encounter, ...]:
    """Find every approach within encounter range, in order of time."""
    kinds, found = map_kinds(world), []
    for what, gaps in clearances_m.items():
        near = np.flatnonzero(gaps < ENCOUNTER_RANGE_M[BANK if what == BANK else "thing"])
        if not len(near):
            continue
        for part in np.split(near, np.flatnonzero(np.diff(near) > ENCOUNTER_GAP_S * SAMPLE_HZ) + 1):
            k = int(part[np.argmin(gaps[part])])
            begin_s, end_s = samples[int(part[0])].t_s, samples[int(part[-1])].t_s
            touched = any(c.what == what and begin_s - 0.2 <= c.at_s <= end_s + 0.2 for c in contacts)
            clearance_m = 0.0 if touched else float(gaps[k])
            found.append(
                Encounter(
                    what=what,
                    kind=kinds[what],
                    at_s=round(samples[k].t_s, 2),
                    clearance_m=round(clearance_m, 3),
                    closeness=Closeness.CONTACT if touched else classify_closeness(clearance_m),
                    x_m=round(samples[k].x_m, 2),
                    y_m=round(samples[k].y_m, 2),
                )
            )
    return tuple(sorted(found, key=lambda encounter: (encounter.at_s, encounter.what)))


def classify_closeness(clearance_m: float) -> Closeness:
    """Class of the clearance at a closest point without contact."""
    return next((kind for kind, under_m in CLOSENESS_LIMIT_M.items() if clearance_m < under_m), Closeness.CLEAR)


def map_kinds(world: World) -> dict[str, str]:
    """Kind of each thing in the water, and of each shoal, by id."""
    shoals = {f"{SHOAL_GEOM_PREFIX}{number}": SHOAL for number in range(len(world.shoals))}
    return {thing.id: thing.kind.value for thing in list_waterborne(world)} | {BANK: BANK} | shoals


def summarise_stops(stops: Sequence[StopInterval], end_s: float) -> tuple[StopTotals, ...]:
    """Number and duration of stops by reason, the longest first."""
    count: collections.Counter[str] = collections.Counter()
    seconds: collections.defaultdict[str, float] = collections.defaultdict(float)
    for stop in stops:
        count[stop.reason] += 1
        seconds[stop.reason] += (stop.ended_s if stop.ended_s is not None else end_s) - stop.t_s
    order = sorted(count, key=lambda reason: (-seconds[reason], reason))
    return tuple(StopTotals(reason=reason, count=count[reason], seconds=round(seconds[reason], 2)) for reason in order)


def summarise_latency(applied: Sequence[ThrustChange]) -> Latency:
    """Latency from each picture to the first thrust decided from it."""
    newest_us, found = 0, []
    for each in applied:
        if each.picture_us > newest_us and not each.is_zero:
            newest_us = each.picture_us
            found.append(round((each.at_us - each.picture_us) * 1e-6, 3))
    if not found:
        return Latency()
    ordered = sorted(found)
    return Latency(
        p50_s=nearest_rank(ordered, 50), p95_s=nearest_rank(ordered, 95), max_s=ordered[-1], samples=len(ordered)
    )


def _min_clearance_m(clearances_m: Iterable[F64]) -> float:
    return round(min((float(gaps.min()) for gaps in clearances_m if len(gaps)), default=MAX_CLEARANCE_M), 3)
