"""Training machinery: schedule, order, averages, checkpoints, and a resumed run that equals an unbroken one."""

from dataclasses import replace
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the extra paani[train]")
onnx = pytest.importorskip("onnx", reason="needs the extra paani[train]")

from paani.errors import UserError  # noqa: E402
from paani_models.catalogue import PAPER_WEIGHTS, WEIGHTS, verified_path  # noqa: E402
from paani_models.commands.models import main  # noqa: E402
from paani_models.detector import train as detector_train  # noqa: E402
from paani_models.detector.data import BoxedPicture  # noqa: E402
from paani_models.detector.paper_network import Yolo11n  # noqa: E402
from paani_models.detector.shipped_network import Detector  # noqa: E402
from paani_models.network_input import SIZE_WH, detector_input, segmenter_batch, segmenter_input  # noqa: E402
from paani_models.recipes.onnx_export import (  # noqa: E402
    CONTRACTS,
    SmallerInside,
    build_network,
    export_network,
    largest_export_difference,
    write_onnx,
)
from paani_models.recipes.train_and_export import (  # noqa: E402
    TrainingOptions,
    detector_recipe,
    parse_size,
    parse_stages,
    segmenter_recipe,
)
from paani_models.recipes.warm_start import load_exported  # noqa: E402
from paani_models.segmenter import train as segmenter_train  # noqa: E402
from paani_models.segmenter.paper_augmentation import augment_paper_pair  # noqa: E402
from paani_models.segmenter.paper_network import DECODER_CHANNELS, PaperSegmenter  # noqa: E402
from paani_models.segmenter.train import CACHE_WH, CachedPicture, SegmenterTraining  # noqa: E402
from paani_models.training.training_state import (  # noqa: E402
    AveragedWeights,
    Prefetch,
    Stage,
    TrainingState,
    learning_rate,
    load_checkpoint,
    stage_at_epoch,
)
from tests import pictures  # noqa: E402

pytestmark = pytest.mark.train

NO_BOXES = np.zeros((0, 5), np.float32)
SMALL = segmenter_train.SegmenterRecipe(stages=(Stage(2, 64, 64),), batch=4, warmup_steps=2)


@pytest.fixture
def river(monkeypatch: pytest.MonkeyPatch) -> list[CachedPicture]:
    """Six striped pictures: sky above bank above water."""
    monkeypatch.setitem(segmenter_train.DRAWS_PER_EPOCH, "river", 7)
    rng = np.random.default_rng(0)
    pictures = []
    for _ in range(6):
        mask = np.zeros((CACHE_WH[1], CACHE_WH[0]), np.uint8)
        top, bank = sorted(int(y) for y in rng.integers(40, 240, 2))
        mask[:top], mask[top:bank] = 2, 1
        colour = np.array([[30, 60, 90], [40, 90, 30], [200, 210, 230]], np.uint8)[mask]
        pictures.append(CachedPicture("river", colour, mask))
    return pictures


def segmenter_run(folder: Path, pictures: list[CachedPicture]) -> SegmenterTraining:
    torch.manual_seed(SMALL.seed)
    return SegmenterTraining(PaperSegmenter(), SMALL, folder, pictures, pictures[:2])


@pytest.mark.train
def test_a_resumed_run_equals_an_unbroken_one_s11(tmp_path: Path, river: list[CachedPicture]) -> None:
    segmenter_run(tmp_path / "whole", river).run()
    segmenter_run(tmp_path / "broken", river).run(until=1)
    torch.manual_seed(999)
    segmenter_run(tmp_path / "broken", river).run()
    whole, broken = ((tmp_path / name / "epochs.jsonl").read_text() for name in ("whole", "broken"))
    assert whole == broken
    assert len(whole.splitlines()) == 2
    one, other = (load_checkpoint(tmp_path / name / "last.pt")["average"] for name in ("whole", "broken"))
    assert all(torch.equal(one[key], other[key]) for key in one)


@pytest.mark.train
def test_records_hold_loss_and_iou_per_class_s10(tmp_path: Path, river: list[CachedPicture]) -> None:
    segmenter_run(tmp_path, river).run(until=1)
    record = msgspec.json.decode((tmp_path / "epochs.jsonl").read_bytes())
    assert set(record) == {"epoch", "seed", "loss", "miou", "edge_f1", "water", "obstacle", "sky"}  # no validation loss
    assert record["seed"] == SMALL.seed


