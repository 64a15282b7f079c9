"""Inference by ncnn, which is faster than onnxruntime on small ARM boards."""

from typing import Self

import numpy as np

from paani.arrays import F32, U8
from paani.errors import UserError
from paani_models.catalogue import Model, choose_model, file_sha256
from paani_models.engines.ncnn_runner import Run, blob_before_resize, open_ncnn, verified_ncnn_files
from paani_services.perception.corridors import cell_shape


class NcnnEngine:
    """Runs the files that `paani models convert` wrote beside an ONNX file."""

    def __init__(self, run: Run, contract: Model, name: str) -> None:
        self._run, self._name = run, name
        self.contract = contract

    @classmethod
    def load(cls, role: str, path: str, threads: int) -> Self:
        """As `Engine.load`; also raises UserError where the converted files are missing or of another model."""
        contract, file = choose_model(role, path)
        if contract.input.dtype != "float32":
            raise UserError(f"{file}: takes {contract.input.dtype}; ncnn runs float32 models alone")
        files = verified_ncnn_files(file)
        run = open_ncnn(files, threads)
        shape = run(np.zeros(contract.input.shape, np.float32)).shape
        if shape != contract.output.shape:
            raise UserError(f"{files.param}: {role} must give {list(contract.output.shape)}, found {list(shape)}")
        cells = cell_shape(shape) if role == "segmenter" else None
        if cells and (name := blob_before_resize(files)):
            short = open_ncnn(files, threads, name)
            run = short if short(np.zeros(contract.input.shape, np.float32)).shape == cells else run
        return cls(run, contract, f"{role} {file_sha256(file)[:12]} ncnn")

    def run(self, tensor: F32 | U8) -> F32:
        """One inference: the contract's input to its output, or its cells."""
        return self._run(np.asarray(tensor, np.float32))

    def info(self) -> str:
        """Role, the beginning of the checksum of the model that was converted, and "ncnn"."""
        return self._name
