"""Hysteresis of the policy, and what must hold however the policy is tuned."""

from __future__ import annotations

import random

import msgspec
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from paani import messages as m
from paani.config import Config, load_config
from paani.statistics.dithering import Dithering, dithering
from paani_services.advisor.frame_facts import OPPOSITE_SIDE, PolicyState, frame_facts, held_side, lane_risk_limit
from paani_services.advisor.policy import frame_components, preferred_side
from paani_services.advisor.risk import ALL_EVIDENCE, LANES, severity
from tests.unit.paani_services.advisor.advisor_evidence import CALIBRATED, PAANI, PAPER, murky, play, water
from tests.unit.paani_services.advisor.advisor_scenes import Scene, scene, scenes

D, R = m.Direction, m.Reason
CONFIGS = st.sampled_from((PAANI, PAPER, CALIBRATED))
ABRUPT = load_config(sets=("advisor.policy.side_change_margin=0", "advisor.policy.release_margin=0"))
MIRRORED = {
    D.LEFT: D.RIGHT, D.RIGHT: D.LEFT, D.SLIGHT_LEFT: D.SLIGHT_RIGHT, D.SLIGHT_RIGHT: D.SLIGHT_LEFT,
    D.STRAIGHT: D.STRAIGHT, D.STOP: D.STOP,
}  # fmt: skip


def test_a_new_side_must_be_clearly_better() -> None:
    """`paper` follows every gain beyond a tie, `paani` a clear one."""
    frames = [water(0.30, 0.50, 0.40), water(0.40, 0.50, 0.30), water(0.50, 0.50, 0.34)]
    _, steady, _ = play(frames)
    _, abrupt, _ = play(frames, PAPER)
    assert [(a.direction, a.reason) for a in steady] == [
        (D.LEFT, R.CENTER_RISK), (D.LEFT, R.TIE_KEPT_SIDE), (D.RIGHT, R.CENTER_RISK),
    ]  # fmt: skip
    assert [a.direction for a in abrupt] == [D.LEFT, D.RIGHT, D.RIGHT]


def test_a_side_that_becomes_blocked_is_left_at_once() -> None:
    """J8: no margin holds a turn into a blocked side."""
    blocked = msgspec.structs.replace(water(0.58, 0.50, 0.57), right=murky(0.57))
    _, advice, _ = play([water(0.30, 0.50, 0.40), blocked])
    assert [a.direction for a in advice] == [D.LEFT, D.RIGHT]


def test_a_blocked_lane_is_free_again_only_clearly_below_its_limit() -> None:
    """J5: 0.48 blocks the centre; in `paani` it then takes less than 0.40, for the frames of J10, to go straight."""
    frames = [water(0.1, risk, 0.4) for risk in (0.47, 0.48, 0.45, 0.41, 0.39, 0.47)]
    _, steady, _ = play(frames)
    _, abrupt, _ = play(frames, PAPER)
    assert [a.direction for a in steady] == [D.STRAIGHT, D.LEFT, D.LEFT, D.LEFT, D.LEFT, D.STRAIGHT]
    assert [a.direction for a in abrupt] == [D.STRAIGHT, D.LEFT, D.LEFT, D.STRAIGHT, D.STRAIGHT, D.STRAIGHT]
    assert [a.center.limit for a in steady] == pytest.approx([0.48, 0.48, 0.40, 0.40, 0.40, 0.48])
    assert all(a.center.limit == a.center_block_risk for a in abrupt)
    assert "centre risk 0.45 (limit 0.40)" in steady[2].explanation
    assert "centre risk 0.48 (limit 0.48)" in steady[1].explanation
    _, sides, _ = play([water(0.60, 0.60, 0.60), water(0.55, 0.60, 0.60), water(0.49, 0.60, 0.60)])
    assert [a.direction for a in sides] == [D.STOP, D.STOP, D.LEFT]


def noisy(config: Config, risks: tuple[float, float, float]) -> Dithering:
    """Two minutes of risks that change from frame to frame as they do on the recorded drives."""
    rng = random.Random(1)
    frames = [water(*(min(0.7, max(0.0, rng.gauss(risk, 0.04))) for risk in risks)) for _ in range(600)]
    return dithering(play(frames, config)[1])


@pytest.mark.slow
@pytest.mark.parametrize("risks", [(0.30, 0.60, 0.30), (0.30, 0.45, 0.40), (0.55, 0.60, 0.55)])
def test_noise_around_a_limit_changes_the_advice_less(risks: tuple[float, float, float]) -> None:
    """Between like sides, at the centre's limit, at the sides' limit (where it stops more often instead)."""
    steady, abrupt = noisy(PAANI, risks), noisy(ABRUPT, risks)
    assert abrupt.changes > 50
    assert steady.changes < 0.6 * abrupt.changes
    assert steady.side_flips <= 0.6 * abrupt.side_flips


