"""What a boat did about each vessel that it met on a collision course, from the samples of its drive. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence

import msgspec
import numpy as np

from paani.arrays import F64, Bools
from paani.encounters import classify_encounter
from paani.messages import EncounterClass
from paani_sim.trials.hull_clearance import HullPath, compute_actor_poses, compute_clearances_m
from paani_sim.trials.rule_scores import CLEAR_M, Manoeuvre, score_by_rule
from paani_sim.worlds import Actor, Kind, World
from paani_sim.worlds.footprint import build_outline

PERSON_CLEAR_M, LARGE_VESSEL_CLEAR_M = 2.0, 5.0  # wanted of people, and of vessels longer than LARGE_VESSEL_M
LARGE_VESSEL_M = 7.0
UNDER_WAY_FRAC = 0.9  # of the cruising speed: from then on the boat's manoeuvres count
ACTED_TURN_DEG, ACTED_SPEED_FRAC = 10.0, 0.8  # off the first heading, or of the cruising speed: the boat has acted
# Ship domain of four quarter ellipses around the middle of a hull of 1.3 m x 0.75 m: size 2 of MarWaltz/TUD_RL.
DOMAIN_AHEAD_M, DOMAIN_ASTERN_M, DOMAIN_PORT_M, DOMAIN_STARBOARD_M = 3.3, 2.2, 1.9, 3.4


class RuleEncounter(msgspec.Struct, frozen=True, kw_only=True):
    """One vessel met. `scores` by rule, the class's own first.

    is_seen: it was within the lens before the closest point.
    clearance_m: least, between hulls. is_domain_entered: some of its outline came into the boat's ship domain.
    """

    what: str
    encounter_class: EncounterClass
    is_seen: bool
    clearance_m: float
    is_domain_entered: bool
    manoeuvre: Manoeuvre
    scores: dict[str, float]


def measure_rule_encounters(
    world: World, hull_path: HullPath, surge_mps: F64, cruise_mps: float, hfov_deg: float
) -> tuple[RuleEncounter, ...]:
    """One for each actor of the world. surge_mps: of each moment of the path. hfov_deg: of the boat's lens."""
    if not len(surge_mps):
        return ()
    clearances_m = compute_clearances_m(world, hull_path)
    return tuple(
        _measure(actor, number, clearances_m[actor.id], hull_path, surge_mps, cruise_mps, hfov_deg)
        for number, actor in enumerate(world.actors)
    )


def is_in_domain(ahead_m: F64, starboard_m: F64) -> Bools:
    """Whether places relative to the boat's middle are in its ship domain."""
    along = np.where(ahead_m >= 0.0, ahead_m / DOMAIN_AHEAD_M, ahead_m / DOMAIN_ASTERN_M)
    across = np.where(starboard_m >= 0.0, starboard_m / DOMAIN_STARBOARD_M, starboard_m / DOMAIN_PORT_M)
    return np.asarray(along * along + across * across < 1.0)


def _measure(
    actor: Actor,
    number: int,
    clearance_m: F64,
    hull_path: HullPath,
    surge_mps: F64,
    cruise_mps: float,
    hfov_deg: float,
) -> RuleEncounter:
    poses = compute_actor_poses(actor, hull_path.along_m[:, number])
    east_m, north_m = poses[:, 0] - hull_path.x_m, poses[:, 1] - hull_path.y_m
    range_m = np.hypot(east_m, north_m)
    bearing_deg = _clockwise_deg(np.arctan2(north_m, east_m), hull_path.yaw_rad)
    aspect_deg = _clockwise_deg(np.arctan2(-north_m, -east_m), poses[:, 2])
    last = int(range_m.argmin())
    first = min(last, int(np.argmax(surge_mps >= UNDER_WAY_FRAC * cruise_mps)))
    kind = classify_encounter(float(bearing_deg[0]), float(aspect_deg[0]), cruise_mps, actor.speed_mps)
    approach = slice(first, last + 1)
    turn_deg = _clockwise_deg(hull_path.yaw_rad[approach], np.array(hull_path.yaw_rad[0]))
    speed_mps = surge_mps[approach]
    acted = np.flatnonzero((np.abs(turn_deg) >= ACTED_TURN_DEG) | (speed_mps <= ACTED_SPEED_FRAC * cruise_mps))
    seen = np.flatnonzero(np.abs(bearing_deg[: last + 1]) <= 0.5 * hfov_deg)
    manoeuvre = Manoeuvre(
        clearance_m=_rounded(clearance_m.min()),
        detected_m=_rounded(range_m[seen[0]]) if len(seen) else None,
        acted_m=_rounded(range_m[first + acted[0]]) if len(acted) else None,
        closest_m=_rounded(range_m[last]),
        bearing_deg=_rounded(bearing_deg[last]),
        aspect_deg=_rounded(aspect_deg[last]),
        turn_deg=_rounded(np.abs(turn_deg).max()),
        starboard_turn_deg=_rounded(max(0.0, float(turn_deg.max()))),
        start_mps=cruise_mps,
        least_mps=_rounded(max(0.0, float(speed_mps.min()))),
        most_mps=_rounded(speed_mps.max()),
    )
    return RuleEncounter(
        what=actor.id,
        encounter_class=kind,
        is_seen=len(seen) > 0,
        clearance_m=manoeuvre.clearance_m,
        is_domain_entered=_enters_domain(actor, poses, hull_path),
        manoeuvre=manoeuvre,
        scores={rule: _rounded(score) for rule, score in score_by_rule(kind, manoeuvre, clear_m_of(actor)).items()},
    )


def clear_m_of(actor: Actor) -> float:
    """The clearance between hulls at which an actor is passed well clear [m]."""
    if actor.kind is Kind.PERSON:
        return PERSON_CLEAR_M
    return LARGE_VESSEL_CLEAR_M if actor.length_m > LARGE_VESSEL_M else CLEAR_M


def _enters_domain(actor: Actor, poses: F64, hull_path: HullPath) -> bool:
    points = np.vstack([build_outline(actor), [[0.0, 0.0]]])
    cos, sin = np.cos(poses[:, 2])[:, None], np.sin(poses[:, 2])[:, None]
    east_m = poses[:, 0, None] + cos * points[:, 0] - sin * points[:, 1] - hull_path.x_m[:, None]
    north_m = poses[:, 1, None] + sin * points[:, 0] + cos * points[:, 1] - hull_path.y_m[:, None]
    cos, sin = np.cos(hull_path.yaw_rad)[:, None], np.sin(hull_path.yaw_rad)[:, None]
    return bool(is_in_domain(cos * east_m + sin * north_m, sin * east_m - cos * north_m).any())


def _clockwise_deg(direction_rad: F64, from_rad: F64) -> F64:
    """The angle from one direction to another, both counter-clockwise from east: clockwise, [-180, 180)."""
    return np.asarray(np.degrees((from_rad - direction_rad + math.pi) % (2.0 * math.pi) - math.pi))


def _rounded(value: float | np.floating | F64) -> float:
    return round(float(value), 4)


def mean_own_score(encounters: Sequence[RuleEncounter], kind: EncounterClass) -> float | None:
    """Mean score by the class's own rule; None without an encounter of the class."""
    scores = [next(iter(each.scores.values())) for each in encounters if each.encounter_class is kind and each.scores]
    return sum(scores) / len(scores) if scores else None
