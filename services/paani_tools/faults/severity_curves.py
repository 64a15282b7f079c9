"""What the picture's check and the segmenter make of each fault as one SVG: a small panel each, over severity.

Each panel shows the share of pictures refused by the check, and the segmenter's mIoU (mean intersection over union).
"""

from collections.abc import Sequence

from paani.picture_faults import MUST_ACCEPT, MUST_REJECT
from paani.statistics.charts import PALETTE, Axes, circle, drawing, element, polyline
from paani_tools.faults.measure import LevelFigures

COLUMNS = 6
PANEL_W, PANEL_H, LEFT, TOP, PLOT_W, PLOT_H = 170, 130, 30, 24, 124, 76
MIOU, REFUSED, BAND, AXIS, NOTE = PALETTE[0], PALETTE[1], "#e6eef0", "#888", "#555"


def draw_severity_curves(cells: Sequence[LevelFigures]) -> str:
    """The SVG text. Both curves share the axis 0 to 1; the band is where either verdict will do."""
    names = list(dict.fromkeys(cell.fault for cell in cells))
    width, height = COLUMNS * PANEL_W, -(-len(names) // COLUMNS) * PANEL_H + 26
    parts = [
        element("rect", width=width, height=height, fill="#fff"),
        element("text", "refused by the image-quality check", x=LEFT, y=16, fill=REFUSED),
        element("text", "mIoU of the segmenter (dashed)", x=LEFT + 230, y=16, fill=MIOU),
        element("text", "band: either verdict will do; severity 1 to 5", x=LEFT + 430, y=16, fill=NOTE),
    ]
    for index, name in enumerate(names):
        row, column = divmod(index, COLUMNS)
        axes = Axes((1, 5), (0, 1), column * PANEL_W + LEFT, row * PANEL_H + 20 + TOP, PLOT_W, PLOT_H)
        parts += _draw_panel([cell for cell in cells if cell.fault == name], axes)
    return drawing(
        width, height, "Faults of the picture, by severity", parts,
        xmlns="http://www.w3.org/2000/svg", font_family="sans-serif", font_size=11,
    ) + "\n"  # fmt: skip


def _draw_panel(cells: Sequence[LevelFigures], axes: Axes) -> list[str]:
    (left, bottom), (right, top) = axes.place(1, 0), axes.place(5, 1)
    band_top, band_bottom = axes.place(1, MUST_ACCEPT)[1], axes.place(1, MUST_REJECT)[1]
    miou = axes.place_all((cell.severity, cell.miou) for cell in cells)
    refused = axes.place_all((cell.severity, cell.rejected / max(1, cell.n)) for cell in cells)
    return [
        element("text", cells[0].fault.replace("_", " "), x=left, y=top - 6),
        element("rect", x=left, y=band_top, width=right - left, height=band_bottom - band_top, fill=BAND),
        polyline([(left, top), (left, bottom), (right, bottom)], fill="none", stroke=AXIS),
        element("text", "1", x=left - 12, y=top + 4, fill=NOTE),
        element("text", "0", x=left - 12, y=bottom, fill=NOTE),
        polyline(miou, fill="none", stroke=MIOU, stroke_width=1.6, stroke_dasharray="4 3"),
        *(circle(point, 2.4, fill=MIOU) for point in miou),
        polyline(refused, fill="none", stroke=REFUSED, stroke_width=1.6),
        *(circle(point, 2.4, fill=REFUSED) for point in refused),
    ]
