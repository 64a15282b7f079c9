"""The explanation of an advisory in plain words, made last, from the advisory's own numbers (J12). Pure.

One sentence says what is advised and why, the next what would change it.
"""

import msgspec

from paani.messages import (
    INPUT_FAULTS,
    SIDE_OF,
    Advisory,
    ChangedBy,
    Direction,
    Lane,
    LaneRisk,
    Purpose,
    Reason,
    Removal,
    Track,
    UnusableCause,
)

MANOEUVRE_TEXT = {
    Direction.STRAIGHT: "Straight on",
    Direction.SLIGHT_LEFT: "Slightly left",
    Direction.SLIGHT_RIGHT: "Slightly right",
    Direction.LEFT: "Turn left",
    Direction.RIGHT: "Turn right",
    Direction.STOP: "Stop",
    Direction.NO_DATA: "No advice",
}
UNUSABLE_TEXT = {
    UnusableCause.NONE: "gave no reason",
    UnusableCause.UNDECODABLE: "cannot be decoded",
    UnusableCause.WRONG_SIZE: "is too small",
    UnusableCause.BLACK: "is black",
    UnusableCause.WHITE: "is white",
    UnusableCause.FLAT: "shows nothing",
    UnusableCause.NOISE: "is noise",
    UnusableCause.BLURRED: "is blurred",
    UnusableCause.COVERED: "is covered",
    UnusableCause.SKEWED: "has lines of a wrong length",
    UnusableCause.FROZEN: "is frozen",
    UnusableCause.UNFIT: "is not fit to be judged",
    UnusableCause.FILLED: "is filled by something near",
    UnusableCause.NO_WATER: "shows no water",
    UnusableCause.NO_HORIZON: "shows water to its upper edge, as no boat sees it",
    UnusableCause.STALE: "was too old to look at",
}
NO_SIDE = frozenset({Reason.NO_SAFE_SIDE, Reason.NO_SIDE_UNOCCUPIED, Reason.NO_SIDE_FOR_LONG})
NO_OPEN_WATER = "the way ahead shows no open water"
CANDIDATE_TEXT = "something that may be a person"
MAX_NAMED_TRACKS = 3  # further tracks are counted, not named
ALTERNATIVE_TEXT = {
    Direction.STRAIGHT: "go STRAIGHT",
    Direction.SLIGHT_LEFT: "turn SLIGHTLY LEFT",
    Direction.SLIGHT_RIGHT: "turn SLIGHTLY RIGHT",
    Direction.LEFT: "turn LEFT",
    Direction.RIGHT: "turn RIGHT",
    Direction.STOP: "STOP",
    Direction.NO_DATA: "give no advice",
}
LANE_NAMES = {Lane.LEFT: "left", Lane.CENTER: "centre", Lane.RIGHT: "right"}
WATER_TEXT = {Lane.LEFT: "on the left", Lane.CENTER: "in the centre", Lane.RIGHT: "on the right"}
MAX_LENGTH = 400  # characters, the limit of the message type `Text`


def explain_advisory(advisory: Advisory, tracks: tuple[Track, ...]) -> str:
    """Say what is advised and why, and what would change it; the reason alone where both are too long."""
    people, reason = _people_text(advisory), _reason_text(advisory, tracks)
    if people and advisory.direction is Direction.STOP:
        why = f"{people}{reason[0].upper()}{reason[1:]}."  # it begins with Stop already
    else:
        why = f"{people}{MANOEUVRE_TEXT[advisory.direction]}: {reason}."
    both = f"{why} {_counterfactual_text(advisory, tracks)}".rstrip()
    return both if len(both) <= MAX_LENGTH else why


