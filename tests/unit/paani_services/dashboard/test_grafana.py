"""Grafana's dashboard and Prometheus' alert rules ask for what /metrics says, with its labels and words."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import yaml
from prometheus_client.parser import text_string_to_metric_families

from paani import keys
from paani import messages as m
from paani_services.dashboard.hub import Hub
from paani_services.dashboard.metrics import metrics_text
from tests.places import ROOT
from tests.unit.paani_services.dashboard.test_metrics import CONFIG, NOW_US, hub_with

FOLDER = ROOT / "deploy" / "grafana"
BOARD: dict[str, Any] = json.loads((FOLDER / "dashboard.json").read_bytes())
RULES: list[dict[str, Any]] = yaml.safe_load((FOLDER / "alerts.yml").read_bytes())["groups"][0]["rules"]
BY_PROMETHEUS = {"up"}  # metrics that it makes of a scrape itself
LABELS_BY_PROMETHEUS = {"instance", "job"}
WORDS = {
    "and", "or", "on", "by", "sum", "count", "vector", "rate", "increase", "max_over_time", "clamp_min", "label_values",
}  # fmt: skip
SELECTOR = re.compile(r"\b([a-z_]+)(?:\{([^}]*)\})?")
MATCHER = re.compile(r'(\w+)\s*(=~|!=|!~|=)\s*"([^"]*)"')
promtool = pytest.mark.skipif(shutil.which("promtool") is None, reason="promtool is not installed (Debian: prometheus)")


class Query(NamedTuple):
    where: str
    expression: str
    legend: str


def queries() -> Iterator[Query]:
    for panel in BOARD["panels"]:
        for target in panel["targets"]:
            yield Query(panel["title"], target["expr"], target["legendFormat"])
    for variable in BOARD["templating"]["list"]:
        if variable["type"] == "query":
            yield Query(variable["name"], variable["definition"], "")
    for rule in RULES:
        text = " ".join(rule["annotations"].values())
        yield Query(rule["alert"], rule["expr"], " ".join(f"{{{{{name}}}}}" for name in _labels_in(text)))


def _labels_in(text: str) -> list[str]:
    return re.findall(r"\$labels\.(\w+)", text)


@pytest.fixture(scope="module")
def offered() -> dict[str, dict[str, set[str]]]:
    """Every metric that the page can say, by the name Prometheus keeps, with the values of its labels."""
    found: dict[str, dict[str, set[str]]] = {}
    text = metrics_text(_full_hub(), CONFIG, NOW_US).decode()
    for family in text_string_to_metric_families(text):
        for sample in family.samples:
            labels = found.setdefault(sample.name, {})
            for name, value in sample.labels.items():
                labels.setdefault(name, set()).add(value)
    return found


def _full_hub() -> Hub:
    """A hub that has something of every topic."""
    hub = hub_with()
    hub.put(keys.OPERATOR_STATE.name, m.OperatorState(source_us=1, armed=True, stopped=False), NOW_US, NOW_US)
    thrusters = m.ThrustersState(source_us=1, line="", connected=True, zero_cause=m.ZeroCause.NONE, battery_v=12.0)
    advice = m.Advisory(source_us=1, direction=m.Direction.STOP, reason=m.Reason.NO_SAFE_SIDE)
    order = m.NavCommand(source_us=1, enable=False, heading_rad=0.0, speed_mps=0.0)
    applied = m.ThrustApplied(source_us=1, left=0.0, right=0.0, left_n=0.0, right_n=0.0, zero_cause=m.ZeroCause.NONE)
    pose = m.Odometry(source_us=1, x_m=0.0, y_m=0.0, yaw_rad=0.0, surge_mps=0.5)
    for topic, message in (
        (keys.ADVISORY, advice), (keys.COMMAND, order), (keys.THRUST_APPLIED, applied), (keys.ODOMETRY, pose),
        (keys.THRUSTERS_STATE, thrusters),
    ):  # fmt: skip
        hub.put(topic.name, message, NOW_US, NOW_US)
    for topic in keys.topics_in(CONFIG.bus.graph):
        if hub.newest(topic.name) is None:
            hub.put(topic.name, pose, NOW_US, NOW_US)
    return hub


@pytest.mark.parametrize("query", list(queries()), ids=lambda query: query.where)
def test_every_metric_and_label_exists(query: Query, offered: dict[str, dict[str, set[str]]]) -> None:
    bare = re.sub(r'"[^"]*"|\[[^\]]*\]|\b(?:by|on)\s*\([^)]*\)', "", query.expression)
    bare = re.sub(r"\{[^}]*\}", "", bare).removeprefix("label_values").replace(", instance", "")
    names = set(re.findall(r"[a-z_]+", bare)) - WORDS
    assert names, query
    assert names <= set(offered) | BY_PROMETHEUS, query.where
    labels = {label for name in names for label in offered.get(name, ())} | LABELS_BY_PROMETHEUS
    grouped = re.findall(r"\b(?:by|on)\s*\(([^)]*)\)", query.expression)
    assert {label.strip() for group in grouped for label in group.split(",")} <= labels
    assert set(re.findall(r"\{\{\s*(\w+)\s*\}\}", query.legend)) <= labels, "legend"
    for name, matchers in SELECTOR.findall(query.expression):
        for label, _, value in MATCHER.findall(matchers):
            if label not in LABELS_BY_PROMETHEUS:
                assert set(value.split("|")) <= offered[name][label], (query.where, label)


def test_nothing_that_the_page_says_of_the_boat_is_left_out(offered: dict[str, dict[str, set[str]]]) -> None:
    """Every metric has a place on the board, `_created` stamps of counters apart."""
    board = " ".join(query.expression for query in queries())
    assert {name for name in offered if not name.endswith("_created") and name not in board} == set()


def test_the_board_is_one_that_grafana_reads() -> None:
    panels = BOARD["panels"]
    assert len({panel["id"] for panel in panels}) == len(panels)
    assert all(panel["datasource"]["uid"] == "${datasource}" for panel in panels)
    cells = [
        (x, y)
        for panel in panels
        for place in [panel["gridPos"]]
        for x in range(place["x"], place["x"] + place["w"])
        for y in range(place["y"], place["y"] + place["h"])
    ]
    assert len(cells) == len(set(cells)), "no panel lies on another"
    assert max(x for x, _ in cells) < 24
    assert {variable["name"] for variable in BOARD["templating"]["list"]} == {"datasource", "instance"}


def test_every_alert_says_what_and_how_bad() -> None:
    for rule in RULES:
        assert rule["labels"]["severity"] in {"critical", "warning"}
        assert "$labels.instance" in rule["annotations"]["summary"]
        assert rule["annotations"]["description"]


@promtool
def test_promtool_takes_rules_and_every_query_of_the_board(tmp_path: Path) -> None:
    """What Grafana fills in is filled in; each query is then a rule that promtool parses."""
    filled = {"$instance": "boat:8043", "[$__range]": "[15m]", "[$__rate_interval]": "[1m]"}
    records = []
    for number, query in enumerate(query for query in queries() if "label_values" not in query.expression):
        expression = query.expression
        for name, value in filled.items():
            expression = expression.replace(name, value)
        records.append({"record": f"board:{number}", "expr": expression})
    made = tmp_path / "board.yml"
    made.write_text(yaml.safe_dump({"groups": [{"name": "board", "rules": records}]}))
    for words in (
        ["rules", str(FOLDER / "alerts.yml"), str(made)], ["config", "--syntax-only", str(FOLDER / "prometheus.yml")],
    ):  # fmt: skip
        done = subprocess.run(["promtool", "check", *words], capture_output=True, text=True, timeout=30, check=False)
        assert done.returncode == 0, done.stdout + done.stderr


@promtool
def test_alerts_fire_when_they_should_and_only_then(tmp_path: Path) -> None:
    """Prometheus evaluates the rules over series of a boat that is well for a minute, and then is not."""
    instance, none, stop = 'instance="b"', 'cause="none"', 'cause="emergency_stop"'
    series = {
        f'up{{job="paani",{instance}}}': "1+0x60",
        f"paani_armed{{{instance}}}": "1+0x60",
        f"paani_stopped{{{instance}}}": "0+0x11 1+0x48",
        f'paani_service_ready{{{instance},service="eye"}}': "1+0x11 0+0x48",
        f'paani_service_starts_total{{{instance},service="eye"}}': "1+0x11 2+0x48",
        f'paani_service_starts_total{{{instance},service="plant"}}': "0+0x11 1+0x48",  # its first start
        f"paani_thrust_zero_cause{{{instance},{none}}}": "1+0x11 0+0x48",
        f"paani_thrust_zero_cause{{{instance},{stop}}}": "0+0x11 1+0x48",
        f'paani_topic_age_seconds{{{instance},topic="camera/picture"}}': "0.2+0x11 9+0x48",
        f'paani_inhibit{{{instance},inhibit="UNHEALTHY_ODOMETRY"}}': "0+0x60",
    }
    wanted = {
        "PaaniStopped": {}, "PaaniProcessNotReady": {"service": "eye"}, "PaaniProcessRestarted": {"service": "eye"},
        "PaaniHeldByHardware": {"cause": "emergency_stop"},
        "PaaniPictureSilent": {"topic": "camera/picture"}, "PaaniArmedWithoutThrust": {},
        "PaaniPositionUnhealthy": None, "PaaniUnreachable": None,
    }  # fmt: skip
    tests = []
    for alert, labels in wanted.items():
        rule = next(rule for rule in RULES if rule["alert"] == alert)
        summary = rule["annotations"]["summary"].replace("{{ $labels.instance }}", "b")
        for name, value in (labels or {}).items():
            summary = summary.replace(f"{{{{ $labels.{name} }}}}", value)
        summary = summary.replace("{{ $value | humanizeDuration }}", "9s")
        fired = [
            {
                "exp_labels": {"instance": "b", "severity": rule["labels"]["severity"], **(labels or {})},
                "exp_annotations": {**rule["annotations"], "summary": summary},
            }
        ]
        tests += [
            {"eval_time": "55s", "alertname": alert, "exp_alerts": []},
            {"eval_time": "170s", "alertname": alert, "exp_alerts": [] if labels is None else fired},
        ]
    case = {"interval": "5s", "input_series": [{"series": s, "values": v} for s, v in series.items()]}
    made = tmp_path / "cases.yml"
    made.write_text(
        yaml.safe_dump(
            {
                "rule_files": [str(FOLDER / "alerts.yml")],
                "evaluation_interval": "5s",
                "tests": [{**case, "alert_rule_test": tests}],
            }
        )
    )
    done = subprocess.run(
        ["promtool", "test", "rules", str(made)], capture_output=True, text=True, timeout=30, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
