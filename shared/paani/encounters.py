"""Classes of the encounter of two vessels, by the angles between them. Pure.

After Woerner et al.: "Quantifying protocol evaluation for autonomous collision avoidance", Autonomous Robots 43 (2019),
doi 10.1007/s10514-018-9765-y, made symmetric: a boat that gives way to everything treats both sides alike.
"""

from __future__ import annotations

from paani.messages import EncounterClass

OVERTAKEN_SECTOR_DEG = 112.5  # off the bow: further round, a vessel comes from astern
OVERTAKING_COURSE_DEG = 45.0  # the faster one's bow points at the slower one within this
HEAD_ON_DEG = 13.0  # off both bows
CROSSING_TOLERANCE_DEG = 10.0  # by which a crossing vessel's bow may point across ours


def classify_encounter(bearing_deg: float, aspect_deg: float, own_mps: float, target_mps: float) -> EncounterClass:
    """The class of an encounter at its beginning; it is kept until the two are past each other.

    Angles are clockwise, (-180, 180]: `bearing_deg` of the target from our bow, `aspect_deg` is our bearing from the
    target's.
    """
    bearing, aspect = abs(bearing_deg), abs(aspect_deg)
    if bearing >= OVERTAKEN_SECTOR_DEG and aspect < OVERTAKING_COURSE_DEG and target_mps > own_mps:
        return EncounterClass.OVERTAKEN
    if aspect >= OVERTAKEN_SECTOR_DEG and bearing < OVERTAKING_COURSE_DEG and own_mps > target_mps:
        return EncounterClass.OVERTAKING
    if aspect < HEAD_ON_DEG and bearing < HEAD_ON_DEG:
        return EncounterClass.HEAD_ON
    side = 1.0 if bearing_deg >= 0.0 else -1.0
    if bearing <= OVERTAKEN_SECTOR_DEG and -OVERTAKEN_SECTOR_DEG <= side * aspect_deg <= CROSSING_TOLERANCE_DEG:
        return EncounterClass.CROSSING_STARBOARD if side > 0.0 else EncounterClass.CROSSING_PORT
    return EncounterClass.NONE
