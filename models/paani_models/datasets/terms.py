"""Sources whose terms let anyone use, change and sell what is learnt from them, and whether their manifests say so."""

from __future__ import annotations

from pathlib import Path

import msgspec

from paani.errors import UserError
from paani.undecodable import UNREADABLE
from paani_models.datasets.sources import RENDERED

OPEN = "open"  # in place of the names of sources: those below

# Each source's terms in the words of its manifest. What is only believed, or said of the boxes and not of the
# pictures, is not among them.
OPEN_TERMS = {
    "redyellow_buoy": "CC BY 4.0",
    "surf_people": "CC0 1.0",
    "typesofships_kayak_buoy": "CC BY 4.0",
    "ships_pd": "Public Domain",
    "boats_valenspace": "CC BY 4.0",
    RENDERED: "Apache-2.0",
}
OPEN_LICENCE = "weights: Apache-2.0; learnt from sources that anyone may use, whose authors are named with them"
DOUBTS = ("believed", "not verified", "unknown", "no licence", "none stated", "research")


class _Stated(msgspec.Struct):
    licence: str = ""


def states_open_terms(licence: str, terms: str) -> bool:
    """Whether a manifest's words on its licence name the terms and leave no doubt."""
    return terms in licence and not any(doubt in licence.lower() for doubt in DOUBTS)


def refusal_of_terms(name: str, manifest: Path) -> str:
    """Why a source is none that anyone may use; empty where it is one. Rendered pictures are the project's own."""
    if name not in OPEN_TERMS:
        return "its terms do not let anyone use it"
    if name == RENDERED:
        return ""
    try:
        licence = msgspec.json.decode(manifest.read_bytes(), type=_Stated).licence
    except UNREADABLE as error:
        raise UserError(f"{manifest}: {error}") from error
    if states_open_terms(licence, OPEN_TERMS[name]):
        return ""
    return f"licence: {licence!r} does not state {OPEN_TERMS[name]} without doubt"
