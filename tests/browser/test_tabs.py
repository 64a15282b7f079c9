"""What somebody types, chooses, focuses, scrolls to and freezes in a table stays while its values change."""

from __future__ import annotations

import re
from typing import Any

import pytest

from paani.config import Config
from tests.browser.conftest import Boat
from tests.browser.test_page import until, watch
from tests.conftest import Spawn

pytestmark = [pytest.mark.browser, pytest.mark.timeout(120)]
AGES = "[...document.querySelectorAll('#topics tr')].map((row) => row.children[3].textContent).join()"
CELLS = "[...document.querySelectorAll('#topics tr td')].map((cell) => cell.textContent)"
SIZE, VALUE = "document.querySelectorAll('#topics tr').length", "document.querySelector('#topic-value').textContent"


@pytest.mark.rotating(cpu_s=3)
async def test_a_topic_says_where_it_is_from_how_often_it_comes_its_age_and_its_size(
    browser: Any, boat: Boat, spawn: Spawn, config: Config
) -> None:
    async with spawn("dashboard"):
        page = (await watch(browser, config)).page
        await page.click("[data-tab-of='topics']")
        await page.fill("#topics-search", "perception/evidence")
        await until(page, f"{SIZE} === 1 && {CELLS}[2] !== '–'")
        heads = await page.evaluate("[...document.querySelectorAll('.topics-tab th')].map((head) => head.textContent)")
        assert heads == ["Topic", "From", "Rate / nominal [Hz]", "Age", "Size"]
        topic, producer, rate, age, size = await page.evaluate(CELLS)
        assert (topic, producer) == ("perception/evidence", "perception")
        assert re.fullmatch(r"[0-9]+\.[0-9] / [0-9.]+", rate)
        assert re.fullmatch(r"[0-9]\.[0-9] s", age)
        assert re.fullmatch(r"[0-9.]+ k?B", size)
        await page.fill("#topics-search", "")
        await until(page, f"{SIZE} > 20")
        names = await page.evaluate("[...document.querySelectorAll('#topics button')].map((each) => each.textContent)")
        assert names == sorted(names), "in the order of their names"


async def is_changing(page: Any, expression: str) -> bool:
    before = await page.evaluate(expression)
    await page.wait_for_timeout(1200)
    return bool(await page.evaluate(expression) != before)


@pytest.mark.rotating(cpu_s=4)
async def test_topics_are_searched_chosen_and_frozen(browser: Any, boat: Boat, spawn: Spawn, config: Config) -> None:
    async with spawn("dashboard"):
        watched = await watch(browser, config, 900, 500)
        page = watched.page
        await until(page, "paani.overlay.mask_seq !== null")
        await page.click("[data-tab-of='topics']")
        await until(page, f"{SIZE} > 20")
        all_topics = await page.evaluate(SIZE)
        await page.evaluate("document.querySelector('.topics-tab .scroll').scrollTop = 120")
        await page.focus("#topics tr:nth-child(6) button")
        focused = await page.evaluate("document.activeElement.textContent")
        assert await is_changing(page, AGES)
        assert await page.evaluate("document.activeElement.textContent") == focused
        assert await page.evaluate("document.querySelector('.topics-tab .scroll').scrollTop") == 120

        await page.locator("#topics-search").press_sequentially("Advisor/ADV")
        await until(page, f"{SIZE} === 1")
        found, total = (await page.inner_text("#topics-sum")).split(" of ")
        assert found == "1"
        assert int(total) >= all_topics, "as more may have come since"
        await page.click("#topics button")
        await until(page, f"{VALUE}.includes('centre risk 0.80')")
        assert await page.get_attribute("#topics tr", "aria-selected") == "true"
        assert await is_changing(page, VALUE)
        await page.click("#topics-freeze")
        assert not await is_changing(page, f"{AGES} + {VALUE}")
        await page.fill("#topics-search", "perception/evidence")
        await page.click("#topics button")
        assert '"navigation_eligible": true' in await page.evaluate(VALUE), "what was there when it was frozen"
        assert not await is_changing(page, VALUE)
        await page.click("#topics-freeze")
        assert await is_changing(page, VALUE)
        await page.fill("#topics-search", "")
        await until(page, f"{SIZE} >= {total}")
        assert watched.errors == []
