"""One recorded decision, told: everything in the story is what the log holds."""

from __future__ import annotations

import datetime
import itertools
import math
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest

from paani import cli, keys
from paani import messages as m
from paani.logs import protobuf
from paani.logs.reader import Record, open_log
from paani_tools.explain.command import time_us
from paani_tools.explain.moment import last_change_us, moment_at
from paani_tools.explain.narrative import narrative_of
from tests.unit.paani_tools.replay.recorded_drive import CONFIG, T0_US, drive, write_log

DRIVE = drive(16.0)
ADVISORIES = [(r.log_us, msgspec.json.decode(r.data, type=m.Advisory)) for r in DRIVE if r.topic == keys.ADVISORY.name]


def paani(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    code = cli.main([str(word) for word in words])
    out, errors = capsys.readouterr()
    return code, out, errors


def pictures(records: list[Record]) -> list[Record]:
    """A grey picture and its mask for every piece of evidence, recorded as the recorder does."""
    found = []
    for record in records:
        if record.topic == keys.EVIDENCE.name:
            seen = msgspec.json.decode(record.data, type=m.Evidence)
            for topic, image in (
                (keys.PICTURE, np.full((240, 320, 3), 90, np.uint8)),
                (keys.MASK, np.zeros((64, 80), np.uint8)),
            ):
                media = ".jpg" if topic is keys.PICTURE else ".png"
                data = cv2.imencode(media, image)[1].tobytes()
                header = m.PictureHeader(
                    source_us=seen.source_us, frame_seq=seen.frame_seq, frame_epoch=seen.frame_epoch,
                    width_px=320, height_px=240,
                )  # fmt: skip
                packed = protobuf.encode("foxglove.CompressedImage", {"data": data, "format": media[1:]})
                found.append(Record(topic.name, record.log_us, seen.frame_seq, packed))
                found.append(Record(topic.name + "/header", record.log_us, seen.frame_seq, msgspec.json.encode(header)))
    return found


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    records = sorted([*DRIVE, *pictures(DRIVE)], key=lambda r: r.log_us)
    return write_log(tmp_path_factory.mktemp("explain") / "drive.mcap", records)


def last_change() -> tuple[int, m.Advisory]:
    changes = [
        (at, now) for (_, before), (at, now) in itertools.pairwise(ADVISORIES) if before.direction is not now.direction
    ]
    return changes[-1]


@pytest.mark.slow
def test_by_default_the_last_change_of_direction_is_told(capsys: pytest.CaptureFixture[str], log: Path) -> None:
    at_us, advisory = last_change()
    assert last_change_us(open_log(log)) == at_us
    code, out, errors = paani(capsys, "explain", log)
    assert (code, errors) == (0, "")
    assert f"{(at_us - open_log(log).start_us) * 1e-6:.1f} s: {advisory.direction} ({advisory.reason})" in out
    assert advisory.explanation in out
    assert datetime.datetime.fromtimestamp(at_us * 1e-6, tz=datetime.UTC).strftime("%Y-%m-%d %H:%M:%S") in out


@pytest.mark.slow
def test_the_order_names_the_tracks_that_it_was_planned_for(log: Path) -> None:
    """By the labels and numbers of the tracks; one that is tracked no more by its number alone."""
    moment = moment_at(open_log(log), T0_US + 8_000_000)
    assert "planned for" not in narrative_of(moment, CONFIG)
    assert moment.order is not None
    assert moment.tracks is not None
    track = moment.tracks.tracks[0]
    order = msgspec.structs.replace(moment.order, obstacle_track_ids=(track.id, 99))
    printed = narrative_of(msgspec.structs.replace(moment, order=order), CONFIG)
    assert f"planned for {track.label} #{track.id}, track #99" in printed


def test_the_order_tells_the_encounter_that_it_is_for(log: Path) -> None:
    """In the navigator's own words, with the closest point of approach of every obstacle that has one."""
    moment = moment_at(open_log(log), T0_US + 8_000_000)
    obstacle = m.MovingObstacle(track_id=99, x_m=1.0, y_m=2.0, radius_m=0.3, east_mps=0.5, north_mps=0.0)
    close = msgspec.structs.replace(obstacle, cpa_m=1.25, cpa_std_m=0.5, tcpa_s=6.0)
    words = "Give way: vessel #99 crossing from starboard, passing astern of it"
    ahead = m.Prediction(source_us=1, obstacles=(close, obstacle), courtesy=words)
    printed = narrative_of(msgspec.structs.replace(moment, prediction=ahead), CONFIG)
    assert f"{words}\n{' ' * 12}track #99 nearest in 6.0 s: 1.2 m, +- 0.5 m\n" in printed
    assert printed.count("nearest in") == 1
    assert "nearest in" not in narrative_of(msgspec.structs.replace(moment, prediction=None), CONFIG)


@pytest.mark.parametrize(
    ("soundings", "depth_m", "words"),
    [
        (m.SoundingStatus.OK, 1.234, "depth 1.23 m\n"),
        (m.SoundingStatus.FROZEN, 1.234, "depth 1.23 m, sonar frozen\n"),
        (m.SoundingStatus.NO_ECHO, 0.0, "no depth yet, sonar no echo\n"),
    ],
)
def test_the_order_tells_the_depth_and_what_is_wrong_with_the_sonar(
    log: Path, soundings: m.SoundingStatus, depth_m: float, words: str
) -> None:
    moment = moment_at(open_log(log), T0_US + 8_000_000)
    ahead = m.Prediction(source_us=1, soundings=soundings, depth_m=depth_m)
    assert f" {words}" in narrative_of(msgspec.structs.replace(moment, prediction=ahead), CONFIG) + "\n"
    silent = msgspec.structs.replace(ahead, soundings=m.SoundingStatus.OFF)
    assert "sonar" not in narrative_of(msgspec.structs.replace(moment, prediction=silent), CONFIG)


@pytest.mark.slow
def test_headings_that_were_not_taken_are_told_with_why(log: Path) -> None:
    """From port to starboard, neighbours alike together; the costs of the cheapest by name."""
    wall, free = m.Constraint.STATIC_OBSTACLE, m.Constraint.NONE
    cheap = m.HeadingCosts(0.25, 0.0, 0.125, 0.0, 0.0, 0.0, 0.0, 0.0)
    dear = msgspec.structs.replace(cheap, margin=2.0)
    headings = tuple(
        m.HeadingVerdict(heading_rad=math.radians(yaw_deg), refused_by=refused_by, speed_mps=speed_mps, costs=costs)
        for yaw_deg, refused_by, speed_mps, costs in (
            (90.0, (wall, wall, m.Constraint.TURN), 0.0, msgspec.UNSET),
            (100.0, (wall, wall, m.Constraint.TURN), 0.0, msgspec.UNSET),
            (80.0, (wall, free, wall), 0.3, dear),
            (70.0, (free, free, free), 0.6, cheap),
        )
    )
    moment = moment_at(open_log(log), T0_US + 8_000_000)
    ahead = m.Prediction(source_us=1, headings=headings)
    printed = narrative_of(msgspec.structs.replace(moment, prediction=ahead), CONFIG)
    lines = [line.strip() for line in printed.splitlines()]
    at = lines.index("350 to 000 deg refused: static obstacle, turn")
    assert lines[at + 1 : at + 4] == [
        "010 deg free at 0.30 m/s",
        "020 deg free at 0.60 m/s",
        "cheapest 020 deg, cost 0.38: course 0.25, heading change 0.12",
    ]


@pytest.mark.slow
def test_the_newest_prediction_by_then_is_told_unless_it_is_old(tmp_path: Path) -> None:
    at_us = T0_US + 8_000_000
    put = [
        Record(keys.PREDICTION.name, at_us + off_us, k, msgspec.json.encode(m.Prediction(source_us=1, courtesy=str(k))))
        for k, off_us in enumerate((-9_000_000, -1_500_000, -500_000, 500_000))
    ]
    for kept, courtesy in ((put, "2"), (put[:1], None)):
        log = write_log(tmp_path / f"{courtesy}.mcap", sorted([*DRIVE, *kept], key=lambda record: record.log_us))
        prediction = moment_at(open_log(log), at_us).prediction
        assert (prediction.courtesy if prediction else None) == courtesy


def test_the_chain_is_followed_to_what_this_advice_became(log: Path) -> None:
    moment = moment_at(open_log(log), T0_US + 8_000_000)
    advisory = moment.advisory
    assert advisory == [a for at, a in ADVISORIES if at <= T0_US + 8_000_000][-1]
    assert moment.evidence is not None
    assert (moment.evidence.frame_seq, moment.evidence.sent_us) == (advisory.frame_seq, advisory.evidence_sent_us)
    assert moment.tracks is not None
    assert moment.tracks.frame_seq == advisory.frame_seq
    assert moment.order is not None
    assert moment.order.advisory_sent_us == advisory.sent_us
    assert moment.thrust is not None
    assert moment.thrust.command_sent_us == moment.order.sent_us


def test_lanes_carry_their_numbers_and_thresholds(capsys: pytest.CaptureFixture[str], log: Path) -> None:
    at_us, advisory = next((at, a) for at, a in ADVISORIES if a.direction is m.Direction.LEFT)
    _, out, _ = paani(capsys, "explain", log, "--at", f"{(at_us - open_log(log).start_us) * 1e-6 + 0.001:.3f}")
    for lane in (advisory.left, advisory.center, advisory.right):
        sign = ">=" if lane.risk >= lane.limit else "<"
        assert f"risk {lane.risk:.2f} {sign} {lane.limit:.2f} {'blocked' if lane.blocked else 'free'}" in out
        assert f"0.55 x {lane.non_water:.2f} not water" in out
    assert "LEFT" in out
    assert "steer " in out


@pytest.mark.parametrize(
    ("held", "text"),
    [
        (
            {"enable": False, "inhibits": (m.Inhibit.NOT_ARMED, m.Inhibit.NO_CLOCK)},
            "holds the boat: not armed, no clock",
        ),
        (
            {"speed_mps": 0.0, "vetoes": (m.Inhibit.ADVISED_STOP,), "keeps_station": True},
            "keeps the boat where it is: advised stop",
        ),
    ],
)
@pytest.mark.slow
def test_a_boat_that_is_held_says_why(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, held: dict[str, object], text: str
) -> None:
    stopped = []
    for record in DRIVE:
        data = record.data
        if record.topic == keys.COMMAND.name:
            order = msgspec.json.decode(data, type=m.NavCommand)
            data = msgspec.json.encode(msgspec.structs.replace(order, **held))
        stopped.append(record._replace(data=data))
    applied = m.ThrustApplied(
        source_us=T0_US, left=0, right=0, left_n=0, right_n=0, zero_cause=m.ZeroCause.PULSE_LOST, lost_pulse="eye"
    )
    stopped.append(Record(keys.THRUST_APPLIED.name, T0_US + 8_500_000, 0, msgspec.json.encode(applied)))
    _, out, _ = paani(capsys, "explain", write_log(tmp_path / "a.mcap", stopped), "--at", "8")
    assert text in out
    assert "applies zero: pulse lost (eye)" in out


def test_thrust_that_another_order_gave_is_not_that_of_this_one(tmp_path: Path) -> None:
    applied = m.ThrustApplied(
        source_us=T0_US, left=0.1, right=0.1, left_n=7.5, right_n=7.5, zero_cause=m.ZeroCause.NONE, command_sent_us=1
    )
    other = Record(keys.THRUST_APPLIED.name, T0_US + 8_500_000, 0, msgspec.json.encode(applied))
    assert moment_at(open_log(write_log(tmp_path / "a.mcap", [*DRIVE, other])), T0_US + 8_000_000).applied is None


@pytest.mark.slow
def test_the_picture_is_drawn(capsys: pytest.CaptureFixture[str], log: Path, tmp_path: Path) -> None:
    out = tmp_path / "p.png"
    code, _, _ = paani(capsys, "explain", log, "--at", "8", "--picture", out)
    assert code == 0
    picture = cv2.imread(str(out))
    assert picture is not None
    assert picture.shape[1] == 800
    assert list(tmp_path.iterdir()) == [out]


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("--at", "900"), "no advice at 900.0 s"),
        (("--at", "-1"), "--at -1"),
        (("--at", "soon"), "--at soon"),
        (("--picture", "p.gif"), "--picture p.gif"),
        (("--picture", "no/such/p.png"), "--picture no/such/p.png"),
    ],
)
@pytest.mark.slow
def test_a_mistake_is_one_line(
    capsys: pytest.CaptureFixture[str], log: Path, words: tuple[str, ...], named: str
) -> None:
    code, _, errors = paani(capsys, "explain", log, *words)
    assert code == 2
    assert len(errors.splitlines()) == 1
    assert named in errors