def _people_text(advisory: Advisory) -> str:
    """What was decided about who is, or may be, in the way ahead, as a sentence; empty where there is nobody."""
    if advisory.reason in INPUT_FAULTS:
        return ""
    if advisory.people_ahead:
        count = len(advisory.people_ahead)
        who = "swimmer ahead" if count == 1 else f"{count} swimmers ahead"
    elif advisory.candidates_ahead:
        who = f"{CANDIDATE_TEXT} ahead"
    else:
        return ""
    if not isinstance(advisory.person_distance_m, msgspec.UnsetType):
        who += f" at about {advisory.person_distance_m:.0f} m" if advisory.person_distance_m > 0.0 else " close by"
    if advisory.direction is Direction.STOP:
        return f"Stop: {who}, waiting. "
    is_slowed = not isinstance(advisory.speed_limit_mps, msgspec.UnsetType)
    opening = f"Slow: {who}" if is_slowed else f"{who[0].upper()}{who[1:]}"
    if advisory.purpose is Purpose.LOOK:
        return f"{opening}, looking for a way around. "
    return f"{opening}, passing on the {SIDE_OF.get(advisory.direction, 'side')}. "


def _counterfactual_text(advisory: Advisory, tracks: tuple[Track, ...]) -> str:
    found = advisory.counterfactual
    match found.changed_by:
        case ChangedBy.EVIDENCE if found.removals:
            return _removal_text(found.removals[0], advisory, tracks)
        case ChangedBy.CLEAR_PICTURES:
            return "Nothing in the picture asks for it any more."
        case ChangedBy.NEW_EVIDENCE:
            return "Only new evidence can change that."
        case ChangedBy.MORE_EVIDENCE if found.judged:
            return "No three pieces of evidence, or fewer, decide it."
        case _:
            return ""


def _removal_text(removal: Removal, advisory: Advisory, tracks: tuple[Track, ...]) -> str:
    parts = []
    labels = {track.id: track.label for track in tracks}
    lanes = {Lane.LEFT: advisory.left, Lane.CENTER: advisory.center, Lane.RIGHT: advisory.right}
    if removal.track_ids:
        names = [
            f"{labels.get(i, 'track')} #{i} ({_join_names([LANE_NAMES[n] for n in lanes if i in lanes[n].track_ids])})"
            for i in removal.track_ids
        ]
        parts.append(f"without {_join_names(names)}")
    if removal.candidates:
        parts.append(f"without what may be {'a person' if len(removal.candidates) == 1 else 'people'}")
    if removal.water:
        parts.append(f"with clear water {_join_names([WATER_TEXT[lane] for lane in removal.water])}")
    condition = " and ".join(parts)
    return f"{condition[0].upper()}{condition[1:]} it would {ALTERNATIVE_TEXT[removal.direction]}."


def _join_names(names: list[str]) -> str:
    return " and ".join(names) if len(names) < 3 else f"{', '.join(names[:-1])} and {names[-1]}"


