"""Kind and usual size of things, by their look."""

from typing import NamedTuple

from paani_sim.worlds.world import Kind


class Size(NamedTuple):
    """What a thing with this look is, and how large it usually is."""

    kind: Kind
    length_m: float
    width_m: float
    height_m: float


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
}
