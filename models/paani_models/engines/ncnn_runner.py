"""Run a network by ncnn (the only importer of it), and verify the converted files beside the model.

`NET.onnx` has `NET.ncnn.param`, `NET.ncnn.bin` and `NET.ncnn.json` beside it; `paani models convert` writes them.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np

from paani.arrays import F32
from paani.errors import UserError
from paani.undecodable import UNREADABLE
from paani_models.catalogue import Record, file_sha256

Run = Callable[[F32], F32]
INPUT, OUTPUT = "in0", "out0"
_CUBIC, _ALIGN_CORNERS = "0=3", "6=1"  # settings of ncnn's Interp
NOT_INSTALLED = "ncnn is not installed; install the extra paani[ncnn]"
_HALF_PRECISION_OPTIONS = (
    "use_fp16_packed",
    "use_fp16_storage",
    "use_fp16_arithmetic",
    "use_bf16_packed",
    "use_bf16_storage",
)


class Conversion(Record, frozen=True):
    """The files' checksums, the model they were made from, and how far their answers lie from its.

    max_difference: over `inputs` pictures; scores and logits as they are, boxes as shares of the input's sides.
    """

    source_sha256: str
    param_sha256: str
    bin_sha256: str
    max_difference: float
    inputs: int


class NcnnFiles(msgspec.Struct, frozen=True):
    """Paths of a model's converted files, whether or not they exist."""

    param: Path
    bin: Path
    record: Path


def ncnn_files(model: Path) -> NcnnFiles:
    """Paths of the converted files beside a model file."""
    return NcnnFiles(*(model.with_suffix(f".ncnn.{ending}") for ending in ("param", "bin", "json")))


def verified_ncnn_files(model: Path) -> NcnnFiles:
    """Paths beside a model, checksums compared: ncnn itself crashes on some damaged files.

    Raises UserError naming the file that is missing, corrupt or made from another model, and the command that makes it.
    """
    files, remedy = ncnn_files(model), f"make it with: paani models convert {model}"
    for path in (files.param, files.bin, files.record):
        if not path.is_file():
            raise UserError(f"{path}: missing; {remedy}")
    try:
        record = msgspec.json.decode(files.record.read_bytes(), type=Conversion)
    except UNREADABLE as error:
        raise UserError(f"{files.record}: {error}; {remedy}") from error
    if record.source_sha256 != file_sha256(model):
        raise UserError(f"{files.param}: made from another {model.name}; {remedy}")
    for path, sha256 in ((files.param, record.param_sha256), (files.bin, record.bin_sha256)):
        if file_sha256(path) != sha256:
            raise UserError(f"{path}: corrupt (SHA-256 differs from {files.record.name}); {remedy}")
    return files


def ncnn_version() -> str | None:
    """The version of ncnn; None where it is not installed."""
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # read once by its thread pool, which else waits busily
    try:
        import ncnn  # noqa: PLC0415 - an extra
    except ModuleNotFoundError:
        return None
    return str(ncnn.__version__)


def blob_before_resize(files: NcnnFiles) -> str | None:
    """Name of what the last step resizes, as `last_resize` has it, into the output; None where it is no such step."""
    for words in map(str.split, files.param.read_text(encoding="utf-8", errors="replace").splitlines()):
        if words[:1] == ["Interp"] and words[2:4] == ["1", "1"] and words[5] == OUTPUT:
            return None if {_CUBIC, _ALIGN_CORNERS} & set(words) else words[4]
    return None


def open_ncnn(files: NcnnFiles, threads: int, output: str = OUTPUT) -> Run:
    """Open a network as a function from input [1,C,H,W] to an output with a leading 1, computed in float32. The calls
    release the GIL.

    Raises UserError where ncnn is not installed, or naming a file that it does not read.
    """
    return open_ncnn_network(files.param, files.bin, threads, INPUT, output)


def open_ncnn_network(param: Path, weights: Path, threads: int, taken_from: str, output: str) -> Run:
    """Open any pair of ncnn files as `open_ncnn` does, by the names of its input and its output.

    Raises UserError where ncnn is not installed, or naming a file that is missing or that it does not read.
    """
    if ncnn_version() is None:
        raise UserError(NOT_INSTALLED)
    import ncnn  # noqa: PLC0415 - an extra

    for path in (param, weights):
        if not path.is_file():
            raise UserError(f"{path}: missing")
    net = ncnn.Net()
    for option in _HALF_PRECISION_OPTIONS:  # half precision moves logits by more than 1e-3
        setattr(net.opt, option, False)
    net.opt.use_vulkan_compute = False
    net.opt.num_threads = threads
    if net.load_param(str(param)) != 0:
        raise UserError(f"{param}: not a net that ncnn {ncnn_version()} can run")
    if net.load_model(str(weights)) != 0:
        raise UserError(f"{weights}: not the weights of {param.name}")

    def run(x: F32) -> F32:
        extractor = net.create_extractor()
        own = ncnn.Mat(np.ascontiguousarray(x[0], np.float32)).clone()  # some networks write into their input
        failed, answer = extractor.input(taken_from, own), None
        if failed == 0:
            failed, answer = extractor.extract(output)
        if failed != 0:
            raise UserError(f"{param}: does not run from {taken_from} to {output}")
        return np.array(answer, np.float32)[None]

    return run
