"""The report in a real browser: nothing fails to load, nothing runs off the page, on a screen and on a telephone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from paani_models.commands.models import main
from tests.unit.paani_models.datasets.public_sets import own_data

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]
SOURCES = "tbiseg_dasha,mcoe_boats"
OFF_THE_PAGE = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
UNLOADED = "[...document.images].filter(i => { i.loading = 'eager'; return !(i.complete && i.naturalWidth) }).length"


@pytest.fixture
def report(tmp_path: Path) -> Path:
    data, run, out = own_data(tmp_path / "data"), tmp_path / "run", tmp_path / "report"
    run.mkdir()
    (run / "epochs.jsonl").write_text("".join(f'{{"epoch":{e},"loss":{2 / e},"miou":0.5}}\n' for e in range(1, 9)))
    command = ["report", "--data", str(data), "--sources", SOURCES, "--out", str(out), "--runs", str(run)]
    assert main(command) == 0
    return out / "index.html"


@pytest.mark.rotating(cpu_s=4)
@pytest.mark.parametrize("width", [1280, 390])
async def test_the_report_shows_everything(browser: Any, report: Path, width: int) -> None:
    page = await browser.new_page(viewport={"width": width, "height": 800})
    wrong: list[str] = []
    page.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
    page.on("requestfailed", lambda request: wrong.append(request.url))
    await page.goto(report.as_uri())
    await page.wait_for_function(f"{UNLOADED} === 0")
    assert await page.evaluate(OFF_THE_PAGE) <= 0
    assert await page.locator("section").count() == 4
    assert await page.locator("img").count() > 0
    assert await page.locator("svg.chart").count() >= 3
    assert wrong == []
    await page.close()
