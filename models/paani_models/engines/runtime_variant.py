"""Write a variant of a network that takes the picture as bytes and gives scores once per cell of 4x4 pixels.

The float32 contract costs a look-up per pixel before each run, and the segmenter's last step makes sixteen scores of
each. A variant takes RGB bytes [1,H,W,3], scales them itself, and leaves that last step out, as perception does. Its
answers are the shipped network's to rounding; a manifest beside it states what it takes and gives.
"""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from paani.errors import UserError
from paani.whole_file import replacement_file
from paani_models.catalogue import Model, Tensor, file_sha256, load_catalogue, save_catalogue
from paani_models.engines.last_resize import drop_last_resize


def write_variant(name: str, contract: Model, net: Path, folder: Path) -> Model:
    """Write `folder`/<file> and its manifest entry, both by renaming. Raises UserError naming a file that is no net."""
    try:
        whole = net.read_bytes()
        cells = drop_last_resize(whole)
        model = onnx.load_from_string(cells or whole)
    except Exception as error:
        raise UserError(f"{net}: not a readable ONNX file ({type(error).__name__})") from error
    _accept_bytes(model, contract)
    output = _declare_cell_output(model, contract.output.shape[:2]) if cells else contract.output
    onnx.checker.check_model(model, full_check=True)
    folder.mkdir(parents=True, exist_ok=True)
    catalogue = load_catalogue(folder) if (folder / "manifest.json").exists() else {}
    _, channels, height, width = contract.input.shape
    with replacement_file(folder / contract.file) as beside:
        onnx.save(model, str(beside))
        entry = msgspec.structs.replace(
            contract,
            name=name,
            sha256=file_sha256(beside),
            size_bytes=beside.stat().st_size,
            input=Tensor(model.graph.input[0].name, (1, height, width, channels), "uint8"),
            output=output,
            figures=(),
        )
    save_catalogue({**catalogue, name: entry}, folder)
    return entry


def _accept_bytes(model: onnx.ModelProto, contract: Model) -> None:
    """RGB bytes [1,H,W,3] -> what the network took."""
    graph = model.graph
    taken = graph.input[0].name
    _, channels, height, width = contract.input.shape
    preprocessing = contract.preprocessing
    std = np.array(preprocessing.std, np.float32)
    scale, shift = 1.0 / (255.0 * std), -np.array(preprocessing.mean, np.float32) / std
    steps = [
        helper.make_node("Transpose", ["picture"], ["picture.planes"], perm=[0, 3, 1, 2]),
        helper.make_node("Cast", ["picture.planes"], ["picture.float"], to=TensorProto.FLOAT),
        helper.make_node("Mul", ["picture.float", "picture.scale"], ["picture.scaled"]),
        helper.make_node("Add", ["picture.scaled", "picture.shift"], [taken]),
    ]
    graph.initializer.extend([_per_channel("picture.scale", scale), _per_channel("picture.shift", shift)])
    del graph.input[:]
    shape = [1, height, width, channels]
    graph.input.append(helper.make_tensor_value_info("picture", TensorProto.UINT8, shape))
    later = list(graph.node)
    del graph.node[:]
    graph.node.extend([*steps, *later])


def _per_channel(name: str, values: NDArray[np.float32]) -> onnx.TensorProto:
    return numpy_helper.from_array(np.ascontiguousarray(values.reshape(1, -1, 1, 1), np.float32), name)


def _declare_cell_output(model: onnx.ModelProto, batch_and_classes: tuple[int, ...]) -> Tensor:
    """The answer once per cell, its shape written into the file."""
    graph = model.graph
    cells = onnx.shape_inference.infer_shapes(model).graph.output[0]
    height_and_width = (int(side.dim_value) for side in cells.type.tensor_type.shape.dim[2:])
    answer = Tensor(cells.name, (*batch_and_classes, *height_and_width))
    graph.output[0].CopyFrom(helper.make_tensor_value_info(answer.name, TensorProto.FLOAT, answer.shape))
    return answer
