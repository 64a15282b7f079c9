"""Size, layout and loss of the paper's segmenter, cost and output of the shipped one (D1 - D6, D9)."""

import pytest

torch = pytest.importorskip("torch", reason="needs the extra paani[train]")

from torch import Tensor, nn  # noqa: E402

from paani_models.catalogue import Preprocessing  # noqa: E402
from paani_models.datasets.sources import SEGMENTER_CLASSES  # noqa: E402
from paani_models.recipes.onnx_export import CONTRACTS  # noqa: E402
from paani_models.segmenter import paper_network as segmenter  # noqa: E402
from paani_models.segmenter.shipped_network import ShippedSegmenter  # noqa: E402

pytestmark = pytest.mark.train


def test_segmenter_parameters_d9() -> None:
    assert segmenter.parameter_count(segmenter.PaperSegmenter()) == 1_082_467


def test_segmenter_taps_d1() -> None:
    taps = segmenter.PaperSegmenter().eval().taps(torch.zeros(1, 3, 256, 320))
    assert [tuple(t.shape[1:]) for t in taps] == [
        (16, 64, 80),
        (24, 32, 40),
        (48, 16, 20),
        (576, 8, 10),
    ]


def test_the_encoders_weights_have_torchvisions_names_d1() -> None:
    """D1: those of `mobilenet_v3_small().features`, so that ImageNet weights load as they are."""
    names = [name for name in segmenter.PaperSegmenter().state_dict() if name.startswith("features.")]
    assert {name.split(".")[1] for name in names} == {str(index) for index in range(13)}
    assert {
        "features.0.0.weight",
        "features.0.1.running_mean",
        "features.1.block.0.0.weight",
        "features.1.block.1.fc1.weight",
        "features.1.block.1.fc2.bias",
        "features.4.block.2.fc1.weight",
        "features.11.block.3.1.bias",
        "features.12.0.weight",
    } <= set(names)


# Howard et al. 2019, table 2: kernel, expanded, out, squeeze-and-excite, nonlinearity, stride.
MOBILENET_V3_SMALL = (
    (3, 16, 16, True, nn.ReLU, 2),
    (3, 72, 24, False, nn.ReLU, 2),
    (3, 88, 24, False, nn.ReLU, 1),
    (5, 96, 40, True, nn.Hardswish, 2),
    (5, 240, 40, True, nn.Hardswish, 1),
    (5, 240, 40, True, nn.Hardswish, 1),
    (5, 120, 48, True, nn.Hardswish, 1),
    (5, 144, 48, True, nn.Hardswish, 1),
    (5, 288, 96, True, nn.Hardswish, 2),
    (5, 576, 96, True, nn.Hardswish, 1),
    (5, 576, 96, True, nn.Hardswish, 1),
)


def test_the_encoders_blocks_are_those_of_mobilenet_v3_small_d1() -> None:
    features = segmenter.PaperSegmenter().features
    assert [type(features[end][2]) for end in (0, 12)] == [nn.Hardswish] * 2
    channels = 16
    for block, row in zip(list(features)[1:12], MOBILENET_V3_SMALL, strict=True):
        assert isinstance(block, segmenter.InvertedResidual)
        *hidden, projection = block.block
        gates = [layer for layer in hidden if isinstance(layer, segmenter.SqueezeExcite)]
        stages = [layer for layer in hidden if isinstance(layer, nn.Sequential)]
        depthwise, out = stages[-1][0], projection[0].out_channels
        assert {type(stage[2]) for stage in stages} == {row[4]}
        assert depthwise.groups == depthwise.in_channels
        found = (depthwise.kernel_size[0], depthwise.in_channels, out, bool(gates), row[4], depthwise.stride[0])
        assert found == row
        assert [type(layer) for layer in projection] == [nn.Conv2d, nn.BatchNorm2d], "the bottleneck is linear"
        assert block.residual is (row[5] == 1 and channels == out)
        channels = out


def test_a_block_adds_its_input_and_its_gate_is_a_hard_sigmoid_d1() -> None:
    torch.manual_seed(0)
    net, x = segmenter.PaperSegmenter().eval(), torch.rand(1, 40, 8, 10)
    block = net.features[5]
    assert isinstance(block, segmenter.InvertedResidual)
    gate = block.block[2]
    assert isinstance(gate, segmenter.SqueezeExcite)
    with torch.no_grad():
        assert torch.allclose(block(x), x + block.block(x))
        wide = 9.0 * torch.randn(1, 240, 8, 10)
        squeezed = gate.fc1(wide.mean((2, 3), keepdim=True)).clamp(0)
        assert torch.allclose(gate(wide), wide * (gate.fc2(squeezed) / 6 + 0.5).clamp(0, 1), atol=1e-5)


def test_segmenter_decoder_d2_d3_d4() -> None:
    net = segmenter.PaperSegmenter()
    assert net.project.kernel_size == (1, 1)
    assert net.project.out_channels == 64
    assert len(net.refines) == len(net.laterals) == 3
    assert net.head.kernel_size == (3, 3)


def test_the_deepest_map_is_projected_as_it_is_d2() -> None:
    torch.manual_seed(0)
    net, entered = segmenter.PaperSegmenter().eval(), []
    net.refines[0].register_forward_pre_hook(lambda _, inputs: entered.append(inputs[0]))
    sides = ((16, 64, 80), (24, 32, 40), (48, 16, 20), (576, 8, 10))
    taps = [torch.randn(1, *side) for side in sides]
    with torch.no_grad():
        net.decode(taps)
        projected = torch.einsum("oc,nchw->nohw", net.project.weight[:, :, 0, 0], taps[-1])
        deepest = projected + net.project.bias[:, None, None]
        repeated = deepest.repeat_interleave(2, 2).repeat_interleave(2, 3)
        assert torch.allclose(entered[0], repeated + net.laterals[0](taps[-2]), atol=1e-4)


