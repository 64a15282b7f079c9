"""Build hook of hatchling: the commit that wheel and sdist are built from, for `paani --version`."""

from __future__ import annotations

import os
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

COMMIT_FILE = "paani/commit.txt"  # as paani.version reads it
IN_SOURCE = f"shared/{COMMIT_FILE}"  # of a source distribution
COMMIT_VARIABLE = "PAANI_COMMIT"  # for a build without .git, as in a container
DESCRIBE = ("git", "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*")


class CommitHook(BuildHookInterface):  # type: ignore[type-arg]
    """Adds `commit.txt`; where nobody knows the commit there is none.

    A checkout installed in place has none either: git is asked there, as its commit changes.
    """

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Writes the file beside the tree, so that a build leaves nothing in it."""
        commit = _commit_of(Path(self.root))
        if version == "editable" or not commit:
            return
        self._folder = tempfile.TemporaryDirectory()
        file = Path(self._folder.name) / "commit.txt"
        file.write_text(f"{commit}\n", encoding="ascii")
        place = COMMIT_FILE if self.target_name == "wheel" else IN_SOURCE
        build_data["force_include"][str(file)] = place

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Removes what `initialize` wrote."""
        if hasattr(self, "_folder"):
            self._folder.cleanup()


def _commit_of(root: Path) -> str:
    if (root / ".git").exists():
        try:
            done = subprocess.run(DESCRIBE, cwd=root, capture_output=True, text=True, check=False)
        except OSError:  # no git here
            return ""
        return done.stdout.strip()
    came_along = root / IN_SOURCE
    return (
        came_along.read_text(encoding="ascii").strip() if came_along.exists() else os.environ.get(COMMIT_VARIABLE, "")
    )
