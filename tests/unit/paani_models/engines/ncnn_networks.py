"""Small networks in both forms, their converted files, and a program with the converter's manners."""

from __future__ import annotations

import stat
import sys
from pathlib import Path

import msgspec
import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from paani_models.catalogue import file_sha256
from paani_models.engines.ncnn_runner import Conversion, ncnn_files

SHAPE = [1, 3, 256, 320]
WEIGHTS_3X3 = np.array([[0.5, -1.0, 0.25], [-0.5, 1.0, 0.0], [0.0, 0.125, -1.0]], np.float32)
WATER_BIAS = np.array([9.0, 0.0, -1.0], np.float32)
CONVOLUTION = """7767517
2 2
Input in0 0 1 in0
Convolution scores 1 1 in0 out0 0=3 1=1 11=1 2=1 12=1 3=1 13=1 4=0 14=0 5=1 6=9
"""
RESIZED = """7767517
3 3
Input in0 0 1 in0
Convolution scores 1 1 in0 cells 0=3 1=1 11=1 2=1 12=1 3=4 13=4 4=0 14=0 5=1 6=9
Interp last 1 1 cells out0 0=2 1=4.0 2=4.0 6=0
"""
NO_BOXES = """7767517
2 2
Input in0 0 1 in0
MemoryData boxes 0 1 out0 0=2730 1=8
"""
PNNX = """#!{python}
import pathlib, sys
assert sys.argv[2:] == ["inputshape=[1,3,256,320]", "fp16=0"], sys.argv
net = pathlib.Path(sys.argv[1])
net.with_suffix(".ncnn.param").write_text({param!r})
net.with_suffix(".ncnn.bin").write_bytes(bytes.fromhex({weights!r}))
pathlib.Path("litter.py").touch()
print("a last word")
sys.exit({code})
"""


def packed(bias: NDArray[np.float32] = WATER_BIAS) -> bytes:
    """Weights as ncnn keeps them: a zero for float32, then the numbers."""
    return bytes(4) + WEIGHTS_3X3.tobytes() + bias.astype(np.float32).tobytes()


def small_segmenter(path: Path) -> Path:
    """Scores that are a mix of each pixel's colours; mostly water."""
    graph = helper.make_graph(
        [helper.make_node("Conv", ["input", "weights", "bias"], ["logits"])],
        "small",
        [helper.make_tensor_value_info("input", TensorProto.FLOAT, SHAPE)],
        [helper.make_tensor_value_info("logits", TensorProto.FLOAT, SHAPE)],
        [
            numpy_helper.from_array(WEIGHTS_3X3.reshape(3, 3, 1, 1), "weights"),
            numpy_helper.from_array(WATER_BIAS, "bias"),
        ],
    )
    onnx.save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8), str(path))
    return path


def focus_layer(path: Path) -> Path:
    """YOLOX's focus layer alone: the four quarters of a picture as twelve channels."""
    _, colours, height, width = SHAPE
    nodes, quarters = [], []
    for column in (0, 1):
        for row in (0, 1):
            rows, quarter = f"rows_{column}{row}", f"quarter_{column}{row}"
            nodes.append(helper.make_node("Slice", ["input", f"at_{row}", "end", "rows", "two"], [rows]))
            nodes.append(helper.make_node("Slice", [rows, f"at_{column}", "end", "columns", "two"], [quarter]))
            quarters.append(quarter)
    numbers = {"at_0": 0, "at_1": 1, "end": 2**63 - 1, "rows": 2, "columns": 3, "two": 2}
    graph = helper.make_graph(
        [*nodes, helper.make_node("Concat", quarters, ["focused"], axis=1)],
        "focus",
        [helper.make_tensor_value_info("input", TensorProto.FLOAT, SHAPE)],
        [helper.make_tensor_value_info("focused", TensorProto.FLOAT, (1, 4 * colours, height // 2, width // 2))],
        [numpy_helper.from_array(np.array([value], np.int64), name) for name, value in numbers.items()],
    )
    onnx.save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8), str(path))
    return path


def place(model: Path, param: str, weights: bytes) -> Path:
    """Converted files beside a model, with the record that belongs to them."""
    files = ncnn_files(model)
    files.param.write_text(param)
    files.bin.write_bytes(weights)
    record = Conversion(file_sha256(model), file_sha256(files.param), file_sha256(files.bin), 0.0, 4)
    files.record.write_bytes(msgspec.json.encode(record))
    return model


def program(folder: Path, param: str = CONVOLUTION, weights: bytes | None = None, code: int = 0) -> Path:
    """A program with pnnx's manners."""
    path = folder / "pnnx"
    content = packed() if weights is None else weights
    path.write_text(PNNX.format(python=sys.executable, param=param, weights=content.hex(), code=code))
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return path
