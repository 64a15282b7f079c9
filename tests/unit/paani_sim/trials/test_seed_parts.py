"""The parts of the seeds, and how fresh ones follow from a commit."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani.errors import UserError
from paani_sim.trials.policies import Policy
from paani_sim.trials.seed_parts import (
    FRESH_SEEDS,
    VALIDATION_SEEDS,
    SeedChoice,
    SeedPart,
    draw_fresh_seeds,
    list_seeds,
    parse_seeds,
    part_of_seed,
)
from paani_sim.trials.trial_cases import SUITES, list_cases, parse_case
from paani_sim.worlds.load import load_scenario

COMMITS = st.text("0123456789abcdef", min_size=40, max_size=40)


@settings(deadline=None)
@given(COMMITS, st.integers(1, 60), st.integers(0, 60))
def test_fewer_fresh_seeds_are_the_beginning_of_more(commit: str, count: int, more: int) -> None:
    seeds = draw_fresh_seeds(commit, count + more)
    assert draw_fresh_seeds(commit, count) == seeds[:count]
    assert len(set(seeds)) == count + more
    assert {part_of_seed(seed) for seed in seeds} == {SeedPart.FRESH}


@settings(deadline=None)
@given(COMMITS, COMMITS)
def test_another_commit_draws_other_seeds(one: str, other: str) -> None:
    assert (set(draw_fresh_seeds(one, 5)) == set(draw_fresh_seeds(other, 5))) is (one == other)


def test_fresh_seeds_are_the_published_function_of_the_commit() -> None:
    """100,000,000 + SHA-256("paani trial fresh COMMIT 0"), its first eight bytes modulo 900,000,000."""
    assert draw_fresh_seeds("0" * 40, 2) == [
        100_000_000 + digest % 900_000_000 for digest in (0x2B4006804A24FB24, 0x991AA19498CB94EA)
    ]


@pytest.mark.slow
def test_a_fresh_seed_draws_a_world() -> None:
    seed = draw_fresh_seeds("1" * 40, 1)[0]
    assert load_scenario(f"random:lake:{seed}").seed == seed


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("3..5", [3, 4, 5]),
        ("7", [7]),
        ("development", [1, 2]),
        ("development:4", [1, 2, 3, 4]),
        ("validation", [VALIDATION_SEEDS.start, VALIDATION_SEEDS.start + 1]),
        ("validation:1", [VALIDATION_SEEDS.start]),
        ("fresh:3@abc", draw_fresh_seeds("abc", 3)),
    ],
)
def test_a_choice_names_its_seeds(text: str, expected: list[int]) -> None:
    choice = parse_seeds(text)
    assert list_seeds(choice, 2) == expected
    assert {part_of_seed(seed) for seed in expected} == {choice.part}
    assert choice.is_ledgered is (choice.part is not SeedPart.DEVELOPMENT)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("3..1", "is empty"),
        ("a", "is none of"),
        ("fresh", "is not fresh:N@COMMIT"),
        ("fresh:0@HEAD", "is not fresh:N@COMMIT"),
        ("fresh:5@", "is not fresh:N@COMMIT"),
        ("validation:x", "is not validation or validation:N"),
        ("development:5@HEAD", "is not development"),
        ("development:", "is not development"),
        (f"1..{VALIDATION_SEEDS.start}", "holds validation seeds"),
        (f"{FRESH_SEEDS.start + 5}", "holds fresh seeds"),
        ("2000000000..99999999999", r"seeds \(at most 100000\)"),
        ("20000..120000", "100001 seeds"),
        ("9" * 19, "is none of"),
        (f"fresh:{'9' * 5000}@HEAD", "is not fresh:N@COMMIT"),
    ],
)
def test_what_is_no_choice_is_refused(text: str, says: str) -> None:
    with pytest.raises(UserError, match=says):
        parse_seeds(text)


def test_the_imazu_suite_drives_every_case_of_both_forms_once() -> None:
    cases = list_cases(SUITES["imazu"], SUITES["imazu"].worlds, [Policy.PAANI, Policy.ORACLE])
    assert len(cases) == 2 * 2 * 24
    assert {case.fault for case in cases} == {""}
    assert all(parse_case(case.name) == case for case in cases)


def test_a_suite_drives_the_seeds_that_were_chosen() -> None:
    """The slow policy drives few of a suite's own seeds, and all of those that are counted out."""
    suite, worlds = SUITES["standard"], ["lake"]
    for choice, paper in ((SeedChoice(part=SeedPart.VALIDATION), 5), (parse_seeds("validation:50"), 50)):
        cases = list_cases(suite, worlds, Policy, choice)
        assert sum(case.policy is Policy.PAPER for case in cases) == paper
        assert sum(case.policy is Policy.PAANI and not case.fault for case in cases) == 50
        assert {part_of_seed(case.seed) for case in cases} == {SeedPart.VALIDATION}
