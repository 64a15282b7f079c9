"""What holds for any evidence over several pictures: caution, mirrored pictures, order of boxes, and the words."""

from __future__ import annotations

import math
import random
import re

import msgspec
from hypothesis import given, settings
from hypothesis import strategies as st

from paani import messages as m
from paani.config import Config, calibration_of, load_config
from tests.unit.paani_services.advisor.advisor_evidence import CALIBRATED, CLEAR, PAANI, PAPER, play

D = m.Direction
WIDE = load_config(profile="wide")
CONFIGS = st.sampled_from([PAANI, CALIBRATED, msgspec.structs.replace(WIDE, calibration=calibration_of(WIDE.eye))])
MIRRORED = {
    D.LEFT: D.RIGHT, D.RIGHT: D.LEFT, D.SLIGHT_LEFT: D.SLIGHT_RIGHT, D.SLIGHT_RIGHT: D.SLIGHT_LEFT,
    D.STRAIGHT: D.STRAIGHT, D.STOP: D.STOP,
}  # fmt: skip
BOLDNESS = {D.STOP: 0, D.LEFT: 1, D.RIGHT: 1, D.SLIGHT_LEFT: 2, D.SLIGHT_RIGHT: 2, D.STRAIGHT: 3}
MANOEUVRES = {
    D.STRAIGHT: "Straight on", D.SLIGHT_LEFT: "Slightly left", D.SLIGHT_RIGHT: "Slightly right",
    D.LEFT: "Turn left", D.RIGHT: "Turn right", D.STOP: "Stop",
}  # fmt: skip
TIES = {m.Reason.TIE_STARBOARD, m.Reason.NO_SIDE_FOR_LONG}  # they prefer starboard


def _box(rng: random.Random) -> m.BoxXyxy:
    """Off the edges of every corridor: a mirrored box is not exact to the last bit."""
    width, height = rng.uniform(0.01, 0.5), rng.uniform(0.02, 0.6)
    x1, y1 = rng.uniform(0.0, 1.0 - width), rng.uniform(0.0, 1.0 - height)
    return x1, y1, x1 + width, rng.choice((y1 + height, 1.0))


def _lane(rng: random.Random) -> m.LaneEvidence:
    non_water = rng.choice((rng.uniform(0.0, 0.3), rng.random()))
    open_width = rng.choice((1.0, rng.random()))
    return m.LaneEvidence(
        non_water=non_water, uncertainty=rng.uniform(0.0, 0.4), clear_width=1.0 - non_water, open_width=open_width
    )


def detection(rng: random.Random, *labels: m.Label) -> m.Detection:
    return m.Detection(label=rng.choice(labels), confidence=rng.uniform(0.41, 1.0), box_xyxy=_box(rng))


def frame(rng: random.Random, *labels: m.Label) -> m.Evidence:
    kinds = list(m.CandidateKind)
    candidates = tuple(
        m.Candidate(kind=rng.choice(kinds), confidence=rng.random(), box_xyxy=_box(rng))
        for _ in range(rng.choice((0, 0, 0, 1)))
    )
    edge = rng.choice(((), (0.4,) * 80, (0.6,) * 80, tuple(rng.random() for _ in range(80))))
    return msgspec.structs.replace(
        CLEAR,
        left=_lane(rng),
        center=_lane(rng),
        right=_lane(rng),
        detections=tuple(detection(rng, *labels) for _ in range(rng.randrange(5))),
        candidates=candidates,
        water_edge=edge,
    )


def sequence(seed: int, *labels: m.Label) -> list[m.Evidence]:
    """One to four pictures, one of which may come several times."""
    rng = random.Random(seed)
    frames = [frame(rng, *labels) for _ in range(rng.randrange(1, 4))]
    return [each for each in frames for _ in range(rng.randrange(1, 4))][:4]


SEEDS = st.integers(0, 2**32)


def limit_mps(advisory: m.Advisory) -> float:
    return math.inf if isinstance(advisory.speed_limit_mps, msgspec.UnsetType) else advisory.speed_limit_mps


