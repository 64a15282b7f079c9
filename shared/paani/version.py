"""Which PAANI this is: its release, and the commit that it was built from."""

from __future__ import annotations

import subprocess
from importlib.metadata import version
from pathlib import Path

PACKAGE = Path(__file__).parent
CHECKOUT = PACKAGE.parents[1]
UNKNOWN = "unknown"
DESCRIBE = ("git", "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*")


def version_text() -> str:
    """`paani 0.1.0 (commit 0123456789ab)`; a commit ends in `-dirty` where tracked files were changed since."""
    return f"paani {version('paani')} (commit {commit()})"


def commit(package: Path = PACKAGE, checkout: Path = CHECKOUT) -> str:
    """The commit that a wheel carries, else the checkout's by git, else `unknown`."""
    try:
        return (package / "commit.txt").read_text(encoding="ascii").strip()
    except OSError:
        pass
    if not (checkout / ".git").exists():  # in a folder of somebody else's repository git would tell that one's
        return UNKNOWN
    try:
        done = subprocess.run(DESCRIBE, cwd=checkout, capture_output=True, text=True, check=False)
    except OSError:  # no git here
        return UNKNOWN
    return done.stdout.strip() or UNKNOWN
