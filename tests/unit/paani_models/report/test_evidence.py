"""Four classes of evidence stay apart (U7)."""

from itertools import combinations
from pathlib import Path

import msgspec
import pytest

from paani.errors import UserError
from paani_models.report.evidence import Evidence, Finding, Findings, group_by_evidence, pool_findings, read_findings


def finding(kind: Evidence, metric: str = "miou", value: float = 0.5, n: int = 10) -> Finding:
    return Finding(evidence=kind, metric=metric, source="a", value=value, n=n)


def test_there_are_four_classes_u7() -> None:
    assert list(Evidence) == ["labelled_models", "offline_scenarios", "generated_trajectories", "board_logs"]
    split = group_by_evidence([finding(Evidence.BOARD), finding(Evidence.LABELLED)])
    assert [len(found) for found in split.values()] == [1, 0, 0, 1]


@pytest.mark.parametrize(("one", "other"), list(combinations(Evidence, 2)))
def test_two_classes_are_never_pooled_u7(one: Evidence, other: Evidence) -> None:
    with pytest.raises(ValueError, match="cannot pool"):
        pool_findings([finding(one), finding(other)])


def test_one_class_pools_by_count() -> None:
    assert pool_findings([finding(Evidence.BOARD, value=1.0, n=1), finding(Evidence.BOARD, value=0.0, n=3)]) == 0.25
    with pytest.raises(ValueError, match="cannot pool"):
        pool_findings([finding(Evidence.BOARD), finding(Evidence.BOARD, metric="other")])
    with pytest.raises(ValueError, match="cannot pool"):
        pool_findings([])


def test_a_file_holds_the_class_that_it_declares_u7(tmp_path: Path) -> None:
    path = tmp_path / "board.json"
    for kind in (Evidence.BOARD, Evidence.SCENARIOS):
        path.write_bytes(msgspec.json.encode(Findings(evidence=Evidence.BOARD, findings=(finding(kind),))))
        if kind is Evidence.BOARD:
            assert read_findings(path).findings == (finding(kind),)
        else:
            with pytest.raises(UserError, match=r"board\.json: miou is of offline_scenarios, the file of board_logs"):
                read_findings(path)
    path.write_text("{")
    with pytest.raises(UserError, match=r"board\.json"):
        read_findings(path)
