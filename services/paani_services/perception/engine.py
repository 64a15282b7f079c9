"""Inference engines: one interface to run a model on the CPU, and its implementation by onnxruntime.

This is the only file of the services that imports onnxruntime, and it does so only when a model is loaded.
"""

from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any, Protocol, Self

import numpy as np

from paani.arrays import F32, U8
from paani.config import EngineName, PerceptionConfig
from paani.errors import UserError
from paani_models.catalogue import OTHER_SETS, Model, choose_model, file_sha256, verified_path
from paani_models.engines.last_resize import drop_last_resize
from paani_services.perception.corridors import cell_shape
from paani_services.perception.ncnn_engine import NcnnEngine

# NumPy's name of an element type, and that of onnxruntime.
ORT_TYPES = {"float32": "tensor(float)", "uint8": "tensor(uint8)"}


class Engine(Protocol):
    """One loaded model, and the contract of its input and output."""

    contract: Model

    @classmethod
    def load(cls, role: str, path: str, threads: int) -> Self:
        """Load the model at `path`, or without a path the shipped model of a role, after comparing its checksum.

        role: "detector", "segmenter" or "gate", the fitness network. A manifest beside the user's file may state
        another size, preprocessing or order of classes. Raises UserError naming a file that is missing, corrupt, no
        model, or of other shapes than its contract.
        """
        ...

    def run(self, tensor: F32 | U8) -> F32:
        """One inference: the contract's input to its output. Other threads run meanwhile.

        A segmenter that ends by resizing its scores fourfold returns the scores before that, one per cell.
        """
        ...

    def info(self) -> str:
        """Role, the beginning of the model file's checksum, and the engine where it is not onnxruntime."""
        ...


def engine_class(name: EngineName) -> type[Engine]:
    """The engine that the setting `perception.engine` names."""
    return NcnnEngine if name == "ncnn" else OnnxEngine


def network_path(role: str, config: PerceptionConfig) -> str:
    """The file of a role's network: the user's own, else that of the chosen set; empty for the one of the full set.

    role: "detector" or "segmenter". Raises UserError naming a file of the set that is missing or corrupt.
    """
    own = config.detector if role == "detector" else config.segmenter
    return own or ("" if config.weights == "full" else str(verified_path(role, OTHER_SETS[config.weights])))


def load_network(role: str, config: PerceptionConfig, threads: int) -> Engine:
    """The detector or the segmenter that the settings choose. Raises UserError as `Engine.load`."""
    return engine_class(config.engine).load(role, network_path(role, config), threads)


def check_onnxruntime(release: str) -> None:
    """Raises UserError for a release of onnxruntime that must not even be imported."""
    if release.split(".")[:2] == ["1", "21"]:
        raise UserError(
            f"onnxruntime {release}: executes an illegal instruction on ARM Cortex-A53; install 1.22 or later"
        )


@cache
def share_arena() -> None:
    """Give all models of this process one arena for what they compute with, that grows by what is asked of it alone.

    With it perception holds 140 MiB; it holds 151 with an arena for each model, and 150 to 166 with the C library's
    heap, where gaps stay between what lasts. All take the same time.
    """
    import onnxruntime as ort  # noqa: PLC0415 - as in `OnnxEngine.load`

    of_cpu = ort.OrtMemoryInfo("Cpu", ort.OrtAllocatorType.ORT_ARENA_ALLOCATOR, 0, ort.OrtMemType.DEFAULT)
    default, as_requested = -1, 1
    ort.create_and_register_allocator(of_cpu, ort.OrtArenaCfg(0, as_requested, default, default))


class OnnxEngine:
    """Runs an ONNX file by onnxruntime."""

    def __init__(self, session: Any, contract: Model, name: str) -> None:
        self._session, self._name = session, name
        self._input = session.get_inputs()[0].name
        self.contract = contract

    @classmethod
    def load(cls, role: str, path: str, threads: int, *, spinning: bool = False, full_size: bool = False) -> Self:
        """As `Engine.load`. spinning: idle threads wait busily, which slows a second model that runs beside this one.

        full_size: a segmenter returns its contract's output, not the cells before its last resize.
        """
        check_onnxruntime(_installed_release())
        import onnxruntime as ort  # noqa: PLC0415 - a release that is refused would end the process here

        contract, file = choose_model(role, path)
        checksum = file_sha256(file)
        options = ort.SessionOptions()
        options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
        options.add_session_config_entry("session.intra_op.allow_spinning", "1" if spinning else "0")
        options.add_session_config_entry("session.model_external_initializers_file_folder_path", str(file.parent))
        options.log_severity_level = 3
        options.enable_mem_pattern = False  # 8 MiB less, in the same time
        share_arena()
        options.add_session_config_entry("session.use_env_allocators", "1")

        def open_session(model: str | bytes) -> Any:
            try:
                return ort.InferenceSession(model, options, providers=["CPUExecutionProvider"])
            except Exception as error:  # onnxruntime raises classes of its own that it does not export
                raise UserError(f"{file}: not an ONNX model that can run here") from error

        session = open_session(str(file))
        inputs, outputs = _signature(session)
        # The candidates come first; an export with instance masks has theirs behind them.
        for found, wanted in ((inputs, contract.input), (outputs[:1], contract.output)):
            if found != [(wanted.shape, ORT_TYPES[wanted.dtype])]:
                raise UserError(f"{file}: {role} must have {wanted.dtype} {list(wanted.shape)}, found {found}")
        cells = None if full_size or role != "segmenter" else cell_shape(contract.output.shape)
        if cells and (model := drop_last_resize(file.read_bytes())):
            del session  # frees its memory before the other session takes its own
            session = open_session(model)
            if _signature(session)[1][0][0] != cells:
                return cls.load(role, path, threads, spinning=spinning, full_size=True)
        return cls(session, contract, f"{role} {checksum[:12]}")

    def run(self, tensor: F32 | U8) -> F32:
        """One inference: the contract's input to its output, or its cells."""
        return np.asarray(self._session.run(None, {self._input: tensor})[0], np.float32)

    def info(self) -> str:
        """Role, and the beginning of the file's checksum."""
        return self._name


def _signature(session: Any) -> tuple[list[tuple[tuple[int, ...], str]], ...]:
    """Shapes and element types of the inputs and of the outputs."""
    ends = (session.get_inputs(), session.get_outputs())
    return tuple([(tuple(end.shape), end.type) for end in found] for found in ends)


def _installed_release() -> str:
    """The release of onnxruntime; empty for one built from source that states none."""
    try:
        return version("onnxruntime")
    except PackageNotFoundError:
        return ""
