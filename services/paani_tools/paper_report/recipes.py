"""Settings of the paper's two trainings beside those that `paani models train yolo11n` and `paper-segmenter` use."""

from __future__ import annotations

from types import SimpleNamespace

from paani.statistics.figure_table import FigureTable
from paani_tools.paper_report.settings import figures_at
from paani_tools.paper_report.tables import COLUMNS

# Statement, what it is, the paper's figures, and what holds them here.
DETECTOR: tuple[tuple[str, str, str, tuple[str, ...]], ...] = (
    ("S2", "detector: epochs / batch / workers", "60 / 32 / 4", ("recipe.epochs", "recipe.batch", "recipe.workers")),
    ("S2", "detector: side of its input [px]", "320", ("recipe.side_px",)),
    ("S3", "detector: rate / weight decay", "0.001 / 0.0005", ("recipe.peak_rate", "recipe.weight_decay")),
    ("S3", "detector: warm-up [epochs] / momentum then and after", "3 / 0.8 / 0.937", (
        "recipe.warmup_epochs", "recipe.warmup_momentum", "recipe.momentum")),
    ("S3", "detector: bias rate of the warm-up / nominal batch", "0.1 / 64", (
        "recipe.warmup_bias_rate", "recipe.nominal_batch")),
    ("S4", "detector: loss of box / class / DFL", "7.5 / 0.5 / 1.5", (
        "loss.BOX_GAIN", "loss.SCORE_GAIN", "loss.BINS_GAIN")),
    ("S4", "detector: seed / patience [epochs]", "42 / 12", ("recipe.seed", "recipe.patience")),
    ("S5", "detector: hue / saturation / value", "0.015 / 0.5 / 0.3", (
        "recipe.augmentation.hue", "recipe.augmentation.saturation", "recipe.augmentation.value")),
    ("S5", "detector: translation / scale / flip", "0.1 / 0.3 / 0.5", (
        "recipe.augmentation.translate_frac", "recipe.augmentation.scale", "recipe.augmentation.flip_frac")),
    ("S5", "detector: mosaic / last epochs without", "1 / 10", (
        "recipe.augmentation.mosaic_frac", "recipe.plain_epochs")),
)  # fmt: skip
SEGMENTER: tuple[tuple[str, str, str, tuple[str, ...]], ...] = (
    ("S6", "segmenter: epochs / batch / workers", "50 / 16 / 4", ("recipe.epochs", "recipe.batch", "recipe.workers")),
    ("S7", "segmenter: rate / weight decay", "0.0003 / 0.0001", ("recipe.peak_rate", "recipe.weight_decay")),
    ("S7", "segmenter: seed", "42", ("recipe.seed",)),
    ("S8", "segmenter: share flipped / jittered", "0.5 / 0.5", ("colour.FLIP_FRAC", "colour.JITTER_FRAC")),
    ("S8", "segmenter: brightness / contrast / saturation / hue", "0.2 / 0.2 / 0.2 / 0.05", (
        "colour.BRIGHTNESS", "colour.CONTRAST", "colour.SATURATION", "colour.HUE")),
    ("S8", "segmenter: share with glare / its blob / its glitter", "0.35 / 0.7 / 0.6", (
        "glare.GLARE_FRAC", "glare.BLOB_FRAC", "glare.GLITTER_FRAC")),
)  # fmt: skip
DATA_ROW = ("R5 R6 R7", "pictures and boxes of each split", "stated", None, 0, "WaterScenes is not at hand")


def _detector() -> SimpleNamespace:
    from paani_models.detector import paper_loss, train_paper_network  # noqa: PLC0415 - PyTorch is not on the board

    return SimpleNamespace(recipe=train_paper_network.Yolo11nRecipe(), loss=paper_loss)


def _segmenter() -> SimpleNamespace:
    from paani_models.segmenter import paper_augmentation, train  # noqa: PLC0415 - PyTorch is not on the board
    from paani_models.training import augment  # noqa: PLC0415

    return SimpleNamespace(recipe=train.PAPER_RECIPE, colour=paper_augmentation, glare=augment)


def training_table() -> FigureTable:
    """Both recipes; without PyTorch (extra `train`), the paper's column alone."""
    rows: list[tuple[str, str, str, str | None, int, str]] = []
    for table, read in ((DETECTOR, _detector), (SEGMENTER, _segmenter)):
        try:
            here, why = read(), "nothing"
        except ModuleNotFoundError as error:
            here, why = None, f"not read: {error.name} is not installed (extra `train`)"
        rows += [
            (
                statement,
                what,
                printed,
                None if here is None else figures_at(here, names),
                len(names) if here else 0,
                why,
            )
            for statement, what, printed, names in table
        ]
    return FigureTable(name="Training, the paper's recipes", columns=COLUMNS, rows=(*rows, DATA_ROW))
