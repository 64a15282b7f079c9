"""`python -m deploy.page_libraries BILL.json`: adds the page's libraries to a bill of materials (CycloneDX).

What these are stands in the tables of the folders' READMEs, and nowhere else.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
STATIC = Path("services/paani_services/dashboard/static")
FOLDERS = ("preact", "uplot")
ROW = re.compile(
    r"\| `(?P<file>[^`]+)` \| (?P<package>\S+) (?P<version>\S+) \| (?P<licence>\S+) \| (?P<sha256>[0-9a-f]{64}) \|"
)


def page_libraries() -> list[dict[str, Any]]:
    """A component for each library, with its files and their hashes, by name."""
    found: dict[str, dict[str, Any]] = {}
    for folder, row in _rows():
        purl = f"pkg:npm/{row['package'].replace('@', '%40')}@{row['version']}"
        group, _, name = row["package"].rpartition("/")
        library = found.setdefault(
            purl,
            {
                "type": "library",
                "bom-ref": purl,
                **({"group": group} if group else {}),
                "name": name,
                "version": row["version"],
                "licenses": [{"license": {"id": row["licence"]}}],
                "purl": purl,
                "components": [],
            },
        )
        place = STATIC.relative_to("services") / folder / row["file"]
        hashes = [{"alg": "SHA-256", "content": row["sha256"]}]
        library["components"].append(
            {"type": "file", "bom-ref": f"{purl}#{row['file']}", "name": str(place), "hashes": hashes}
        )
    return [found[purl] for purl in sorted(found)]


def _rows() -> Iterator[tuple[str, dict[str, str]]]:
    for folder in FOLDERS:
        for row in ROW.finditer((ROOT / STATIC / folder / "README.md").read_text(encoding="utf-8")):
            yield folder, row.groupdict()


def add_to(bom: dict[str, Any]) -> None:
    """Appends the libraries to a bill's components and dependencies."""
    libraries = page_libraries()
    bom["components"] += libraries
    bom["dependencies"] += [{"ref": library["bom-ref"]} for library in libraries]


if __name__ == "__main__":
    path = Path(sys.argv[1])
    bill = json.loads(path.read_text(encoding="utf-8"))
    add_to(bill)
    path.write_text(json.dumps(bill, indent=2), encoding="utf-8")
