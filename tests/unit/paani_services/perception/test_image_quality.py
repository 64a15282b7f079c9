"""Image-quality check: what no working camera delivers is refused, what cameras deliver is not."""

from __future__ import annotations

import cv2
import msgspec
import numpy as np
import pytest

from paani.config import ImageQualityConfig, PerceptionConfig, load_config
from paani.messages import UnusableCause
from paani.picture_faults import apply_fault
from paani_services.perception.fitness import load_fitness
from paani_services.perception.image_quality import ImageQualityState, check_image_quality
from tests.pictures import PICTURES, noisy, river
from tests.places import DATA

C = UnusableCause
ON = ImageQualityConfig()
FITNESS = load_fitness(PerceptionConfig(image_quality=ON), 1)


@pytest.mark.parametrize(("name", "causes"), [
    ("black", {C.BLACK}),
    ("black_with_noise", {C.BLACK}),
    ("nearly_black", {C.BLACK, C.FLAT}),
    ("white", {C.WHITE}),
    ("overexposed", {C.WHITE}),
    ("grey", {C.FLAT}),
    ("green", {C.FLAT}),
    ("grey_with_noise", {C.FLAT, C.NOISE}),
    ("test_card", {C.FLAT}),
    ("test_card_with_noise", {C.FLAT}),
    ("white_noise", {C.NOISE}),
    ("salt_and_pepper", {C.NOISE}),
    ("river_in_strong_noise", {C.NOISE}),
    ("blurred", {C.BLURRED, C.UNFIT}),
    ("gradient", {C.BLURRED, C.FLAT, C.UNFIT}),
    ("covered_60", {C.COVERED}),
    ("covered_80", {C.COVERED}),
])  # fmt: skip
@pytest.mark.parametrize("size_wh", [(320, 240), (640, 480)])
def test_what_no_camera_delivers_is_refused_with_its_cause(
    name: str, causes: set[UnusableCause], size_wh: tuple[int, int]
) -> None:
    """J19, W1, U8: each with its cause, in its first frame, through JPEG."""
    picture = cv2.resize(PICTURES[name], size_wh, interpolation=cv2.INTER_NEAREST)
    if name == "white_noise":
        picture = np.random.default_rng(2).integers(0, 256, (size_wh[1], size_wh[0], 3), np.uint8)
    assert check_image_quality(ImageQualityState(), picture, 1, ON, FITNESS)[1] in causes
    coded = cv2.imdecode(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 85])[1], cv2.IMREAD_COLOR)
    assert check_image_quality(ImageQualityState(), np.asarray(coded, np.uint8), 1, ON, FITNESS)[1] in causes


@pytest.mark.parametrize("name", ["river", "river_in_fog", "river_at_dusk", "river_in_light_noise"])
def test_what_cameras_deliver_is_usable(name: str) -> None:
    assert check_image_quality(ImageQualityState(), PICTURES[name], 1, ON, FITNESS)[1] is C.NONE


@pytest.mark.parametrize("name", ["river", "river_at_dusk"])
@pytest.mark.parametrize("size_wh", [(320, 240), (480, 270), (640, 480)])
@pytest.mark.parametrize("sense", [1, -1])
def test_lines_of_a_wrong_length_are_skewed(name: str, size_wh: tuple[int, int], sense: int) -> None:
    """Each line begins 3/320 of the width further along than the one above, to either side."""
    picture = cv2.resize(PICTURES[name], size_wh, interpolation=cv2.INTER_AREA)[:, ::sense]
    skewed, _ = apply_fault("sheared", picture, np.zeros(size_wh[::-1], np.uint8), 5, np.random.default_rng(0))
    assert check_image_quality(ImageQualityState(), np.ascontiguousarray(skewed[:, ::sense]), 1, ON)[1] is C.SKEWED


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("severity", [3, 4])
def test_motion_blur_is_not_taken_for_lines_of_a_wrong_length(severity: int, seed: int) -> None:
    """Blurred aslant, lines are like those above them moved along; the segmenter still reaches 0.84 on these."""
    picture, _ = apply_fault(
        "motion_blur", river(), np.zeros((240, 320), np.uint8), severity, np.random.default_rng(seed)
    )
    assert check_image_quality(ImageQualityState(), picture, 1, ON, FITNESS)[1] is C.NONE


@pytest.mark.parametrize("seed", range(3))
def test_the_fitness_network_refuses_what_statistics_cannot_tell(seed: int) -> None:
    """These have sound statistics; only the network knows that no camera on a boat sees this."""
    mask = np.zeros((240, 320), np.uint8)
    for name in ("shuffled", "drop_out", "drops", "false_colour"):
        picture, _ = apply_fault(name, river(), mask, 5, np.random.default_rng(seed))
        assert check_image_quality(ImageQualityState(), picture, 1, ON)[1] is C.NONE
        assert check_image_quality(ImageQualityState(), picture, 1, ON, FITNESS)[1] is C.UNFIT


