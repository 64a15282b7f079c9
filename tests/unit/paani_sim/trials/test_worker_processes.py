"""Processes that work side by side: whoever is interrupted does not wait for them."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from paani_sim.trials.worker_processes import open_processes

pytestmark = [pytest.mark.slow, pytest.mark.timeout(60)]  # a wait for the work below takes longer


def work_for_minutes(began: Path) -> None:
    began.touch()
    time.sleep(120.0)


@pytest.mark.parametrize("why", [KeyboardInterrupt, ValueError])
def test_an_interruption_ends_what_is_at_work_and_begins_nothing_more(why: type[BaseException], tmp_path: Path) -> None:
    files = [tmp_path / f"{number}" for number in range(3)]

    def interrupted() -> None:
        with open_processes(1) as executor:
            for file in files:
                executor.submit(work_for_minutes, file)
            while not files[0].exists():
                time.sleep(0.02)
            raise why

    with pytest.raises(why):
        interrupted()
    assert [file.exists() for file in files] == [True, False, False]


def test_work_that_is_not_interrupted_is_done_and_gives_way_to_others() -> None:
    own = os.nice(0)
    with open_processes(2) as executor:
        assert all(number > own for number in executor.map(os.nice, (0, 0, 0)))
