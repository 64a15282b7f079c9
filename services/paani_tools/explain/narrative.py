"""A moment in words, line by line: what was seen, weighed, decided, ordered and done. Pure."""

from __future__ import annotations

import datetime
import itertools
import math

import msgspec

from paani.config import Config
from paani.geometry import wrap_rad
from paani.messages import (
    Advisory,
    Direction,
    HeadingVerdict,
    Inhibit,
    Lane,
    LaneRisk,
    Limit,
    MotionState,
    SoundingStatus,
    Track,
    ZeroCause,
)
from paani_tools.explain.moment import Moment

LIMITS = {
    Limit.CENTER_RISK: "the centre's risk",
    Limit.LEFT_RISK: "the left side's risk",
    Limit.RIGHT_RISK: "the right side's risk",
    Limit.SIDE_GAIN: "how much better the other side is",
}
INDENT = 12


def narrative_of(moment: Moment, config: Config) -> str:
    """The whole story, one paragraph for each process."""
    lines = [_title(moment), ""]
    for name, sentences in (
        ("seen", _seen(moment)),
        ("tracks", _tracks(moment)),
        ("lanes", _lanes(moment.advisory, config)),
        ("decided", _decided(moment)),
        ("navigator", _navigator(moment)),
        ("controller", _controller(moment)),
        ("plant", _plant(moment)),
    ):
        lines += [f"{name if number == 0 else '':<{INDENT}}{line}" for number, line in enumerate(sentences)]
    return "\n".join(lines) + "\n"


def _title(moment: Moment) -> str:
    advisory = moment.advisory
    utc = datetime.datetime.fromtimestamp(moment.at_us * 1e-6, tz=datetime.UTC)
    text = f"{utc:%Y-%m-%d %H:%M:%S}.{utc.microsecond // 100_000} UTC, {_since_start(moment, moment.at_us)}: "
    text += f"{advisory.direction} ({advisory.reason})"
    if moment.before:
        text += f"; before that {moment.before} from {_since_start(moment, moment.before_us)}"
    return text


def _since_start(moment: Moment, at_us: int) -> str:
    return f"{(at_us - moment.start_us) * 1e-6:.1f} s"


def _seen(moment: Moment) -> list[str]:
    evidence, advisory = moment.evidence, moment.advisory
    if evidence is None:
        if advisory.direction is Direction.NO_DATA:
            return ["nothing yet"]
        return [f"picture {advisory.frame_seq}; what was seen in it is not in the log"]
    lines = [
        f"picture {evidence.frame_seq} ({evidence.width_px} x {evidence.height_px} px), "
        f"{advisory.evidence_age_s:.2f} s old when decided, "
        + ("usable" if evidence.usable else f"not usable: {evidence.cause.replace('_', ' ')}")
        + ("" if moment.picture is not None else "; the picture itself is not in the log")
    ]
    boxes = [
        f"{d.label} {d.confidence:.2f} at ({d.box_xyxy[0]:.2f}, {d.box_xyxy[1]:.2f}) to "
        f"({d.box_xyxy[2]:.2f}, {d.box_xyxy[3]:.2f})"
        for d in evidence.detections
    ]
    lines += boxes or ["no box above the detector's threshold"]
    if not evidence.navigation_eligible:
        lines.append("the mask may not count as free water")
    return lines


def _tracks(moment: Moment) -> list[str]:
    tracks = moment.tracks.tracks if moment.tracks is not None else ()
    return [_track(track, moment.advisory) for track in tracks] or ["none"]


def _track(track: Track, advisory: Advisory) -> str:
    inside = [
        name
        for name, lane in (("left", advisory.left), ("centre", advisory.center), ("right", advisory.right))
        if track.id in lane.track_ids
    ]
    accepted = "counts"
    if not track.accepted:
        accepted = "does not count yet"
    elif not track.confirmed:
        accepted = "counts at once: an immediate danger"
    motion = track.motion.value
    if track.motion is MotionState.UNKNOWN:
        motion = f"motion unknown ({track.motion_cause.replace('_', ' ')})"
    else:
        motion += f" {track.motion_rate_per_s:+.2f}/s"
    return (
        f"{track.label} #{track.id} {track.confidence:.2f}, seen {track.hits} times in {track.age_s:.1f} s"
        + (", held" if track.held else "")
        + f", {accepted}, in {' and '.join(inside) or 'no lane'}, urgency {track.urgency:.2f}, {motion}"
    )


