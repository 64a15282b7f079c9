"""A failing camera: what it shows, when, and that it comes back."""

import numpy as np
import pytest

from paani_sim.eye.camera_faults import CameraFaults
from paani_sim.worlds import Fault, FaultKind

RNG = np.random.default_rng(3)
PICTURES = RNG.integers(0, 255, (6, 60, 80, 3), dtype=np.uint8)


def pictures_with(*faults: Fault, step_s: float = 1.0) -> list[np.ndarray | None]:
    camera = CameraFaults(faults)
    return [camera.apply(picture, k * step_s) for k, picture in enumerate(PICTURES)]


def test_without_faults_pictures_pass_unchanged() -> None:
    for picture, seen in zip(PICTURES, pictures_with(), strict=True):
        assert np.array_equal(picture, np.asarray(seen))


@pytest.mark.parametrize("kind", [FaultKind.CAMERA_DROPPED, FaultKind.LINK_LOSS])
def test_dropped_pictures_do_not_come(kind: FaultKind) -> None:
    seen = pictures_with(Fault(kind, 2.0, 2.0))
    assert [s is None for s in seen] == [False, False, True, True, False, False]


def test_frozen_camera_repeats_the_last_picture_and_comes_back() -> None:
    seen = pictures_with(Fault(FaultKind.CAMERA_FROZEN, 2.0, 2.0))
    for k, source in enumerate((0, 1, 1, 1, 4, 5)):
        assert np.array_equal(PICTURES[source], np.asarray(seen[k])), k


def test_camera_frozen_from_the_start_shows_its_first_picture() -> None:
    seen = pictures_with(Fault(FaultKind.CAMERA_FROZEN, 0.0))
    assert all(np.array_equal(PICTURES[0], np.asarray(s)) for s in seen)


def test_the_kept_picture_is_a_copy() -> None:
    camera = CameraFaults([Fault(FaultKind.CAMERA_FROZEN, 1.0)])
    picture = PICTURES[0].copy()
    camera.apply(picture, 0.0)
    picture[:] = 0
    assert np.array_equal(PICTURES[0], np.asarray(camera.apply(picture, 1.0)))


def test_black_is_noise_alone_and_repeats() -> None:
    fault = Fault(FaultKind.CAMERA_BLACK, 1.0, 1.0)
    first, again = np.asarray(pictures_with(fault)[1]), np.asarray(pictures_with(fault)[1])
    assert first.max() < 30
    assert first.std() > 0.1
    assert np.array_equal(first, again)


def test_blur_takes_its_amount() -> None:
    spread = [
        np.asarray(pictures_with(Fault(FaultKind.CAMERA_BLURRED, 0.0, amount=amount))[0]).std()
        for amount in (4.0, 12.0, 40.0)
    ]
    assert PICTURES[0].std() > spread[0] > spread[1] > spread[2]
