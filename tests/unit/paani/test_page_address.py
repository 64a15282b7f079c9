"""Where the page is reached from, and by which address."""

from __future__ import annotations

import pytest

from paani.config import load_config
from paani.errors import UserError
from paani.page_address import is_page_exposed, page_origin
from paani_tools.up.plan import make_plan


@pytest.mark.parametrize(
    ("sets", "exposed", "origin"),
    [
        ((), False, "http://127.0.0.1:8043"),
        (("dashboard.host=::1",), False, "http://[::1]:8043"),
        (("dashboard.host=0.0.0.0",), True, "https://127.0.0.1:8043"),
        (("dashboard.host=0.0.0.0", "dashboard.behind_loopback=true"), False, "http://127.0.0.1:8043"),
        (("dashboard.host=192.168.4.1", "dashboard.port=8080"), True, "https://192.168.4.1:8080"),
        (("dashboard.host=0.0.0.0", "dashboard.serve=false"), False, "http://127.0.0.1:8043"),
    ],
)
def test_the_page_is_exposed_where_other_machines_reach_it(sets: tuple[str, ...], exposed: bool, origin: str) -> None:
    config = load_config(sets=sets)
    assert (is_page_exposed(config), page_origin(config)) == (exposed, origin)


async def test_without_a_certificate_no_page_is_served_beyond_this_machine(private_sets: tuple[str, ...]) -> None:
    config = load_config(sets=(*private_sets, "dashboard.host=0.0.0.0"))
    with pytest.raises(UserError, match=r"dashboard\.host: .*paani certs make --folder certs --address ADDRESS"):
        await make_plan(config)
