"""Scales, clipping and escaping of the drawings."""

from xml.etree import ElementTree

import pytest

from paani.statistics.charts import Axes, bar, drawing, element, lines, polygon

AXES = Axes((0.0, 10.0), (-1.0, 1.0), 40.0, 20.0, 200.0, 100.0)


@pytest.mark.parametrize(
    ("point", "pixel"),
    [
        ((0.0, -1.0), (40.0, 120.0)),  # the origin of the data is at the lower left
        ((10.0, 1.0), (240.0, 20.0)),
        ((5.0, 0.0), (140.0, 70.0)),
        ((20.0, 3.0), (440.0, -80.0)),  # outside the ranges is outside the rectangle
    ],
)
def test_points_are_placed_by_linear_scales(point: tuple[float, float], pixel: tuple[float, float]) -> None:
    assert AXES.place(*point) == pytest.approx(pixel)


def test_points_are_clipped_to_the_ranges() -> None:
    assert AXES.clip((20.0, -3.0)) == (10.0, -1.0)


def test_an_empty_range_places_everything_at_its_beginning() -> None:
    assert AXES._replace(x_range=(2.0, 2.0)).place(7.0, 0.0)[0] == 40.0


def test_text_and_attributes_are_escaped() -> None:
    assert element("text", "a < b", class_='"x"', stroke_width=1.25) == (
        '<text class="&quot;x&quot;" stroke-width="1.2">a &lt; b</text>'
    )


def test_every_drawing_is_well_formed() -> None:
    curves = lines({"<one>": [(0.0, 0.0), (1.0, 2.0)], "none": []}, "x", "y", (0.0, 1.0))
    outline = polygon([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)], class_="water")
    for text in (curves, bar(0.5, 0.4, 0.6), bar(2.0, None, None), drawing(10, 20, "<plan>", [outline])):
        assert ElementTree.fromstring(text).tag == "svg"
