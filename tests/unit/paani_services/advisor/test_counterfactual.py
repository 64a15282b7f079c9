"""What is said to have decided did decide: each set changes the direction, and no smaller one does."""

from __future__ import annotations

import itertools

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani import messages as m
from paani.config import Config, load_config
from paani_services.advisor import counterfactual
from paani_services.advisor.advise import AdvisorState, advise
from paani_services.advisor.counterfactual import find_counterfactual, nearest_limit, prepare_subsets
from paani_services.advisor.explanation import explain_advisory
from paani_services.advisor.frame_facts import PolicyState, frame_facts
from paani_services.advisor.policy import decide, frame_components
from paani_services.advisor.risk import ALL_EVIDENCE, LANES
from tests.unit.paani_services.advisor.advisor_evidence import (
    CALIBRATED,
    CLEAR,
    PAANI,
    PAPER,
    T0_US,
    box,
    lane,
    murky,
    play,
    seeing,
    water,
)
from tests.unit.paani_services.advisor.advisor_scenes import Scene, scene, scenes

CLEAR_WATER = m.LaneEvidence(non_water=0.0, uncertainty=0.0, clear_width=1.0)
D, R, By = m.Direction, m.Reason, m.ChangedBy
CONFIGS = st.sampled_from((PAANI, PAPER, CALIBRATED))
Taken = tuple[tuple[int, ...], tuple[str, ...]]  # track ids, lanes


def why(given_scene: Scene, config: Config) -> m.Counterfactual:
    return find_counterfactual(given_scene.facts(config), given_scene.decided(config), config)


def without(given_scene: Scene, taken: Taken) -> Scene:
    """The same frame without some evidence, after as many such frames as a kept turn lasts."""
    ids, lanes = taken
    return Scene(
        state=msgspec.structs.replace(given_scene.state, clear_frames=10_000),
        water={name: CLEAR_WATER if name in lanes else found for name, found in given_scene.water.items()},
        obstacles=tuple(o for o in given_scene.obstacles if o.id not in ids),
    )


def exhaustive(given_scene: Scene, config: Config) -> list[Taken]:
    """Every smallest set, of up to three of all tracks and lanes, that changes the direction; by `decide` alone."""
    direction = given_scene.decided(config).direction
    pieces: list[int | str] = [*sorted(o.id for o in given_scene.obstacles), *LANES]
    for size in (1, 2, 3):
        found = []
        for chosen in itertools.combinations(pieces, size):
            taken = (tuple(p for p in chosen if isinstance(p, int)), tuple(p for p in chosen if isinstance(p, str)))
            if without(given_scene, taken).decided(config).direction is not direction:
                found.append(taken)
        if found:
            return found
    return []


def require_exact(given_scene: Scene, config: Config) -> None:
    """What is reported is what asking the policy about everything finds."""
    decision, found = given_scene.decided(config), why(given_scene, config)
    if decision.direction is D.STRAIGHT:
        assert found == m.Counterfactual()
        return
    if decision.reason is R.TURN_RETAINED:
        assert found.changed_by is By.CLEAR_PICTURES
        assert without(given_scene, ((), ())).decided(config).direction is D.STRAIGHT
        return
    expected = exhaustive(given_scene, config)
    assert found.changed_by is (By.EVIDENCE if expected else By.MORE_EVIDENCE)
    assert found.found == len(expected)
    assert len(found.removals) == min(3, len(expected))
    for removal in found.removals:
        taken = (removal.track_ids, tuple(str(each) for each in removal.water))
        assert taken in expected
        assert without(given_scene, taken).decided(config).direction is removal.direction is not decision.direction
    straight = [without(given_scene, taken).decided(config).direction is D.STRAIGHT for taken in expected]
    assert [r.direction is D.STRAIGHT for r in found.removals] == sorted(straight, reverse=True)[:3]


@settings(max_examples=250, deadline=None)
@given(scenes(7), CONFIGS)
@pytest.mark.slow
def test_every_set_changes_the_direction_and_none_smaller_does(given_scene: Scene, config: Config) -> None:
    require_exact(given_scene, config)


