"""Which commit the code that runs is, as git says it."""

from __future__ import annotations

import os
import shutil
import subprocess
from importlib.util import find_spec
from pathlib import Path

from paani.errors import UserError
from paani_sim.trials.fingerprint import CODE_PACKAGES, MODELS_PACKAGE

LEDGER_NAME = "sim_host/trial_ledger.jsonl"  # in the checkout; what it holds is no part of the code under test


def find_checkout() -> Path:
    """The checkout that every package of the code under test is imported from. Raises UserError."""
    roots = {}
    for package in (*CODE_PACKAGES, MODELS_PACKAGE):
        spec = find_spec(package)
        folder = next(iter((spec.submodule_search_locations if spec is not None else None) or ()), "")
        roots[package] = run_git(Path(folder or "/"), "rev-parse", "--show-toplevel") or folder
    if len(set(roots.values())) > 1:
        raise UserError("--seeds: the code is of several places: " + ", ".join(f"{k} {v}" for k, v in roots.items()))
    root = Path(next(iter(roots.values())))
    if run_git(root, "rev-parse", "--show-toplevel") is None:
        raise UserError(f"--seeds: {root} is no checkout under git, so no commit can be told")
    return root


def resolve_commit(root: Path, commit: str, ledger: Path) -> str:
    """All digits of the commit, which must be what is checked out, unchanged but for the ledger. Raises UserError.

    It may be an ancestor of what is checked out where nothing but the ledger was changed since.
    """
    found = run_git(root, "rev-parse", "--verify", "--quiet", f"{commit}^{{commit}}")
    if found is None:
        raise UserError(f"--seeds: no commit '{commit}' in {root}")
    apart = [":/", *(f":(exclude,top){name}" for name in {LEDGER_NAME, *_names_below(root, ledger)})]
    changed = run_git(root, "status", "--porcelain", "--untracked-files=all", "--", *apart)
    if changed is None or changed:
        first = changed.splitlines()[0].strip() if changed else "git status fails"
        raise UserError(f"--seeds: {root} is not commit {found[:12]}: {first}; commit it, and measure that commit")
    head = run_git(root, "rev-parse", "HEAD") or ""
    if found != head and (
        run_git(root, "merge-base", "--is-ancestor", found, head) is None
        or run_git(root, "diff", "--quiet", found, head, "--", *apart) is None
    ):
        raise UserError(f"--seeds: {root} has {head[:12]} checked out, not {found[:12]}; check that out")
    return found


def run_git(folder: Path, *words: str) -> str | None:
    """What git says in the folder, without the last line end; None where it fails or is missing.

    The environment cannot point it at another repository.
    """
    git = shutil.which("git")
    if git is None or not folder.is_dir():
        return None
    own = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}
    done = subprocess.run([git, *words], cwd=folder, env=own, capture_output=True, text=True, check=False)
    return done.stdout.rstrip("\n") if done.returncode == 0 else None


def _names_below(root: Path, path: Path) -> list[str]:
    resolved = path.resolve()
    return [str(resolved.relative_to(root))] if resolved.is_relative_to(root) else []