@pytest.mark.train
def test_the_recorded_edge_f1_is_that_of_the_labels_s10(tmp_path: Path, river: list[CachedPicture]) -> None:
    """A net that says what the masks say has 1; one that says water everywhere has no edge, and 0."""
    training = segmenter_run(tmp_path, river)
    size = (SMALL.stages[0].width_px, SMALL.stages[0].height_px)
    masks = np.stack([cv2.resize(p.mask, size, interpolation=cv2.INTER_NEAREST) for p in training.held_out])
    labels = torch.from_numpy(masks.astype(np.int64))
    right = torch.nn.functional.one_hot(labels, 3).permute(0, 3, 1, 2).float()
    for logits, edge_f1 in ((right, 1.0), (torch.zeros_like(right), 0.0)):
        training.state.average.model.forward = lambda _, logits=logits: logits
        assert training.validate()["edge_f1"] == edge_f1


@pytest.mark.slow
def test_s10_u3_x5_the_iou_of_each_class_is_recorded_by_its_name_and_their_mean(
    tmp_path: Path, river: list[CachedPicture]
) -> None:
    """Of a net that is right but for the bank, which it calls water."""
    training = segmenter_run(tmp_path, river)
    size = (SMALL.stages[0].width_px, SMALL.stages[0].height_px)
    masks = np.stack([cv2.resize(p.mask, size, interpolation=cv2.INTER_NEAREST) for p in training.held_out])
    labels = torch.from_numpy(np.where(masks == 1, 0, masks).astype(np.int64))
    logits = torch.nn.functional.one_hot(labels, 3).permute(0, 3, 1, 2).float()
    training.state.average.model.forward = lambda _: logits
    figures, water = training.validate(), float((masks == 0).sum() / (masks != 2).sum())
    assert 0.0 < water < 1.0
    found = [figures[name] for name in ("water", "obstacle", "sky", "miou")]
    assert found == pytest.approx([water, 0.0, 1.0, (water + 1.0) / 3.0], abs=1e-4)


@pytest.mark.slow
def test_s9_best_is_the_epoch_of_the_highest_miou(tmp_path: Path, river: list[CachedPicture]) -> None:
    training = segmenter_run(tmp_path, river)
    figures = iter(({"miou": 0.5, "edge_f1": 0.1, "water": 0.1}, {"miou": 0.4, "edge_f1": 0.9, "water": 0.9}))
    training.validate = lambda: next(figures)
    training.run()
    assert (load_checkpoint(tmp_path / "best.pt")["epoch"], load_checkpoint(tmp_path / "last.pt")["epoch"]) == (1, 2)
    rows = (tmp_path / "epochs.jsonl").read_bytes().splitlines()
    assert [msgspec.json.decode(row)["epoch"] for row in rows] == [1, 2]


def test_an_epoch_of_the_paper_shows_every_picture_once_by_its_own_augmentation_s7_s8(
    tmp_path: Path, river: list[CachedPicture]
) -> None:
    """No picture that shows nothing, no balance of sources, and the last incomplete batch is dropped."""
    recipe = replace(segmenter_train.PAPER_RECIPE, stages=(Stage(1, 64, 64),), batch=4, without=("glare",))
    order = segmenter_train.draw_epoch(river, recipe, 0)
    assert sorted(order) == list(range(6))
    assert order != segmenter_train.draw_epoch(river, recipe, 1)
    torch.manual_seed(0)
    training = SegmenterTraining(PaperSegmenter(), recipe, tmp_path, river, river[:2])
    pictures, masks = training._batch(order[:4], recipe.stages[0], (0, 0))
    for slot, index in enumerate(order[:4]):
        rng = np.random.default_rng((recipe.seed, 0, 0, slot))
        picture, mask = augment_paper_pair(rng, river[index].picture, river[index].mask, (64, 64), ("glare",))
        assert np.array_equal(masks[slot].numpy(), mask)
        assert np.array_equal(pictures[slot].numpy(), segmenter_batch(picture[None])[0])
    training.run()
    assert training.state.step == 1


@pytest.mark.train
def test_another_recipe_does_not_resume(tmp_path: Path, river: list[CachedPicture]) -> None:
    segmenter_run(tmp_path, river).run(until=1)
    other = SegmenterTraining(PaperSegmenter(), replace(SMALL, peak_rate=0.5), tmp_path, river, river)
    with pytest.raises(UserError, match=r"last\.pt: was made with another recipe"):
        other.run()


