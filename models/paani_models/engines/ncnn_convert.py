"""Convert ONNX to ncnn by pnnx, and check that both give the same outputs. Host only: needs onnx, ncnn and pnnx."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path

import msgspec
import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import helper, numpy_helper

from paani.errors import UserError
from paani.whole_file import indented_json, replacement_file
from paani_models.catalogue import MANIFEST, Model, file_sha256, load_catalogue, read_contract, save_catalogue
from paani_models.engines.contract_check import MAX_DIFFERENCE
from paani_models.engines.ncnn_runner import Conversion, NcnnFiles, ncnn_files
from paani_models.engines.onnx_file import read_onnx
from paani_models.engines.parity import Inputs, measure_difference

PNNX_LIMIT_S = 600.0
PNNX_NOT_FOUND = (
    "no pnnx to be run: `pip install --no-deps pnnx` into an environment of its own, "
    "and give the program in its site-packages/pnnx with --pnnx"
)


def convert_to_ncnn(source: Path, role: str, folder: Path, pnnx: str | None, inputs: Inputs) -> Conversion:
    """Write the ncnn files of a float32 model into `folder`, the model and its manifest entry too if it is elsewhere.

    inputs: the pictures on which both must agree to MAX_DIFFERENCE; else nothing is written. Raises UserError naming
    what is missing, what ncnn cannot run, or the difference.
    """
    program = shutil.which(pnnx or "pnnx")
    if program is None:
        raise UserError(f"--pnnx {pnnx}: no such program" if pnnx else PNNX_NOT_FOUND)
    contract = read_contract(source, role)
    if contract.input.dtype != "float32":
        raise UserError(f"{source}: takes {contract.input.dtype}; ncnn gets the float32 model that it was made from")
    with tempfile.TemporaryDirectory() as scratch:
        produced = _run_pnnx(program, source, contract, Path(scratch))
        diff = measure_difference(source, produced, role, contract, inputs)
        if not diff <= MAX_DIFFERENCE:
            raise UserError(f"{source}: ncnn's answers differ by {diff:.1e} (at most {MAX_DIFFERENCE:.0e})")
        record = Conversion(
            source_sha256=file_sha256(source),
            param_sha256=file_sha256(produced.param),
            bin_sha256=file_sha256(produced.bin),
            max_difference=diff,
            inputs=len(inputs),
        )
        produced.record.write_bytes(indented_json(record))
        try:
            _install_files(source, msgspec.structs.replace(contract, name=role, file=source.name), produced, folder)
        except OSError as error:
            raise UserError(f"{folder}: {error.strerror}") from error
    return record


def _install_files(source: Path, entry: Model, produced: NcnnFiles, folder: Path) -> None:
    """Copy the files into place, the record last: without it the files are not used."""
    folder.mkdir(parents=True, exist_ok=True)
    target = folder / source.name
    targets = ncnn_files(target)
    if target.resolve() != source.resolve():
        _copy_whole(source, target)
        known = load_catalogue(folder) if (folder / MANIFEST).exists() else {}
        entry = msgspec.structs.replace(entry, sha256=file_sha256(target), size_bytes=target.stat().st_size)
        save_catalogue({**known, entry.name: entry}, folder)
    for have, place in (
        (produced.param, targets.param),
        (produced.bin, targets.bin),
        (produced.record, targets.record),
    ):
        _copy_whole(have, place)


def _copy_whole(have: Path, place: Path) -> None:
    with replacement_file(place) as beside:
        shutil.copyfile(have, beside)


def _run_pnnx(program: str, source: Path, contract: Model, scratch: Path) -> NcnnFiles:
    """Run pnnx in a folder of its own, as it leaves files behind."""
    model = read_onnx(source)
    net = scratch / "net.onnx"
    onnx.save(replace_strided_slices(model), str(net))
    shape = ",".join(str(side) for side in contract.input.shape)
    command = [program, str(net), f"inputshape=[{shape}]", "fp16=0"]
    try:
        done = subprocess.run(
            command, cwd=scratch, capture_output=True, text=True, errors="replace", timeout=PNNX_LIMIT_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise UserError(f"{program}: {error}") from error
    produced = ncnn_files(net)
    if done.returncode != 0 or not (produced.param.is_file() and produced.bin.is_file()):
        lines = [line for line in (done.stdout + done.stderr).splitlines() if line.strip()]
        raise UserError(f"{program}: failed on {source.name}: {lines[-1].strip() if lines else 'without a word'}")
    unknown = find_untranslated_layers(produced.param.read_text(encoding="utf-8"))
    if unknown:
        raise UserError(f"{source}: ncnn has no {', '.join(unknown)}")
    return produced


def find_untranslated_layers(param: str) -> list[str]:
    """Find the layers that pnnx could not translate, which it leaves under their dotted names."""
    kinds = [line.split()[0] for line in param.splitlines()[2:] if line.strip()]
    return sorted({kind for kind in kinds if "." in kind})


def replace_strided_slices(model: onnx.ModelProto) -> onnx.ModelProto:
    """Replace each concatenation of slices with step 2 (YOLOX's focus layer) by one convolution: ncnn slices without
    steps.

    Exact: each weight is 0 or 1. Changes and returns the model.
    """
    graph = model.graph
    constants = {tensor.name: numpy_helper.to_array(tensor) for tensor in graph.initializer}
    for node in graph.node:
        if node.op_type == "Constant" and node.attribute[0].name == "value":
            constants[node.output[0]] = numpy_helper.to_array(node.attribute[0].t)
    producers = {output: node for node in graph.node for output in node.output}
    inferred = onnx.shape_inference.infer_shapes(model).graph
    channels = {
        value.name: value.type.tensor_type.shape.dim[1].dim_value
        for value in (*inferred.input, *inferred.value_info)
        if len(value.type.tensor_type.shape.dim) == 4
    }
    for place, node in enumerate(graph.node):
        if node.op_type != "Concat" or helper.get_node_attr_value(node, "axis") != 1:
            continue
        corners = [_read_strided_slice(name, producers, constants) for name in node.input]
        if None in corners or len({corner[0] for corner in corners if corner}) != 1:
            continue
        taken, count = corners[0][0], channels[corners[0][0]]  # type: ignore[index]
        weights = np.zeros((len(corners) * count, count, 2, 2), np.float32)
        for number, (_, row, column) in enumerate(corner for corner in corners if corner):
            for channel in range(count):
                weights[number * count + channel, channel, row, column] = 1.0
        name = f"{node.output[0]}.corners"
        graph.initializer.append(numpy_helper.from_array(weights, name))
        joined = helper.make_node("Conv", [taken, name], [node.output[0]], kernel_shape=[2, 2], strides=[2, 2])
        graph.node.remove(node)
        graph.node.insert(place, joined)
    _drop_unused_nodes(graph)
    return model


def _read_strided_slice(
    name: str, producers: Mapping[str, onnx.NodeProto], constants: Mapping[str, NDArray[np.generic]]
) -> tuple[str, int, int] | None:
    """Read a slice of every second row and column: its tensor, first row and column; None where it is another."""
    starts: dict[int, int] = {}
    while (node := producers.get(name)) is not None and node.op_type == "Slice":
        values = [constants.get(given) for given in node.input[1:]]
        if len(values) != 4 or any(value is None for value in values):
            return None
        start, end, axis, step = (int(value.reshape(-1)[0]) for value in values if value is not None)
        if step != 2 or start not in {0, 1} or end < 2**31 - 1 or axis not in {2, 3} or axis in starts:
            return None
        starts[axis] = start
        name = node.input[0]
    return (name, starts[2], starts[3]) if set(starts) == {2, 3} else None


def _drop_unused_nodes(graph: onnx.GraphProto) -> None:
    used_names = {value.name for value in graph.output}
    for node in reversed(list(graph.node)):
        if used_names.isdisjoint(node.output):
            graph.node.remove(node)
        else:
            used_names.update(node.input)
