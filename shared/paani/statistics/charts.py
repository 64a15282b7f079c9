"""Charts and plans as SVG text: scales, axes, elements, curves, bars. Pure.

Every drawing of ours is made of these few functions. Colours and sizes come from the page's style sheet where they can.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import NamedTuple

WIDTH, HEIGHT = 420, 260
LEFT, RIGHT, TOP, BOTTOM = 44, 96, 24, 32
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7f7f7f")  # tells apart for everyone

Point = tuple[float, float]
Points = Sequence[Point]


class Axes(NamedTuple):
    """A rectangle of a drawing [px] with a linear scale along each side; y of the data points up."""

    x_range: tuple[float, float]
    y_range: tuple[float, float]
    left_px: float
    top_px: float
    width_px: float
    height_px: float

    def place(self, x: float, y: float) -> Point:
        """Pixels of a point; what lies outside the ranges lies outside the rectangle."""
        return (
            self.left_px + _fraction(x, self.x_range) * self.width_px,
            self.top_px + (1.0 - _fraction(y, self.y_range)) * self.height_px,
        )

    def place_all(self, points: Iterable[Sequence[float]]) -> list[Point]:
        """Pixels of each point."""
        return [self.place(x, y) for x, y in points]

    def clip(self, point: Point) -> Point:
        """The nearest point within the ranges."""
        return _clip(point[0], self.x_range), _clip(point[1], self.y_range)


def element(name: str, text: str | None = None, /, **attributes: object) -> str:
    """One SVG element; `stroke_width` becomes stroke-width, `class_` class. Numbers are in pixels."""
    written = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{_attribute(value)}"' for key, value in attributes.items()
    )
    return f"<{name}{written}/>" if text is None else f"<{name}{written}>{escape(text)}</{name}>"


def drawing(width: float, height: float, title: str, parts: Iterable[str], /, **attributes: object) -> str:
    """A whole SVG element of this size [px]; its title is what a screen reader says."""
    opened = element("svg", viewBox=f"0 0 {width:g} {height:g}", role="img", **attributes)
    return f"{opened[:-2]}>{element('title', title)}{''.join(parts)}</svg>"


def polyline(points_px: Points, /, **attributes: object) -> str:
    """An open line."""
    return element("polyline", points=_joined(points_px), **attributes)


def polygon(points_px: Points, /, **attributes: object) -> str:
    """A closed outline."""
    return element("polygon", points=_joined(points_px), **attributes)


def circle(point_px: Point, radius_px: float, /, **attributes: object) -> str:
    """A dot or a ring."""
    return element("circle", cx=point_px[0], cy=point_px[1], r=radius_px, **attributes)


def lines(
    series: Mapping[str, Points],
    x_label: str,
    y_label: str,
    x_range: tuple[float, float],
    y_range: tuple[float, float] = (0.0, 1.0),
) -> str:
    """Named curves over common axes; names stand at the right, apart from each other."""
    axes = Axes(x_range, y_range, LEFT, TOP, WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM)
    right_px = LEFT + axes.width_px
    parts = []
    for tick in range(5):
        x_value = x_range[0] + tick / 4 * (x_range[1] - x_range[0])
        y_value = y_range[0] + tick / 4 * (y_range[1] - y_range[0])
        x, y = LEFT + tick / 4 * axes.width_px, TOP + (1 - tick / 4) * axes.height_px
        parts += [
            element("line", class_="grid", x1=LEFT, y1=y, x2=right_px, y2=y),
            element("text", f"{x_value:g}", class_="tick", x=x, y=HEIGHT - BOTTOM + 14, text_anchor="middle"),
            element("text", f"{y_value:.3g}", class_="tick", x=LEFT - 6, y=y + 4, text_anchor="end"),
        ]
    parts += [
        element("text", x_label, class_="label", x=LEFT + axes.width_px / 2, y=HEIGHT - 4, text_anchor="middle"),
        element("text", y_label, class_="label", x=2, y=12),
    ]
    ends = []
    for index, (name, points) in enumerate(series.items()):
        if not points:
            continue
        colour = PALETTE[index % len(PALETTE)]
        points_px = axes.place_all(axes.clip(point) for point in points)
        parts.append(polyline(points_px, fill="none", stroke=colour, stroke_width=1.8))
        ends.append((points_px[-1][1], name, colour))
    for y, (_, name, colour) in zip(_spread([end[0] for end in sorted(ends)]), sorted(ends), strict=True):
        parts.append(element("text", name, class_="name", x=right_px + 6, y=y + 4, fill=colour))
    return drawing(WIDTH, HEIGHT, f"{y_label} over {x_label}", parts, class_="chart", width=WIDTH, height=HEIGHT)


def bar(value: float, low: float | None, high: float | None, scale: float = 1.0) -> str:
    """A small bar with its interval, `scale` being its full length."""
    width, height = 120, 14
    value_px, low_px, high_px = (
        _fraction(_clip(v, (0.0, scale)), (0.0, scale)) * width for v in (value, low or 0.0, high or 0.0)
    )
    parts = [
        element("rect", x=0, y=3, width=width, height=8, class_="track"),
        element("rect", x=0, y=3, width=value_px, height=8, class_="fill"),
    ]
    if low is not None and high is not None:
        parts += [
            element("line", x1=low_px, x2=high_px, y1=7, y2=7, class_="whisker"),
            element("line", x1=low_px, x2=low_px, y1=3, y2=11, class_="whisker"),
            element("line", x1=high_px, x2=high_px, y1=3, y2=11, class_="whisker"),
        ]
    opened = element(
        "svg", class_="bar", width=width, height=height, viewBox=f"-1 0 {width + 2} {height}", aria_hidden="true"
    )
    return f"{opened[:-2]}>{''.join(parts)}</svg>"


def _fraction(value: float, ends: tuple[float, float]) -> float:
    span = ends[1] - ends[0]
    return (value - ends[0]) / span if span > 0 else 0.0


def _clip(value: float, ends: tuple[float, float]) -> float:
    return min(max(ends), max(ends[0], value))


def _attribute(value: object) -> str:
    return f"{value:.1f}" if isinstance(value, float) else escape(str(value))


def _joined(points_px: Points) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points_px)


def _spread(ys: Sequence[float], gap: float = 13.0) -> list[float]:
    """Sorted heights, moved apart so that names do not cover each other."""
    placed: list[float] = []
    for y in ys:
        placed.append(max(y, placed[-1] + gap) if placed else y)
    over = placed[-1] - (HEIGHT - BOTTOM) if placed else 0.0
    return [y - over for y in placed] if over > 0 else placed