def test_a_training_takes_its_batch_and_seed_from_the_options(tmp_path: Path) -> None:
    options = TrainingOptions(tmp_path, batch=64, seed=7)
    for recipe in (detector_recipe(options), segmenter_recipe("segmenter", options)):
        assert (recipe.batch, recipe.seed) == (64, 7)
    left_out = segmenter_recipe("paper-segmenter", TrainingOptions(tmp_path, without=("jitter", "glare")))
    assert left_out == replace(segmenter_train.PAPER_RECIPE, without=("jitter", "glare"))
    usual = detector_recipe(TrainingOptions(tmp_path))
    assert (usual.batch, usual.seed, usual.distilled) == (16, 42, False)


@pytest.mark.train
def test_detector_learns_from_one_batch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(detector_train, "NULL_DRAWS", 1)
    picture = np.full((256, 320, 3), 90, np.uint8)
    picture[100:150, 100:200] = (200, 30, 30)
    box = np.array([[1, 100 / 320, 100 / 256, 200 / 320, 150 / 256]], np.float32)
    item = BoxedPicture("mcoe_boats", picture, box, np.array([0, 1, 0, 1], np.uint8))
    recipe = detector_train.DetectorRecipe(epochs=2, batch=4, warmup_steps=1, height_px=128, width_px=160)
    torch.manual_seed(0)
    run = detector_train.DetectorTraining(Detector(), recipe, tmp_path, [item] * 7, [item])
    run.run()
    rows = [msgspec.json.decode(line) for line in (tmp_path / "epochs.jsonl").read_bytes().splitlines()]
    assert rows[0]["vessel"]["n"] == 1
    assert rows[0]["person"]["n"] == 0
    assert sum(rows[1][k] for k in ("box_loss", "score_loss")) < sum(rows[0][k] for k in ("box_loss", "score_loss"))


@pytest.mark.train
def test_a_detector_is_exported_for_the_size_that_it_was_trained_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(detector_train, "NULL_DRAWS", 1)
    item = BoxedPicture("mcoe_boats", np.full((96, 128, 3), 90, np.uint8), NO_BOXES, np.array([0, 1, 0, 1], np.uint8))
    recipe = detector_train.DetectorRecipe(epochs=1, batch=4, warmup_steps=1, height_px=64, width_px=96)
    detector_train.DetectorTraining(Detector(), recipe, tmp_path, [item] * 3, [item]).run()
    inputs = [np.random.default_rng(0).random((1, 3, 64, 96), dtype=np.float32)]
    model = export_network("detector", tmp_path / "last.pt", tmp_path / "out", inputs, ())
    assert (model.input.shape, model.output.shape) == ((1, 3, 64, 96), (1, 8, 8 * 12 + 4 * 6 + 2 * 3))


def test_a_size_is_height_times_width_in_whole_cells() -> None:
    assert parse_size("320x416") == (320, 416)
    for wrong in ("320", "320x416x3", "300x400", "²x32", "0x32", "9" * 5000 + "x32"):
        with pytest.raises(UserError, match="stage"):
            parse_size(wrong)


def test_epoch_order_depends_on_seed_and_epoch_only_and_holds_the_nulls(
    river: list[CachedPicture],
) -> None:
    orders = [segmenter_train.draw_epoch(river, SMALL, epoch) for epoch in (0, 0, 1)]
    assert orders[0] == orders[1] != orders[2]
    assert orders[0].count(-1) == round(7 * 0.12 / 0.88)


def test_rendered_pictures_are_two_in_ten_of_the_shown_ones(river: list[CachedPicture]) -> None:
    rendered = [replace(item, source="rendered") for item in river]
    order = segmenter_train.draw_epoch(river + rendered, SMALL, 0)
    indices = [i for i in order if i >= 0]
    assert sum(i >= len(river) for i in indices) == 2
    assert len(indices) == 9


def test_rendered_pictures_alone_are_shown_once_each(river: list[CachedPicture]) -> None:
    rendered = [replace(item, source="rendered") for item in river]
    order = segmenter_train.draw_epoch(rendered, SMALL, 0)
    assert sorted(i for i in order if i >= 0) == list(range(len(rendered)))


def test_learning_rate_warms_up_and_ends_at_one_hundredth_s3() -> None:
    rates = [learning_rate(1.0, step, 100, 10) for step in range(101)]
    assert rates[0] == pytest.approx(0.1)
    assert max(rates) == rates[10] == pytest.approx(1.0)
    assert rates[100] == pytest.approx(0.01)


