"""The result of one drive: closed values that encode to JSON. Equal drives give equal bytes."""

from __future__ import annotations

from enum import StrEnum

import msgspec

from paani.statistics.dithering import Dithering
from paani_sim.trials.drive_states import DriveOutcome
from paani_sim.trials.policies import Policy
from paani_sim.trials.rule_encounters import RuleEncounter
from paani_sim.trials.seed_parts import SeedPart


class Closeness(StrEnum):
    """Clearance between hull and footprint at the closest point of an encounter.

    GRAZING: under 0.3 m, less than half the hull's width. TIGHT: under 0.6 m, one second at cruising speed.
    CLOSE: under 1.5 m, twice the hull's width. CLEAR: the rest of the encounters, which begin at five metres.
    """

    CONTACT = "contact"
    GRAZING = "grazing"
    TIGHT = "tight"
    CLOSE = "close"
    CLEAR = "clear"


NEAR_MISS_CLEARANCE_M = 0.5  # without touching: less than the hull's width
PERSON_CLEARANCE_M = 1.5  # least distance to be kept to a person: twice the hull's width, as for CLOSE
CLOSENESS_LIMIT_M = {Closeness.GRAZING: 0.3, Closeness.TIGHT: 0.6, Closeness.CLOSE: 1.5}


class Encounter(msgspec.Struct, frozen=True, kw_only=True):
    """One approach to a thing or the bank: clearance and time of the closest point."""

    what: str
    kind: str
    at_s: float
    clearance_m: float
    closeness: Closeness
    x_m: float
    y_m: float


def is_near_miss(encounter: Encounter) -> bool:
    """Whether it came under `NEAR_MISS_CLEARANCE_M` without touching."""
    return encounter.closeness is not Closeness.CONTACT and encounter.clearance_m < NEAR_MISS_CLEARANCE_M


SHOAL = "shoal"  # kind of a contact by which the boat runs aground


class Contact(msgspec.Struct, frozen=True, kw_only=True):
    """One touch. `visible`: the camera could have seen it in the five seconds before."""

    what: str
    kind: str
    at_s: float
    x_m: float
    y_m: float
    speed_mps: float
    visible: bool


class StopTotals(msgspec.Struct, frozen=True, kw_only=True):
    """Number and total duration of commanded stops for one reason."""

    reason: str
    count: int
    seconds: float


class Reaction(msgspec.Struct, frozen=True, kw_only=True):
    """Reaction to a camera fault, in seconds from its beginning; None: never.

    `noticed_s`: the picture first called unusable, or None where none came. `zero_thrust_s`, `rest_s`: fans off
    until the fault is over, boat slower than 0.05 m/s. `in_time`: fans off within one frame and 0.5 s.
    """

    fault: str
    at_s: float
    noticed_s: float | None
    zero_thrust_s: float | None
    rest_s: float | None
    in_time: bool


class Latency(msgspec.Struct, frozen=True, kw_only=True):
    """From a picture to the first thrust decided from it, simulated time [s]; None without a source of evidence."""

    p50_s: float | None = None
    p95_s: float | None = None
    max_s: float | None = None
    samples: int = 0


class TrialResult(msgspec.Struct, frozen=True, kw_only=True):
    """One drive. `track`: time, x, y every two seconds. Cross-track error is that of the true position.

    `part`: what the seed may be used for. `profile`: of the settings that it was driven with; `hfov_deg`: of its lens.
    `rule_encounters`: of the Imazu cases alone.
    """

    scenario: str
    seed: int
    part: SeedPart
    policy: Policy
    profile: str
    hfov_deg: float
    world: str
    why: DriveOutcome
    completed: bool
    error: str
    goal_m: float
    progress_m: float
    distance_m: float
    seconds: float
    limit_s: float
    collisions: int
    collisions_visible: int
    collisions_bank: int
    near_misses: int
    near_misses_bank: int
    min_clearance_m: float
    min_bank_clearance_m: float
    off_route_rms_m: float
    off_route_max_m: float
    energy_j: float
    frames: int
    unusable: int
    encounters: tuple[Encounter, ...]
    contacts: tuple[Contact, ...]
    stops: tuple[StopTotals, ...]
    reactions: tuple[Reaction, ...]
    latency: Latency
    dithering: Dithering
    track: tuple[tuple[float, float, float], ...]
    state_hash: str
    rule_encounters: tuple[RuleEncounter, ...] = ()