@pytest.mark.slow
@settings(max_examples=400, deadline=None)
@given(scenes(6))
def test_steadiness_never_moves_a_boat_that_would_stop(given_scene: Scene) -> None:
    """The margins only ever block more lanes: what stops without them stops with them."""
    abrupt, steady = given_scene.decided(ABRUPT), given_scene.decided(PAANI)
    for lane in LANES:
        assert getattr(steady, lane).blocked >= getattr(abrupt, lane).blocked
    if abrupt.direction is D.STOP:
        assert steady.direction is D.STOP
    if steady.direction is D.STRAIGHT:
        assert abrupt.direction in {D.STRAIGHT, given_scene.state.turn}


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(scenes(6), st.integers(0, 2**32), CONFIGS)
def test_one_more_obstacle_is_never_good_news(given_scene: Scene, seed: int, config: Config) -> None:
    """J3, J4: no risk falls, no lane comes free, no turn becomes STRAIGHT while the centre is blocked.

    A boat that stops keeps still, but for one case: an obstacle that reached in from one side, with the other side
    blocked, is no mere edge any more (J9), so that the near side may be taken if it is free.
    """
    extra = msgspec.structs.replace(scene(seed, 1).obstacles[0], id=1000)
    more = msgspec.structs.replace(given_scene, obstacles=(*given_scene.obstacles, extra))
    before, after = given_scene.decided(config), more.decided(config)
    for lane in LANES:
        assert getattr(after, lane).risk >= getattr(before, lane).risk
        assert getattr(after, lane).blocked >= getattr(before, lane).blocked
        assert 0.0 <= getattr(after, lane).risk <= 1.0
    if before.center.blocked:
        assert after.direction is not D.STRAIGHT
    if before.direction is D.STOP and before.policy_input.incursion_side is None:
        assert after.direction is D.STOP


def off_grid(given_scene: Scene) -> Scene:
    """Boxes whose edges coincide with no corridor's and no part of it: a mirrored box is not exact to the last bit."""

    def moved(box: m.BoxXyxy) -> m.BoxXyxy:
        return (1.23e-4 + 0.9997 * box[0], box[1], 1.23e-4 + 0.9997 * box[2], box[3])

    return msgspec.structs.replace(
        given_scene, obstacles=tuple(msgspec.structs.replace(o, box=moved(o.box)) for o in given_scene.obstacles)
    )


def mirrored(given_scene: Scene) -> Scene:
    state = given_scene.state
    return Scene(
        state=PolicyState(
            occupied_frames=state.occupied_frames[::-1],
            turn=None if state.turn is None else MIRRORED[state.turn],
            clear_frames=state.clear_frames,
            blocked=state.blocked[::-1],
            no_way_frames=state.no_way_frames,
        ),
        water={
            "left": given_scene.water["right"], "center": given_scene.water["center"],
            "right": given_scene.water["left"],
        },
        obstacles=tuple(
            msgspec.structs.replace(o, box=(1.0 - o.box[2], o.box[1], 1.0 - o.box[0], o.box[3]))
            for o in given_scene.obstacles
        ),
    )  # fmt: skip


@pytest.mark.slow
@settings(max_examples=400, deadline=None)
@given(scenes(6), CONFIGS)
@example(scene(2465981, 2), CALIBRATED)  # no side was free for long, and both are alike
def test_a_mirrored_scene_gives_mirrored_advice(given_scene: Scene, config: Config) -> None:
    """Port and starboard differ in nothing but a tie without a turn in progress, which goes to starboard."""
    given_scene = off_grid(given_scene)
    decision, other = given_scene.decided(config), mirrored(given_scene).decided(config)
    risks = {lane: getattr(decision, lane).risk for lane in LANES}
    held, needed = held_side(given_scene.state, config)
    gain = risks[held] - risks[OPPOSITE_SIDE[held]]
    near = [abs(risks[lane] - lane_risk_limit(lane, given_scene.state, config)) for lane in LANES]
    assume(min(*near, abs(gain - needed), abs(gain + needed)) > 1e-9)
    is_tie = given_scene.state.turn is None and -config.advisor.policy.tie < gain < needed
    searches_in_tie = (
        is_tie and decision.reason is other.reason is R.NO_SIDE_FOR_LONG and not decision.policy_input.incursion_side
    )
    if searches_in_tie or R.TIE_STARBOARD in {decision.reason, other.reason}:
        assert decision.direction is other.direction is D.RIGHT
    else:
        assert other.direction is MIRRORED[decision.direction]
        assert other.reason is decision.reason


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.sampled_from((None, D.LEFT, D.SLIGHT_RIGHT)), CONFIGS)
def test_the_side_taken_is_never_much_the_worse(
    left: float, right: float, turn: m.Direction | None, config: Config
) -> None:
    policy = config.advisor.policy
    risks = {"left": left, "right": right}
    side = preferred_side(*held_side(PolicyState(turn=turn), config), risks)
    assert risks[side] - risks[OPPOSITE_SIDE[side]] <= max(policy.tie, policy.side_change_margin)


@pytest.mark.slow
def test_the_scenes_cover_every_direction() -> None:
    """The scenes of these tests are scenes: some of each direction, with risks between none and all."""
    decided = [scene(seed, seed % 7).decided(PAANI) for seed in range(400)]
    assert {d.direction for d in decided} == set(D) - {D.NO_DATA}
    assert severity(1.0, (0.0, 0.5, 1.0, 1.0)) == 1.0
    unseen = frame_facts(PolicyState(), {lane: m.LaneEvidence() for lane in LANES}, (), PAANI)
    assert frame_components(unseen, ALL_EVIDENCE, PAANI)["center"].risk == pytest.approx(0.70)
