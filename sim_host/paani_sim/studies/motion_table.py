"""How often the advisor's apparent motion is known, and how often it is wrong, by frame rate: encounters against truth.

A moment is *closing* if for as long as the rule needs (1.5 s, or six periods between frames if that is longer) the
target was whole in the picture and at least 16 px in size, and its range shrank by 8 % a second or more, twice the
estimator's dead band. Missed, dropped and mistaken boxes are no excuse. A state is *wrong* if it says that a target
approaches or recedes which did not over the time that the state is measured over. It is *late* if it was right over
that time and no longer is over the last half second.

`paani bench judgement --only motion`, or `python -m paani_sim.studies.motion_table SEED N`.
"""

import math
import sys
from collections import Counter
from collections.abc import Iterator
from typing import Any, NamedTuple

import msgspec
import numpy as np

from paani import keys
from paani import messages as m
from paani.config import Config, load_config
from paani.decider import Decider, Input, decider_of
from paani.statistics.figure_table import FigureTable, table_text
from paani_sim.eye.camera import Camera
from paani_sim.studies.encounters import (
    EncounterCourse,
    EncounterFamily,
    FrameObservation,
    boat_pose_at,
    draw_course,
    range_at_m,
    simulate_frames,
)

RATES_HZ = (0.5, 1.0, 2.0, 4.0, 5.0, 10.0)
UNCOMPENSATED = "no rotation"  # `paani` that takes its own turning for motion
PROFILES = ("paani", UNCOMPENSATED, "paper")
RULE_S, RULE_PERIODS = 1.5, 6.0
MIN_CLOSING_PER_S, STATIC_PER_S = 0.08, 1e-9
MIN_SIZE_PX = 16.0
RECENT_S = 0.5
START_US = 1_000_000_000
STEP_S = 0.2  # the advisor repeats itself, and hears odometry
LATENCY_S, ODOMETRY_AGE_S = 0.25, 0.03  # from the picture to its evidence; of the newest odometry
YAW_STD_RAD, YAW_RATE_STD_RADPS = 0.002, 0.004
CAUSES = 3


class MotionRow(msgspec.Struct, frozen=True, kw_only=True):
    """One profile, rate and family; `family` is None for all of them together.

    closing: moments whose truth is that the thing closes in; known: of those, with any state but unknown.
    tracks: encounters with such moments; known_tracks: of those, known at half of them at least.
    judged: all moments with a state but unknown; wrong, late: of those. things, identities: encounters, and how many
    different tracks they were taken for. causes: of unknown at closing moments, most frequent first.
    """

    profile: str
    rate_hz: float
    family: EncounterFamily | None
    closing: int = 0
    known: int = 0
    tracks: int = 0
    known_tracks: int = 0
    judged: int = 0
    wrong: int = 0
    late: int = 0
    targets: int = 0
    identities: int = 0
    causes: tuple[tuple[m.MotionCause, int], ...] = ()


class _JudgedFrame(NamedTuple):
    """The judged motion of the target at one frame, and the true one."""

    motion: m.MotionState
    cause: m.MotionCause
    ids: frozenset[int]
    closing: bool
    wrong: bool
    late: bool


def motion_table(
    seed: int,
    n: int,
    profiles: tuple[str, ...] = PROFILES,
    rates_hz: tuple[float, ...] = RATES_HZ,
    families: tuple[EncounterFamily, ...] = tuple(EncounterFamily),
) -> list[MotionRow]:
    """`n` encounters of each family at each rate, the same ones for every profile; all families together last."""
    advisor = decider_of("advisor")
    rows = []
    for profile in profiles:
        config = load_profile_config(profile)
        for rate_hz in rates_hz:
            found = []
            for family in families:
                row = MotionRow(profile=profile, rate_hz=rate_hz, family=family)
                for number in range(n):
                    rng = np.random.default_rng([seed, list(EncounterFamily).index(family), number])
                    row = _add_encounter(
                        row, list(_judge_encounter(advisor, config, draw_course(family, rng), rate_hz, rng))
                    )
                found.append(row)
            rows += [*found, _sum_rows(found)]
    return rows