def test_the_papers_recipe_for_its_segmenter_s6_s7() -> None:
    """50 epochs, batch 16, 320x256; AdamW at 3e-4, decay 1e-4, cosine over all 50 epochs to zero; seed 42."""
    recipe = segmenter_train.PAPER_RECIPE
    assert recipe.stages == (Stage(50, 256, 320),)
    assert (recipe.epochs, recipe.batch, recipe.workers, recipe.seed) == (50, 16, 4, 42)
    assert DECODER_CHANNELS == PaperSegmenter().project.out_channels == 64
    assert (recipe.peak_rate, recipe.weight_decay) == (3e-4, 1e-4)
    rates = [learning_rate(recipe.peak_rate, s, 500, recipe.warmup_steps, recipe.final_frac) for s in (0, 250, 500)]
    assert rates == pytest.approx([3e-4, 1.5e-4, 0.0], abs=1e-12)
    progress = TrainingState(PaperSegmenter(), recipe.peak_rate, recipe.weight_decay)
    assert isinstance(progress.optimiser, torch.optim.AdamW)


def test_stage_at_epoch() -> None:
    stages = (Stage(2, 64, 64), Stage(1, 128, 128))
    assert [stage_at_epoch(stages, epoch).height_px for epoch in range(3)] == [64, 64, 128]
    with pytest.raises(IndexError):
        stage_at_epoch(stages, 3)


@pytest.mark.parametrize("text", ["4x128", "4x128x161", "axbxc", "4x128x160x1"])
def test_a_malformed_stage_is_one_line(text: str) -> None:
    with pytest.raises(UserError, match=r"^stage: "):
        parse_stages((text,))


def test_averaged_weights_follow_but_lag() -> None:
    net = torch.nn.Linear(1, 1)
    torch.nn.init.zeros_(net.weight)
    average = AveragedWeights(net, decay=0.9)
    torch.nn.init.ones_(net.weight)
    seen = []
    for _ in range(200):
        average.update(net)
        seen.append(float(average.model.state_dict()["weight"]))
    assert 0.0 < seen[0] < 1.0
    assert seen == sorted(seen)
    assert seen[-1] == pytest.approx(1.0, abs=1e-3)


def test_prefetch_keeps_the_order_and_passes_errors_on() -> None:
    assert list(Prefetch[int](workers=2)(lambda i: i * i, 10)) == [i * i for i in range(10)]
    with pytest.raises(ZeroDivisionError):
        list(Prefetch[float]()(lambda i: 1 / (3 - i), 5))


def test_an_unreadable_checkpoint_is_named(tmp_path: Path) -> None:
    (tmp_path / "last.pt").write_bytes(b"not a checkpoint")
    with pytest.raises(UserError, match=r"last\.pt: not a readable checkpoint"):
        load_checkpoint(tmp_path / "last.pt")


@pytest.mark.parametrize("name", CONTRACTS)
def test_export_equals_the_net_on_pictures_t2(tmp_path: Path, name: str) -> None:
    torch.manual_seed(1)
    net = build_network(name)
    write_onnx(net, CONTRACTS[name], tmp_path / "net.onnx")
    rng = np.random.default_rng(0)
    inputs = [rng.random(CONTRACTS[name].input.shape, dtype=np.float32) for _ in range(2)]
    assert largest_export_difference(net, tmp_path / "net.onnx", inputs) <= 1e-3


def test_a_segmenter_that_looks_at_a_smaller_picture_keeps_its_contract(tmp_path: Path) -> None:
    torch.manual_seed(1)
    inner = build_network("segmenter").eval()
    net = SmallerInside(inner, (128, 160)).eval()
    write_onnx(net, CONTRACTS["segmenter"], tmp_path / "net.onnx")
    inputs = [np.random.default_rng(0).random(CONTRACTS["segmenter"].input.shape, dtype=np.float32)]
    assert largest_export_difference(net, tmp_path / "net.onnx", inputs) <= 1e-3
    small = torch.nn.functional.interpolate(torch.from_numpy(inputs[0]), size=(128, 160), mode="bilinear")
    with torch.no_grad():
        seen = torch.nn.functional.interpolate(inner(small), size=(256, 320), mode="bilinear")
        assert torch.allclose(net(torch.from_numpy(inputs[0])), seen, atol=1e-5)


