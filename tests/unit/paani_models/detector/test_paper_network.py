"""The YOLO11n-shaped detector: size, contract, loss and recipe (C1, C2, C4, C12, C13, S2 - S5, T1, T2)."""

from dataclasses import replace
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the extra paani[train]")
onnx = pytest.importorskip("onnx", reason="needs the extra paani[train]")

from paani import messages as m  # noqa: E402
from paani.clock import stopwatch_ms  # noqa: E402
from paani.config import DetectorConfig, PerceptionConfig  # noqa: E402
from paani.errors import UserError  # noqa: E402
from paani_models.catalogue import load_catalogue  # noqa: E402
from paani_models.detector import paper_loss, train_paper_network  # noqa: E402
from paani_models.detector.data import BoxedPicture  # noqa: E402
from paani_models.detector.paper_data import Augmentation, augment_paper_example, jitter_hsv  # noqa: E402
from paani_models.detector.paper_loss import assign_task_aligned, bins_loss, complete_iou, task_aligned_loss  # noqa: E402
from paani_models.detector.paper_network import FUSED_PARAMETERS, Head, Yolo11n, fuse_batch_norm  # noqa: E402
from paani_models.detector.shipped_network import candidate_grid  # noqa: E402
from paani_models.detector.train_paper_network import Yolo11nRecipe, Yolo11nTraining  # noqa: E402
from paani_models.recipes.onnx_export import CONTRACTS, export_untrained, largest_export_difference, write_onnx  # noqa: E402
from paani_models.training.training_state import load_checkpoint  # noqa: E402
from paani_services.perception.box_decoding import decode_boxes  # noqa: E402
from paani_services.perception.engine import OnnxEngine  # noqa: E402
from paani_services.perception.pipeline import Perceiver  # noqa: E402
from paani_services.perception.preprocessing import LetterboxTransform  # noqa: E402
from tests.pictures import river  # noqa: E402

pytestmark = pytest.mark.train

COLOURS = ((220, 40, 40), (40, 220, 40), (230, 230, 40), (240, 240, 240))


