"""Who blocks which corridor, people and what may be one, and how fast the boat may go near them. Pure.

A person is no obstacle to be weighed: one sighting blocks a corridor, whatever its risk is, for as long as the track is
held. Distances are those of the box's foot where the camera is calibrated; without a calibration everybody is near.
"""

from collections.abc import Iterable

from paani.config import Config
from paani.messages import Reason, UnusableCause
from paani_services.advisor.risk import Obstacle, lane_span, shared_width

WATER_STOPS = frozenset({Reason.NO_SAFE_SIDE, Reason.NO_SIDE_UNOCCUPIED})  # for what lies on the water that is seen
# The camera is sound, and what it sees is no boat's view: a hull fills the picture, for one. Any other cause may be a
# camera that is broken.
DOUBTED_VIEWS = frozenset({UnusableCause.FILLED, UnusableCause.NO_WATER, UnusableCause.NO_HORIZON})
MIN_GLIMPSE_PRESENCE = 0.5  # presence below which a person seen once, and no more, blocks nothing


def people_in_lane(lane: str, obstacles: tuple[Obstacle, ...], config: Config) -> tuple[int, ...]:
    """Indices of the people who block the lane: in it, about to drift into it, or so close that nothing is passed.

    What may be a person blocks as well, at any size, but is not taken to drift.
    """
    if not config.advisor.people.use:
        return ()
    start, end = lane_span(lane, config.perception.corridors)
    drift = config.advisor.people.drift_frac if lane == "center" else 0.0
    beside = (start - drift, end + drift)
    return tuple(
        i
        for i, person in enumerate(obstacles)
        if counts(person)
        and (
            is_close(person, config)
            or _is_in(person, lane, beside if person.candidate is None else (start, end), config)
        )
    )


def speed_limit_mps(obstacles: Iterable[Obstacle], config: Config) -> float | None:
    """The speed that must not be exceeded; None where the camera is calibrated and nobody is within `slow_m`.

    By weights other than the full ones, which miss more, no advice is followed faster than by an uncalibrated camera.
    """
    people = config.advisor.people
    limits_mps = [people.uncalibrated_mps] if config.perception.weights != "full" else []
    if not people.use:
        return min(limits_mps, default=None)
    center = lane_span("center", config.perception.corridors)
    is_near = any(
        counts(person)
        and (person.candidate is None or shared_width(person.box, center) > 0.0)
        and (person.distance_m is None or person.distance_m <= people.slow_m)
        for person in obstacles
    )
    if is_near:
        limits_mps.append(people.slow_mps)
    if not config.calibration.valid:
        limits_mps.append(people.uncalibrated_mps)
    return min(limits_mps, default=None)


def may_keep_station(reason: Reason, obstacles: Iterable[Obstacle], config: Config) -> bool:
    """Whether thrust may hold the boat where a STOP for this reason finds it: nobody is near, as far as is known.

    Nobody is where everybody who counts is farther than `stop_m`; without a calibration nobody knows.
    """
    return reason in WATER_STOPS and nobody_near_s(obstacles, config) > 0.0


def may_keep_station_unseen(
    cause: UnusableCause, until_us: int, at_us: int, candidates: Iterable[Obstacle], config: Config
) -> bool:
    """The same for a picture that is unusable: its view alone is doubted, and what was seen before it still holds.

    until_us: how long it holds, by the last usable picture. candidates: of this picture, who may be in it.
    """
    return cause in DOUBTED_VIEWS and at_us < until_us and nobody_near_s(candidates, config) > 0.0


def nobody_near_s(obstacles: Iterable[Obstacle], config: Config) -> float:
    """For how long nobody can come within `stop_m` by swimming [s]; 0 where somebody may be there already.

    Nobody: none of these, nor whoever is farther off than `ahead_m`, where somebody may be out of sight.
    """
    people = config.advisor.people
    if not people.use or not config.calibration.valid:
        return 0.0
    distances_m = [0.0 if each.distance_m is None else each.distance_m for each in obstacles if counts(each)]
    return max(0.0, min((*distances_m, people.ahead_m)) - people.stop_m) / people.swim_mps


def people_near(obstacles: Iterable[Obstacle], config: Config) -> tuple[int, ...]:
    """Indices of those beside whom the boat does not turn on the spot: people within `stop_m`, and what may be one.

    Without a calibration everybody is.
    """
    people = config.advisor.people
    if not people.use:
        return ()
    return tuple(
        i
        for i, each in enumerate(obstacles)
        if counts(each) and (each.distance_m is None or each.distance_m <= people.stop_m)
    )


def nearest_ahead_m(obstacles: tuple[Obstacle, ...], ahead: Iterable[int]) -> float | None:
    """Distance of the nearest of these people; None without a calibration, or without people."""
    known = [distance for i in ahead if (distance := obstacles[i].distance_m) is not None]
    return min(known, default=None)


def counts(obstacle: Obstacle) -> bool:
    """Whether the obstacle may be in the way as a person: seen now, seen more than once, or glimpsed a moment ago.

    Somebody ashore or aboard is not in the way; a candidate is of the present picture.
    """
    if obstacle.candidate is not None:
        return True
    return (
        obstacle.is_person
        and not obstacle.is_ashore
        and (obstacle.is_confirmed or obstacle.presence >= MIN_GLIMPSE_PRESENCE)
    )


def is_close(person: Obstacle, config: Config) -> bool:
    """Whether the boat stops for the person: within `stop_m`, or a box in the way of `stop_height` and more."""
    people = config.advisor.people
    if person.candidate is not None:
        return False
    if shared_width(person.box, lane_span("center", config.perception.corridors)) <= 0.0:
        return False
    if person.distance_m is not None:
        return person.distance_m <= people.stop_m
    return person.box[3] - person.box[1] >= people.stop_height


def _is_in(person: Obstacle, lane: str, span: tuple[float, float], config: Config) -> bool:
    people = config.advisor.people
    reach_m = people.ahead_m if lane == "center" else people.slow_m
    is_within = person.distance_m is None or person.distance_m <= reach_m
    return is_within and shared_width(person.box, span) > 0.0
