"""`python -m tests.mutation`: how many small changes of the safety path its unit tests notice.

mutmut makes the changes, in a copy below runs/mutation: `[tool.mutmut]` in pyproject.toml names the files that it
changes and the tests that may notice. After Ctrl-C the same command goes on; with a changed checkout it begins anew.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

from tests.mutation.verdicts import NOTICED, UNTRIED, judge_file, load_equivalents, summary
from tests.places import ROOT

STAGE = ROOT / "runs" / "mutation"
# mutmut names a module by its path, so the packages lie side by side there.
PACKAGES = {"paani": "shared/paani", "paani_services": "services/paani_services"}


def main(argv: list[str]) -> int:
    """0: the tests notice as many changes of each file as they have to; 1: fewer, or mutmut failed."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__.partition("\n")[0])
    parser.add_argument("--only", nargs="+", metavar="MUTANT", help="try these again, such as 'paani.thrust_adapter.*'")
    parser.add_argument("--survivors", action="store_true", help="keep what was noticed, try again what was not")
    options = parser.parse_args(argv)
    stage_copy(keep=options.survivors or bool(options.only))
    if options.survivors:
        forget_survivors()
    words = [str(Path(sys.executable).with_name("mutmut")), "run", "--max-children", "1", *(options.only or ())]
    if subprocess.run(words, cwd=STAGE, check=False).returncode != 0:
        return 1
    equivalents = load_equivalents()
    text, is_enough = summary([judge_file(STAGE / "mutants", file, equivalents) for file in _changed_files()])
    print(text)
    return 0 if is_enough else 1


def stage_copy(*, keep: bool) -> None:
    """The folder that mutmut runs in. What was found there goes where the checkout has changed, unless it is kept."""
    STAGE.mkdir(parents=True, exist_ok=True)
    for name, folder in {**PACKAGES, "tests": "tests"}.items():
        if not (STAGE / name).is_symlink():
            (STAGE / name).symlink_to(ROOT / folder)
    shutil.copy2(ROOT / "pyproject.toml", STAGE)
    digest, record = _digest(), STAGE / "checkout.sha256"
    if not keep and (not record.is_file() or record.read_text() != digest):
        shutil.rmtree(STAGE / "mutants", ignore_errors=True)
    record.write_text(digest)


def forget_survivors() -> None:
    """mutmut tries again what has no verdict."""
    for file in _changed_files():
        path = STAGE / "mutants" / f"{file}.meta"
        record = json.loads(path.read_text())
        codes = record["exit_code_by_key"]
        record["exit_code_by_key"] = {key: code if code in NOTICED else UNTRIED for key, code in codes.items()}
        path.write_text(json.dumps(record))


def _changed_files() -> list[str]:
    """The files that mutmut changed and has a verdict about for every mutant, by their paths in the stage."""
    with (STAGE / "pyproject.toml").open("rb") as file:
        changed = tomllib.load(file)["tool"]["mutmut"]["only_mutate"]
    return [name for name in changed if (STAGE / "mutants" / f"{name}.meta").is_file()]


def _digest() -> str:
    """SHA-256 of all that decides a verdict, by path and content."""
    digest = hashlib.sha256((STAGE / "pyproject.toml").read_bytes())
    for folder in (*PACKAGES, "tests"):
        for path in sorted((STAGE / folder).resolve().rglob("*.py")):
            digest.update(path.as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
