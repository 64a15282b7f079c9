"""Sources that anyone may use: by what their manifests state, and without doubt."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from paani.errors import UserError
from paani_models.commands.models import data_folder
from paani_models.datasets.selection import PictureSelection
from paani_models.datasets.terms import OPEN_TERMS, states_open_terms


@pytest.mark.parametrize(
    ("licence", "terms", "is_open"),
    [
        ("CC0 1.0 (LICENSE file)", "CC0 1.0", True),
        ("CC BY 4.0 stated in the export", "CC BY 4.0", True),
        ("CC BY 4.0 believed, not verified", "CC BY 4.0", False),
        ("CC BY 4.0 stated; the pictures' own rights unknown", "CC BY 4.0", False),
        ("annotations CC BY 4.0; pictures other terms; no licence file", "CC BY 4.0", False),
        ("CC BY-NC-SA 4.0", "CC BY 4.0", False),
        ("for research: CC BY 4.0", "CC BY 4.0", False),
        ("", "CC BY 4.0", False),
    ],
)
def test_terms_are_stated_without_doubt(licence: str, terms: str, is_open: bool) -> None:
    assert states_open_terms(licence, terms) is is_open


def data_with(folder: Path, **licences: str) -> Path:
    for name, licence in licences.items():
        (folder / name / "images").mkdir(parents=True)
        (folder / name / "labels").mkdir()
        (folder / name / "labels" / "a.txt").write_text("1 0.5 0.5 0.2 0.2\n")
        stated: dict[str, object] = {"licence": licence, "items": [{"file": "images/a.jpg", "seq": "s"}]}
        (folder / name / "manifest.json").write_text(json.dumps(stated))
    return folder


def test_open_selects_by_the_manifests_and_names_what_it_leaves_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = data_with(tmp_path, surf_people="CC0 1.0", ships_pd="not stated", mcoe_boats="CC0 1.0")
    assert {source.name for source in PictureSelection(data, ["open"], None).sources} == {"surf_people", "rendered"}
    message = capsys.readouterr().err
    assert "ships_pd: licence: 'not stated' does not state Public Domain without doubt" in message
    assert len(PictureSelection(data, [], None).sources) > 2


def test_a_source_of_other_terms_beside_open_is_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = data_with(tmp_path, surf_people="CC0 1.0", mcoe_boats="CC0 1.0")
    chosen = PictureSelection(data, ["open", "mcoe_boats"], None).sources
    assert {source.name for source in chosen} == {"surf_people", "rendered"}
    assert "mcoe_boats: its terms do not let anyone use it" in capsys.readouterr().err


@pytest.mark.slow
def test_the_manifests_at_hand_state_the_terms_that_are_relied_on() -> None:
    if not data_folder().is_dir():
        pytest.skip(f"{data_folder()}: no such folder")
    chosen = PictureSelection(data_folder(), ["open"], None)
    assert {source.name for source in chosen.sources} == set(OPEN_TERMS)
    assert not chosen.skipped


def test_where_no_source_is_left_the_first_is_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="surf_people: licence: 'not stated'"):
        PictureSelection(data_with(tmp_path, surf_people="not stated"), ["open"], None)
