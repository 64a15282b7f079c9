"""The manifest's figures, measured again on part of the held-out pictures (T3, U1 - U4)."""

from pathlib import Path

import pytest

from paani_models.catalogue import PAPER_WEIGHTS, WEIGHTS, Figure, load_catalogue, verified_path
from paani_models.commands.models import data_folder
from paani_models.datasets.sources import Sample, choose_sources, read_samples
from paani_models.report.manifest_figures import (
    measure_detector,
    measure_false_alarms,
    measure_null_pictures,
    measure_segmenter,
)

pytestmark = pytest.mark.slow

needs_data = pytest.mark.skipif(
    not data_folder().is_dir(), reason=f"no picture data at {data_folder()}; set PAANI_DATA"
)


def recorded(net: str, source: str, weights: Path = WEIGHTS) -> dict[str, Figure]:
    return {figure.metric: figure for figure in load_catalogue(weights)[net].figures if figure.source == source}


def held_out(*names: str) -> list[Sample]:
    return [sample for sample in read_samples(data_folder(), choose_sources(names)) if sample.held_out]


@pytest.mark.data
@needs_data
def test_segmenter_figures_are_reproduced_t3_u3_u4() -> None:
    measured = {f.metric: f for f in measure_segmenter(verified_path("segmenter"), held_out("mastr1325")) if f.n == 24}
    expected = recorded("segmenter", "mastr1325")
    assert set(measured) == {"iou_water", "iou_obstacle", "iou_sky", "miou"} == set(expected)
    for metric, figure in measured.items():
        assert figure.value == pytest.approx(expected[metric].value, abs=0.005)


@pytest.mark.data
@needs_data
def test_the_papers_segmenter_trained_here_has_the_stated_figures_v9() -> None:
    measured = measure_segmenter(verified_path("segmenter", PAPER_WEIGHTS), held_out("mastr1325"))
    found = {figure.metric: figure.value for figure in measured if figure.source == "mastr1325"}
    stated = {"miou": 0.886, "iou_water": 0.946, "iou_obstacle": 0.722, "iou_sky": 0.989}
    assert found == pytest.approx(stated, abs=0.002)
    expected = recorded("segmenter", "mastr1325", PAPER_WEIGHTS)
    assert {metric: figure.value for metric, figure in expected.items()} == pytest.approx(stated, abs=0.002)


@pytest.mark.data
@needs_data
def test_detector_figures_are_reproduced_u1_u2() -> None:
    measured = measure_detector(verified_path("detector"), held_out("tunai_sooke"))
    expected = recorded("detector", "tunai_sooke")
    for figure in measured:
        if figure.source == "tunai_sooke":
            assert figure.value == pytest.approx(expected[figure.metric].value, abs=0.02)
            assert figure.n == expected[figure.metric].n > 0


@pytest.mark.data
@needs_data
@pytest.mark.parametrize(
    ("label", "source", "ap50", "ap50_95", "n"),
    [
        ("person", "lifeguard_swim", 0.471, 0.157, 75),
        ("vessel", "typesofships_kayak_buoy", 0.562, 0.189, 70),
        ("vessel", "tunai_sooke", 0.0, 0.0, 21),
        ("pier", "tampere_pier", 0.298, 0.093, 23),
        ("buoy", "uon_robotx", 0.692, 0.308, 39),
    ],
)
def test_the_papers_detector_trained_here_has_the_stated_figures_v1_v4_v5_v6_v7(
    label: str, source: str, ap50: float, ap50_95: float, n: int
) -> None:
    measured = measure_detector(verified_path("detector", PAPER_WEIGHTS), held_out(source))
    expected = recorded("detector", source, PAPER_WEIGHTS)
    for metric, stated in ((f"{label}_ap50", ap50), (f"{label}_ap50_95", ap50_95)):
        (found,) = (figure for figure in measured if (figure.metric, figure.source) == (metric, source))
        assert (found.value, expected[metric].value) == pytest.approx((stated, stated), abs=0.002)
        assert found.n == expected[metric].n == n


@pytest.mark.rotating(cpu_s=10)
@pytest.mark.data
@needs_data
def test_water_is_water_on_rivers_never_seen_in_training() -> None:
    """USVInland, six held-out sequences; Tampere, one."""
    for name in ("tbiseg_usvinland", "tbiseg_tampere"):
        measured = {f.metric: f.value for f in measure_segmenter(verified_path("segmenter"), held_out(name))}
        assert measured["iou_water"] >= 0.93


@pytest.mark.data
@needs_data
def test_rivers_without_craft_raise_few_alarms() -> None:
    (figure,) = measure_false_alarms(verified_path("detector"), held_out("tbiseg_usvinland")[::4])
    assert figure.value <= 0.3


@pytest.mark.rotating(cpu_s=5)
def test_nothing_reads_as_water_v15() -> None:
    figure = measure_null_pictures(verified_path("segmenter"))
    assert figure.value <= 0.05
    assert figure.n == 200


def test_every_model_states_figures_and_origins() -> None:
    """The image-quality figures are of held-out pictures of every source, the others' of what people drew."""
    for model in load_catalogue().values():
        assert model.origins
        assert all(origin.licence for origin in model.origins)
        assert all(figure.value >= 0 and figure.n > 0 for figure in model.figures)
        assert {figure.source for figure in model.figures} >= {"tbiseg_usvinland"}
