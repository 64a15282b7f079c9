"""The exported files: their form, and how far they may differ from the network (T1, T2)."""

from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the extra paani[train]")
onnx = pytest.importorskip("onnx", reason="needs the extra paani[train]")

from paani.errors import UserError  # noqa: E402
from paani_models.recipes import onnx_export  # noqa: E402
from paani_models.recipes.onnx_export import (  # noqa: E402
    CONTRACTS,
    build_network,
    contract_of,
    export_untrained,
    largest_export_difference,
    write_onnx,
)
from paani_models.training.training_state import read_recipe  # noqa: E402

pytestmark = [pytest.mark.train, pytest.mark.slow]


@pytest.mark.parametrize("name", CONTRACTS)
def test_t1_every_export_is_static_float32_of_opset_17(tmp_path: Path, name: str) -> None:
    contract = CONTRACTS[name]
    write_onnx(build_network(name), contract, tmp_path / "net.onnx")
    model = onnx.load(str(tmp_path / "net.onnx"))
    assert [each.version for each in model.opset_import if not each.domain] == [17]
    for value, shape in ((model.graph.input[0], contract.input.shape), (model.graph.output[0], contract.output.shape)):
        assert value.type.tensor_type.elem_type == onnx.TensorProto.FLOAT
        assert tuple(dim.dim_value for dim in value.type.tensor_type.shape.dim) == shape


def test_t2_an_export_that_differs_by_more_than_the_tolerance_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert onnx_export.MAX_EXPORT_DIFFERENCE == 1e-3
    difference = export_untrained("paper-segmenter", tmp_path / "weights").export_max_abs_diff
    monkeypatch.setattr(onnx_export, "MAX_EXPORT_DIFFERENCE", 0.9 * difference)
    with pytest.raises(UserError, match="segmenter: the exported net differs by"):
        export_untrained("paper-segmenter", tmp_path / "other")
    assert not list((tmp_path / "other").iterdir())


def test_t2_the_difference_is_the_largest_of_all_inputs_in_whatever_order(tmp_path: Path) -> None:
    """Of a network with other weights, so that it differs on each."""
    write_onnx(build_network("gate"), CONTRACTS["gate"], tmp_path / "net.onnx")
    other, rng = build_network("gate").eval(), np.random.default_rng(0)
    inputs = [rng.random(CONTRACTS["gate"].input.shape, dtype=np.float32) * size for size in (1, 2, 3)]
    single = [largest_export_difference(other, tmp_path / "net.onnx", [each]) for each in inputs]
    assert len(set(single)) == 3
    for order in (inputs, inputs[::-1]):
        assert largest_export_difference(other, tmp_path / "net.onnx", order) == max(single)


@pytest.mark.parametrize(
    ("state", "named"),
    [
        ({}, "recipe: Expected `object`, got `null`"),
        ({"recipe": {}}, "recipe: Object missing required field `seed`"),
        ({"recipe": {"seed": 10**600}}, "recipe: "),
        ({"recipe": {"seed": 1, "height_px": 10**600}}, "recipe: "),
        ({"recipe": {"seed": 1, "width_px": 100}}, "recipe: "),
    ],
    ids=["no recipe", "no seed", "a seed of 600 digits", "a height of 600 digits", "a width of no whole cells"],
)
def test_a_checkpoint_with_a_recipe_of_no_training_is_named_in_one_line(
    tmp_path: Path, state: dict[str, object], named: str
) -> None:
    path = tmp_path / "last.pt"
    torch.save(state, path)
    with pytest.raises(UserError) as refused:
        contract_of("detector", read_recipe(path))
    assert str(refused.value).startswith(f"{path}: {named}")
    assert len(str(refused.value).splitlines()) == 1