def _lanes(advisory: Advisory, config: Config) -> list[str]:
    return [
        _lane(name, lane, lane.limit or limit, config)
        for name, lane, limit in (
            (Lane.LEFT, advisory.left, advisory.side_block_risk),
            (Lane.CENTER, advisory.center, advisory.center_block_risk),
            (Lane.RIGHT, advisory.right, advisory.side_block_risk),
        )
    ]


def _lane(name: Lane, lane: LaneRisk, limit: float, config: Config) -> str:
    weights = config.advisor.risk
    sign = ">=" if lane.risk >= limit else "<"
    verdict = "blocked" if lane.blocked else "free"
    return (
        f"{name:<7} risk {lane.risk:.2f} {sign} {limit:.2f} {verdict}"
        + (", occupied" if lane.occupied else "")
        + f"  = {weights.non_water:.2f} x {lane.non_water:.2f} not water + {weights.obstacle:.2f} x "
        f"{lane.obstacle:.2f} obstacles + {weights.urgency:.2f} x {lane.urgency:.2f} urgency + "
        f"{weights.uncertainty:.2f} x {lane.uncertainty:.2f} uncertainty"
    )


def _decided(moment: Moment) -> list[str]:
    found = moment.advisory.counterfactual
    lines = [moment.advisory.explanation]
    if found.limit is not Limit.NONE:
        above = "above" if found.margin >= 0.0 else "below"
        lines.append(f"nearest limit: {LIMITS[found.limit]} lies {abs(found.margin):.3f} {above} it")
    return lines


def _navigator(moment: Moment) -> list[str]:
    order = moment.order
    if order is None:
        return ["no order on this advice in the log"]
    planned_for = [f"planned for {obstacles}"] if (obstacles := _planned_for(moment, order.obstacle_track_ids)) else []
    planned_for += _encounters(moment)
    planned_for += _soundings(moment)
    planned_for += _headings(moment.prediction.headings) if moment.prediction is not None else []
    if order.halt_reasons:
        holds = "keeps the boat where it is" if order.keeps_station else "holds the boat"
        return [f"{holds}: {inhibits(order.halt_reasons)}", *planned_for]
    course = f"steer {_heading_deg(order.heading_rad):03.0f} deg at {order.speed_mps:.2f} m/s"
    off = f", {abs(order.cross_track_m):.1f} m {'left' if order.cross_track_m > 0 else 'right'} of the route"
    return [f"{course}, waypoint {order.waypoint_index}{off}", *planned_for]


def _planned_for(moment: Moment, track_ids: tuple[int, ...]) -> str:
    """The moving obstacles of the plan, such as `person #3`; `track #3` where it is tracked no more."""
    labels = {track.id: track.label.value for track in moment.tracks.tracks} if moment.tracks is not None else {}
    return ", ".join(f"{labels.get(number, 'track')} #{number}" for number in track_ids)


def _encounters(moment: Moment) -> list[str]:
    """The nearest encounter in words, and the closest point of approach of every obstacle that has one."""
    ahead = moment.prediction
    if ahead is None:
        return []
    lines = [ahead.courtesy] if ahead.courtesy else []
    for each in ahead.obstacles:
        cpa_m, std_m, tcpa_s = each.cpa_m, each.cpa_std_m, each.tcpa_s
        if cpa_m is msgspec.UNSET or std_m is msgspec.UNSET or tcpa_s is msgspec.UNSET:
            continue
        when = f"in {tcpa_s:.1f} s" if tcpa_s > 0.0 else "now"
        lines.append(f"{_planned_for(moment, (each.track_id,))} nearest {when}: {cpa_m:.1f} m, +- {std_m:.1f} m")
    return lines