@settings(max_examples=25)
@given(SEEDS, CONFIGS)
def test_somebody_more_in_the_last_picture_makes_no_advice_bolder_and_no_boat_faster(seed: int, config: Config) -> None:
    """But that a turn which is merely retained ends where they are, with nobody ahead."""
    frames = sequence(seed, m.Label.BUOY, m.Label.VESSEL, m.Label.PIER)
    somebody = detection(random.Random(~seed), m.Label.PERSON)
    last = msgspec.structs.replace(frames[-1], detections=(*frames[-1].detections, somebody))
    before, after = play(frames, config)[1][-1], play([*frames[:-1], last], config)[1][-1]
    is_turn_ended = before.reason is m.Reason.TURN_RETAINED and after.reason is m.Reason.CENTER_CLEAR
    assert is_turn_ended or BOLDNESS[after.direction] <= BOLDNESS[before.direction]
    assert not (after.people_ahead and after.direction is D.STRAIGHT)
    assert limit_mps(after) <= limit_mps(before)
    assert after.may_keep_station is not True or before.direction is not D.STOP or before.may_keep_station is True


def mirrored(evidence: m.Evidence) -> m.Evidence:
    def turned(thing: m.Detection | m.Candidate) -> m.BoxXyxy:
        x1, y1, x2, y2 = thing.box_xyxy
        return 1.0 - x2, y1, 1.0 - x1, y2

    return msgspec.structs.replace(
        evidence,
        left=evidence.right,
        right=evidence.left,
        detections=tuple(msgspec.structs.replace(each, box_xyxy=turned(each)) for each in evidence.detections),
        candidates=tuple(msgspec.structs.replace(each, box_xyxy=turned(each)) for each in evidence.candidates or ()),
        water_edge=evidence.water_edge[::-1],
    )


@settings(max_examples=25)
@given(SEEDS, CONFIGS | st.just(PAPER))
def test_mirrored_pictures_give_mirrored_advice(seed: int, config: Config) -> None:
    """But for ties, which go to starboard, and what follows from them."""
    frames = sequence(seed, *m.Label)
    given_advice, other_advice = play(frames, config)[1], play(list(map(mirrored, frames)), config)[1]
    for one, other in zip(given_advice, other_advice, strict=True):
        if not TIES.isdisjoint({one.reason, other.reason}):
            return
        assert other.direction is MIRRORED[one.direction]
        assert (other.people_ahead, other.candidates_ahead) == (one.people_ahead, one.candidates_ahead)
        assert limit_mps(other) == limit_mps(one)


@settings(max_examples=25)
@given(SEEDS, CONFIGS | st.just(PAPER))
def test_the_order_of_the_detections_changes_nothing(seed: int, config: Config) -> None:
    frames = sequence(seed, *m.Label)
    turned = [msgspec.structs.replace(each, detections=each.detections[::-1]) for each in frames]
    assert play(turned, config)[1] == play(frames, config)[1]


@settings(max_examples=25)
@given(SEEDS, CONFIGS | st.just(PAPER))
def test_the_words_agree_with_direction_limit_and_who_is_ahead(seed: int, config: Config) -> None:
    _, advice, seen = play(sequence(seed, *m.Label), config)
    for advisory, tracks in zip(advice, seen, strict=True):
        text, direction = advisory.explanation, advisory.direction
        assert {found for found, words in MANOEUVRES.items() if words in text} == {direction}
        assert ("swimmer" in text.lower()) is bool(advisory.people_ahead)
        if not advisory.people_ahead:
            assert ("something that may be a person" in text.lower()) is bool(advisory.candidates_ahead)
        assert "Slow:" not in text or limit_mps(advisory) < math.inf
        assert ("passing on the " in text) <= (f"passing on the {m.SIDE_OF.get(direction)}" in text)
        assert not advisory.center.blocked or "the way ahead is clear" not in text
        free = [not side.blocked for side in (advisory.left, advisory.right)].count(True)
        assert "no side is free:" not in text or text.count("reaches in from there") == free
        assert {int(number) for number in re.findall(r"#(\d+)", text)} <= {track.id for track in tracks.tracks}