@pytest.mark.parametrize(
    ("seed", "tracks", "size"), [(17, 24, 1), (4, 24, 2), (0, 24, 3), (5, 24, 0), (1, 12, 3), (38, 12, 0)]
)
@pytest.mark.slow
def test_the_sets_are_exact_in_crowded_scenes(seed: int, tracks: int, size: int) -> None:
    """Up to all 24 boxes of the detector, against every set of up to three; size 0: there is none so small."""
    require_exact(scene(seed, tracks), PAANI)
    found = why(scene(seed, tracks), PAANI)
    assert [len(r.track_ids) + len(r.water) for r in found.removals[:1]] == ([size] if size else [])


@settings(max_examples=100, deadline=None)
@given(scenes(5), st.integers(101, 200), st.floats(0.0, 0.02))
@pytest.mark.slow
def test_what_overlaps_no_corridor_is_left_out_without_loss(given_scene: Scene, number: int, x1: float) -> None:
    """A track beside every corridor changes no direction, alone or taken away with others."""
    beside = msgspec.structs.replace(
        scene(1, 1).obstacles[0], id=number, box=(x1, 0.3, 0.03, 1.0), severity=1.0, presence=1.0, is_danger=True
    )
    more = msgspec.structs.replace(given_scene, obstacles=(beside, *given_scene.obstacles))
    assert more.decided(PAANI) == given_scene.decided(PAANI)
    assert why(more, PAANI) == why(given_scene, PAANI)


@settings(max_examples=100, deadline=None)
@given(scenes(6), CONFIGS)
@pytest.mark.slow
def test_crossing_the_nearest_limit_changes_the_direction(given_scene: Scene, config: Config) -> None:
    """Water alone is moved, since any number of tracks could be: a hair across the limit is another direction."""
    decision = given_scene.decided(config)
    if decision.direction is D.STRAIGHT or decision.reason is R.TURN_RETAINED:
        return
    limit, margin = nearest_limit(given_scene.facts(config), decision)
    if limit not in {m.Limit.CENTER_RISK, m.Limit.LEFT_RISK, m.Limit.RIGHT_RISK}:
        return
    name = limit.value.removesuffix("_risk")
    parts = frame_components(given_scene.facts(config), ALL_EVIDENCE, config)
    moved = parts[name].risk - margin + (-1e-9 if margin >= 0.0 else 1e-9)
    parts[name] = msgspec.structs.replace(parts[name], risk=moved)
    patient = msgspec.structs.replace(given_scene.state, clear_frames=10_000)
    facts = frame_facts(patient, given_scene.water, given_scene.obstacles, config)
    assert decide(patient, facts, parts, config)[1].direction is not decision.direction
    shy = msgspec.structs.replace(parts[name], risk=moved + (2e-9 if margin >= 0.0 else -2e-9))
    assert decide(patient, facts, parts | {name: shy}, config)[1].direction is decision.direction


def test_the_nearest_limit_by_hand() -> None:
    _, advice, _ = play([water(0.10, 0.50, 0.40)])
    found = advice[0].counterfactual
    assert found.limit is m.Limit.CENTER_RISK
    assert found.margin == pytest.approx(0.02)
    _, advice, _ = play([water(0.30, 0.70, 0.331)])
    found = advice[0].counterfactual
    assert found.limit is m.Limit.SIDE_GAIN
    assert found.margin == pytest.approx(0.011)
    _, advice, _ = play([msgspec.structs.replace(water(0.57, 0.70, 0.60), left=murky(0.57))])
    found = advice[0].counterfactual
    assert found.limit is m.Limit.LEFT_RISK
    assert found.margin == pytest.approx(-0.01)
    near = seeing(box(m.Label.BUOY, (0.40, 0.56, 0.60, 0.70), 0.41))  # occupies: no risk could set it free
    _, advice, _ = play([msgspec.structs.replace(near, left=lane(0.0), right=lane(0.2))])
    assert advice[0].counterfactual.limit is m.Limit.SIDE_GAIN