@pytest.mark.parametrize("words", [["detector", "--looks-at", "128x160"], ["segmenter", "--looks-at", "100x160"]])
def test_a_picture_inside_is_of_a_segmenter_and_of_whole_cells(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "surf_people").mkdir()
    (tmp_path / "surf_people" / "manifest.json").write_text('{"items":[]}')
    checkpoint, earlier = tmp_path / "last.pt", tmp_path / "earlier.onnx"
    for path in (checkpoint, earlier):
        path.touch()
    pictures = ["--data", str(tmp_path), "--sources", "surf_people"]
    where = [*pictures, "--checkpoint", str(checkpoint), "--weights", str(tmp_path)]
    assert main(["export", *words, *where]) == 2
    assert "--looks-at: detector" in (message := capsys.readouterr().err) or "multiples of 32" in message
    assert main(["export", "segmenter", "--mean-with", str(earlier), *where]) == 2
    assert capsys.readouterr().err == "paani models: --mean-with: segmenter is neither our detector nor our gate\n"
    assert main(["export", "detector", "--share", "0.25", *where]) == 2
    assert capsys.readouterr().err == "paani models: --share 0.25: of what? --mean-with says whose weights\n"


@pytest.mark.parametrize("net", ["paper-segmenter", "yolo11n"])
def test_the_papers_networks_take_no_shipped_place(
    net: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "surf_people").mkdir()
    (tmp_path / "surf_people" / "manifest.json").write_text('{"items":[]}')
    where = ["--data", str(tmp_path), "--sources", "surf_people"]
    (tmp_path / "last.pt").touch()
    assert main(["export", net, "--checkpoint", str(tmp_path / "last.pt"), *where]) == 2
    assert f"--weights: {net} is not what ships there" in capsys.readouterr().err
    for folder in (WEIGHTS, PAPER_WEIGHTS):
        assert main(["export", net, "--untrained", *where, "--weights", str(folder)]) == 2
        assert "the shipped nets stay" in capsys.readouterr().err


def test_the_paper_segmenters_file_has_the_papers_size_d10(tmp_path: Path) -> None:
    """D10: FP32 and opset 17. 4 bytes a weight are 99.2 % of the file; the rest is names, which differ."""
    write_onnx(PaperSegmenter(), CONTRACTS["paper-segmenter"], tmp_path / "segmenter.onnx")
    write_onnx(build_network("yolo11n"), CONTRACTS["yolo11n"], tmp_path / "detector.onnx")
    graph = onnx.load(str(tmp_path / "segmenter.onnx"))
    assert [each.version for each in graph.opset_import if not each.domain] == [17]
    assert {tensor.data_type for tensor in graph.graph.initializer} == {onnx.TensorProto.FLOAT}
    segmenter, detector = ((tmp_path / f"{name}.onnx").stat().st_size for name in ("segmenter", "detector"))
    assert segmenter == pytest.approx(4_344_661, rel=0.007)
    assert segmenter + detector == pytest.approx(14_817_168, rel=0.007)


def test_the_papers_segmenter_says_the_same_in_pytorch_as_in_its_file_v8() -> None:
    file = verified_path("segmenter", PAPER_WEIGHTS)
    inputs = [segmenter_input(pictures.river(seed)) for seed in range(4)]
    net = PaperSegmenter()
    load_exported(net, file, torch.from_numpy(np.concatenate(inputs)))
    assert largest_export_difference(net.eval(), file, inputs) < 1e-3


def test_the_papers_detector_says_the_same_in_pytorch_as_in_its_file_v3() -> None:
    file = verified_path("detector", PAPER_WEIGHTS)
    inputs = [detector_input(pictures.river(seed), SIZE_WH) for seed in range(4)]
    net = Yolo11n()
    load_exported(net, file, torch.from_numpy(np.concatenate(inputs)))
    assert largest_export_difference(net.eval(), file, inputs) < 1e-3


def test_export_notices_other_weights(tmp_path: Path) -> None:
    torch.manual_seed(1)
    write_onnx(PaperSegmenter(), CONTRACTS["segmenter"], tmp_path / "net.onnx")
    inputs = [np.random.default_rng(0).random((1, 3, 256, 320), dtype=np.float32)]
    assert largest_export_difference(PaperSegmenter().eval(), tmp_path / "net.onnx", inputs) > 1e-3


def test_a_missing_data_folder_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PAANI_DATA", str(tmp_path / "absent"))
    assert main(["prepare"]) == 2
    assert capsys.readouterr().err == f"paani models: {tmp_path / 'absent'}: no such folder; set PAANI_DATA or --data\n"