def picture(kind: int, seed: int, width: int = 160, height: int = 128) -> BoxedPicture:
    """A plain scene with one coloured block, its class told by the colour."""
    rng = np.random.default_rng(seed)
    x, y = rng.integers(5, width // 2), rng.integers(5, height // 2)
    w, h = rng.integers(30, 60), rng.integers(25, 50)
    rgb = np.full((height, width, 3), (60, 90, 110), np.uint8)
    rgb[y : y + h, x : x + w] = COLOURS[kind]
    box = np.array([[kind, x / width, y / height, (x + w) / width, (y + h) / height]], np.float32)
    return BoxedPicture("rendered", rgb, box, np.ones(4, np.uint8))


def with_statistics() -> Yolo11n:
    """A network whose normalisations have seen something, so that folding them changes the weights."""
    torch.manual_seed(1)
    net = Yolo11n()
    net.train()
    with torch.no_grad():
        net(torch.rand(2, 3, 64, 64))
    net.eval()
    return net


def test_fused_parameters_c12() -> None:
    net = with_statistics()
    folded = fuse_batch_norm(net)
    assert sum(p.numel() for p in folded.parameters()) == 2_582_932 == FUSED_PARAMETERS
    x = torch.rand(1, 3, 256, 320)
    with torch.no_grad():
        assert float((net(x) - folded(x)).abs().max()) < 1e-3


def test_output_c1_c2_c4() -> None:
    with torch.no_grad():
        out = with_statistics()(torch.rand(1, 3, 256, 320))
    assert tuple(out.shape) == (1, 8, 1680)
    assert ((out[:, 4:] >= 0) & (out[:, 4:] <= 1)).all()
    assert (out[:, 2:4] > 0).all()
    assert CONTRACTS["yolo11n"].input.shape == (1, 3, 256, 320)
    assert CONTRACTS["yolo11n"].output.shape == (1, 8, 1680)
    assert CONTRACTS["yolo11n"].classes == ("person", "vessel", "pier", "buoy")
    assert CONTRACTS["yolo11n"].preprocessing.resize == "letterbox"


def test_candidates_lie_on_their_cells_in_input_pixels_c4() -> None:
    """With even distributions every side is 7.5 strides from the centre of the cell."""
    net = Yolo11n().eval()
    for head in net.heads:
        assert isinstance(head, Head)
        torch.nn.init.zeros_(head.box[-1].weight)
    with torch.no_grad():
        boxes = net(torch.zeros(1, 3, 256, 320))[0, :4].T.numpy()
    centres, strides = (t.numpy() for t in candidate_grid(256, 320))
    np.testing.assert_allclose(boxes[:, :2], centres, atol=1e-3)
    np.testing.assert_allclose(boxes[:, 2:], 15 * strides[:, None].repeat(2, 1), rtol=1e-5)


def test_export_is_opset_17_of_the_papers_size_and_equals_the_net_t1_t2_c13(tmp_path: Path) -> None:
    net = with_statistics()
    write_onnx(net, CONTRACTS["yolo11n"], tmp_path / "net.onnx")
    assert (tmp_path / "net.onnx").stat().st_size == pytest.approx(10_472_507, rel=0.007)
    graph = onnx.load(str(tmp_path / "net.onnx"))
    assert [o.version for o in graph.opset_import if not o.domain] == [17]
    assert [d.dim_value for d in graph.graph.output[0].type.tensor_type.shape.dim] == [1, 8, 1680]
    inputs = [np.random.default_rng(0).random((1, 3, 256, 320), dtype=np.float32)]
    assert largest_export_difference(net, tmp_path / "net.onnx", inputs) <= 1e-3


def test_complete_iou_by_hand() -> None:
    a = torch.tensor([[0.0, 0.0, 10.0, 10.0]])
    assert float(complete_iou(a, a)) == pytest.approx(1.0, abs=1e-6)
    beside = torch.tensor([[10.0, 0.0, 20.0, 10.0]])  # no overlap; centres 10 apart; hull 20 x 10
    assert float(complete_iou(a, beside)) == pytest.approx(-100 / 500, abs=1e-6)
    longer = torch.tensor([[0.0, 0.0, 20.0, 5.0]])
    assert float(complete_iou(a, longer)) < float(complete_iou(a, torch.tensor([[0.0, 0.0, 10.0, 5.0]])))


def test_bins_loss_is_least_where_the_mean_is_the_distance() -> None:
    distance = torch.full((1, 4), 3.25)
    right = torch.full((1, 4, 16), -30.0)
    right[..., 3], right[..., 4] = float(np.log(0.75)), float(np.log(0.25))
    entropy = -(0.75 * np.log(0.75) + 0.25 * np.log(0.25))
    assert float(bins_loss(right, distance)) == pytest.approx(entropy, abs=1e-4)
    assert float(bins_loss(torch.zeros(1, 4, 16), distance)) == pytest.approx(np.log(16), abs=1e-4)


def test_assignment_takes_the_aligned_candidates_inside_the_object() -> None:
    centres, _ = candidate_grid(64, 64)
    truth = torch.tensor([[1.0, 8.0, 8.0, 40.0, 40.0], [0.0, 50.0, 50.0, 53.0, 53.0]])
    boxes = truth[:1, 1:].repeat(len(centres), 1)
    scores = torch.full((len(centres), 4), 0.1)
    owner, wanted = assign_task_aligned(boxes, scores, truth, centres)
    mine = centres[owner == 0]
    assert len(mine) == 10
    assert ((mine > 8) & (mine < 40)).all()
    assert float(wanted.max()) == pytest.approx(1.0, abs=1e-3)
    assert (owner == 1).any(), "an object between the centres still has a candidate"
    assert (wanted[owner == -1] == 0).all()


def test_only_judged_classes_are_punished_on_background() -> None:
    net = Yolo11n().train()
    boxes, bins, logits = net.raw(torch.rand(2, 3, 64, 64))
    nothing = [torch.zeros(0, 5), torch.zeros(0, 5)]
    judged = torch.zeros(2, 4, 8, 8, dtype=torch.bool)
    silent = task_aligned_loss(boxes, bins, logits, nothing, judged, (64, 64))
    assert [float(part.detach()) for part in silent] == [0.0, 0.0, 0.0]
    judged[:, 2] = True
    logits.retain_grad()
    torch.autograd.backward(sum(task_aligned_loss(boxes, bins, logits, nothing, judged, (64, 64))))
    assert (logits.grad[..., 2] > 0).all()
    assert not logits.grad[..., [0, 1, 3]].any()


def test_the_recipe_is_the_papers_s2_s3_s4_s5() -> None:
    recipe = Yolo11nRecipe()
    assert (recipe.epochs, recipe.batch, recipe.workers, recipe.side_px) == (60, 32, 4, 320)
    assert (recipe.peak_rate, recipe.weight_decay, recipe.warmup_epochs) == (0.001, 0.0005, 3.0)
    assert (recipe.momentum, recipe.warmup_momentum, recipe.warmup_bias_rate) == (0.937, 0.8, 0.1)
    assert (recipe.nominal_batch, recipe.plain_epochs, recipe.patience, recipe.seed) == (64, 10, 12, 42)
    augmentation = recipe.augmentation
    assert (augmentation.hue, augmentation.saturation, augmentation.value) == (0.015, 0.5, 0.3)
    assert (augmentation.translate_frac, augmentation.scale, augmentation.flip_frac) == (0.1, 0.3, 0.5)
    assert (augmentation.mosaic_frac, augmentation.auto_augment, augmentation.erasing) == (1.0, "randaugment", 0.4)


def test_the_recipe_decides_each_step_s3(tmp_path: Path) -> None:
    """S3: rate and momentum of the first step, at the end of the warm-up and at the end; how many batches a step."""
    run = Yolo11nTraining(Yolo11n(), Yolo11nRecipe(), tmp_path, [], [])
    groups = {group["kind"]: group for group in run.state.optimiser.param_groups}
    assert {kind: group["weight_decay"] for kind, group in groups.items()} == {"weight": 5e-4, "scale": 0, "bias": 0}

    def step_once() -> None:
        nothing = run.model.stem[0].conv.weight.sum() * 0.0
        run._update(nothing, is_last=False, total_steps=600, warmup_steps=30)

    seen = {}
    for step in (0, 30, 599):
        run.state.step = step
        step_once()
        seen[step] = (groups["weight"]["lr"], groups["bias"]["lr"], groups["bias"]["betas"][0])
    assert seen[0] == pytest.approx((1e-3 / 30, 0.1, 0.8))
    assert seen[30] == pytest.approx((1e-3, 1e-3, 0.937))
    assert seen[599] == pytest.approx((1e-5, 1e-5, 0.937), rel=0.01)
    updates = run.state.average.updates
    for _ in range(4):
        step_once()
    assert run.state.average.updates - updates == 2, "two batches of 32 make one of 64"


def test_the_parts_of_the_loss_weigh_as_in_the_paper_s4(monkeypatch: pytest.MonkeyPatch) -> None:
    """S4: box 7.5, class 0.5, DFL 1.5; and each gain is that of its part."""
    assert (paper_loss.BOX_GAIN, paper_loss.SCORE_GAIN, paper_loss.BINS_GAIN) == (7.5, 0.5, 1.5)
    torch.manual_seed(0)
    with torch.no_grad():
        boxes, bins, logits = Yolo11n().raw(torch.rand(1, 3, 64, 64))
    truth, judged = [torch.tensor([[1.0, 8.0, 8.0, 40.0, 40.0]])], torch.ones(1, 4, 8, 8, dtype=torch.bool)
    plain = np.array([float(part) for part in task_aligned_loss(boxes, bins, logits, truth, judged, (64, 64))])
    assert (plain > 0.0).all()
    for place, name in enumerate(("BOX_GAIN", "SCORE_GAIN", "BINS_GAIN")):
        with monkeypatch.context() as changed:
            changed.setattr(paper_loss, name, 2.0 * getattr(paper_loss, name))
            parts = [float(part) for part in task_aligned_loss(boxes, bins, logits, truth, judged, (64, 64))]
        assert parts / plain == pytest.approx([2.0 if each == place else 1.0 for each in range(3)])


def test_the_last_ten_epochs_see_no_mosaic_s5(tmp_path: Path) -> None:
    """S5: four pictures in one until then."""
    items = [picture(kind, kind) for kind in range(4)]
    still = Augmentation(scale=0.0, translate_frac=0.0)
    run = Yolo11nTraining(Yolo11n(), Yolo11nRecipe(augmentation=still), tmp_path, items, items)

    def kinds(epoch: int) -> list[set[int]]:
        run.state.epoch = epoch
        examples = [run._example(np.random.default_rng(slot), [0, 1, 2, 3], slot) for slot in range(12)]
        return [set(example.boxes[:, 0].astype(int).tolist()) for example in examples]

    assert kinds(50) == kinds(59) == [{slot % 4} for slot in range(12)]
    assert max(len(seen) for seen in kinds(49)) > 1


@pytest.mark.parametrize("count", [1, 4])
def test_boxes_stay_on_their_blocks_through_the_augmentation_s5(count: int) -> None:
    """The median colour inside each box is the block's, whatever was shifted, flipped, scaled or put together."""
    plain = replace(Augmentation(), hue=0.0, saturation=0.0, value=0.0)
    seen = 0
    for seed in range(12):
        items = [picture(kind, 10 * seed + kind) for kind in range(count)]
        example = augment_paper_example(np.random.default_rng(seed), items, (320, 320), plain)
        assert example.picture.shape == (320, 320, 3)
        assert example.exhaustive_mask.shape == (4, 40, 40)
        for kind, x1, y1, x2, y2 in example.boxes.round().astype(int):
            inside = np.median(example.picture[y1:y2, x1:x2].reshape(-1, 3), 0)
            assert np.abs(inside - COLOURS[kind]).max() <= 6
            seen += 1
    assert seen >= 8


def test_jitter_stays_within_its_gains_and_is_seeded_s5() -> None:
    rgb = picture(0, 0).picture
    one, same, other = (jitter_hsv(np.random.default_rng(seed), rgb, Augmentation()) for seed in (3, 3, 4))
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)
    assert one.max() <= rgb.max() * 1.3 + 1


