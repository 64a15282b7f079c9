"""What a check finds, and how checks are run: one that fails in a way nobody thought of is a finding, too."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from enum import StrEnum

import msgspec

from paani.config import Config
from paani.errors import UserError


class State(StrEnum):
    """`warn`: it runs, and something is not as it should be."""

    OK = "ok"
    WARN = "warn"
    FAIL = "fail"


class Finding(msgspec.Struct, frozen=True):
    """One line. `check`: the name of the check; `remedy`: what to do, empty where all is well."""

    check: str
    state: State
    text: str
    remedy: str = ""


class Verdict(msgspec.Struct, frozen=True):
    """What a check says of one thing that it looked at."""

    state: State
    text: str
    remedy: str = ""


Check = Callable[[Config], Iterator[Verdict]]


def passed(text: str) -> Verdict:
    return Verdict(State.OK, text)


def warned(text: str, remedy: str) -> Verdict:
    return Verdict(State.WARN, text, remedy)


def failed(text: str, remedy: str = "") -> Verdict:
    """Without a remedy of its own the text says what to do, as that of a UserError does."""
    return Verdict(State.FAIL, text, remedy)


def run_check(name: str, check: Check, config: Config) -> Iterator[Finding]:
    """The findings of one check. Never raises: what a check raises is its last finding."""
    try:
        for verdict in check(config):
            yield Finding(name, verdict.state, verdict.text, verdict.remedy)
    except UserError as error:
        yield Finding(name, State.FAIL, str(error))
    except Exception as error:  # noqa: BLE001  # a doctor that falls over helps nobody
        text = " ".join(f"{type(error).__name__}: {error}".split())
        yield Finding(name, State.FAIL, f"cannot be checked: {text}", "please report this")


def finding_text(finding: Finding) -> str:
    """One line."""
    remedy = f" -> {finding.remedy}" if finding.remedy else ""
    return f"{finding.state:<5} {finding.check:<12} {finding.text}{remedy}\n"
