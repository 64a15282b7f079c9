"""Both compose files and their images, built by a real engine."""

import pytest

from tests.deploy.engine import Engine

pytestmark = [pytest.mark.deploy, pytest.mark.timeout(900)]


@pytest.mark.parametrize("side", ["board", "host"])
def test_the_engine_takes_the_file_with_every_profile(engine: Engine, side: str) -> None:
    engine.compose(side, "--profile", "*", "config", "-q")


@pytest.mark.parametrize("side", ["board", "host"])
def test_an_image_holds_no_secret_and_nothing_of_the_build(engine: Engine, side: str) -> None:
    run = ("run", "--rm", "--network", "none", "--entrypoint")
    assert engine.docker(*run, "find", f"paani-{side}", "/var/lib/paani", "-type", "f") == ""
    assert not {"source", "build", "wheel"} & set(engine.docker(*run, "ls", f"paani-{side}", "/").split())