def tabulate_motion() -> FigureTable:
    """The table for `paani bench judgement`."""
    return tabulate_rows(motion_table(seed=1, n=20))


def tabulate_rows(rows: list[MotionRow]) -> FigureTable:
    """Fractions in percent; None where there was nothing to judge."""
    return FigureTable(
        name="motion",
        columns=(
            "constants", "Hz", "encounter", "closing", "known %", "tracks", "known %", "judged", "wrong %", "late %",
            "ids", "why unknown",
        ),
        rows=tuple(
            (
                row.profile, f"{row.rate_hz:g}", row.family or "all", row.closing, _percent(row.known, row.closing),
                row.tracks, _percent(row.known_tracks, row.tracks), row.judged, _percent(row.wrong, row.judged),
                _percent(row.late, row.judged), round(row.identities / max(1, row.targets), 2),
                ", ".join(f"{cause} {count}" for cause, count in row.causes[:CAUSES]),
            )
            for row in rows
        ),
        note="closing moments and tracks, and those of them with a known state; states that contradict the true range.",
    )  # fmt: skip


def load_profile_config(profile: str) -> Config:
    """A profile's configuration."""
    if profile == UNCOMPENSATED:
        return load_config(sets=["advisor.motion.compensate_rotation=false"])
    return load_config(profile=profile)


def _judge_encounter(
    advisor: Decider[Any], config: Config, course: EncounterCourse, rate_hz: float, rng: np.random.Generator
) -> Iterator[_JudgedFrame]:
    """Step the advisor through one encounter at its live rate."""
    camera = Camera(hfov_deg=config.eye.hfov_deg, down_deg=config.eye.pitch_down_deg)
    need_s = max(RULE_S, RULE_PERIODS / rate_hz)
    state, inputs = advisor.state(), {topic.name: Input() for topic in advisor.inputs}
    step_s, since = 0.0, list[FrameObservation]()
    for number, frame in enumerate(simulate_frames(course, rate_hz, camera, rng)):
        now_s = frame.at_s + LATENCY_S
        while step_s < now_s:
            inputs[keys.ODOMETRY.name] = Input(_odometry(course, step_s - ODOMETRY_AGE_S, rng), _us(step_s))
            state, _ = advisor.decide(state, inputs, _us(step_s), config)
            step_s += STEP_S
        inputs[keys.ODOMETRY.name] = Input(_odometry(course, now_s - ODOMETRY_AGE_S, rng), _us(now_s))
        inputs[keys.EVIDENCE.name] = Input(_evidence(frame, number, course, camera), _us(now_s))
        state, outputs = advisor.decide(state, inputs, _us(now_s), config)
        since = [*(f for f in since if f.at_s >= frame.at_s - need_s), frame]
        yield _judge_frame(outputs[keys.TRACKS.name], course, frame, since, need_s)


def _judge_frame(
    tracks: m.Message, course: EncounterCourse, frame: FrameObservation, since: list[FrameObservation], need_s: float
) -> _JudgedFrame:
    assert isinstance(tracks, m.Tracks)
    matched = [track for track in tracks.tracks if not track.held] if frame.box is not None else []
    track = max(matched or tracks.tracks, key=lambda t: (t.hits, -t.id), default=None)
    motion = track.motion if track else m.MotionState.UNKNOWN
    cause = track.motion_cause if track else m.MotionCause.TOO_FEW_SAMPLES
    wrong = _contradicts(motion, _closing_per_s(course, frame.at_s, tracks.motion_history_s))
    closing = (
        frame.at_s >= need_s
        and _closing_per_s(course, frame.at_s, need_s) >= MIN_CLOSING_PER_S
        and all(observation.whole and observation.size_px >= MIN_SIZE_PX for observation in since)
    )
    late = not wrong and _contradicts(motion, _closing_per_s(course, frame.at_s, RECENT_S))
    return _JudgedFrame(motion, cause, frozenset(t.id for t in matched), closing, wrong, late)


