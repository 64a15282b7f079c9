"""Kind and usual size of things, by their look. Animals and what drifts are of no class that the detector knows."""

from __future__ import annotations

from typing import NamedTuple

from paani_sim.worlds.world import Actor, Kind, Obstacle


class Size(NamedTuple):
    """What a thing with this look is, and how large it usually is."""

    kind: Kind
    length_m: float
    width_m: float
    height_m: float

    def scaled(self, factor: float) -> Size:
        """As tall, and so many times as long and wide."""
        return self._replace(length_m=factor * self.length_m, width_m=factor * self.width_m)


SIZES: dict[str, Size] = {
    "rowboat": Size(Kind.VESSEL, 3.7, 1.4, 0.6),
    "dinghy": Size(Kind.VESSEL, 3.4, 1.5, 0.9),
    "kayak": Size(Kind.VESSEL, 4.2, 0.7, 1.1),
    "cruiser": Size(Kind.VESSEL, 6.2, 2.1, 1.9),
    "sailboat": Size(Kind.VESSEL, 6.6, 2.1, 8.5),
    "workboat": Size(Kind.VESSEL, 7.2, 2.5, 2.6),
    "barge": Size(Kind.VESSEL, 13.0, 2.6, 2.2),
    "narrowboat": Size(Kind.VESSEL, 12.0, 2.1, 1.8),
    "tug": Size(Kind.VESSEL, 11.0, 3.5, 5.5),
    "pontoonboat": Size(Kind.VESSEL, 6.0, 2.4, 2.4),
    "eight": Size(Kind.VESSEL, 17.6, 6.4, 1.1),  # as wide as its oars reach
    "paddleboard": Size(Kind.VESSEL, 3.3, 0.8, 1.9),
    "jetski": Size(Kind.VESSEL, 3.2, 1.2, 1.5),
    "ferry": Size(Kind.VESSEL, 10.5, 3.8, 4.0),
    "standing": Size(Kind.PERSON, 0.5, 0.5, 1.75),
    "walking": Size(Kind.PERSON, 0.5, 0.5, 1.75),
    "sitting": Size(Kind.PERSON, 0.6, 0.6, 1.2),
    "swimming": Size(Kind.PERSON, 1.1, 0.6, 0.4),
    "jetty": Size(Kind.PIER, 8.0, 1.8, 0.8),
    "pontoon": Size(Kind.PIER, 10.0, 2.2, 0.45),
    "quay": Size(Kind.PIER, 6.0, 2.0, 0.9),
    "quay_steps": Size(Kind.PIER, 4.0, 1.2, 0.9),
    "finger": Size(Kind.PIER, 11.0, 1.6, 0.45),
    "can": Size(Kind.BUOY, 0.7, 0.7, 1.2),
    "cone": Size(Kind.BUOY, 0.7, 0.7, 1.2),
    "sphere": Size(Kind.BUOY, 0.8, 0.8, 0.7),
    "pillar": Size(Kind.BUOY, 0.8, 0.8, 2.2),
    "spar": Size(Kind.BUOY, 0.5, 0.5, 2.0),
    "crane": Size(Kind.OTHER, 6.0, 5.0, 15.0),
    "warehouse": Size(Kind.OTHER, 24.0, 10.0, 8.0),
    "island": Size(Kind.OTHER, 20.0, 7.0, 4.0),
    "weir": Size(Kind.OTHER, 22.0, 1.8, 0.35),
    "bridge_pier": Size(Kind.OTHER, 5.6, 1.5, 3.6),
    "log": Size(Kind.OTHER, 3.6, 0.5, 0.25),
    "dog": Size(Kind.OTHER, 0.9, 0.35, 0.35),
    "swan": Size(Kind.OTHER, 1.1, 0.5, 0.85),
    "duck": Size(Kind.OTHER, 0.5, 0.25, 0.3),
}
AFLOAT_LOOKS = frozenset({"swimming", "log", "dog", "swan", "duck"})  # besides vessels and buoys
HULL_BEAM_M = {"eight": 0.6}  # where the width is not the hull's
WAVELESS_LOOKS = frozenset({"eight", "paddleboard"})  # too slender or too light for waves that rock a boat


def is_afloat_by_nature(thing: Obstacle | Actor) -> bool:
    """Whether a thing of this kind and look belongs into the water and moves with it."""
    return thing.kind in {Kind.VESSEL, Kind.BUOY} or thing.look in AFLOAT_LOOKS


def hull_beam_m(thing: Obstacle | Actor) -> float:
    """Its width at the waterline."""
    return HULL_BEAM_M.get(thing.look, thing.width_m)


def makes_waves(actor: Actor) -> bool:
    """Whether it leaves waves behind that rock the boat, if it is fast enough."""
    return actor.kind is Kind.VESSEL and actor.look not in WAVELESS_LOOKS
