"""Output layout, class order and scores of the shipped detector (C1, C2, C4)."""

from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the extra paani[train]")


from paani.errors import UserError  # noqa: E402
from paani_models.datasets.sources import DETECTOR_CLASSES  # noqa: E402
from paani_models.detector import shipped_network as detector  # noqa: E402

pytestmark = pytest.mark.train


def test_detector_output_c4() -> None:
    torch.manual_seed(0)
    out = detector.Detector().eval()(torch.rand(1, 3, 256, 320)).detach()
    assert tuple(out.shape) == (1, 8, 1680)
    assert detector.count_candidates(256, 320) == 1680
    assert ((out[:, 4:] >= 0) & (out[:, 4:] <= 1)).all()
    assert (out[:, 2:4] > 0).all()


def test_detector_class_order_c2() -> None:
    assert DETECTOR_CLASSES == ("person", "vessel", "pier", "buoy")


def test_detector_candidates_run_over_strides_8_16_32_row_by_row() -> None:
    """With zeroed box outputs each candidate is its cell: corner at (column, row) * stride, side = stride."""
    net = detector.Detector().eval()
    for head in net.heads:
        assert isinstance(head, detector.Head)
        torch.nn.init.zeros_(head.box_out.weight)
        torch.nn.init.zeros_(head.box_out.bias)
    boxes = net(torch.zeros(1, 3, 256, 320))[0, :4].T.detach().numpy()
    np.testing.assert_allclose(boxes[0], [0, 0, 8, 8])
    np.testing.assert_allclose(boxes[1], [8, 0, 8, 8])
    np.testing.assert_allclose(boxes[40], [0, 8, 8, 8])
    np.testing.assert_allclose(boxes[1280 + 21], [16, 16, 16, 16])
    np.testing.assert_allclose(boxes[1600 + 79], [9 * 32, 7 * 32, 32, 32])


def test_detector_score_is_objectness_times_class() -> None:
    net = detector.Detector().eval()
    for head in net.heads:
        assert isinstance(head, detector.Head)
        for out, bias in ((head.object_out, 0.0), (head.class_out, 1.0)):
            torch.nn.init.zeros_(out.weight)
            torch.nn.init.constant_(out.bias, bias)
    scores = net(torch.zeros(1, 3, 256, 320))[0, 4:].detach().numpy()
    np.testing.assert_allclose(scores, 0.5 / (1 + np.exp(-1.0)), rtol=1e-5)


def test_candidate_grid_matches_the_output_order() -> None:
    centres, strides = detector.candidate_grid(256, 320)
    assert centres[41].tolist() == [12.0, 12.0]
    assert centres[1280].tolist() == [8.0, 8.0]
    assert [int((strides == s).sum()) for s in detector.STRIDES] == [1280, 320, 80]


@pytest.mark.parametrize(
    ("content", "wrong"), [(b"junk", "not a readable ONNX file"), (b"", r"0 convolutions, expected \d+")]
)
def test_a_start_from_what_is_no_such_net_names_the_file(tmp_path: Path, content: bytes, wrong: str) -> None:
    (tmp_path / "start.onnx").write_bytes(content)
    with pytest.raises(UserError, match=rf"start\.onnx: {wrong}"):
        detector.load_yolox_weights(detector.Detector(), tmp_path / "start.onnx")
