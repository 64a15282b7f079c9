"""`paani bench deck`."""

from __future__ import annotations

import argparse
import asyncio
import os
import sys
from collections import defaultdict

from paani.cli import add_config_arguments, config_from
from paani.config import Config
from paani.errors import UserError
from paani.extras import require_modules
from paani.option_numbers import seconds, whole_number
from paani.option_paths import output_file
from paani.page_address import is_page_exposed, page_host
from paani.whole_file import write_json
from paani_tools.bench.deck.picture_path import spread_of_stages
from paani_tools.bench.deck.report import Crowd, DeckReport, deck_text, heap_slope, keeps_bars, ratio_of_medians
from paani_tools.bench.deck.slow_link import slow_link
from paani_tools.inspect.listen import observer
from paani_tools.up.command import up_sets
from paani_tools.up.lifecycle import run_plan
from paani_tools.up.plan import make_plan
from paani_tools.up.run_summary import percentiles
from paani_tools.up.terminal import Display

LINK_MS = 50.0  # each way
MANY = 10
MAX_RATE_HZ = 10  # the page is sent no more (dashboard.picture_rate_hz)
HERE, CROWDED, LINK = "with 1 client", f"with {MANY} clients", f"over a link of {LINK_MS:g} ms each way"


def deck_parser() -> argparse.ArgumentParser:
    """The options."""
    parser = argparse.ArgumentParser(
        prog="paani bench deck", description="The page in headless Chromium beside a simulated boat under way."
    )
    parser.add_argument("--world", help="a world or a scenario (default: lake)", default="lake")
    parser.add_argument(
        "--rate",
        type=whole_number(most=MAX_RATE_HZ),
        default=10,
        metavar="HZ",
        help="pictures a second of the simulated camera, all of which perception looks at; default: 10",
    )
    parser.add_argument("--loads", type=whole_number(), default=5, metavar="N", help="of the page; default: 5")
    parser.add_argument("--stops", type=whole_number(), default=20, metavar="N", help="each way and round; default: 20")
    parser.add_argument("--sticks", type=whole_number(), default=40, metavar="N", help="default: 40")
    parser.add_argument("--for", dest="seconds", type=seconds, default=20.0, metavar="S", help="each; default: 20")
    parser.add_argument(
        "--rounds",
        type=whole_number(),
        default=2,
        metavar="N",
        help="with 1 and 10 clients, one after the other; default: 2",
    )
    parser.add_argument("--heap", type=seconds, metavar="S", help="leave a page open for so long, and watch its heap")
    parser.add_argument("--json", type=output_file("--json"), metavar="FILE", help="write the figures there too")
    add_config_arguments(parser)
    return parser


def deck_config(options: argparse.Namespace) -> Config:
    """The simulated boat that is measured. Raises UserError."""
    rates = tuple(f"{name}.rate_hz={options.rate}" for name in ("camera", "eye", "perception"))
    return config_from(options, (*up_sets(world=options.world, camera=None, headless=False), *rates))


def main(argv: list[str]) -> int:
    """Exit codes: 0 every bar was kept, 1 one was not or could not be measured, 2 user's mistake."""
    options = deck_parser().parse_args(argv)
    require_modules("bench deck", "playwright")
    config = deck_config(options)
    if is_page_exposed(config):
        raise UserError(f"dashboard.host {config.dashboard.host}: this bench measures a page on the loopback interface")
    report = asyncio.run(_measure(config, options))
    if isinstance(report, str):
        sys.stderr.write(f"paani: bench deck: {report}\n")
        return 1
    sys.stdout.write("\n" + deck_text(report))
    if options.json:
        write_json(options.json, report, "--json")
    return 0 if keeps_bars(report) else 1


async def _measure(config: Config, options: argparse.Namespace) -> DeckReport | str:
    """The figures, or why there are none."""
    from paani_tools.bench.deck import browser, measuring, pictures  # noqa: PLC0415  # need the extra

    plan = await make_plan(config)
    load_before, reports, failures = os.getloadavg()[0], list[DeckReport](), list[str]()

    async def measure() -> None:
        async with observer(plan.config.bus) as bus, browser.chromium(plan.config) as chromium:
            boat = measuring.Boat(bus, plan.config)
            deck, _ = await chromium.open_page(probed=True)
            await boat.until_applied(measuring.is_under_way, 0.0, measuring.UNDER_WAY_S)
            timed = await pictures.time_pictures(plan.config, bus, deck, options.seconds)
            await deck.hide_overlays()
            alone = await pictures.time_pictures(plan.config, bus, deck, options.seconds)
            loads = [await chromium.load_page() for _ in range(options.loads)]
            crowds, stops, unanswered = list[Crowd](), defaultdict[str, list[float]](list), 0
            for number in range(options.rounds):
                for clients in (1, MANY)[:: (-1) ** number]:  # so that what drifts meets both alike
                    measured, stops_ms, missed = await measuring.measure_crowd(
                        plan.config, boat, deck, clients, options.seconds, options.stops
                    )
                    crowds.append(measured)
                    stops[HERE if clients == 1 else CROWDED] += stops_ms
                    unanswered += missed
            page = plan.config.dashboard
            async with slow_link(page_host(plan.config), page.port, LINK_MS * 1e-3) as port:
                far, _ = await chromium.open_page(f"http://127.0.0.1:{port}")
                stops[LINK], missed_link = await measuring.time_stops(boat, far, options.stops)
                await far.close()
            sticks_ms, missed_sticks = await measuring.time_sticks(boat, deck, options.sticks)
            heap = await measuring.watch_heap(chromium, options.heap or 0.0)
            reports.append(
                DeckReport(
                    camera_hz=plan.config.camera.rate_hz,
                    received_hz=len(timed.received_ms) / options.seconds,
                    loads=tuple(loads),
                    received_ms=percentiles(timed.received_ms),
                    drawn_ms=percentiles(timed.drawn_ms),
                    stage_ms=spread_of_stages(timed.stages),
                    beyond_ms=percentiles(timed.beyond_ms),
                    alone_ms=percentiles(alone.beyond_ms),
                    crowds=tuple(crowds),
                    stop_ms={name: percentiles(found) for name, found in stops.items()},
                    stop_ratio=ratio_of_medians(stops[CROWDED], stops[HERE]),
                    stick_ms=percentiles(sticks_ms),
                    unanswered=unanswered + missed_sticks + missed_link,
                    heap_s=options.heap or 0.0,
                    heap_slope_mib_h=heap_slope(heap),
                    load_average=(load_before, os.getloadavg()[0]),
                )
            )

    async def measure_if_answered() -> None:
        try:
            await measure()
        except measuring.NO_ANSWER as error:
            failures.append(silence_text(error))

    outcome = await run_plan(plan, None, Display(sys.stdout), measure_if_answered)
    return reports[0] if reports else outcome.failure or next(iter(failures), "interrupted")


def silence_text(error: BaseException) -> str:
    """What did not answer, by the first line of what was raised."""
    return f"the page or the boat did not answer: {(str(error).splitlines() or ['in time'])[0]}"
