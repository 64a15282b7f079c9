"""A command whose extra is not installed says what to install."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib

import pytest

from paani.errors import UserError
from paani.extras import EXTRA_OF, require_modules
from paani.keys import PORTS
from tests.places import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
DISTRIBUTION = {  # where it is not called as its module
    "OpenGL": "PyOpenGL",
    "prometheus_client": "prometheus-client",
    "foxglove": "foxglove-sdk",
    "rerun": "rerun-sdk",
}


@pytest.mark.parametrize(("module", "extra"), EXTRA_OF.items())
def test_each_module_comes_with_its_extra(module: str, extra: str) -> None:
    names = [re.split(r"[<>=!]", line)[0] for line in PROJECT["optional-dependencies"][extra]]
    assert DISTRIBUTION.get(module, module) in names
    assert DISTRIBUTION.get(module, module) not in [re.split(r"[<>=!]", line)[0] for line in PROJECT["dependencies"]]


def test_what_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    require_modules("up", "mujoco", "filterpy")
    monkeypatch.setitem(sys.modules, "filterpy", None)
    with pytest.raises(UserError, match=r"up needs filterpy, not installed here: pip install 'paani\[host\]'"):
        require_modules("up", "mujoco", "filterpy")
    monkeypatch.setitem(sys.modules, "pymavlink", None)
    with pytest.raises(UserError, match=r"needs filterpy, pymavlink, .*: pip install 'paani\[host,mavlink\]'"):
        require_modules("up", "filterpy", "pymavlink")


@pytest.mark.slow
@pytest.mark.parametrize(
    "words", [["trial", "--suite", "quick"], ["world", "list"], ["models", "check"], ["up", "--headless", "--for", "1"]]
)
def test_without_the_host_extra_a_command_is_one_line(words: list[str]) -> None:
    hidden = [module for module, extra in EXTRA_OF.items() if extra == "host"]
    hide = f"import sys\nfor name in {hidden}: sys.modules[name] = None\n"
    code = f"{hide}from paani.cli import main\nsys.exit(main({words}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
    assert re.fullmatch(
        rf"paani: {words[0]} needs [\w, ]+, not installed here: pip install 'paani\[host\]'\n", done.stderr
    )


@pytest.mark.slow
@pytest.mark.parametrize("service", [*PORTS, "advisor", "navigator", "operator"])
def test_a_port_needs_its_own_extra_and_every_other_process_none(service: str) -> None:
    blocked = {module: None for module, extra in EXTRA_OF.items() if extra != service}
    code = f"import sys; sys.modules.update({blocked}); import paani_services.{service}.service"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
