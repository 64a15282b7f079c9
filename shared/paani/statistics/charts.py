"""Charts as SVG text. Colours and sizes come from the page's style sheet where they can."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

WIDTH, HEIGHT = 420, 260
LEFT, RIGHT, TOP, BOTTOM = 44, 96, 24, 32
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7f7f7f")  # tells apart for everyone

Points = Sequence[tuple[float, float]]


def lines(
    series: Mapping[str, Points],
    x_label: str,
    y_label: str,
    x_range: tuple[float, float],
    y_range: tuple[float, float] = (0.0, 1.0),
) -> str:
    """Named curves over common axes; names stand at the right, apart from each other."""
    plot_w, plot_h = WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM

    def place(x: float, y: float) -> tuple[float, float]:
        return (
            LEFT + _share(x, x_range) * plot_w,
            TOP + (1.0 - _share(y, y_range)) * plot_h,
        )

    parts = [_open(WIDTH, HEIGHT, f"{y_label} over {x_label}")]
    for tick in range(5):
        share = tick / 4
        x, y = LEFT + share * plot_w, TOP + (1 - share) * plot_h
        x_value = x_range[0] + share * (x_range[1] - x_range[0])
        y_value = y_range[0] + share * (y_range[1] - y_range[0])
        parts.append(f'<line class="grid" x1="{LEFT}" y1="{y:.1f}" x2="{LEFT + plot_w}" y2="{y:.1f}"/>')
        parts.append(
            f'<text class="tick" x="{x:.1f}" y="{HEIGHT - BOTTOM + 14}" text-anchor="middle">{x_value:g}</text>'
        )
        parts.append(f'<text class="tick" x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{y_value:.3g}</text>')
    middle = LEFT + plot_w / 2
    parts.append(f'<text class="label" x="{middle}" y="{HEIGHT - 4}" text-anchor="middle">{escape(x_label)}</text>')
    parts.append(f'<text class="label" x="2" y="12">{escape(y_label)}</text>')
    ends = []
    for index, (name, points) in enumerate(series.items()):
        if not points:
            continue
        colour = PALETTE[index % len(PALETTE)]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in (place(*point) for point in points))
        parts.append(f'<polyline fill="none" stroke="{colour}" stroke-width="1.8" points="{path}"/>')
        ends.append((place(*points[-1])[1], name, colour))
    for y, (_, name, colour) in zip(_spread([end[0] for end in sorted(ends)]), sorted(ends), strict=True):
        parts.append(
            f'<text class="name" x="{LEFT + plot_w + 6}" y="{y + 4:.1f}" fill="{colour}">{escape(name)}</text>'
        )
    return "".join(parts) + "</svg>"


def bar(value: float, low: float | None, high: float | None, scale: float = 1.0) -> str:
    """A small bar with its interval, `scale` being its full length."""
    width, height = 120, 14
    at = [_share(v, (0.0, scale)) * width for v in (value, low or 0.0, high or 0.0)]
    whisker = (
        f'<line x1="{at[1]:.1f}" x2="{at[2]:.1f}" y1="7" y2="7" class="whisker"/>'
        f'<line x1="{at[1]:.1f}" x2="{at[1]:.1f}" y1="3" y2="11" class="whisker"/>'
        f'<line x1="{at[2]:.1f}" x2="{at[2]:.1f}" y1="3" y2="11" class="whisker"/>'
        if low is not None and high is not None
        else ""
    )
    return (
        f'<svg class="bar" width="{width}" height="{height}" viewBox="-1 0 {width + 2} {height}" aria-hidden="true">'
        f'<rect x="0" y="3" width="{width}" height="8" class="track"/>'
        f'<rect x="0" y="3" width="{at[0]:.1f}" height="8" class="fill"/>{whisker}</svg>'
    )


def _share(value: float, ends: tuple[float, float]) -> float:
    span = ends[1] - ends[0]
    return min(1.0, max(0.0, (value - ends[0]) / span)) if span > 0 else 0.0


def _spread(ys: Sequence[float], gap: float = 13.0) -> list[float]:
    """Sorted heights, moved apart so that names do not cover each other."""
    placed: list[float] = []
    for y in ys:
        placed.append(max(y, placed[-1] + gap) if placed else y)
    over = placed[-1] - (HEIGHT - BOTTOM) if placed else 0.0
    return [y - over for y in placed] if over > 0 else placed


def _open(width: int, height: int, title: str) -> str:
    return (
        f'<svg class="chart" viewBox="0 0 {width} {height}" width="{width}" height="{height}" role="img">'
        f"<title>{escape(title)}</title>"
    )
