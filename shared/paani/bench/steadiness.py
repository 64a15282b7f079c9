"""How much each set of constants dithers on the same evidence, from recorded drives."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec

from paani import keys
from paani import messages as m
from paani.bench.part import Part
from paani.config import Config, load_config
from paani.decider import Input, decider_of
from paani.dithering import dithering
from paani.errors import UserError
from paani.logs.reader import open_log

STEP_US = 200_000  # J17: between pictures the advice is given again
READ = (keys.EVIDENCE, keys.ODOMETRY)
MARGIN = "advisor.policy.side_change_margin"
MARGINS = (0.0, 0.05, 0.1, 0.15, 0.2)


def steadiness(drives: list[Path]) -> Part:
    """Every drive judged by `paper` and by `paani`, and by `paani` with other margins. Raises UserError."""
    settings = {"paper": load_config(profile="paper"), "paani": load_config()}
    settings |= {f"margin {margin:g}": load_config(sets=(f"{MARGIN}={margin}",)) for margin in MARGINS}
    rows = []
    for drive in drives:
        heard = tuple(_heard(drive))
        for name, config in settings.items():
            found = dithering(advice(heard, config))
            rows.append((
                drive.name, name, round(found.seconds), found.changes, found.side_flips, found.stop_go_flips,
                found.changes_per_min, found.side_flips_per_min, found.stop_go_flips_per_min,
            ))  # fmt: skip
    return Part(
        name="dithering",
        columns=("drive", "constants", "s", "changes", "side", "stop-go", "changes/min", "side/min", "stop-go/min"),
        rows=tuple(rows),
        note=f"the same evidence through each; 'margin' is `paani` with another {MARGIN}.",
    )


def advice(heard: tuple[tuple[int, m.Message], ...], config: Config) -> Iterator[m.Advisory]:
    """What the advisor says at each new evidence and between, as the messages came [us]."""
    decider = decider_of("advisor")
    state: Any = decider.state()
    inputs = {topic.name: Input() for topic in decider.inputs}
    due_us = heard[0][0] if heard else 0
    for at_us, message in heard:
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


def _heard(drive: Path) -> Iterator[tuple[int, m.Message]]:
    decoders = {topic.name: msgspec.json.Decoder(topic.type) for topic in READ}
    for record in open_log(drive).records([topic.name for topic in READ]):
        try:
            yield record.log_us, decoders[record.topic].decode(record.data)
        except msgspec.MsgspecError as error:
            raise UserError(f"{drive}: {record.topic} {record.seq}: {error}") from error