def _closing_per_s(course: EncounterCourse, at_s: float, over_s: float) -> float:
    """How fast the logarithm of the range shrank, on average over the time before `at_s`."""
    start_s = max(0.0, at_s - over_s)
    if at_s - start_s < 1e-6:
        return 0.0
    return (math.log(range_at_m(course, start_s)) - math.log(range_at_m(course, at_s))) / (at_s - start_s)


def _contradicts(motion: m.MotionState, closing_per_s: float) -> bool:
    if motion is m.MotionState.APPROACHING:
        return closing_per_s <= STATIC_PER_S
    return motion is m.MotionState.RECEDING and closing_per_s >= -STATIC_PER_S


def _us(at_s: float) -> int:
    return START_US + round(at_s * 1e6)


def _odometry(course: EncounterCourse, at_s: float, rng: np.random.Generator) -> m.Odometry:
    pose, rate_radps = boat_pose_at(course, at_s)
    return m.Odometry(
        source_us=_us(at_s),
        x_m=pose.x_m,
        y_m=pose.y_m,
        yaw_rad=pose.yaw_rad + rng.normal(0.0, YAW_STD_RAD),
        surge_mps=course.boat_mps,
        yaw_rate_radps=rate_radps + rng.normal(0.0, YAW_RATE_STD_RADPS),
        healthy=True,
    )


def _evidence(frame: FrameObservation, number: int, course: EncounterCourse, camera: Camera) -> m.Evidence:
    found: tuple[m.Detection, ...] = ()
    if frame.box is not None:
        found = (m.Detection(label=course.target.label, confidence=frame.confidence, box_xyxy=frame.box),)
    clear = m.LaneEvidence(non_water=0.0, uncertainty=0.0, clear_width=1.0)
    return m.Evidence(
        source_us=_us(frame.at_s),
        frame_seq=number,
        frame_epoch=1,
        width_px=camera.width_px,
        height_px=camera.height_px,
        usable=True,
        detections=found,
        left=clear,
        center=clear,
        right=clear,
        segmentation=m.SegmentationSource.LEARNED,
        navigation_eligible=True,
    )


def _add_encounter(row: MotionRow, moments: list[_JudgedFrame]) -> MotionRow:
    """The row with one more encounter."""
    closing = [moment for moment in moments if moment.closing]
    unknown = [moment.cause for moment in closing if moment.motion is m.MotionState.UNKNOWN]
    known = len(closing) - len(unknown)
    one = MotionRow(
        profile=row.profile,
        rate_hz=row.rate_hz,
        family=row.family,
        closing=len(closing),
        known=known,
        tracks=int(bool(closing)),
        known_tracks=int(bool(closing) and 2 * known >= len(closing)),
        judged=sum(moment.motion is not m.MotionState.UNKNOWN for moment in moments),
        wrong=sum(moment.wrong for moment in moments),
        late=sum(moment.late for moment in moments),
        targets=1,
        identities=len(frozenset[int]().union(*(moment.ids for moment in moments))),
        causes=tuple(Counter(unknown).items()),
    )
    return msgspec.structs.replace(_sum_rows([row, one]), family=row.family)


def _sum_rows(rows: list[MotionRow]) -> MotionRow:
    """The sum of rows of one profile and rate."""
    causes: Counter[m.MotionCause] = Counter()
    for row in rows:
        causes.update(dict(row.causes))
    counts = ("closing", "known", "tracks", "known_tracks", "judged", "wrong", "late", "targets", "identities")
    return MotionRow(
        profile=rows[0].profile,
        rate_hz=rows[0].rate_hz,
        family=None,
        causes=tuple(sorted(causes.items(), key=lambda item: (-item[1], item[0]))),
        **{name: sum(getattr(row, name) for row in rows) for name in counts},
    )


def _percent(part: int, whole: int) -> float | None:
    return round(100.0 * part / whole, 1) if whole else None


if __name__ == "__main__":
    sys.stdout.write(table_text(tabulate_rows(motion_table(int(sys.argv[1]), int(sys.argv[2])))))
