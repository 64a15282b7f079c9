"""How often the advisor's apparent motion is known, and how often it is wrong, by frame rate: encounters against truth.

A moment counts as a *closing* one when, over as long as the rule needs (1.5 s, or six periods between frames if that is
more), the thing was whole in the picture, at least 16 px in size, and its range shrank by 8 % a second or more, twice
the estimator's dead band. Missed, dropped and mistaken boxes do not excuse a moment. A state is *wrong* when it says
that a thing approaches or recedes which did not over the time that the state is measured over, and *late* when it was
right over that time but no longer over the last half second.
"""

import math
import sys
from collections import Counter
from typing import Any

import msgspec
import numpy as np

from paani import keys
from paani import messages as m
from paani.config import Config, load_config
from paani.decider import Decider, Input, decider_of
from paani_sim.encounters import Course, Family, Look, course, looks, pose_at, range_at
from paani_sim.eye.camera import Camera

RATES_HZ = (0.5, 1.0, 2.0, 4.0, 5.0, 10.0)
MIN_CLOSING_PER_S = 0.08
MIN_SIZE_PX = 16.0
STILL_PER_S = 1e-9
NOW_S = 0.5
STEP_S = 0.2  # the advisor's own period
LATENCY_S = 0.25  # from picture to evidence
YAW_STD_RAD, YAW_RATE_STD_RADPS = 0.002, 0.004
SETTINGS: dict[str, tuple[str, ...]] = {
    "paani": (),
    "uncompensated": ("advisor.motion.compensate_rotation=false",),
    "paper": (),
}


class MotionRow(msgspec.Struct, frozen=True, kw_only=True):
    """One profile, rate and family.

    closing: moments whose truth is that the thing closes in. known_frac: of those, motion not unknown;
    known_tracks_frac: tracks with such moments that were known for at least half of them. judged: moments with any
    state but unknown, in or out of those; wrong_frac and late_frac: of those. identities: per thing. causes: of unknown
    at closing moments, most frequent first.
    """

    profile: str
    rate_hz: float
    family: Family
    closing: int
    known_frac: float
    known_tracks_frac: float
    judged: int
    wrong: int
    wrong_frac: float
    late_frac: float
    identities: float
    causes: tuple[tuple[m.MotionCause, int], ...]


class _Tally:
    def __init__(self) -> None:
        self.closing = self.known = self.judged = self.wrong = self.late = self.identities = self.things = 0
        self.tracks = self.known_tracks = 0
        self.causes: Counter[m.MotionCause] = Counter()


def motion_table(
    seed: int,
    n: int,
    profiles: tuple[str, ...] = ("paani", "uncompensated", "paper"),
    rates_hz: tuple[float, ...] = RATES_HZ,
    families: tuple[Family, ...] = tuple(Family),
) -> list[MotionRow]:
    """`n` encounters of each family at each rate, the same ones for every profile."""
    advisor = decider_of("advisor")
    rows = []
    for profile in profiles:
        config = load_config(profile="paper" if profile == "paper" else "paani", sets=SETTINGS[profile])
        for rate_hz in rates_hz:
            for family in families:
                tally = _Tally()
                for number in range(n):
                    rng = np.random.default_rng([seed, list(Family).index(family), number])
                    _encounter(advisor, config, course(family, rng), rate_hz, rng, tally)
                rows.append(_row(profile, rate_hz, family, tally))
    return rows


def text_of(rows: list[MotionRow]) -> str:
    """The table."""
    lines = [
        f"{'profile':<14} {'rate [Hz]':>9} {'family':<17} {'closing':>7} {'known':>6} {'tracks':>6} {'judged':>7}"
        f" {'wrong':>12} {'late':>6} {'ids':>5}  causes of unknown"
    ]
    for row in rows:
        causes = ", ".join(f"{cause} {count}" for cause, count in row.causes[:3])
        known = f"{row.known_frac:6.1%} {row.known_tracks_frac:6.1%}" if row.closing else f"{'-':>6} {'-':>6}"
        lines.append(
            f"{row.profile:<14} {row.rate_hz:>9g} {row.family:<17} {row.closing:>7} {known} {row.judged:>7}"
            f" {row.wrong:>5} {row.wrong_frac:6.2%} {row.late_frac:6.2%} {row.identities:>5.2f}  {causes}"
        )
    return "\n".join(lines) + "\n"