@pytest.mark.slow
def test_what_the_log_has_not_is_said(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    only = write_log(tmp_path / "a.mcap", [r for r in DRIVE if r.topic == keys.ADVISORY.name])
    code, out, _ = paani(capsys, "explain", only)
    assert code == 0
    assert "what was seen in it is not in the log" in out
    assert "no order on this advice in the log" in out
    code, _, errors = paani(capsys, "explain", only, "--picture", tmp_path / "p.png")
    assert (code, "the picture of this decision is not in it" in errors) == (2, True)
    none = write_log(tmp_path / "b.mcap", [r for r in DRIVE if r.topic == keys.THRUST.name], CONFIG)
    code, _, errors = paani(capsys, "explain", none)
    assert (code, "no advice in it" in errors) == (2, True)


def test_times_are_seconds_or_utc(log: Path) -> None:
    opened = open_log(log)
    start = datetime.datetime.fromtimestamp(opened.start_us * 1e-6, tz=datetime.UTC)
    later = start + datetime.timedelta(seconds=5)
    whole = round(later.timestamp()) * 1_000_000
    assert time_us("5.5", opened) == opened.start_us + 5_500_000
    assert abs(time_us(later.strftime("%H:%M:%S"), opened) - whole) <= 1_000_000
    assert abs(time_us(later.strftime("%Y-%m-%dT%H:%M:%SZ"), opened) - whole) <= 1_000_000
    there = later.astimezone(datetime.timezone(datetime.timedelta(hours=1)))
    assert abs(time_us(there.strftime("%H:%M:%S+01:00"), opened) - whole) <= 1_000_000
    earlier = start - datetime.timedelta(hours=1)
    assert time_us(earlier.strftime("%H:%M:%S"), opened) > opened.end_us  # after midnight
