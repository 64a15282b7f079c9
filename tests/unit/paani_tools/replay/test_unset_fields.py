"""A field that was not set is told from one that the recording version did not know, by the schemas in the log."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from paani import keys
from paani import messages as m
from paani.decider import decider_of
from paani.logs.reader import Record, open_log
from paani.logs.schema import json_schema
from paani_tools.replay.check import ServiceCheck, check_service
from paani_tools.replay.difference import as_recorded
from paani_tools.replay.ledger import Ledger
from paani_tools.replay.verify import recording_facts
from tests.unit.paani_tools.replay.recorded_drive import CONFIG, drive, write_log

pytestmark = pytest.mark.slow
ADVISORY = keys.ADVISORY.name


def without_limit(record: Record) -> Record:
    """The record, without the speed limit that goes with an advisory."""
    if record.topic != ADVISORY:
        return record
    tree = msgspec.json.decode(record.data)
    tree.pop("speed_limit_mps", None)
    return record._replace(data=msgspec.json.encode(tree))


def check_advisor(path: Path) -> ServiceCheck:
    log, decider = open_log(path), decider_of("advisor")
    return check_service(decider, CONFIG, log.records(Ledger(decider).topics), recording_facts(log))


@pytest.mark.parametrize("chunked", [True, False])
def test_an_advisory_whose_speed_limit_was_not_recorded_differs_where_it_could_have_been(
    tmp_path: Path, *, chunked: bool
) -> None:
    known = {ADVISORY: json_schema(m.Advisory)}
    properties = msgspec.json.decode(known[ADVISORY])["properties"]
    earlier = {name: of for name, of in properties.items() if name != "speed_limit_mps"}
    records = [without_limit(record) for record in drive(6.0)]
    result = check_advisor(write_log(tmp_path / "a.mcap", records, schemas=known, chunked=chunked))
    assert result.differ > 20
    assert {each.field for each in result.differences} == {"speed_limit_mps"}
    older = {ADVISORY: msgspec.json.encode({"type": "object", "properties": earlier})}
    assert check_advisor(write_log(tmp_path / "b.mcap", records, schemas=older, chunked=chunked)).is_exact
    assert check_advisor(write_log(tmp_path / "c.mcap", drive(6.0), schemas=known, chunked=chunked)).is_exact


def test_what_a_schema_knows_is_compared_however_deep_it_lies() -> None:
    schema = {
        "properties": {
            "seq": {}, "left": {"properties": {"risk": {}, "limit": {}}},
            "tracks": {"items": {"properties": {"id": {}, "cpa_m": {}}}},
        }
    }  # fmt: skip
    recorded = b'{"seq":1,"left":{"risk":0.5},"tracks":[{"id":1}]}'
    added = b'{"seq":1,"left":{"risk":0.5,"new":1},"tracks":[{"id":1,"new":2}],"new":{"a":1}}'
    assert as_recorded(added, recorded, schema) == recorded
    for known in (
        b'{"seq":1,"left":{"risk":0.5,"limit":0.58},"tracks":[{"id":1}]}',
        b'{"seq":1,"left":{"risk":0.5},"tracks":[{"id":1,"cpa_m":2.0}]}',
    ):
        assert as_recorded(known, recorded, schema) == known
        assert as_recorded(known, recorded) == recorded
