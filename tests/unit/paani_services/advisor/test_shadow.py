"""Shadow tuning: what is tried never reaches the advice, and takes effect in two deliberate steps alone."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani import keys
from paani import messages as m
from paani.config import Config
from paani.config.tuning import FIXED, TUNABLE, setting_text
from paani.decider import Input, Inputs, Outputs
from paani_services.advisor.decide import DECIDER, DeciderState, decide
from tests.unit.paani_services.advisor.advisor_evidence import (
    BUOY_AHEAD,
    CLEAR,
    PAANI,
    T0_US,
    box,
    murky,
    seeing,
    water,
)

pytestmark = pytest.mark.slow

ACT, NO = m.TuningAct, m.TuningRefusal
LOWER = (m.Change(path="advisor.policy.center_block_risk", value="0.46"),)
PERIOD_US = 200_000
NEEDED = PAANI.advisor.tuning.min_frames
DISARMED, ARMED = m.Arming(source_us=0, armed=False), m.Arming(source_us=0, armed=True)
STREAM = [water(0.3, 0.47, 0.4), seeing(BUOY_AHEAD), CLEAR, water(0.6, 0.47, 0.6), water(0.1, 0.5, 0.3)]


class Boat:
    """Steps the advisor's decider on evidence, one distinct frame a step, and asks things of it.

    twice: compute each step again from the state as JSON, as a replay does.
    """

    def __init__(self, config: Config = PAANI, *, twice: bool = True) -> None:
        self.config, self.state, self.twice = config, DeciderState(), twice
        self.now_us, self.frame = T0_US, -1
        self.tuning, self.arming = Input(), Input()
        self.outputs: Outputs = {}
        self.requests = 0
        self.evidence: m.Evidence | None = None

    def ask(self, act: m.TuningAct, proposal: str, changes: tuple[m.Change, ...] = (), **header: int) -> m.Shadow:
        """Ask at once, on a repeat of the last evidence."""
        self.requests += 1
        request = m.Tuning(
            source_us=self.now_us, act=act, request=self.requests, proposal=proposal, changes=changes, epoch=7
        )
        self.tuning = Input(msgspec.structs.replace(request, **header), self.now_us)
        return self.step()

    def say(self, arming: m.Arming) -> None:
        self.arming = Input(arming, self.now_us)

    def see(self, frames: Iterable[m.Evidence]) -> list[m.Message]:
        """One step for each new frame; the advisories."""
        advice = []
        for frame in frames:
            self.frame += 1
            self.now_us += PERIOD_US
            self.evidence = msgspec.structs.replace(
                frame, source_us=self.now_us, frame_seq=self.frame, sent_us=self.now_us
            )
            if self.arming.message is not None:
                self.say(self.arming.message)
            self.step()
            advice.append(self.outputs[keys.ADVISORY.name])
        return advice

    def step(self) -> m.Shadow:
        inputs: Inputs = {
            keys.EVIDENCE.name: Input(self.evidence, self.now_us),
            keys.ODOMETRY.name: Input(),
            keys.TUNING.name: self.tuning,
            keys.ARMING.name: self.arming,
        }
        before = msgspec.json.encode(self.state)
        self.state, self.outputs = decide(self.state, inputs, self.now_us, self.config)
        if self.twice:
            again = decide(msgspec.json.decode(before, type=DeciderState), inputs, self.now_us, self.config)
            assert again == (self.state, self.outputs)
        return self.shadow

    @property
    def shadow(self) -> m.Shadow:
        shadow = self.outputs[keys.SHADOW.name]
        assert isinstance(shadow, m.Shadow)
        return shadow

    def promoted(self, changes: tuple[m.Change, ...] = LOWER, name: str = "a") -> m.Shadow:
        """Propose, try for as long as it takes, promote while disarmed."""
        self.ask(ACT.PROPOSE, name, changes)
        self.say(DISARMED)
        self.see(STREAM[i % len(STREAM)] for i in range(NEEDED))
        return self.ask(ACT.PROMOTE, name)


def stream(n: int) -> list[m.Evidence]:
    return [STREAM[i % len(STREAM)] for i in range(n)]


def test_advice_is_the_same_to_the_byte_with_and_without_a_shadow() -> None:
    plain, tuned = Boat(), Boat()
    tuned.ask(ACT.PROPOSE, "a", (*LOWER, m.Change(path="advisor.tracker.confirm_hits", value="1")))
    before = [msgspec.json.encode(advice) for advice in plain.see(stream(60))]
    beside = [msgspec.json.encode(advice) for advice in tuned.see(stream(60))]
    assert before == beside
    assert plain.outputs[keys.TRACKS.name] == tuned.outputs[keys.TRACKS.name]
    assert tuned.shadow.differing > 0


def test_disagreements_are_counted_and_named() -> None:
    boat = Boat()
    boat.see([CLEAR])
    assert boat.ask(ACT.PROPOSE, "a", LOWER).proposal == "a"
    boat.see([water(0.3, 0.47, 0.4), water(0.6, 0.47, 0.6), CLEAR, CLEAR])
    shadow = boat.step()  # a repeat is no frame
    assert (shadow.frames, shadow.differing, shadow.stops_more, shadow.moves_more) == (4, 3, 1, 0)
    assert shadow.differing_frac == 0.75
    first = shadow.recent[0]
    assert (first.frame_seq, first.active_direction, first.shadow_direction) == (1, "STRAIGHT", "LEFT")
    assert (first.active_reason, first.shadow_reason) == ("CENTER_CLEAR", "CENTER_RISK")
    assert [found.shadow_direction for found in shadow.recent] == ["LEFT", "STOP", "LEFT"]

    boat = Boat()
    boat.ask(ACT.PROPOSE, "b", (m.Change(path="advisor.policy.side_block_risk", value="0.7"),))
    boat.see([msgspec.structs.replace(CLEAR, left=murky(0.6), center=murky(0.6), right=murky(0.6))] * 20)
    assert (boat.shadow.moves_more, boat.shadow.stops_more, len(boat.shadow.recent)) == (20, 0, 8)


def test_after_promotion_the_advice_is_what_the_shadow_gave() -> None:
    boat, reference = Boat(), Boat(msgspec.convert(_with(center_block_risk=0.46), Config))
    assert boat.promoted().active == "a"
    reference.see(stream(NEEDED))
    assert _directions(boat.see(stream(40))) == _directions(reference.see(stream(40)))
    advisory = boat.outputs[keys.ADVISORY.name]
    assert isinstance(advisory, m.Advisory)
    assert advisory.center_block_risk == 0.46  # the page shows the limit in force
    assert boat.shadow.proposal == ""


def test_one_step_back() -> None:
    boat = Boat()
    boat.promoted()
    second = (m.Change(path="advisor.policy.side_block_risk", value="0.55"),)
    shadow = boat.promoted(second, "b")
    assert [(c.path[15:], c.value) for c in shadow.active_changes] == [
        ("center_block_risk", "0.46"), ("side_block_risk", "0.55"),
    ]  # fmt: skip
    assert boat.ask(ACT.ROLLBACK, "a").refusal is NO.NOT_CURRENT
    shadow = boat.ask(ACT.ROLLBACK, "b")
    assert (shadow.refusal, shadow.active, shadow.active_changes, shadow.previous) == (NO.NONE, "a", LOWER, False)
    assert boat.ask(ACT.ROLLBACK, "a").refusal is NO.NOT_CURRENT  # one step, no more

    boat = Boat()
    boat.promoted()
    assert boat.ask(ACT.ROLLBACK, "a").active == ""
    plain = Boat()
    plain.see(stream(NEEDED))
    assert _directions(boat.see(stream(40))) == _directions(plain.see(stream(40)))


def test_a_trial_may_be_dropped_at_any_time() -> None:
    boat = Boat()
    boat.say(ARMED)
    boat.ask(ACT.PROPOSE, "a", LOWER)
    shadow = boat.ask(ACT.ROLLBACK, "a")
    assert (shadow.refusal, shadow.proposal, shadow.frames) == (NO.NONE, "", 0)


def test_nothing_changes_while_the_boat_is_armed() -> None:
    """A promotion may let the boat move where it stopped before, so it wants an arming of its own afterwards."""
    boat = Boat()
    boat.ask(ACT.PROPOSE, "a", LOWER)
    boat.see(stream(NEEDED))
    assert boat.ask(ACT.PROMOTE, "a").refusal is NO.ARMING_UNKNOWN
    boat.say(ARMED)
    assert boat.ask(ACT.PROMOTE, "a").refusal is NO.ARMED
    boat.say(DISARMED)
    boat.now_us += round(keys.ARMING.fresh_s * 1e6) + 1
    assert boat.ask(ACT.PROMOTE, "a").refusal is NO.ARMING_UNKNOWN  # an old word is none
    assert boat.shadow.active == ""
    boat.say(DISARMED)
    assert boat.ask(ACT.PROMOTE, "a").active == "a"
    boat.say(ARMED)
    assert boat.ask(ACT.ROLLBACK, "a").refusal is NO.ARMED
    assert boat.shadow.active == "a"


def test_promotion_wants_the_proposal_of_now_tried_long_enough() -> None:
    boat = Boat()
    boat.say(DISARMED)
    assert boat.ask(ACT.PROMOTE, "a").refusal is NO.NOT_CURRENT
    boat.ask(ACT.PROPOSE, "a", LOWER)
    boat.see(stream(NEEDED - 1))
    assert boat.ask(ACT.PROMOTE, "a").refusal is NO.TOO_FEW_FRAMES
    for _ in range(5):
        boat.step()  # repeats do not make up for frames
    assert boat.ask(ACT.PROMOTE, "a").refusal is NO.TOO_FEW_FRAMES
    boat.see([CLEAR])
    assert boat.ask(ACT.PROMOTE, "b").refusal is NO.NOT_CURRENT
    late = boat.now_us - round(PAANI.advisor.tuning.max_request_age_s * 1e6) - 1
    assert boat.ask(ACT.PROMOTE, "a", source_us=late).refusal is NO.STALE_REQUEST
    boat.ask(ACT.PROPOSE, "c", LOWER)  # begins to count again
    assert (boat.shadow.frames, boat.ask(ACT.PROMOTE, "c").refusal) == (0, NO.TOO_FEW_FRAMES)
    boat.see(stream(NEEDED))
    boat.now_us += 3_600_000_000
    boat.say(DISARMED)
    assert boat.ask(ACT.PROMOTE, "c").refusal is NO.STALE_PROPOSAL
    assert (boat.shadow.active, boat.shadow.refused) == ("", 7)


def test_a_request_is_obeyed_once_however_often_it_is_heard() -> None:
    boat = Boat()
    boat.promoted()
    boat.see(stream(10))  # the promotion is repeated on the bus all the while
    assert (boat.shadow.refused, boat.shadow.active) == (0, "a")
    promotion = boat.tuning
    boat.ask(ACT.ROLLBACK, "a")
    boat.tuning = promotion  # an older request, heard again
    assert boat.step().active == ""
    assert boat.ask(ACT.PROPOSE, "b", LOWER, epoch=8, request=1).proposal == "b"  # the dashboard restarted


def test_a_restart_is_back_at_the_configuration() -> None:
    """The promotion is still repeated on the bus; the advisor that starts anew refuses it."""
    boat = Boat()
    boat.promoted()
    boat.state = DeciderState()
    assert (boat.step().active, boat.shadow.refusal) == ("", NO.NOT_CURRENT)
    boat.ask(ACT.PROPOSE, "b", LOWER)
    boat.state = DeciderState()
    assert (boat.step().active, boat.shadow.proposal) == ("", "b")  # a trial goes on, counted from nothing


@pytest.mark.parametrize(
    ("path", "value", "refusal"),
    [
        ("advisor.policy.center_block_risk", "nan", NO.INVALID_VALUE),
        ("advisor.policy.center_block_risk", "inf", NO.INVALID_VALUE),
        ("advisor.policy.center_block_risk", "1e999", NO.INVALID_VALUE),
        ("advisor.policy.center_block_risk", "1.1", NO.INVALID_VALUE),
        ("advisor.policy.center_block_risk", "-0.1", NO.INVALID_VALUE),
        ("advisor.policy.center_block_risk", "low", NO.INVALID_VALUE),
        ("advisor.policy.center_block_risk", "", NO.INVALID_VALUE),
        ("advisor.policy.center_block_risk", "[0.4]", NO.INVALID_VALUE),
        ("advisor.policy.core_left", "0.6", NO.INVALID_VALUE),  # contradicts core_right
        ("advisor.tracker.confirm_hits", "2.5", NO.INVALID_VALUE),
        ("advisor.policy", "{}", NO.NOT_TUNABLE),
        ("advisor.policy.center", "0.4", NO.NOT_TUNABLE),
        ("advisor.evidence_max_age_s", "60", NO.NOT_TUNABLE),
        ("advisor.tuning.min_frames", "1", NO.NOT_TUNABLE),
        ("advisor.tracker.max_tracks", "9999", NO.NOT_TUNABLE),
        ("perception.image_quality.enabled", "false", NO.NOT_TUNABLE),
        ("", "1", NO.NOT_TUNABLE),
        ("=", "=", NO.NOT_TUNABLE),
    ],
)
def test_a_bad_proposal_is_refused_and_counted(path: str, value: str, refusal: m.TuningRefusal) -> None:
    boat = Boat()
    shadow = boat.ask(ACT.PROPOSE, "a", (m.Change(path=path, value=value),))
    assert (shadow.refusal, shadow.refused_path, shadow.refused, shadow.proposal) == (refusal, path, 1, "")


@pytest.mark.parametrize(
    "change",
    [
        '{"path":"advisor.policy.tie","value":"0.1\\n[x]"}',
        '{"path":"a b","value":"1"}',
        '{"path":"advisor.policy.tie"}',
    ],
)
def test_what_is_no_setting_never_leaves_the_bus(change: str) -> None:
    with pytest.raises(msgspec.ValidationError):
        msgspec.json.decode(f'{{"source_us":1,"act":"PROPOSE","proposal":"a","changes":[{change}]}}', type=m.Tuning)


def test_an_empty_or_doubled_proposal_is_refused() -> None:
    boat = Boat()
    assert boat.ask(ACT.PROPOSE, "a").refusal is NO.EMPTY
    assert boat.ask(ACT.PROPOSE, "", LOWER).refusal is NO.EMPTY
    assert boat.ask(ACT.PROPOSE, "a", LOWER * 2).refusal is NO.TWICE
    both = tuple(m.Change(path=f"advisor.policy.core_{s}", value=v) for s, v in (("left", "0.6"), ("right", "0.7")))
    assert boat.ask(ACT.PROPOSE, "a", both).refusal is NO.NONE  # together they do not contradict


def test_a_refused_proposal_leaves_the_trial_alone() -> None:
    boat = Boat()
    boat.ask(ACT.PROPOSE, "a", LOWER)
    boat.see(stream(3))
    shadow = boat.ask(ACT.PROPOSE, "b", (m.Change(path="advisor.policy.tie", value="nan"),))
    assert (shadow.proposal, shadow.frames, shadow.changes) == ("a", 3, LOWER)


def test_what_may_be_tried() -> None:
    """Every setting of the four sections, but those that bound the work; each can be written as it stands."""
    assert {path.split(".")[1] for path in TUNABLE} == {"policy", "risk", "tracker", "motion"}
    assert not FIXED & TUNABLE
    for path in sorted(TUNABLE):
        boat = Boat()
        value = setting_text(PAANI.advisor, path)
        assert boat.ask(ACT.PROPOSE, "a", (m.Change(path=path, value=value),)).refusal is NO.NONE, path
        boat.see(stream(5))
        assert boat.shadow.differing == 0


texts = st.text(max_size=40) | st.sampled_from(["0", "1", "0.5", "true", "1e-300", "1e9", "0.999", "3", "[1]", "{}"])
acts = st.tuples(
    st.sampled_from(list(ACT)),
    st.sampled_from(["", "a", "b"]),
    st.lists(st.tuples(st.sampled_from(sorted(TUNABLE)) | st.text(max_size=20), texts), max_size=4),
)


@settings(max_examples=40, deadline=None)
@given(asked=st.lists(acts, min_size=1, max_size=6), armed=st.booleans())
def test_no_request_stops_the_advisor_or_moves_the_advice(
    asked: list[tuple[m.TuningAct, str, list[tuple[str, str]]]], armed: bool
) -> None:
    """Whatever comes from the bus: bounded, total, and without a promotion the advice is the plain advisor's."""
    boat, plain = Boat(), Boat()
    boat.say(ARMED if armed else DISARMED)
    for act, proposal, pairs in asked:
        boat.ask(act, proposal, tuple(m.Change(path=p, value=v) for p, v in pairs))
        assert msgspec.json.encode(boat.see(stream(4))) == msgspec.json.encode(plain.see(stream(4)))
    assert DECIDER.state() == DeciderState()


def test_no_admissible_value_stops_the_advisor() -> None:
    """A box that grows, shrinks and jumps, judged with each setting at the ends of its range."""
    sizes = (0.1, 0.12, 0.15, 0.3, 0.0, 0.2)
    seen = [seeing(box(m.Label.BUOY, (0.45 - s, 0.5 - s, 0.55 + s, 0.6 + s))) for s in sizes]
    accepted = 0
    for path in sorted(TUNABLE):
        is_switch = setting_text(PAANI.advisor, path) in {"true", "false"}
        for value in ("true", "false") if is_switch else ("0", "1", "5e-324", "1e9"):
            boat = Boat(twice=False)
            boat.ask(ACT.PROPOSE, "a", (m.Change(path=path, value=value),))
            boat.see(seen)
            accepted += boat.shadow.frames == len(sizes)
    assert accepted > 2 * len(TUNABLE)


def _with(**policy: float) -> dict[str, object]:
    tree: dict[str, object] = msgspec.to_builtins(PAANI)
    advisor = tree["advisor"]
    assert isinstance(advisor, dict)
    advisor["policy"] |= policy
    return tree


def _directions(advice: list[m.Message]) -> list[m.Direction]:
    return [given.direction for given in advice if isinstance(given, m.Advisory)]
