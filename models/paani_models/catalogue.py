"""The manifest of a weights folder: each model file's contract, checksum, provenance and measured figures."""

from __future__ import annotations

import hashlib
import math
from pathlib import Path
from typing import Literal

import msgspec

from paani.errors import UserError
from paani.undecodable import UNREADABLE
from paani.whole_file import write_json

WEIGHTS = Path(__file__).parent / "weights"
OPEN_WEIGHTS = WEIGHTS / "open"  # learnt only from what anyone may use
PAPER_WEIGHTS = WEIGHTS / "paper"  # the paper's two networks, trained by its recipes
OTHER_SETS = {"open": OPEN_WEIGHTS, "paper": PAPER_WEIGHTS}  # beside the full set, by the value of `perception.weights`
MANIFEST = "manifest.json"


class Record(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A part of the manifest. Unknown fields are errors."""


class Tensor(Record, frozen=True):
    """One input or output of a net: static shape. A uint8 input is RGB bytes [1, H, W, 3], which the network scales."""

    name: str
    shape: tuple[int, ...]
    dtype: Literal["float32", "uint8"] = "float32"


class Preprocessing(Record, frozen=True):
    """Picture -> input: RGB / 255, then (value - mean) / std per channel.

    resize: "letterbox" keeps the aspect, centred on `pad_grey`; "stretch" fills the input; both bilinear.
    """

    resize: Literal["letterbox", "stretch"]
    mean: tuple[float, float, float]
    std: tuple[float, float, float]
    pad_grey: int = 0


class Figure(Record, frozen=True):
    """One measured value on one source's held-out sequences; n counts pictures, or boxes for detection figures."""

    metric: str
    source: str
    value: float
    n: int


class Origin(Record, frozen=True):
    """One training source as its manifest states it."""

    name: str
    repository: str
    commit: str
    licence: str


class Model(Record, frozen=True):
    """One model file and everything needed to trust and feed it. seed: of its training, where it was trained here."""

    name: str
    file: str
    sha256: str
    size_bytes: int
    parameters: int
    opset: int
    input: Tensor
    output: Tensor
    classes: tuple[str, ...]
    preprocessing: Preprocessing
    architecture: str
    licence: str
    origins: tuple[Origin, ...] = ()
    seed: int | None = None
    export_max_abs_diff: float = 0.0
    figures: tuple[Figure, ...] = ()

    @property
    def size_hw(self) -> tuple[int, int]:
        """Height and width of the input, in pixels."""
        height, width = self.input.shape[1:3] if self.input.dtype == "uint8" else self.input.shape[2:]
        return height, width

    def class_rows(self, classes: tuple[str, ...]) -> list[int] | None:
        """Output rows of the given classes that the model has; None where it has exactly these in this order."""
        declared = self.classes
        return None if declared == classes else [declared.index(name) for name in classes if name in declared]


class _Manifest(Record, frozen=True):
    models: tuple[Model, ...]


def load_catalogue(folder: Path | None = None) -> dict[str, Model]:
    """Models of a weights folder by name; the shipped ones by default.

    Raises UserError naming the manifest where it is missing, malformed, or names a model twice.
    """
    path = (folder or WEIGHTS) / MANIFEST
    try:
        models = msgspec.json.decode(path.read_bytes(), type=_Manifest).models
    except UNREADABLE as error:
        raise UserError(f"{path}: {error}") from error
    catalogue = {model.name: model for model in models}
    if len(catalogue) != len(models):
        raise UserError(f"{path}: names a model twice")
    return catalogue


def save_catalogue(catalogue: dict[str, Model], folder: Path) -> None:
    """Write the manifest, of which a reader never sees half."""
    write_json(folder / MANIFEST, _Manifest(tuple(catalogue[name] for name in sorted(catalogue))))


IGNORED_CLASS = "-"  # in a detector's manifest: a class of the model that is left out


def read_contract(file: Path, role: str) -> Model:
    """Read the contract of a user's model file from a manifest beside it, else take that of the role's shipped model.

    A segmenter names the shipped one's classes in any order; a detector names any of them in any order, and "-" for
    each of its classes that is to be left out. Raises UserError naming the manifest and its field.
    """
    shipped = load_catalogue()[role]
    manifest = file.parent / MANIFEST
    if not manifest.is_file():
        return shipped
    declared = next((m for m in load_catalogue(file.parent).values() if m.file == file.name), None)
    if declared is None:
        return shipped
    names = [name for name in declared.classes if name != IGNORED_CLASS]
    unknown = sorted(set(names) - set(shipped.classes))
    if unknown:
        raise UserError(f"{manifest}: {file.name}: classes: {unknown[0]!r} is not one of {', '.join(shipped.classes)}")
    is_complete = role == "detector" or sorted(declared.classes) == sorted(shipped.classes)
    if not names or len(set(names)) != len(names) or not is_complete:
        raise UserError(f"{manifest}: {file.name}: classes: a {role} has {', '.join(shipped.classes)}, each once")
    if declared.preprocessing.resize != shipped.preprocessing.resize:
        raise UserError(f"{manifest}: {file.name}: preprocessing.resize: a {role} has {shipped.preprocessing.resize}")
    shape, wanted = declared.input.shape, "[1, H, W, 3]" if declared.input.dtype == "uint8" else "[1, 3, H, W]"
    if len(shape) != 4 or (shape[0], shape[3 if declared.input.dtype == "uint8" else 1]) != (1, 3):
        raise UserError(f"{manifest}: {file.name}: input.shape: {list(shape)} is not {wanted}")
    _require_fitting_output(declared, role, f"{manifest}: {file.name}")
    return declared


def _require_fitting_output(declared: Model, role: str, where: str) -> None:
    """Raises UserError naming the field by which the picture would be spoilt, or the output not read."""
    preprocessing, shape = declared.preprocessing, declared.output.shape
    if not 0 <= preprocessing.pad_grey <= 255:
        raise UserError(f"{where}: preprocessing.pad_grey: {preprocessing.pad_grey} is not in 0..255")
    if not all(0.0 < each < math.inf for each in preprocessing.std):
        raise UserError(f"{where}: preprocessing.std: {list(preprocessing.std)} is not above 0")
    rows = 4 + len(declared.classes) if role == "detector" else len(declared.classes)
    if role == "detector" and (len(shape) != 3 or shape[:2] != (1, rows)):
        raise UserError(f"{where}: output.shape: {list(shape)} is not [1, {rows}, N], four numbers and the classes")
    if role == "segmenter" and (len(shape) != 4 or shape[:2] != (1, rows) or min(shape) < 1):
        raise UserError(f"{where}: output.shape: {list(shape)} is not [1, {rows}, H, W]")


def choose_model(role: str, path: str) -> tuple[Model, Path]:
    """Contract and file of a user's model; without a path, of the role's shipped model, whose checksum is compared."""
    return (read_contract(Path(path), role), Path(path)) if path else (load_catalogue()[role], verified_path(role))


def file_sha256(path: Path) -> str:
    """Hexadecimal SHA-256 of a file. Raises UserError naming a file that cannot be read."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}") from error


def verified_path(name: str, folder: Path | None = None) -> Path:
    """The file of a model, its checksum just compared with the manifest's.

    Raises UserError naming the model that is not in the manifest, or the file that is missing or corrupt.
    """
    model = load_catalogue(folder).get(name)
    if model is None:
        raise UserError(f"{(folder or WEIGHTS) / MANIFEST}: no model named {name!r}")
    path = (folder or WEIGHTS) / model.file
    if file_sha256(path) != model.sha256:
        raise UserError(f"{path}: corrupt (SHA-256 differs from the manifest)")
    return path
