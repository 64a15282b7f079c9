"""An engine that has the images of both sides."""

from collections.abc import Iterator

import pytest

from tests.deploy.engine import Engine, NoEngine, running_engine
from tests.deploy.river import build


@pytest.fixture(scope="module")
def engine() -> Iterator[Engine]:
    try:
        with running_engine() as found:
            build(found)
            yield found
    except NoEngine as reason:
        pytest.skip(str(reason))