def test_it_names_the_track_or_the_water_in_one_sentence() -> None:
    """J13: contributing is overlap; this is what decided."""
    pier = box(m.Label.PIER, (0.40, 0.30, 0.55, 0.64), 0.9)
    buoy = box(m.Label.BUOY, (0.62, 0.40, 0.66, 0.45), 0.5)  # overlaps, and decides nothing
    frame = msgspec.structs.replace(CLEAR, center=lane(0.30), detections=(pier, buoy))
    _, advice, tracks = play([frame] * 2)
    ids = {track.label: track.id for track in tracks[1].tracks}
    assert advice[1].direction is D.LEFT
    assert set(advice[1].contributing_track_ids) == set(ids.values())
    assert advice[1].counterfactual.removals[:2] == (
        m.Removal(direction=D.STRAIGHT, track_ids=(ids[m.Label.PIER],)),
        m.Removal(direction=D.STRAIGHT, water=(m.Lane.CENTER,)),
    )
    assert advice[1].explanation.endswith(f" Without pier #{ids[m.Label.PIER]} (centre) it would go STRAIGHT.")
    _, advice, _ = play([water(0.7, 0.7, 0.7)])
    assert advice[0].explanation.endswith(" With clear water in the centre it would go STRAIGHT.")
    occupying = box(m.Label.PIER, (0.40, 0.56, 0.60, 0.70), 0.5)  # so the centre stays blocked without its water
    _, advice, _ = play([msgspec.structs.replace(water(0.6, 0.6, 0.6), detections=(occupying,))])
    assert advice[0].direction is D.STOP
    assert advice[0].explanation.endswith(" With clear water on the left it would turn LEFT.")


def test_both_a_track_and_the_water_when_each_blocks() -> None:
    middle = box(m.Label.PIER, (0.45, 0.36, 0.55, 0.70), 0.9)
    left, right = box(m.Label.PIER, (0.05, 0.36, 0.25, 0.70), 0.9), box(m.Label.PIER, (0.75, 0.36, 0.95, 0.70), 0.9)
    frame = msgspec.structs.replace(water(0.65, 0.60, 0.65), detections=(middle, left, right))
    _, advice, _ = play([frame] * 3)
    assert advice[2].direction is D.STOP
    assert advice[2].center.track_ids == (1,)
    assert advice[2].counterfactual.removals == (
        m.Removal(direction=D.STRAIGHT, track_ids=(1,), water=(m.Lane.CENTER,)),
        m.Removal(direction=D.LEFT, track_ids=(2,), water=(m.Lane.LEFT,)),
        m.Removal(direction=D.RIGHT, track_ids=(3,), water=(m.Lane.RIGHT,)),
    )
    assert advice[2].explanation.endswith(
        " Without pier #1 (centre) and with clear water in the centre it would go STRAIGHT."
    )


def test_a_removal_is_what_follows_once_the_evidence_is_gone() -> None:
    """The turn that is kept meanwhile (J10) is no objection: after its frames the boat goes as was said."""
    state, advice, _ = play([water(0.20, 0.50, 0.40)] * 3)
    assert advice[2].counterfactual.removals == (
        m.Removal(direction=D.STRAIGHT, water=(m.Lane.CENTER,)),
        m.Removal(direction=D.RIGHT, water=(m.Lane.RIGHT,)),
    )
    _, after, _ = play([water(0.20, 0.0, 0.40)] * 2, state=state, first_seq=3)
    assert [a.direction for a in after] == [D.LEFT, D.STRAIGHT]
    assert after[0].counterfactual.changed_by is By.CLEAR_PICTURES


BLACK = msgspec.structs.replace(CLEAR, usable=False, cause=m.UnusableCause.BLACK)
INVERTED = seeing(box(m.Label.BUOY, (0.6, 0.4, 0.4, 0.6)))


@pytest.mark.parametrize(
    ("evidence", "age_s", "reason"),
    [
        (None, 0.0, R.NO_EVIDENCE),
        (BLACK, 0.1, R.UNUSABLE_IMAGE),
        (INVERTED, 0.1, R.MALFORMED_EVIDENCE),
        (water(0.1, 0.6, 0.1), 0.9, R.STALE_EVIDENCE),
        (water(0.1, 0.6, 0.1), -0.2, R.FUTURE_EVIDENCE),
    ],
)
def test_a_fault_of_the_input_is_changed_by_new_evidence_alone(
    evidence: m.Evidence | None, age_s: float, reason: m.Reason
) -> None:
    """J14, J15: what it shows, or would not show, is not asked."""
    _, advisory, _ = advise(AdvisorState(), evidence, T0_US + round(age_s * 1e6), PAANI)
    assert advisory.reason is reason
    assert advisory.counterfactual == m.Counterfactual(changed_by=By.NEW_EVIDENCE)
    assert advisory.explanation.endswith(" Only new evidence can change that.")