def test_a_fitness_that_is_no_number_is_unfit() -> None:
    assert check_image_quality(ImageQualityState(), river(), 1, ON, lambda _: float("nan"))[1] is C.UNFIT


@pytest.mark.parametrize(("upright", "on_its_head", "cause", "looks"), [
    (0.98, 0.99, C.NONE, 1),
    (0.80, 0.60, C.NONE, 2),
    (0.80, 0.90, C.NONE, 2),
    (0.80, 0.98, C.NONE, 2),  # a dark tunnel, a noisy picture: fit both ways up
    (0.80, 0.995, C.UNFIT, 2),
    (0.96, 0.99, C.NONE, 2),
    (0.96, 0.999, C.UNFIT, 2),
    (0.80, float("nan"), C.UNFIT, 2),
    (0.05, 0.01, C.UNFIT, 1),
])  # fmt: skip
def test_a_doubtful_picture_is_checked_upside_down(
    upright: float, on_its_head: float, cause: UnusableCause, looks: int
) -> None:
    pictures = []

    def fitness(picture: np.ndarray) -> float:
        pictures.append(picture)
        return upright if np.array_equal(picture, river()) else on_its_head

    assert check_image_quality(ImageQualityState(), river(), 1, ON, fitness)[1] is cause
    assert len(pictures) == looks
    assert np.array_equal(pictures[-1], river()[:: -1 if looks == 2 else 1, :: -1 if looks == 2 else 1])


@pytest.mark.parametrize(("fitness", "cause"), [(0.98, C.NONE), (0.90, C.SKEWED), (0.05, C.SKEWED), (np.nan, C.SKEWED)])
def test_only_a_sure_fitness_accepts_lines_of_a_wrong_length(fitness: float, cause: UnusableCause) -> None:
    skewed, _ = apply_fault("sheared", river(), np.zeros((240, 320), np.uint8), 5, np.random.default_rng(0))
    assert check_image_quality(ImageQualityState(), skewed, 1, ON, lambda _: fitness)[1] is cause
    high = msgspec.structs.replace(ON, min_fitness=0.99)
    assert check_image_quality(ImageQualityState(), skewed, 1, high, lambda _: fitness)[1] is C.SKEWED


def test_a_picture_below_the_least_size_is_refused() -> None:
    assert check_image_quality(ImageQualityState(), river()[:100], 1, ON)[1] is C.WRONG_SIZE
    assert check_image_quality(ImageQualityState(), river()[:, :150], 1, ON)[1] is C.WRONG_SIZE


def test_a_camera_that_repeats_itself_is_frozen() -> None:
    """Three distinct frames that show the same; one new picture ends it; a new epoch begins again."""
    state = ImageQualityState()
    still = river()
    causes = []
    for _ in range(7):
        state, cause = check_image_quality(state, still, 1, ON)
        causes.append(cause)
    assert causes == [C.NONE] * 2 + [C.FROZEN] * 5
    state, cause = check_image_quality(state, noisy(still, 3.0, seed=5), 1, ON)
    assert cause is C.NONE
    for epoch in range(2, 12):
        state, cause = check_image_quality(state, still, epoch, ON)
        assert cause is C.NONE


def test_a_moored_camera_is_not_frozen() -> None:
    """Sensor noise of one level is enough."""
    state = ImageQualityState()
    for seed in range(20):
        state, cause = check_image_quality(state, noisy(river(), 1.0, seed), 1, ON)
        assert cause is C.NONE


def test_the_paper_checks_no_picture() -> None:
    """J19: black is accepted in the `paper` profile."""
    paper = load_config(profile="paper").perception.image_quality
    assert check_image_quality(ImageQualityState(), PICTURES["black"], 1, paper)[1] is C.NONE


@pytest.mark.data
def test_real_pictures_are_usable() -> None:
    """At most 0.2 % of the annotated real pictures, night included, are refused (every third is looked at)."""
    folder = DATA
    sources = sorted(p for p in folder.glob("*/images") if p.parent.name != "unlabelled")
    if not sources:
        pytest.skip(f"no pictures in {folder}")
    files = [file for source in sources for file in sorted(source.iterdir())][::3]
    refused = []
    for file in files:
        picture = cv2.imread(str(file))
        cause = check_image_quality(ImageQualityState(), np.asarray(picture, np.uint8), 1, ON)[1]
        if cause not in {C.NONE, C.WRONG_SIZE}:
            refused.append((file.name, cause))
    assert len(files) > 1000
    assert len(refused) <= 0.002 * len(files), refused