def _encounter(
    advisor: Decider[Any], config: Config, given: Course, rate_hz: float, rng: np.random.Generator, tally: _Tally
) -> None:
    """Let the advisor hear one encounter as it would live, and compare what it says with the truth."""
    camera = Camera(hfov_deg=config.eye.hfov_deg, down_deg=config.eye.pitch_down_deg)
    frames = list(looks(given, rate_hz, camera, rng))
    need_s = max(1.5, 6.0 / rate_hz)
    state, start_us = advisor.state(), 1_000_000_000
    heard: dict[str, Input] = {topic.name: Input() for topic in advisor.inputs}
    ids: set[int] = set()
    closing = known = 0
    step_s = 0.0
    for number, frame in enumerate(frames):
        while step_s < frame.at_s + LATENCY_S:  # republishes, with nothing new but odometry
            heard[keys.ODOMETRY.name] = Input(_odometry(given, step_s, start_us, rng), 0)
            state, _ = advisor.decide(state, heard, start_us + round(step_s * 1e6), config)
            step_s += STEP_S
        now_us = start_us + round((frame.at_s + LATENCY_S) * 1e6)
        heard[keys.ODOMETRY.name] = Input(_odometry(given, frame.at_s + LATENCY_S - 0.03, start_us, rng), now_us)
        heard[keys.EVIDENCE.name] = Input(_evidence(frame, number, given, camera, start_us), now_us)
        state, outputs = advisor.decide(state, heard, now_us, config)
        tracks = outputs[keys.TRACKS.name]
        assert isinstance(tracks, m.Tracks)
        ids |= {track.id for track in tracks.tracks if not track.held}
        track = _track_of(frame, tracks)
        shrank = _closing_per_s(given, frame.at_s, need_s)
        motion = m.MotionState.UNKNOWN if track is None else track.motion
        if motion is not m.MotionState.UNKNOWN:
            tally.judged += 1
            if _contradicts(motion, _closing_per_s(given, frame.at_s, tracks.motion_history_s)):
                tally.wrong += 1
            elif _contradicts(motion, _closing_per_s(given, frame.at_s, NOW_S)):
                tally.late += 1
        since = [f for f in frames[: number + 1] if frame.at_s - need_s <= f.at_s]
        if (
            frame.at_s >= need_s
            and shrank >= MIN_CLOSING_PER_S
            and all(f.whole and f.size_px >= MIN_SIZE_PX for f in since)
        ):
            closing += 1
            if motion is not m.MotionState.UNKNOWN:
                known += 1
            else:
                tally.causes[m.MotionCause.TOO_FEW_SAMPLES if track is None else track.motion_cause] += 1
    tally.closing, tally.known = tally.closing + closing, tally.known + known
    tally.things, tally.identities = tally.things + 1, tally.identities + len(ids)
    if closing:
        tally.tracks += 1
        tally.known_tracks += 2 * known >= closing


def _closing_per_s(given: Course, at_s: float, over_s: float) -> float:
    """How fast the logarithm of the range shrank, on average over the time before `at_s`."""
    start_s = max(0.0, at_s - over_s)
    if at_s - start_s < 1e-6:
        return 0.0
    return (math.log(range_at(given, start_s)) - math.log(range_at(given, at_s))) / (at_s - start_s)


def _contradicts(motion: m.MotionState, closing_per_s: float) -> bool:
    if motion is m.MotionState.APPROACHING:
        return closing_per_s <= STILL_PER_S
    return motion is m.MotionState.RECEDING and closing_per_s >= -STILL_PER_S


def _track_of(frame: Look, tracks: m.Tracks) -> m.Track | None:
    """The track of the thing: the one seen in this frame, else the one held longest-known."""
    seen = [t for t in tracks.tracks if not t.held] if frame.box is not None else []
    return max(seen or tracks.tracks, key=lambda t: (t.hits, -t.id), default=None)


def _odometry(given: Course, at_s: float, start_us: int, rng: np.random.Generator) -> m.Odometry:
    pose, rate = pose_at(given, max(0.0, at_s))
    return m.Odometry(
        source_us=start_us + round(at_s * 1e6),
        x_m=pose.x_m,
        y_m=pose.y_m,
        yaw_rad=pose.yaw_rad + rng.normal(0.0, YAW_STD_RAD),
        yaw_rate_radps=rate + rng.normal(0.0, YAW_RATE_STD_RADPS),
        surge_mps=given.boat_mps,
        healthy=True,
    )


def _evidence(frame: Look, number: int, given: Course, camera: Camera, start_us: int) -> m.Evidence:
    lane = m.LaneEvidence(non_water=0.05, uncertainty=0.05, clear_width=0.9)
    found = ()
    if frame.box is not None:
        found = (m.Detection(label=given.thing.label, confidence=frame.confidence, box_xyxy=frame.box),)
    return m.Evidence(
        source_us=start_us + round(frame.at_s * 1e6),
        frame_seq=number,
        frame_epoch=1,
        width_px=camera.width_px,
        height_px=camera.height_px,
        usable=True,
        detections=found,
        left=lane,
        center=lane,
        right=lane,
        segmentation=m.SegmentationSource.LEARNED,
        navigation_eligible=True,
    )


def _row(profile: str, rate_hz: float, family: Family, tally: _Tally) -> MotionRow:
    return MotionRow(
        profile=profile,
        rate_hz=rate_hz,
        family=family,
        closing=tally.closing,
        known_frac=tally.known / max(1, tally.closing),
        known_tracks_frac=tally.known_tracks / max(1, tally.tracks),
        judged=tally.judged,
        wrong=tally.wrong,
        wrong_frac=tally.wrong / max(1, tally.judged),
        late_frac=tally.late / max(1, tally.judged),
        identities=tally.identities / max(1, tally.things),
        causes=tuple(sorted(tally.causes.items(), key=lambda item: (-item[1], item[0]))),
    )


if __name__ == "__main__":
    sys.stdout.write(text_of(motion_table(int(sys.argv[1]), int(sys.argv[2]))))