def _reason_text(advisory: Advisory, tracks: tuple[Track, ...]) -> str:
    left, center, right = advisory.left, advisory.center, advisory.right
    names = _obstacles(center, tracks)
    by = f" by {names}" if names else ""
    centre = f"centre risk {center.risk:.2f} (limit {_limit(center, advisory.center_block_risk):.2f})"
    centre += f" with {names} in it" if names else ""
    someone = bool(advisory.people_ahead or advisory.candidates_ahead)
    if someone and center.risk < center.limit:
        who = "somebody is" if advisory.people_ahead else f"{CANDIDATE_TEXT} is"
        centre = f"{who} in the way ahead or beside it"
    elif center.blocked and center.risk < center.limit:
        closed = f"the way ahead is not free, with {names} in it" if names else NO_OPEN_WATER
        centre = f"the way ahead is occupied{by}" if center.occupied else closed
    limits = [_limit(side, advisory.side_block_risk) for side in (left, right)]
    side_texts = [f"left {left.risk:.2f}", f"right {right.risk:.2f}"]
    if limits[0] != limits[1]:
        side_texts = [f"{text} (limit {limit:.2f})" for text, limit in zip(side_texts, limits, strict=True)]
    whys = [_reached_from(side, advisory.reason) or _closed_by(side, tracks) for side in (left, right)]
    side_texts = [text + why for text, why in zip(side_texts, whys, strict=True)]
    sides = ", ".join(side_texts) + (f" (limit {limits[0]:.2f})" if limits[0] == limits[1] else "")
    match advisory.reason:
        case Reason.NO_EVIDENCE:
            return "nothing has been seen yet"
        case Reason.STALE_EVIDENCE:
            return f"the last picture is {advisory.evidence_age_s:.1f} s old"
        case Reason.FUTURE_EVIDENCE:
            return f"the picture is dated {-advisory.evidence_age_s:.1f} s in the future"
        case Reason.UNUSABLE_IMAGE:
            return f"the picture {UNUSABLE_TEXT[advisory.cause]}"
        case Reason.MALFORMED_EVIDENCE:
            return "the evidence is malformed"
        case Reason.CENTER_CLEAR:
            if advisory.people_ahead == () and any(
                track.label == "person" and track.id in center.track_ids for track in tracks
            ):
                return f"nobody is near in the way ahead, {centre}"
            return f"the way ahead is clear, {centre}"
        case Reason.TURN_RETAINED:
            return f"keeping the turn until the way ahead stays clear, {centre}"
        case Reason.CENTER_OCCUPIED if someone and not center.occupied:
            return f"{centre}; {sides}"
        case Reason.CENTER_OCCUPIED if not center.occupied:
            return f"{NO_OPEN_WATER}; {sides}"
        case Reason.CENTER_OCCUPIED:
            return f"the way ahead is occupied{by}; {sides}"
        case Reason.CENTER_VESSEL:
            return f"the way ahead is taken{by}; {sides}"
        case Reason.CENTER_EDGE_INCURSION if someone:
            return f"{centre}, and an obstacle reaches into it from one side; {sides}"
        case Reason.CENTER_EDGE_INCURSION:
            return f"an obstacle reaches into the way ahead from one side, {centre}"
        case Reason.TIE_KEPT_SIDE:
            return f"{centre}; the sides are alike, keeping this one, {sides}"
        case Reason.TIE_STARBOARD:
            return f"{centre}; the sides are alike, starboard by rule, {sides}"
        case Reason.NO_SAFE_SIDE | Reason.NO_SIDE_UNOCCUPIED:
            return f"{centre} and no side is free: {sides}"
        case Reason.NO_SIDE_FOR_LONG:
            return f"{centre} and no side is free for long; looking for a way, {sides}"
        case _:
            return f"{centre}; {sides}"


def _reached_from(side: LaneRisk, reason: Reason) -> str:
    """That an obstacle reaches into the way from this side, which is then not taken although nothing blocks it."""
    return " with an obstacle that reaches in from there" if reason in NO_SIDE and not side.blocked else ""


def _closed_by(side: LaneRisk, tracks: tuple[Track, ...]) -> str:
    """What closes a side whose risk is below its limit; empty where the side is free, and where its risk closes it."""
    if not side.blocked or side.risk >= side.limit:
        return ""
    if any(track.label == "person" and track.id in side.track_ids for track in tracks):
        return " with somebody in it"
    return " occupied" if side.occupied else " not free"


def _limit(lane: LaneRisk, nominal: float) -> float:
    """The lane's own limit where the lane is blocked by that one alone, else the nominal limit."""
    return lane.limit if lane.limit <= lane.risk < nominal else nominal


def _obstacles(lane: LaneRisk, tracks: tuple[Track, ...]) -> str:
    """The tracks in the lane, such as `vessel #3 and pier #7`; empty where there are none."""
    names = [f"{track.label} #{track.id}" for track in tracks if track.id in lane.track_ids]
    if not names:
        return ""
    if len(names) > MAX_NAMED_TRACKS:
        names = [*names[:MAX_NAMED_TRACKS], f"{len(names) - MAX_NAMED_TRACKS} more"]
    return _join_names(names)
