"""Who does work, which cluster may, and what makes a worker's installation another."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import msgspec
import pytest

from paani import cluster
from paani.cluster import InProcess, cluster_address, explain_difference, inspect_installation, open_workers
from paani.errors import UserError


def test_without_a_cluster_the_work_is_done_here_in_order() -> None:
    kept: list[tuple[int, str]] = []
    with open_workers(None, 8) as workers:
        assert isinstance(workers, InProcess)
        assert list(workers.run(str, [7, 8, 9], lambda index, text: kept.append((index, text)))) == [0, 1, 2]
    assert kept == [(0, "7"), (1, "8"), (2, "9")]


@pytest.mark.parametrize("address", ["local", "tcp://127.0.0.1:8786", "tls://cluster.example:8786", "tcp://[::1]:8786"])
def test_addresses_of_schedulers(address: str) -> None:
    assert cluster_address(address) == address


@pytest.mark.parametrize(
    "address",
    ["", "Local", "127.0.0.1:8786", "tcp://127.0.0.1", "http://a:80", "tcp://a:99999", "tcp://a:80/x", "tcp://"],
)
def test_what_is_no_address_is_refused(address: str) -> None:
    with pytest.raises(UserError, match=r"--cluster .*: expected tcp://HOST:PORT, tls://HOST:PORT or local"):
        cluster_address(address)


@pytest.mark.slow
def test_each_part_of_an_installation_counts() -> None:
    own = inspect_installation()
    assert explain_difference(own, own) == ""
    assert own.libraries["numpy"] != "none"
    for part in ("paani", "python", "processor"):
        asked = msgspec.structs.replace(own, **{part: "other"})
        assert explain_difference(own, asked).endswith("not other")
    for library in own.libraries:
        asked = msgspec.structs.replace(own, libraries={**own.libraries, library: "0.0"})
        assert explain_difference(own, asked) == f"{library} {own.libraries[library]}, not 0.0"


@pytest.mark.slow
def test_a_worker_with_threads_is_refused() -> None:
    """Drives of one process would share OpenGL and settings of libraries."""
    own = inspect_installation()
    worker = SimpleNamespace(state=SimpleNamespace(nthreads=1))
    assert cluster._refusal(own, worker) == ""
    worker.state.nthreads = 4
    assert cluster._refusal(own, worker).startswith("4 threads, of which one may be used")


def test_without_the_extra_a_cluster_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with (
        pytest.raises(
            UserError, match=r"--cluster needs distributed, not installed here: pip install 'paani\[cluster\]'"
        ),
        open_workers("local", 1),
    ):
        pass
