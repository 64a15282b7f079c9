"""Check a user's model file against its contract: shapes, classes, ranges, repeatability, and null pictures."""

from __future__ import annotations

import statistics
from collections.abc import Iterator
from pathlib import Path

import cv2
import msgspec
import numpy as np
from numpy.typing import NDArray

from paani.arrays import F32
from paani.clock import stopwatch_ms
from paani.errors import UserError
from paani_models.catalogue import IGNORED_CLASS, Model, load_catalogue, read_contract
from paani_models.engines.onnx_runner import Session, open_session, run_network

MAX_DIFFERENCE = 1e-3  # T2
TIMED_RUNS = 15
MAX_WATER_FRAC_IN_NULL = 0.05
PERSON = "person"
_STRIDES_PX = (8, 16, 32)  # of the shipped detector's candidates
_QUANTISED = b"QuantizeLinear"
_ONNX_TYPES = {"float32": "tensor(float)", "uint8": "tensor(uint8)"}


class Finding(msgspec.Struct, frozen=True):
    """One line of the report. A model with an `error` cannot be used; a `warning` is for its owner to judge."""

    level: str
    text: str


def infer_role(path: Path, asked: str | None) -> str:
    """Infer "segmenter" or "detector" from the output's shape. Raises UserError where it fits neither."""
    if asked is not None:
        return asked
    shape = open_session(path, 1).get_outputs()[0].shape
    if len(shape) in (3, 4):
        return "detector" if len(shape) == 3 else "segmenter"
    raise UserError(f"{path}: output {list(shape)} is neither [1, 3, H, W] nor [1, 4 + classes, N]; say --role")


def inspect_model(path: Path, role: str) -> list[Finding]:
    """Run every check and return the findings in order. Raises UserError for a file that is no ONNX model."""
    contract = read_contract(path, role)
    session = open_session(path, 1)
    findings = [*_check_shapes(session, contract, role)]
    if role == "detector":
        findings += _compare_with_shipped(contract)
    if any(finding.level == "error" for finding in findings):
        return findings
    inputs = synthetic_inputs(contract)
    outputs = {name: run_network(session, tensor) for name, tensor in inputs.items()}
    broken = [name for name, output in outputs.items() if not np.isfinite(output).all()]
    if broken:
        return [*findings, Finding("error", f"output is not finite on a picture of {', '.join(broken)}")]
    findings += (
        _check_segmenter_scores(outputs, contract) if role == "segmenter" else _check_detector_output(outputs, contract)
    )
    plain = open_session(path, 1, optimised=False)
    worst = max(
        largest_output_difference(outputs[name], run_network(plain, tensor), role, contract)
        for name, tensor in inputs.items()
    )
    if _QUANTISED in path.read_bytes():
        note = "8-bit steps are rounded elsewhere in the plain graph; `paani models quantise` judges by score"
        findings.append(Finding("warning", f"optimised and plain graph differ by {worst:.1e}: {note}"))
    else:
        level = "ok" if worst <= MAX_DIFFERENCE else "error"
        text = f"optimised and plain graph differ by {worst:.1e} (at most {MAX_DIFFERENCE:.0e})"
        findings.append(Finding(level, text))
    scene = inputs["a river"]
    took_ms = []
    for _ in range(TIMED_RUNS):
        start_ms = stopwatch_ms()
        run_network(session, scene)
        took_ms.append(stopwatch_ms() - start_ms)
    return [*findings, Finding("ok", f"one run takes {statistics.median(took_ms):.1f} ms on one thread here")]


def require_contract(path: Path, role: str) -> None:
    """Raises UserError naming a file that is no ONNX model, or whose input or output is not its contract's."""
    for finding in _check_shapes(open_session(path, 1), read_contract(path, role), role):
        if finding.level == "error":
            raise UserError(f"{path}: {finding.text}")


def _check_shapes(session: Session, contract: Model, role: str) -> Iterator[Finding]:
    for what, ends, wanted in (
        ("input", session.get_inputs(), contract.input),
        ("output", session.get_outputs(), contract.output),
    ):
        if what == "output" and len(ends) > 1:
            yield Finding("warning", f"{len(ends)} outputs, of which the first alone is read")
        elif len(ends) != 1:
            yield Finding("error", f"{len(ends)} {what}s, the contract has one")
            continue
        shape, kind = tuple(ends[0].shape), ends[0].type
        if any(not isinstance(side, int) for side in shape):
            yield Finding("error", f"{what} {list(shape)} is not static: export with fixed sizes and batch 1")
        elif kind != _ONNX_TYPES[wanted.dtype]:
            yield Finding("error", f"{what} is {kind}, the contract has {_ONNX_TYPES[wanted.dtype]}")
        elif shape != wanted.shape:
            hint = "a manifest.json beside the file may state another size" if what == "input" else _classes_hint(role)
            yield Finding("error", f"{what} is {list(shape)}, the contract has {list(wanted.shape)}; {hint}")
        else:
            yield Finding("ok", f"{what} {list(shape)} {wanted.dtype}")
    yield Finding("ok", f"classes {', '.join(contract.classes)} ({contract.preprocessing.resize})")