def test_it_is_found_once_for_a_frame_and_not_again_for_a_republish() -> None:
    """J17: a republish under settings that would find nothing still says what was found."""
    state, advice, _ = play([water(0.10, 0.50, 0.40)])
    idle = load_config(sets=("advisor.counterfactual_size=0",))
    assert state.evidence is not None
    _, again, _ = advise(state, state.evidence, T0_US + 300_000, idle)
    assert again.counterfactual == advice[0].counterfactual
    _, advice, _ = play([water(0.10, 0.50, 0.40)], idle)
    assert (advice[0].counterfactual.removals, advice[0].counterfactual.judged) == ((), 0)
    assert advice[0].explanation.endswith("(limit 0.58).")


@pytest.mark.parametrize("tracks", [24, 25, 64])
def test_the_work_is_bounded(tracks: int) -> None:
    """27 pieces in sets of up to three are 3303, however many tracks there are; what is left out is said."""
    crowd = scene(4, tracks)
    packed = tuple(
        msgspec.structs.replace(o, box=(0.35, 0.3, 0.65, 0.95), severity=0.9, presence=1.0) for o in crowd.obstacles
    )
    found = why(Scene(PolicyState(), {name: m.LaneEvidence() for name in LANES}, packed), PAANI)
    assert found.changed_by is By.MORE_EVIDENCE
    assert (found.judged, found.left_out) == (27 + 351 + 2925, tracks - 24)


@settings(max_examples=60, deadline=None)
@given(scenes(24), CONFIGS)
@pytest.mark.slow
def test_it_is_the_same_every_time_and_survives_the_wire(given_scene: Scene, config: Config) -> None:
    found = why(given_scene, config)
    data = msgspec.json.encode(found)
    assert msgspec.json.decode(data, type=m.Counterfactual) == found
    assert msgspec.json.encode(why(given_scene, config)) == data
    assert all(removal.track_ids == tuple(sorted(removal.track_ids)) for removal in found.removals)


def test_the_longest_explanation_fits_the_message() -> None:
    """Three of the longest names in all lanes, and a message that cannot be refused for its length."""
    ids = tuple(2**53 - i for i in range(24))
    crowded = m.LaneRisk(track_ids=ids)
    advisory = m.Advisory(
        source_us=0, direction=D.SLIGHT_RIGHT, reason=R.CENTER_RISK, left=crowded, center=crowded, right=crowded,
        counterfactual=m.Counterfactual(
            changed_by=By.EVIDENCE, removals=(m.Removal(direction=D.SLIGHT_LEFT, track_ids=ids[:3]),), found=1
        ),
    )  # fmt: skip
    for reason in R:
        sentence = explain_advisory(msgspec.structs.replace(advisory, reason=reason), ())
        assert len(sentence) <= 400
        assert sentence.endswith(".")


@given(scenes(7), CONFIGS)
def test_no_scene_needs_a_table_that_was_not_made_at_the_start(given_scene: Scene, config: Config) -> None:
    """What a drive sees does not make the advisor larger."""
    prepare_subsets(config)
    made = counterfactual._subsets.cache_info()
    why(given_scene, config)
    assert counterfactual._subsets.cache_info().misses == made.misses


def test_the_tables_are_small() -> None:
    prepare_subsets(PAANI)
    tables = [
        counterfactual._subsets(pieces, size)
        for pieces in range(1, counterfactual.MAX_PIECES + 1)
        for size in range(1, min(3, pieces) + 1)
    ]
    assert sum(array.nbytes for table in tables for array in table) < 1.5 * 2**20
    assert counterfactual._subsets.cache_info().currsize == len(tables)
