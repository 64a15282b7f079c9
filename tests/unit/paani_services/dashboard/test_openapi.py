"""`/openapi.json`: what it says is generated from the types, whole, and refers to nothing that is not there."""

from __future__ import annotations

import json

import pytest

from paani import keys
from paani_services.dashboard.driving import SetpointRequest
from paani_services.dashboard.openapi import LOGIN_OPERATIONS, OPERATIONS, openapi_document

DOCUMENT = openapi_document()


def test_every_reference_leads_somewhere_and_every_operation_has_a_name_of_its_own() -> None:
    schemas = DOCUMENT["components"]["schemas"]
    text = json.dumps(DOCUMENT)
    named = {part.partition('"')[0] for part in text.split("#/components/schemas/")[1:]}
    assert named <= set(schemas)
    operations = [each for path in DOCUMENT["paths"].values() for each in path.values()]
    assert len({each["operationId"] for each in operations}) == len(operations) == len(OPERATIONS + LOGIN_OPERATIONS)


def test_bounds_and_messages_come_from_the_types() -> None:
    body = DOCUMENT["components"]["schemas"][SetpointRequest.__name__]
    assert body["additionalProperties"] is False
    assert (body["properties"]["surge"]["minimum"], body["properties"]["surge"]["maximum"]) == (-1.0, 1.0)
    assert {topic.name for topic in keys.TOPICS} - set(DOCUMENT["x-topics"]) == {
        topic.name for topic in keys.TOPICS if topic.stance is keys.Stance.PICTURE
    }


@pytest.mark.parametrize(("path", "is_open"), [("/healthz", True), ("/snapshot.jpg", False), ("/api/stop", True)])
def test_what_asks_for_a_key_says_so(path: str, is_open: bool) -> None:
    (operation,) = DOCUMENT["paths"][path].values()
    assert operation["security"] == ([{}] if is_open else [{"key": []}, {"session": []}])
    assert ("401" in operation["responses"]) is not is_open