def _compare_with_shipped(contract: Model) -> Iterator[Finding]:
    """What differs from the shipped detector: classes, their order, input size, number of candidates."""
    shipped = load_catalogue()["detector"]
    for name in shipped.classes:
        if name == PERSON and name not in contract.classes:
            yield Finding("warning", "no class person: people are not seen, and a hull refuses it")
        elif name not in contract.classes:
            yield Finding("warning", f"no class {name}: none is found, and only the segmenter stands before one")
    own = tuple(name for name in contract.classes if name != IGNORED_CLASS)
    if own != tuple(name for name in shipped.classes if name in own):
        yield Finding("ok", f"classes in the order {', '.join(own)}, the shipped one has {', '.join(shipped.classes)}")
    if len(own) < len(contract.classes):
        yield Finding("ok", f"{len(contract.classes) - len(own)} of its classes are left out")
    height, width = contract.size_hw
    if contract.size_hw != shipped.size_hw:
        yield Finding(
            "ok", f"input of {width}x{height} pixels, the shipped one has {'x'.join(map(str, shipped.size_hw[::-1]))}"
        )
    expected = sum((height // stride) * (width // stride) for stride in _STRIDES_PX)
    if contract.output.shape[-1] != expected:
        strides = ", ".join(map(str, _STRIDES_PX))
        text = f"{contract.output.shape[-1]} candidates, strides {strides} of {width}x{height} pixels give {expected}"
        yield Finding("warning", f"{text}: other anchors, which is right only if its boxes are already decoded")


def _classes_hint(role: str) -> str:
    return "a manifest.json beside the file states its classes" if role == "detector" else "three classes are needed"


def _check_segmenter_scores(outputs: dict[str, F32], contract: Model) -> Iterator[Finding]:
    scene = outputs["a river"][0]
    if scene.min() >= 0.0 and np.allclose(scene.sum(axis=0), 1.0, atol=1e-3):
        yield Finding("error", "output sums to one: export the scores before the softmax")
    else:
        yield Finding("ok", f"scores from {scene.min():.1f} to {scene.max():.1f}")
    water = contract.classes.index("water")
    for name in ("black", "white", "noise"):
        share = float((outputs[name][0].argmax(axis=0) == water).mean())
        level = "ok" if share <= MAX_WATER_FRAC_IN_NULL else "warning"
        yield Finding(level, f"{share:.0%} of a {name} picture is called water" + _image_quality_note(level))


def _image_quality_note(level: str) -> str:
    return "" if level == "ok" else ": only the image-quality check then stands between this picture and motion"


def _check_detector_output(outputs: dict[str, F32], contract: Model) -> Iterator[Finding]:
    scores = np.concatenate([output[0, 4:].ravel() for output in outputs.values()])
    boxes = np.concatenate([output[0, :4] for output in outputs.values()], axis=1)
    if scores.min() < -1e-6 or scores.max() > 1.0 + 1e-6:
        yield Finding("error", f"scores from {scores.min():.2f} to {scores.max():.2f} are no probabilities")
    else:
        yield Finding("ok", f"scores from {scores.min():.3f} to {scores.max():.3f}")
    height, width = contract.size_hw
    if boxes.max() <= 2.0:
        yield Finding("error", "boxes end at 2: they seem normalised, the contract has input pixels")
    elif not (0.0 <= np.median(boxes[0]) <= width and 0.0 <= np.median(boxes[1]) <= height):
        yield Finding("error", f"box centres lie outside the input of {width}x{height} pixels")
    else:
        yield Finding("ok", "boxes are centre, width and height in input pixels")


def largest_output_difference(one: F32, other: F32, role: str, contract: Model) -> float:
    """Largest absolute difference of two outputs; a detector's boxes count as fractions of the input's sides."""
    differences = np.abs(one - other)
    if role == "detector":
        height, width = contract.size_hw
        differences[:, :4] /= np.array([width, height, width, height], np.float32)[:, None]
    return float(differences.max())


def synthetic_inputs(contract: Model) -> dict[str, F32 | NDArray[np.uint8]]:
    """Synthetic pictures as network inputs: black, white, noise, and a simple river."""
    height, width = contract.size_hw
    rng = np.random.default_rng(0)
    river = np.full((height, width, 3), (200, 190, 180), np.uint8)
    river[height * 2 // 5 :] = (110, 120, 100)
    cv2.rectangle(river, (width // 3, height // 3), (width // 2, height * 3 // 5), (40, 40, 150), -1)
    river = np.asarray(np.clip(river + rng.normal(0.0, 6.0, river.shape), 0, 255), np.uint8)
    drawn = {
        "black": np.zeros_like(river),
        "white": np.full_like(river, 255),
        "noise": rng.integers(0, 256, river.shape).astype(np.uint8),
        "a river": river,
    }
    return {name: to_network_input(picture, contract) for name, picture in drawn.items()}


def to_network_input(picture: NDArray[np.uint8], contract: Model) -> F32 | NDArray[np.uint8]:
    """Convert an RGB picture [H,W,3] of the input's size to the network's input."""
    if contract.input.dtype == "uint8":
        return picture[None]
    mean, std = (np.array(v, np.float32) for v in (contract.preprocessing.mean, contract.preprocessing.std))
    scaled = (picture.astype(np.float32) / 255.0 - mean) / std
    return np.ascontiguousarray(scaled.transpose(2, 0, 1)[None])
