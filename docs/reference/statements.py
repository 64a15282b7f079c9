"""The page of the paper's statements, from the file that says what proves each."""

from __future__ import annotations

import itertools
import tomllib
from pathlib import Path
from typing import Any

from docs.reference.markdown import prose

SUBJECTS = {
    "A": "platform and scope", "B": "messages and authority", "C": "detector", "D": "segmenter",
    "E": "from pixels to corridors", "F": "fallback", "G": "tracker", "H": "urgency", "I": "apparent motion",
    "J": "risk and policy", "K": "simulation", "L": "state estimation", "M": "navigator", "N": "controller",
    "O": "thrust adapter and microcontroller", "P": "observability", "Q": "metric grid", "R": "data sets",
    "S": "training", "T": "export and precision", "U": "evaluation", "V": "results", "W": "limitations",
    "X": "figures", "Y": "tables", "Z": "what the paper leaves unmeasured",
}  # fmt: skip
CLAIMS = Path(__file__).parents[2] / "tests" / "claims.toml"

INTRODUCTION = """# The paper's statements

PAANI follows *PAANI: On-Device Visual Evidence Fusion and Explainable Guidance for River-Robot Simulation* (Cardoz
and Rajan). Each of its statements, figures and tables has an id here, by which code, settings and tests cite it, is
given in our own words, and is either proved by the tests named or out of scope for the reason given. Where PAANI does
better than the paper on purpose, it says what is better and how the paper's own form is kept. What a test proves it
also misses where it is gone: each changed number, operator or branch that is named fails one of the tests beside it.

"""


def read_statements() -> dict[str, dict[str, Any]]:
    """Every row by its id."""
    return tomllib.loads(CLAIMS.read_text(encoding="utf-8"))


def what_statements_say() -> dict[str, str]:
    """Each statement in a sentence or two, by its id."""
    return {name: prose(row["says"]) for name, row in read_statements().items()}


def statements_page() -> str:
    """Every statement with its proof, grouped by the letter of its id."""
    parts = [INTRODUCTION]
    for letter, rows in itertools.groupby(read_statements().items(), key=lambda row: row[0][0]):
        parts.append(f"## {letter}: {SUBJECTS[letter]}\n\n")
        parts += [_statement(name, row) for name, row in rows]
    return "".join(parts)


def _statement(name: str, row: dict[str, Any]) -> str:
    says = prose(row["says"])
    return f"### {name} {{ #{name.lower()} }}\n\n{says}\n\n{_proof(row)}\n\n"


def _proof(row: dict[str, Any]) -> str:
    if "exempt" in row:
        return f"Out of scope: {row['exempt']}."
    improved = f"Better here: {prose(row['improved'])}\n\n" if "improved" in row else ""
    proved = "Proved by " + ", ".join(f"`{test}`" for test in row["test"]) + "."
    return improved + proved + "".join(f"\n\n{_caught(mutant)}" for mutant in row.get("mutant", ()))


def _caught(mutant: dict[str, str]) -> str:
    before, after = (" ".join(mutant[side].split()) for side in ("from", "to"))
    return f"Caught: `{before}` changed to `{after}` in `{mutant['file']}`."
