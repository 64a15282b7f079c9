"""Runs an ONNX model on the CPU: the one place in the services that imports onnxruntime."""

from pathlib import Path

import numpy as np
import onnxruntime as ort
from numpy.typing import NDArray

from paani.errors import UserError
from paani_models.catalogue import Model, described, file_sha256, load_catalogue, verified_path

Floats = NDArray[np.float32]
Bytes = NDArray[np.uint8]
ORT_TYPES = {"float32": "tensor(float)", "uint8": "tensor(uint8)"}


class Engine:
    """One loaded model: `load`, `run`, `info`."""

    def __init__(self, session: ort.InferenceSession, contract: Model, name: str) -> None:
        self._session, self._name = session, name
        self._input = session.get_inputs()[0].name
        self.contract = contract

    def rows_of(self, classes: tuple[str, ...]) -> list[int] | None:
        """Where each of the classes stands in the output, as far as it is there; None when all stand in that order."""
        stated = self.contract.classes
        return None if stated == classes else [stated.index(name) for name in classes if name in stated]

    @classmethod
    def load(cls, role: str, path: str, threads: int, *, spinning: bool = False) -> "Engine":
        """The shipped model of a role ("detector", "segmenter", "gate"), checksum compared, or a file of the user's.

        A manifest beside the user's file may state another size, preprocessing or order of classes. Raises UserError
        naming a file that is missing, corrupt, no ONNX model, or of other shapes than its contract.
        spinning: idle threads wait busily; two models that do so get in each other's way.
        """
        contract = described(Path(path), role) if path else load_catalogue()[role]
        file = Path(path) if path else verified_path(role)
        checksum = file_sha256(file)
        options = ort.SessionOptions()
        options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
        options.add_session_config_entry("session.intra_op.allow_spinning", "1" if spinning else "0")
        options.log_severity_level = 3
        try:
            session = ort.InferenceSession(str(file), options, providers=["CPUExecutionProvider"])
        except Exception as error:  # onnxruntime raises classes of its own that it does not export
            raise UserError(f"{file}: not an ONNX model that can run here") from error
        ends = ((session.get_inputs(), contract.input), (session.get_outputs(), contract.output))
        for found, wanted in ends:
            shapes = [(tuple(end.shape), end.type) for end in found]
            if shapes != [(wanted.shape, ORT_TYPES[wanted.dtype])]:
                raise UserError(f"{file}: {role} must have {wanted.dtype} {list(wanted.shape)}, found {shapes}")
        return cls(session, contract, f"{role} {checksum[:12]}")

    def run(self, tensor: Floats | Bytes) -> Floats:
        """One inference: the contract's input to its output."""
        return np.asarray(self._session.run(None, {self._input: tensor})[0], np.float32)

    def info(self) -> str:
        """Role and the beginning of the file's checksum."""
        return self._name