def test_each_block_of_the_decoder_enlarges_adds_and_refines_d3_d8() -> None:
    """What enters a block is the map before, each cell repeated, plus the projected tap; then 3x3, norm and ReLU."""
    torch.manual_seed(0)
    net, entered = segmenter.PaperSegmenter().eval(), []
    hooks = [r.register_forward_pre_hook(lambda _, inputs: entered.append(inputs[0])) for r in net.refines]
    with torch.no_grad():
        taps = net.taps(torch.rand(1, 3, 256, 320))
        net.decode(taps)
        for hook in hooks:
            hook.remove()
        deeper = net.project(taps[-1])
        for lateral, refine, tap, given in zip(net.laterals, net.refines, taps[-2::-1], entered, strict=True):
            assert lateral.kernel_size == (1, 1)
            repeated = deeper.repeat_interleave(2, 2).repeat_interleave(2, 3)
            assert torch.allclose(given, repeated + lateral(tap), atol=1e-6)
            assert [type(layer) for layer in refine] == [nn.Conv2d, nn.BatchNorm2d, nn.ReLU]
            assert refine[0].kernel_size == (3, 3)
            deeper = refine(given)


def test_segmenter_output_is_piecewise_constant_over_four_pixels_d4_d5() -> None:
    torch.manual_seed(0)
    logits = segmenter.PaperSegmenter().eval()(torch.rand(1, 3, 256, 320)).detach()
    assert tuple(logits.shape) == (1, 3, 256, 320)
    cells = logits[:, :, ::4, ::4]
    assert torch.equal(cells.repeat_interleave(4, 2).repeat_interleave(4, 3), logits)


@pytest.mark.parametrize("name", ["segmenter", "paper-segmenter"])
def test_an_exported_segmenter_has_the_papers_contract_d5_d6_d7(name: str) -> None:
    contract = CONTRACTS[name]
    assert contract.input.shape == contract.output.shape == (1, 3, 256, 320)
    assert contract.classes == ("water", "obstacle", "sky")
    assert contract.preprocessing == Preprocessing("stretch", (0.485, 0.456, 0.406), (0.229, 0.224, 0.225))


def test_segmenter_class_order_d6() -> None:
    assert SEGMENTER_CLASSES == ("water", "obstacle", "sky")


def test_segmenter_loss_ignores_255() -> None:
    logits = torch.tensor([10.0, 0.0, 0.0]).view(1, 3, 1, 1).repeat(1, 1, 4, 4)
    target = torch.zeros(1, 4, 4, dtype=torch.int64)
    spoiled = target.clone()
    spoiled[0, :2] = 255
    worse = target.clone()
    worse[0, :2] = 1
    assert segmenter.segmenter_loss(logits, spoiled) == pytest.approx(
        float(segmenter.segmenter_loss(logits[:, :, 2:], target[:, 2:])), abs=1e-6
    )
    assert segmenter.segmenter_loss(logits, worse) > segmenter.segmenter_loss(logits, target) + 1.0


def multiply_adds(net: nn.Module) -> int:
    total = 0

    def count(conv: nn.Module, _inputs: tuple[Tensor, ...], output: Tensor) -> None:
        nonlocal total
        assert isinstance(conv, nn.Conv2d)
        total += output.numel() * conv.weight[0].numel()

    for module in net.modules():
        if isinstance(module, nn.Conv2d):
            module.register_forward_hook(count)
    with torch.no_grad():
        net.eval()(torch.zeros(1, 3, 256, 320))
    return total


def test_the_shipped_segmenter_costs_less_than_the_papers() -> None:
    assert multiply_adds(segmenter.PaperSegmenter()) == pytest.approx(357e6, rel=0.01)
    assert multiply_adds(ShippedSegmenter()) < 0.75 * multiply_adds(segmenter.PaperSegmenter())


def test_the_shipped_segmenter_is_bilinear_between_the_middles_of_its_cells() -> None:
    """Pixel p of a row lies (p - 1.5) / 4 cells from the first middle; outside the middles nothing changes."""
    torch.manual_seed(0)
    net, heads = ShippedSegmenter().eval(), []
    net.head.register_forward_hook(lambda _head, _inputs, output: heads.append(output))
    with torch.no_grad():
        logits = net(torch.rand(1, 3, 256, 320))
    (head,) = heads
    assert tuple(logits.shape) == (1, 3, 256, 320)
    assert tuple(head.shape) == (1, 3, 64, 80)
    down, across = (_between(cells) for cells in (64, 80))
    expected = torch.einsum("pi,ncij,qj->ncpq", down, head, across)
    assert float((logits - expected).abs().max()) < 1e-5
    assert not torch.equal(logits[:, :, ::4, ::4], logits[:, :, 1::4, 1::4])


def _between(cells: int) -> Tensor:
    """How much each of `cells` counts at each of four times as many pixels [4 cells, cells]."""
    place = ((torch.arange(4 * cells) - 1.5) / 4).clamp(0, cells - 1)
    return (1 - (place[:, None] - torch.arange(cells)[None]).abs()).clamp(0)
