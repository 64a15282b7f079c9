"""How much each set of constants dithers on the same evidence, from recorded drives."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import msgspec

from paani import keys
from paani import messages as m
from paani.config import Config, load_config, with_settings
from paani.decider import decider_of
from paani.errors import UserError
from paani.logs.reader import Log, open_log
from paani.statistics.dithering import dithering
from paani.statistics.figure_table import FigureTable
from paani.undecodable import UNDECODABLE
from paani_tools.replay.compatibility import provenance_of
from paani_tools.replay.ledger import Ledger
from paani_tools.replay.recompute import Recomputation
from paani_tools.replay.verify import recording_facts

STEADYING = ("advisor.policy.release_margin", "advisor.policy.side_change_margin")
WITHOUT = tuple(f"{path}=0" for path in STEADYING)


def steadiness(drives: list[Path]) -> FigureTable:
    """What every drive's advisor said, and what it would have said by its own settings, without what steadies it, and
    by the paper's. Raises UserError for a log that cannot be read or has no steps of an advisor.
    """
    rows = []
    for drive in drives:
        log = open_log(drive)
        given = provenance_of(log, force=True).config
        advice = {
            "as recorded": tuple(_recorded_advice(log)),
            "its settings": _advice_by(log, given),
            "both margins 0": _advice_by(log, with_settings(given, WITHOUT)),
            "release margin 0": _advice_by(log, with_settings(given, WITHOUT[:1])),
            "side change margin 0": _advice_by(log, with_settings(given, WITHOUT[1:])),
            "paper": _advice_by(log, msgspec.structs.replace(given, advisor=load_config(profile="paper").advisor)),
        }
        if not advice["its settings"]:
            raise UserError(f"{drive}: no steps of the advisor, so that nothing can be decided again")
        for name, advisories in advice.items():
            found = dithering(advisories)
            rows.append((
                drive.name, name, round(found.seconds), found.changes, found.interruptions, found.side_flips,
                found.stop_go_flips, found.changes_per_min, found.side_flips_per_min, found.stop_go_flips_per_min,
            ))  # fmt: skip
    return FigureTable(
        name="dithering",
        columns=(
            "drive",
            "constants",
            "s",
            "changes",
            "by input",
            "side",
            "stop-go",
            "/min",
            "side/min",
            "stop-go/min",
        ),
        rows=tuple(rows),
        note="the same inputs through each, step by step as they came. "
        "by input: changes that begin or end with late or unusable pictures.",
    )


def _recorded_advice(log: Log) -> Iterator[m.Advisory]:
    decoder = msgspec.json.Decoder(m.Advisory)
    for record in log.records([keys.ADVISORY.name]):
        try:
            yield decoder.decode(record.data)
        except UNDECODABLE as error:
            raise UserError(f"{log.path}: {record.topic} {record.seq}: {error}") from error


def _advice_by(log: Log, config: Config) -> tuple[m.Advisory, ...]:
    """What each recorded step of the advisor says with these settings, on what it had been given."""
    decider, decoder = decider_of("advisor"), msgspec.json.Decoder(m.Advisory)
    again = Recomputation(decider, config, recording_facts(log), evolve=True)
    return tuple(
        decoder.decode(computed)
        for step in again.steps(log.records(Ledger(decider).topics))
        for sent, _, computed in step.outputs
        if sent.topic == keys.ADVISORY.name
    )
