"""How much each set of constants dithers on the same evidence, from recorded drives."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec

from paani import keys
from paani import messages as m
from paani.config import Config, load_config
from paani.decider import Input, decider_of
from paani.errors import UserError
from paani.logs.reader import open_log
from paani.statistics.dithering import dithering
from paani.statistics.figure_table import FigureTable
from paani.undecodable import UNDECODABLE

STEP_US = 200_000  # J17: between pictures the advice is given again
PROMPT_US = 100_000  # from picture to evidence: a machine that was busy while recording is not the policy's doing
READ = (keys.EVIDENCE, keys.ODOMETRY)
STEADYING = ("advisor.policy.release_margin", "advisor.policy.side_change_margin")
WITHOUT = tuple(f"{path}=0" for path in STEADYING)


def steadiness(drives: list[Path]) -> FigureTable:
    """Every drive judged by `paper`, by `paani`, and by `paani` without what steadies it. Raises UserError."""
    settings = {
        "paper": load_config(profile="paper"),
        "paani, both margins 0": load_config(sets=WITHOUT),
        "paani, release margin 0": load_config(sets=WITHOUT[:1]),
        "paani, side change margin 0": load_config(sets=WITHOUT[1:]),
        "paani": load_config(),
    }
    rows = []
    for drive in drives:
        recorded = tuple(sorted(_recorded_inputs(drive), key=lambda each: each[0]))
        for name, config in settings.items():
            found = dithering(advice(recorded, config))
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
        note="the same evidence through each, 0.1 s after its picture. "
        "by input: changes that begin or end with late or unusable pictures.",
    )


def advice(recorded: tuple[tuple[int, m.Message], ...], config: Config) -> Iterator[m.Advisory]:
    """What the advisor says at each new evidence and between, as the messages came [us]."""
    decider = decider_of("advisor")
    state: Any = decider.state()
    inputs = {topic.name: Input() for topic in decider.inputs}
    due_us = recorded[0][0] if recorded else 0
    for at_us, message in recorded:
        steps = list(range(due_us, at_us, STEP_US))
        if isinstance(message, m.Evidence):
            steps.append(at_us)
        for now_us in steps:
            if now_us == at_us:
                inputs[keys.EVIDENCE.name] = Input(message, at_us)
            state, outputs = decider.decide(state, inputs, now_us, config)
            advisory = outputs[keys.ADVISORY.name]
            assert isinstance(advisory, m.Advisory)
            yield advisory
            due_us = now_us + STEP_US
        if isinstance(message, m.Odometry):
            inputs[keys.ODOMETRY.name] = Input(message, at_us)


def _recorded_inputs(drive: Path) -> Iterator[tuple[int, m.Message]]:
    decoders = {topic.name: msgspec.json.Decoder(topic.type) for topic in READ}
    for record in open_log(drive).records([topic.name for topic in READ]):
        try:
            message = decoders[record.topic].decode(record.data)
        except UNDECODABLE as error:
            raise UserError(f"{drive}: {record.topic} {record.seq}: {error}") from error
        yield (message.source_us + PROMPT_US if isinstance(message, m.Evidence) else record.log_us), message
