"""Report page of a suite: figures with intervals, and the worst drives with chart, pictures and recording."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template

from paani.statistics.charts import bar
from paani.whole_file import write_whole
from paani_sim.trials.imazu_sheet import draw_imazu_sheet
from paani_sim.trials.imazu_summary import ImazuSummary
from paani_sim.trials.intervals import Share
from paani_sim.trials.policies import Policy
from paani_sim.trials.result import CLOSENESS_LIMIT_M, SHOAL, Closeness, TrialResult
from paani_sim.trials.seed_parts import SeedPart
from paani_sim.trials.suite_summary import PolicyFigures, Summary
from paani_sim.trials.summary_table import describe_seeds
from paani_sim.trials.track_chart import draw_track_chart
from paani_sim.trials.trial_cases import TrialCase, build_scenario
from paani_sim.trials.worst_drives import RepeatedDrive, repeat_drives, select_worst_drives

WORST_COUNT = 6
LEGEND = (
    '<p class="key"><span style="background:#0072b2"></span>track<span style="background:#c8321e"></span>contact'
    '<span style="background:#d98200"></span>buoy; ring: closer than 0.6 m'
    '<span style="background:#8a6d4b"></span>vessel'
    '<span style="background:#77685a"></span>pier<span style="background:#b0317a"></span>swimmer. '
    "Dashed: the route, and the ways of what moves, drawn where it would be at the worst moment.</p>"
)

IMAZU_LEGEND = (
    "<p>One to three vessels that reach one point together with the boat, if nobody manoeuvres; none gives way. The "
    "groups say what the lens sees of them at the start: from outside the lens nothing comes into it on a collision "
    "course, unless the boat turns. Scores by the class's own rule, 0 to 1. In the sheets: the boat in blue from the "
    "left, vessels in brown from the large dot on, a dot every ten seconds, the lens to 14 m, contacts in red; the "
    "caption has the least clearance.</p>"
)


def write_report(
    path: Path, summary: Summary, results: Mapping[TrialCase, TrialResult], sets: Sequence[str], jobs: int
) -> None:
    """Write the page, and beside it a folder with recordings and pictures. Raises UserError if that fails.

    Of validation seeds no drive is shown.
    """
    folder = drives_folder(path)
    viewable = {case: result for case, result in results.items() if result.part is not SeedPart.VALIDATION}
    repeated = repeat_drives(select_worst_drives(viewable, WORST_COUNT), results, sets, folder, jobs)
    write_whole(path, render_page(summary, results, repeated, folder.name).encode(), "--report")


def drives_folder(path: Path) -> Path:
    """Of the recordings, beside the page."""
    return path.with_name(f"{path.stem}-drives")


def render_page(
    summary: Summary, results: Mapping[TrialCase, TrialResult], repeated: Sequence[RepeatedDrive], folder: str
) -> str:
    """HTML text of the page. folder: of the recordings, relative to the page."""
    drives = sum(figures.trials for figures in summary.policies.values())
    km = sum(figures.distance_m for figures in summary.policies.values()) * 1e-3
    body = [
        "<h2>Policies</h2>",
        "<p>Every policy drives the same scenarios. Bars: the share and its 95 % Wilson interval. A contact is visible "
        "if the camera could have seen the thing within 15 m in the five seconds before. A near miss is a clearance "
        "below 0.5 m without contact; those of banks are not counted here.</p>",
        _policy_table(summary.policies),
        "<h2>By distance and by encounter</h2><p>Rates per km have the 95 % interval of a Poisson count, shares of "
        "encounters with things that of Wilson.</p>",
        _exposure_table(summary.policies),
        "<h2>How close</h2><p>Encounters within five metres, by the clearance at the closest point.</p>",
        _closeness_table(summary.policies),
        "<h2>Worlds</h2>",
        *(f"<h3>{escape(policy)}</h3>{_policy_table(worlds)}" for policy, worlds in summary.worlds.items()),
        "<h2>Why the boat stood</h2>",
        _stop_table(summary.policies),
    ]
    if summary.faults:
        body += ["<h2>Faults</h2>", _fault_table(summary)]
    if summary.imazu:
        body += ["<h2>Imazu cases</h2>", IMAZU_LEGEND, _imazu_table(summary.imazu)]
        for policy in summary.imazu:
            body += [f"<h3>{escape(policy)}</h3>", draw_imazu_sheet(results, Policy(policy))]
    body += [
        "<h2>Worst drives</h2>",
        LEGEND if repeated else '<p class="faint">None is shown.</p>',
        *(_drive_section(each, results[each.case], folder) for each in repeated),
    ]
    template = Template((files("paani_sim.trials") / "page.html").read_text(encoding="utf-8"))
    return template.substitute(
        title=escape(summary.suite),
        subtitle=escape(f"{drives} drives, {km:.2f} km; {describe_seeds(summary.seeds)}"),
        body="\n".join(body),
    )


def _policy_table(rows: Mapping[str, PolicyFigures]) -> str:
    head = (
        "", "profile", "seeds", "drives", "completed", "without contact", "contacts", "visible", "banks", "per km",
        "near misses",
        "contacts and near misses per km", "least clearance [m]", "off route rms [m]", "speed [m/s]",
        "changes a minute", "latency [s]",
    )  # fmt: skip
    return _table(
        head,
        [
            (
                escape(name), escape(p.profile), f"{p.seeds} {p.part.value}", str(p.trials),
                _share_cell(p.completed_share), _share_cell(p.untouched_share),
                _count_cell(p.collisions), _count_cell(p.collisions_visible), str(p.collisions_bank),
                f"{p.contacts_per_km:.2f}", str(p.near_misses), f"{p.close_per_km:.1f}",
                f"{p.min_clearance_m:.2f}", f"{p.off_route_rms_m:.2f}", f"{p.mean_speed_mps:.2f}",
                f"{p.changes_per_min:.1f}", "-" if p.latency_p50_s is None else f"{p.latency_p50_s:.2f}",
            )
            for name, p in rows.items()
        ],
    )  # fmt: skip


def _exposure_table(rows: Mapping[str, PolicyFigures]) -> str:
    head = (
        "", "km", "contacts per km", "near misses per km", "encounters", "with contact", "with near miss",
        "encounters with people", "at 1.5&nbsp;m or more",
    )  # fmt: skip
    return _table(
        head,
        [
            (
                escape(name), f"{p.distance_m * 1e-3:.2f}",
                _rate_cell(p.contacts_per_km, p.contacts_per_km_interval),
                _rate_cell(p.near_misses_per_km, p.near_misses_per_km_interval), str(p.encountered),
                _share_cell(p.touched_encounter_share), _share_cell(p.near_encounter_share),
                str(p.encountered_people), _share_cell(p.person_clear_share),
            )
            for name, p in rows.items()
        ],
    )  # fmt: skip


def _closeness_table(rows: Mapping[str, PolicyFigures]) -> str:
    body = [(escape(name), *(str(p.encounters.get(kind.value, 0)) for kind in Closeness)) for name, p in rows.items()]
    return _table(
        ("", "contact", *(f"under {under_m}&nbsp;m" for under_m in CLOSENESS_LIMIT_M.values()), "farther"), body
    )


def _imazu_table(summary: ImazuSummary) -> str:
    head = (
        "", "form and group", "drives", "completed", "without contact", "contacts", "under 0.5&nbsp;m",
        "domain entered", "time lost [s]", "scores (encounters)",
    )  # fmt: skip
    rows = [
        (
            escape(policy), escape(f"{form}, {group}"), str(f.drives), str(f.completed), _share_cell(f.untouched_share),
            _count_cell(f.contacts), str(f.near), str(f.domain_entered),
            "-" if f.time_lost_s is None else f"{f.time_lost_s:.1f}",
            "<br>".join(f"{kind.replace('_', ' ')} {s.mean:.2f} ({s.encounters})" for kind, s in f.scores.items()),
        )
        for policy, forms in summary.items()
        for form, groups in forms.items()
        for group, f in groups.items()
    ]  # fmt: skip
    return _table(head, rows, "words")


def _stop_table(rows: Mapping[str, PolicyFigures]) -> str:
    body = [
        (escape(name), reason.replace("_", " ").lower(), str(stop.count), f"{stop.seconds:.0f}")
        for name, p in rows.items()
        for reason, stop in p.stops.items()
    ]
    return _table(("", "reason", "times", "seconds"), body, "words") if body else '<p class="faint">It never stood.</p>'


def _fault_table(summary: Summary) -> str:
    head = ("", "drives", "completed", "contacts", "fans off in time", "latest fans off [s]", "latest at rest [s]")
    return _table(
        head,
        [
            (
                escape(kind.replace("_", " ")), str(f.trials), str(f.completed), _count_cell(f.collisions),
                f"{f.in_time} of {f.judged}" if f.judged else "-",
                "-" if f.worst_zero_thrust_s is None else f"{f.worst_zero_thrust_s:.2f}",
                "-" if f.worst_rest_s is None else f"{f.worst_rest_s:.2f}",
            )
            for kind, f in summary.faults.items()
        ],
    )  # fmt: skip


def _drive_section(each: RepeatedDrive, result: TrialResult, folder: str) -> str:
    facts = [f"{result.progress_m:.1f} of {result.goal_m:.1f} m in {result.seconds:.0f} s: {result.why.value}"]
    facts += [
        f'<span class="bad">{"ran aground on" if c.kind == SHOAL else "touched"} {escape(c.what)} ({c.kind})</span> '
        f"at {c.at_s:.1f} s, {c.speed_mps:.2f} m/s, " + ("in view" if c.visible else "out of view")
        for c in result.contacts
    ]
    facts += [
        f"{e.clearance_m:.2f} m from {escape(e.what)} ({e.kind}) at {e.at_s:.1f} s"
        for e in result.encounters
        if e.closeness in {Closeness.GRAZING, Closeness.TIGHT}
    ]
    facts += [f"stood {s.seconds:.1f} s: {s.reason.replace('_', ' ').lower()} ({s.count})" for s in result.stops[:4]]
    if not each.is_equal:
        facts.append('<span class="bad">driven again it went otherwise: other code or settings</span>')
    strip = ""
    if each.strip:
        data = base64.b64encode(each.strip).decode()
        strip = (
            f'<div class="strip"><img alt="pictures before the worst moment" src="data:image/png;base64,{data}"></div>'
        )
    items = "".join(f"<li>{fact}</li>" for fact in facts)
    link = f"{escape(folder)}/{escape(each.log)}"
    return (
        f'<div class="drive"><div>{draw_track_chart(build_scenario(each.case).world, result)}</div>'
        f'<div><h3>{escape(each.case.name)}</h3><ul>{items}</ul><a href="{link}">recording</a></div>{strip}</div>'
    )


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], kind: str = "") -> str:
    """`kind` "words": with a second column of text."""
    top = "".join(f"<th>{cell}</th>" for cell in head)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    return f'<div class="wide"><table class="{kind}"><tr>{top}</tr>{body}</table></div>'


def _share_cell(s: Share) -> str:
    interval = f"<small>{100 * s.low:.1f} to {100 * s.high:.1f}</small>"
    return f"{100 * s.share:.1f} % {interval}{bar(s.share, s.low, s.high)}"


def _rate_cell(rate: float, interval: tuple[float, float]) -> str:
    return f"{rate:.2f} <small>{interval[0]:.2f} to {interval[1]:.2f}</small>"


def _count_cell(count: int) -> str:
    return f'<span class="bad">{count}</span>' if count else "0"