def test_jitter_reaches_each_of_its_gains_and_no_more_s5() -> None:
    """Of a colour whose three numbers are the means of what is drawn."""
    hsv = np.full((1, 1, 3), (100, 120, 150), np.uint8)
    colour = np.asarray(cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB), np.uint8)
    jittered = [jitter_hsv(np.random.default_rng(seed), colour, Augmentation()) for seed in range(400)]
    drawn = np.array([cv2.cvtColor(each, cv2.COLOR_RGB2HSV)[0, 0] for each in jittered]).astype(int)
    for level, gain, least, most in zip(
        (100, 120, 150), (0.015, 0.5, 0.3), drawn.min(axis=0), drawn.max(axis=0), strict=True
    ):
        assert level * (1.0 - gain) - 2.0 <= least <= level * (1.0 - 0.9 * gain) + 1.0
        assert level * (1.0 + 0.9 * gain) - 1.5 <= most <= level * (1.0 + gain) + 2.0


def small_run(folder: Path, epochs: int) -> Yolo11nTraining:
    """Four pictures, learnt by heart. The normalisations follow quickly, as a long training would let them."""
    torch.manual_seed(0)
    items = [picture(kind, kind) for kind in range(4)]
    recipe = Yolo11nRecipe(
        epochs=epochs,
        batch=4,
        workers=1,
        side_px=160,
        peak_rate=2e-3,
        warmup_epochs=1.0,
        nominal_batch=4,
        plain_epochs=epochs,
        patience=100,
        augmentation=Augmentation(scale=0.1, translate_frac=0.05),
    )
    net = Yolo11n()
    for module in net.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            module.momentum = 0.3
    run = Yolo11nTraining(net, recipe, folder, items * 4, items)
    run.state.average.decay = 0.8
    return run


