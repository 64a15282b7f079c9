"""Curves of the gate as one SVG: a small panel for each fault, refused share and the segmenter's mIoU over severity."""

from collections.abc import Sequence
from html import escape

from paani.picture_faults import MUST_ACCEPT, MUST_REJECT
from paani_tools.faults.measure import CellFigures

COLUMNS = 6
PANEL_W, PANEL_H, LEFT, TOP, PLOT_W, PLOT_H = 170, 130, 30, 24, 124, 76
REFUSED, MIOU, BAND = "#b3470b", "#005f73", "#e6eef0"


def curves(cells: Sequence[CellFigures]) -> str:
    """The SVG text. Both curves share the axis 0 to 1; the band is where either verdict will do."""
    names = list(dict.fromkeys(cell.fault for cell in cells))
    rows = -(-len(names) // COLUMNS)
    width, height = COLUMNS * PANEL_W, rows * PANEL_H + 26
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        'font-family="sans-serif" font-size="11">',
        f'<rect width="{width}" height="{height}" fill="#fff"/>',
        f'<text x="{LEFT}" y="16" fill="{REFUSED}">refused by the gate</text>',
        f'<text x="{LEFT + 130}" y="16" fill="{MIOU}">mIoU of the segmenter (dashed)</text>',
        f'<text x="{LEFT + 330}" y="16" fill="#555">band: either verdict will do; severity 1 to 5</text>',
    ]
    for index, name in enumerate(names):
        row, column = divmod(index, COLUMNS)
        parts.append(_panel([c for c in cells if c.fault == name], column * PANEL_W, row * PANEL_H + 20))
    return "\n".join((*parts, "</svg>\n"))


def _panel(cells: Sequence[CellFigures], x: float, y: float) -> str:
    left, top = x + LEFT, y + TOP

    def at(cell: CellFigures, value: float) -> str:
        return f"{left + (cell.severity - 1) / 4 * PLOT_W:.1f},{top + (1 - value) * PLOT_H:.1f}"

    def line(values: Sequence[float], colour: str, dash: str) -> str:
        points = " ".join(at(cell, value) for cell, value in zip(cells, values, strict=True))
        dots = "".join(
            '<circle cx="{}" cy="{}" r="2.4" fill="{}"/>'.format(*at(cell, value).split(","), colour)
            for cell, value in zip(cells, values, strict=True)
        )
        return f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.6" {dash}/>{dots}'

    band_top = top + (1 - MUST_ACCEPT) * PLOT_H
    return (
        f'<text x="{left}" y="{top - 6}">{escape(cells[0].fault.replace("_", " "))}</text>'
        f'<rect x="{left}" y="{band_top:.1f}" width="{PLOT_W}" height="{(MUST_ACCEPT - MUST_REJECT) * PLOT_H:.1f}" '
        f'fill="{BAND}"/>'
        f'<path d="M{left} {top}V{top + PLOT_H}H{left + PLOT_W}" fill="none" stroke="#888"/>'
        f'<text x="{left - 12}" y="{top + 4}" fill="#555">1</text>'
        f'<text x="{left - 12}" y="{top + PLOT_H}" fill="#555">0</text>'
        + line([cell.miou for cell in cells], MIOU, 'stroke-dasharray="4 3"')
        + line([cell.rejected / max(1, cell.n) for cell in cells], REFUSED, "")
    )
