"""The scripts by which shells complete `paani`, asked by a real shell where there is one."""

from __future__ import annotations

import functools
import shutil
import subprocess
from importlib.metadata import entry_points

import pytest

from paani.cli import main
from paani_tools.completion.command import SHELLS, completion_script

script = functools.cache(completion_script)
SYNTAX = {"bash": ("bash", "-n"), "zsh": ("zsh", "-n"), "fish": ("fish", "--no-execute")}
ASK = """
COMP_WORDS=(paani "$@"); COMP_CWORD=$(($# ))
_shtab_paani
printf '%s\\n' "${COMPREPLY[@]}"
"""


def complete(*words: str) -> set[str]:
    """What bash offers for the last of these words."""
    code = f"cd /\n{script('bash')}\n{ASK}"
    done = subprocess.run(["bash", "-c", code, "bash", *words], capture_output=True, text=True, check=True)
    return {line.strip() for line in done.stdout.splitlines()}


@pytest.mark.slow
def test_bash_completes_commands_options_and_choices() -> None:
    assert {point.name for point in entry_points(group="paani.commands")} < complete("")
    assert complete("up", "--he") == {"--help", "--headless"}
    assert "hull" in complete("up", "--profile", "")
    assert complete("run", "percep") == {"perception"}


@pytest.mark.slow
def test_bash_completes_sub_commands() -> None:
    assert {"info", "mend"} & complete("logs", "")
    assert {"chain", "water", "board"} <= complete("bench", "")
    assert "--drive" in complete("bench", "judgement", "--d")


@pytest.mark.slow
def test_bash_completes_files_where_an_option_takes_one() -> None:
    assert {"etc", "usr"} <= {word.strip("/") for word in complete("up", "--config", "")}


@pytest.mark.parametrize("shell", SHELLS)
@pytest.mark.slow
def test_a_script_is_one_for_its_shell(shell: str) -> None:
    if shutil.which(shell) is None:
        assert "headless" in script(shell)
        pytest.skip(f"no {shell} here to read its script")
    done = subprocess.run(SYNTAX[shell], input=script(shell), capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_another_shell_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as refused:
        main(["completion", "tcl"])
    assert refused.value.code == 2
    assert "tcl" in capsys.readouterr().err