def test_training_overfits_four_pictures_s4(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(train_paper_network, "SIZE_WH", (160, 128))
    small_run(tmp_path, 12).run()
    rows = [msgspec.json.decode(line) for line in (tmp_path / "epochs.jsonl").read_bytes().splitlines()]
    assert [row["epoch"] for row in rows] == list(range(1, 13))
    totals = [sum(row[part] for part in ("box_loss", "score_loss", "bins_loss")) for row in rows]
    assert totals[-1] < 0.5 * totals[0]
    assert {"person", "vessel", "pier", "buoy", "score", "epoch"} <= rows[-1].keys()
    assert rows[-1]["score"] > 0.5


@pytest.mark.parametrize(
    ("gain", "name"), [("BOX_GAIN", "box_loss"), ("SCORE_GAIN", "score_loss"), ("BINS_GAIN", "bins_loss")]
)
def test_x4_each_loss_of_an_epoch_is_recorded_by_its_name(
    gain: str, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(paper_loss, gain, 0.0)
    losses = small_run(tmp_path, 1)._train_epoch()
    assert {part for part, value in losses.items() if value > 0.0} == {"box_loss", "score_loss", "bins_loss"} - {name}


def test_a_resumed_run_equals_an_unbroken_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(train_paper_network, "SIZE_WH", (160, 128))
    small_run(tmp_path / "whole", 2).run()
    small_run(tmp_path / "broken", 2).run(until=1)
    torch.manual_seed(999)
    small_run(tmp_path / "broken", 2).run()
    one, other = (load_checkpoint(tmp_path / name / "last.pt")["average"] for name in ("whole", "broken"))
    assert all(torch.equal(one[key], other[key]) for key in one)
    with pytest.raises(UserError, match=r"last\.pt: was made with another recipe"):
        small_run(tmp_path / "broken", 3).run()


def test_stops_when_no_epoch_is_better_s4(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(train_paper_network, "SIZE_WH", (160, 128))
    run = small_run(tmp_path, 5)
    run.recipe = replace(run.recipe, peak_rate=0.0, warmup_bias_rate=0.0, patience=1)
    run.run()
    assert run.state.epoch == 2


def test_perception_runs_it_from_a_weights_folder(tmp_path: Path) -> None:
    """Any file of the contract, with the manifest that export writes beside it."""
    export_untrained("yolo11n", tmp_path)
    model = load_catalogue(tmp_path)["detector"]
    assert model.parameters == FUSED_PARAMETERS
    own = Perceiver(PerceptionConfig(detector=str(tmp_path / "detector.onnx")), stopwatch_ms)
    header = m.PictureHeader(source_us=1, frame_seq=0, frame_epoch=0, width_px=320, height_px=240)
    evidence, _ = own.perceive(river(), header, 0.0)
    assert evidence.usable
    assert f"detector {model.sha256[:12]}" in evidence.models
    graph = onnx.load(str(tmp_path / "detector.onnx"))
    graph.opset_import[0].version = 99
    onnx.save(graph, str(tmp_path / "newer.onnx"))
    with pytest.raises(UserError, match=r"newer\.onnx: not an ONNX model that can run here"):
        OnnxEngine.load("detector", str(tmp_path / "newer.onnx"), 1)


def test_rows_beyond_the_classes_are_no_boxes_c11() -> None:
    """An export with mask coefficients is read for its boxes; the manifest leaves the other rows out. Ours has none."""
    rows = np.zeros((1, 4 + 4 + 32, 3), np.float32)
    rows[0, :6, 0] = (160, 128, 40, 30, 0.1, 0.9)
    rows[0, 8:] = 7.0
    classes = (*CONTRACTS["yolo11n"].classes, *["-"] * 32)
    found = decode_boxes(rows, LetterboxTransform(1.0, 1.0, 0, 0, 320, 256), DetectorConfig(), classes)
    (only,) = found
    assert only.label is m.Label.VESSEL
    assert only.confidence == pytest.approx(0.9)
    assert CONTRACTS["yolo11n"].output.shape[1] == 4 + len(CONTRACTS["yolo11n"].classes)
