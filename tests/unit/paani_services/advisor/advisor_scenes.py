"""Scenes for the policy: what one frame holds once the tracker and the mask have spoken."""

from __future__ import annotations

import random

import msgspec
from hypothesis import strategies as st

from paani import messages as m
from paani.config import Config
from paani_services.advisor.frame_facts import FrameFacts, PolicyState, frame_facts
from paani_services.advisor.policy import Decision, decide, frame_components
from paani_services.advisor.risk import ALL_EVIDENCE, LANES, Obstacle, severity

SIZES = (0.02, 0.08, 0.15, 0.3, 0.6)


class Scene(msgspec.Struct, frozen=True):
    """The policy's memory, the lanes' water and the obstacles of one frame."""

    state: PolicyState
    water: dict[str, m.LaneEvidence]
    obstacles: tuple[Obstacle, ...]

    def decided(self, config: Config) -> Decision:
        facts = self.facts(config)
        return decide(self.state, facts, frame_components(facts, ALL_EVIDENCE, config), config)[1]

    def facts(self, config: Config) -> FrameFacts:
        return frame_facts(self.state, self.water, self.obstacles, config)


def scene(seed: int, tracks: int) -> Scene:
    """Everything on a coarse grid, so that ties, equal limits and boxes edge to edge occur."""
    rng = random.Random(seed)
    water = {
        lane: m.LaneEvidence(non_water=rng.choice((0.0, 0.0, 0.1, 0.3, 0.6, 0.9)), uncertainty=rng.choice((0.0, 0.2)))
        for lane in LANES
    }
    if rng.random() < 0.3:
        water["right"] = water["left"]
    return Scene(
        state=PolicyState(
            occupied_frames=(rng.randrange(3), rng.randrange(3), rng.randrange(3)),
            turn=rng.choice((None, *m.SIDE_OF)),
            clear_frames=rng.randrange(3),
            blocked=(rng.random() < 0.3, rng.random() < 0.3, rng.random() < 0.3),
            no_way_frames=random.Random(~seed).choice((0, 39, 40, 41)),
        ),
        water=water,
        obstacles=tuple(_obstacle(rng, number) for number in rng.sample(range(1, 100), tracks)),
    )


def _obstacle(rng: random.Random, number: int) -> Obstacle:
    width, height = rng.choice(SIZES), rng.choice(SIZES)
    x1 = round(rng.randrange(21) / 20 * (1.0 - width), 3)
    y1 = round(rng.randrange(21) / 20 * (1.0 - height), 3)
    box = (x1, y1, x1 + width, y1 + height)
    return Obstacle(
        id=number,
        is_vessel=rng.random() < 0.4,
        box=box,
        severity=severity(rng.choice((0.41, 0.6, 0.9)), box),
        urgency=rng.choice((0.0, 0.0, 0.5, 1.0)),
        presence=rng.choice((1.0, 1.0, 0.7, 0.3)),
        is_danger=box[3] >= 0.65 and width * height >= 0.02,
    )


def scenes(most: int) -> st.SearchStrategy[Scene]:
    """Scenes of up to `most` tracks."""
    return st.builds(scene, st.integers(0, 2**32), st.integers(0, most))
