"""The bill of materials names what the page holds of other makers, as the folders' READMEs list it."""

from __future__ import annotations

import hashlib
from typing import Any

from deploy.page_libraries import FOLDERS, STATIC, add_to
from tests.places import ROOT

VENDORED = {".js", ".mjs", ".css"}


def test_every_library_of_the_page_is_in_the_bill_with_its_licence_and_hashes() -> None:
    bill: dict[str, Any] = {"components": [{"name": "aiohttp"}], "dependencies": [{"ref": "aiohttp"}]}
    add_to(bill)
    first, *libraries = bill["components"]
    assert first == {"name": "aiohttp"}
    named = {library["purl"].rpartition("@")[0]: library for library in libraries}
    assert set(named) == {f"pkg:npm/{name}" for name in ("preact", "htm", "%40preact/signals-core", "uPlot")}
    assert [each["ref"] for each in bill["dependencies"][1:]] == [library["bom-ref"] for library in libraries]
    for library in libraries:
        assert library["version"][0].isdigit()
        assert library["licenses"] in ([{"license": {"id": "MIT"}}], [{"license": {"id": "Apache-2.0"}}])
    listed = {file["name"]: file["hashes"][0]["content"] for library in libraries for file in library["components"]}
    served = [file for folder in FOLDERS for file in (ROOT / STATIC / folder).iterdir() if file.suffix in VENDORED]
    assert listed == {
        str(file.relative_to(ROOT / "services")): hashlib.sha256(file.read_bytes()).hexdigest() for file in served
    }
    folders = {path.parent.name for path in (ROOT / STATIC).glob("*/LICENSE*")}
    assert folders == set(FOLDERS), "whatever of other makers is served"
