"""An exported network goes back into PyTorch and answers as before."""

from pathlib import Path

import numpy as np
import onnx
import pytest
from hypothesis import given
from hypothesis import strategies as st

torch = pytest.importorskip("torch", reason="needs the extra paani[train]")

from torch import Tensor, nn  # noqa: E402
from torch.nn import functional as F  # noqa: E402

from paani.errors import UserError  # noqa: E402
from paani_models.catalogue import WEIGHTS  # noqa: E402
from paani_models.detector.shipped_network import FOCUS_SHAPE, Detector, unfold_focus  # noqa: E402
from paani_models.engines.onnx_runner import open_network  # noqa: E402
from paani_models.network_input import DETECTOR_SIZE_WH, SIZE_WH  # noqa: E402
from paani_models.recipes.onnx_export import CONTRACTS, write_onnx  # noqa: E402
from paani_models.recipes.warm_start import load_exported  # noqa: E402
from paani_models.segmenter.paper_network import PaperSegmenter  # noqa: E402
from paani_models.segmenter.shipped_network import ShippedSegmenter  # noqa: E402

pytestmark = pytest.mark.train


def pictures(count: int, size_wh: tuple[int, int] = SIZE_WH) -> Tensor:
    return torch.rand((count, 3, *size_wh[::-1]), generator=torch.Generator().manual_seed(3))


def trained(net: nn.Module) -> nn.Module:
    """Normalisations with statistics of their own, as after training."""
    generator = torch.Generator().manual_seed(1)
    for module in net.modules():
        if isinstance(module, nn.BatchNorm2d):
            for values, low, high in (
                (module.weight.data, 0.5, 1.5),
                (module.bias.data, -0.5, 0.5),
                (module.running_mean, -0.5, 0.5),
                (module.running_var, 0.5, 2.0),
            ):
                values.copy_(torch.rand(values.shape, generator=generator) * (high - low) + low)
    return net


@pytest.mark.parametrize("make", [PaperSegmenter, ShippedSegmenter], ids=lambda make: make.__name__)
def test_a_loaded_export_answers_like_the_file(make: type[nn.Module], tmp_path: Path) -> None:
    torch.manual_seed(0)
    path = tmp_path / "net.onnx"
    write_onnx(trained(make()), CONTRACTS["segmenter"], path)
    loaded = make()
    load_exported(loaded, path, pictures(2))
    x = pictures(1)
    with torch.no_grad():
        difference = np.abs(loaded.eval()(x).numpy() - open_network(path)(x.numpy())).max()
    assert difference < 1e-4


def test_batch_statistics_start_close_to_the_stored_ones(tmp_path: Path) -> None:
    """In training the network normalises by the batch; on the pictures of the statistics that changes nothing."""
    torch.manual_seed(0)
    path = tmp_path / "net.onnx"
    write_onnx(trained(PaperSegmenter()), CONTRACTS["segmenter"], path)
    loaded, x = PaperSegmenter(), pictures(3)
    load_exported(loaded, path, x)
    with torch.no_grad():
        settled = loaded.eval()(x)
        training = loaded.train()(x)
    assert float((settled - training).abs().max()) < 1e-2


def test_the_shipped_detector_loads_exactly() -> None:
    loaded, x = Detector(), pictures(1, DETECTOR_SIZE_WH)
    load_exported(loaded, WEIGHTS / "detector.onnx", x)
    with torch.no_grad():
        ours = loaded.eval()(x).numpy()
    theirs = open_network(WEIGHTS / "detector.onnx")(x.numpy())
    np.testing.assert_allclose(ours[:, 4:], theirs[:, 4:], atol=1e-4)
    np.testing.assert_allclose(ours[:, :4], theirs[:, :4], atol=1e-2)


@given(seed=st.integers(0, 2**16), height=st.sampled_from([2, 4, 10]), width=st.sampled_from([2, 6]))
def test_one_convolution_over_the_picture_does_what_one_over_its_quarters_does(
    seed: int, height: int, width: int
) -> None:
    generator = torch.Generator().manual_seed(seed)
    weight = torch.rand(5, *FOCUS_SHAPE, generator=generator)
    x = torch.rand(1, 3, height, width, generator=generator)
    quarters = torch.cat([x[..., row::2, column::2] for column in (0, 1) for row in (0, 1)], 1)  # YOLOX's order
    wanted = F.conv2d(quarters, weight, padding=1)
    torch.testing.assert_close(F.conv2d(x, unfold_focus(weight), stride=2, padding=2), wanted)


def test_an_export_with_a_focus_layer_loads_as_one_without(tmp_path: Path) -> None:
    focused = torch.rand(16, *FOCUS_SHAPE)
    graph = onnx.load(str(WEIGHTS / "detector.onnx"))
    first = next(node for node in graph.graph.node if node.op_type == "Conv").input[1]
    stored = next(tensor for tensor in graph.graph.initializer if tensor.name == first)
    stored.CopyFrom(onnx.numpy_helper.from_array(focused.numpy(), first))
    onnx.save(graph, str(tmp_path / "focused.onnx"))
    loaded = Detector()
    load_exported(loaded, tmp_path / "focused.onnx", pictures(1, DETECTOR_SIZE_WH))
    torch.testing.assert_close(loaded.stem.conv.weight.data, unfold_focus(focused))


def test_another_net_is_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"detector\.onnx: \d+ convolutions, expected"):
        load_exported(PaperSegmenter(), WEIGHTS / "detector.onnx", pictures(1))
    (tmp_path / "torn.onnx").write_bytes(b"\x08\x07torn")
    with pytest.raises(UserError, match=r"torn\.onnx: not a readable ONNX file"):
        load_exported(PaperSegmenter(), tmp_path / "torn.onnx", pictures(1))
    bare = onnx.load(str(WEIGHTS / "detector.onnx"))
    next(node for node in bare.graph.node if node.op_type == "Conv").input.pop()
    onnx.save(bare, str(tmp_path / "bare.onnx"))
    with pytest.raises(UserError, match="without stored weight and bias"):
        load_exported(Detector(), tmp_path / "bare.onnx", pictures(1))