def _soundings(moment: Moment) -> list[str]:
    """The depth under the boat, and what is wrong with the echo sounder where its soundings do not count."""
    ahead = moment.prediction
    if ahead is None or ahead.soundings is SoundingStatus.OFF:
        return []
    depth = f"depth {ahead.depth_m:.2f} m" if ahead.depth_m > 0.0 else "no depth yet"
    return [depth if ahead.soundings is SoundingStatus.OK else f"{depth}, sonar {ahead.soundings.replace('_', ' ')}"]


def _headings(verdicts: tuple[HeadingVerdict, ...]) -> list[str]:
    """Why headings were not taken, from port to starboard, neighbours alike together; and what the cheapest costs."""
    if not verdicts:
        return []
    course_rad = verdicts[0].heading_rad
    ordered = sorted(verdicts, key=lambda each: -wrap_rad(each.heading_rad - course_rad))
    lines = []
    for text, group in itertools.groupby(ordered, key=_verdict):
        alike = [f"{_heading_deg(each.heading_rad):03.0f}" for each in group]
        lines.append(f"{alike[0] if len(alike) == 1 else f'{alike[0]} to {alike[-1]}'} deg {text}")
    free = [
        (msgspec.structs.asdict(each.costs), each.heading_rad) for each in verdicts if each.costs is not msgspec.UNSET
    ]
    if free:
        costs, heading_rad = min(free, key=lambda pair: sum(pair[0].values()))
        parts = [f"{name.replace('_', ' ')} {cost:.2f}" for name, cost in costs.items() if cost]
        lines.append(f"cheapest {_heading_deg(heading_rad):03.0f} deg, cost {sum(costs.values()):.2f}")
        lines[-1] += f": {', '.join(parts)}" if parts else ""
    return lines


def _verdict(verdict: HeadingVerdict) -> str:
    """`free at 0.30 m/s`, or every reason for which the heading is refused, at the highest speed first."""
    if verdict.costs is not msgspec.UNSET:
        return f"free at {verdict.speed_mps:.2f} m/s"
    return f"refused: {', '.join(each.replace('_', ' ') for each in dict.fromkeys(verdict.refused_by))}"


def _controller(moment: Moment) -> list[str]:
    thrust = moment.thrust
    if thrust is None:
        return ["no thrust for this order in the log"]
    if not thrust.enabled:
        return [f"no thrust: {inhibits(thrust.inhibits)}"]
    turn_deg = math.degrees(wrap_rad(thrust.heading_error_rad))
    side = "left" if turn_deg > 0 else "right"
    text = f"left {thrust.left:.3f}, right {thrust.right:.3f} of full thrust; {abs(turn_deg):.1f} deg to turn {side}"
    text += f", {abs(thrust.speed_error_mps):.2f} m/s too {'slow' if thrust.speed_error_mps > 0 else 'fast'}"
    if not thrust.left and not thrust.right:
        text += "; zero because neither speed nor heading asks for more"
    return [text]


def _plant(moment: Moment) -> list[str]:
    applied = moment.applied
    if applied is None:
        return ["what was applied is not in the log"]
    if applied.zero_cause is not ZeroCause.NONE:
        lost = f" ({applied.lost_pulse})" if applied.lost_pulse else ""
        return [f"applies zero: {applied.zero_cause.replace('_', ' ')}{lost}"]
    return [f"applies {applied.left_n:.1f} N left, {applied.right_n:.1f} N right"]


def inhibits(found: tuple[Inhibit, ...]) -> str:
    """`not armed, no clock`."""
    return ", ".join(inhibit.lower().replace("_", " ") for inhibit in found) or "no reason given"


def _heading_deg(yaw_rad: float) -> float:
    """Compass heading [deg, 0..360) of a yaw from east, counter-clockwise."""
    return math.degrees(math.pi / 2.0 - yaw_rad) % 360.0
