"""The last gate before force (O1, O2): what it lets through, and what it refuses and why."""

import math

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paani.config import AdapterConfig
from paani.messages import Arming, Thrust, ZeroCause
from paani.thrust_adapter import AppliedThrust, InForce, ThrustAdapter, applied_message

NOW_US = 50_000_000
CONFIG = AdapterConfig()
ARMED = Arming(source_us=1, armed=True)


def thrust(**changes: object) -> Thrust:
    message = Thrust(
        source_us=1,
        left=0.02,
        right=0.04,
        enabled=True,
        echo_us=NOW_US - 100_000,
        seq=7,
        epoch=100,
        domain=43,
        producer="controller",
    )
    return msgspec.structs.replace(message, **changes)


def ready(config: AdapterConfig = CONFIG) -> ThrustAdapter:
    adapter = ThrustAdapter(config, domain=43)
    keep_alive(adapter, NOW_US)
    return adapter


def keep_alive(adapter: ThrustAdapter, now_us: int) -> None:
    adapter.receive_arming(ARMED, now_us)
    for service in CONFIG.require_pulses:
        adapter.receive_pulse(service, now_us)


def test_o1_force_is_75_n_per_unit() -> None:
    """O1: 75 N per normalised unit and fan."""
    adapter = ready()
    assert adapter.offer(thrust(), NOW_US) is ZeroCause.NONE
    applied = adapter.decide(NOW_US)
    assert (applied.left_n, applied.right_n) == pytest.approx((1.5, 3.0))
    assert (applied.left, applied.right, applied.zero_cause) == (0.02, 0.04, ZeroCause.NONE)


def test_o2_zero_half_a_second_after_the_last_command() -> None:
    """O2: watchdog 0.5 s; it ends by itself with the next command."""
    adapter = ready()
    adapter.offer(thrust(), NOW_US)
    for after_s, cause in ((0.5, ZeroCause.NONE), (0.501, ZeroCause.TIMEOUT)):
        now_us = NOW_US + round(after_s * 1e6)
        keep_alive(adapter, now_us)
        assert adapter.decide(now_us).zero_cause is cause
    later_us = NOW_US + 600_000
    adapter.offer(thrust(seq=8, echo_us=later_us - 50_000), later_us)
    assert adapter.decide(later_us).zero_cause is ZeroCause.NONE


def test_o2_a_refused_command_prolongs_nothing() -> None:
    adapter = ready()
    adapter.offer(thrust(), NOW_US)
    adapter.offer(thrust(producer="advisor", seq=8), NOW_US + 300_000)
    for after_us, right_n in ((500_000, 3.0), (500_001, 0.0)):
        keep_alive(adapter, NOW_US + after_us)
        assert adapter.decide(NOW_US + after_us).right_n == pytest.approx(right_n)


@pytest.mark.parametrize("timeout", ["timeout_s", "arming_timeout_s", "pulse_timeout_s", "max_echo_age_s"])
def test_a_timeout_ends_within_a_microsecond(timeout: str) -> None:
    long = dict.fromkeys(("timeout_s", "arming_timeout_s", "pulse_timeout_s", "max_echo_age_s"), 60.0)
    for after_us, passes in ((2_000_000, True), (2_000_001, False)):
        adapter = ready(msgspec.structs.replace(CONFIG, **(long | {timeout: 2.0})))
        adapter.offer(thrust(echo_us=NOW_US), NOW_US + after_us if timeout == "max_echo_age_s" else NOW_US)
        assert (adapter.decide(NOW_US + after_us).zero_cause is ZeroCause.NONE) is passes


def test_the_first_command_may_be_of_any_epoch() -> None:
    """At once after the start of the plant, and of its clock."""
    adapter = ThrustAdapter(CONFIG, domain=43)
    assert adapter.command is None
    assert adapter.offer(thrust(epoch=0, seq=0, echo_us=0), 1000) is ZeroCause.NONE


@pytest.mark.parametrize(
    ("changes", "cause"),
    [
        ({"producer": "advisor"}, ZeroCause.WRONG_PRODUCER),
        ({"producer": ""}, ZeroCause.WRONG_PRODUCER),
        ({"domain": 44}, ZeroCause.WRONG_DOMAIN),
        ({"epoch": 99, "seq": 900}, ZeroCause.OLD_EPOCH),
        ({"seq": 7}, ZeroCause.REPLAYED),
        ({"seq": 3}, ZeroCause.REPLAYED),
        ({"seq": 8, "echo_us": NOW_US + 1}, ZeroCause.FUTURE),
        ({"seq": 8, "echo_us": NOW_US - 500_001}, ZeroCause.STALE_ECHO),
        ({"seq": 8, "echo_us": 0}, ZeroCause.STALE_ECHO),
    ],
)
def test_refused_commands_leave_the_one_in_force(changes: dict[str, object], cause: ZeroCause) -> None:
    adapter = ready()
    adapter.offer(thrust(), NOW_US)
    assert adapter.offer(thrust(**changes), NOW_US) is cause
    assert adapter.rejected == 1
    assert adapter.decide(NOW_US).right == 0.04
    keep_alive(adapter, NOW_US + 600_000)
    assert adapter.decide(NOW_US + 600_000).zero_cause is cause


@pytest.mark.parametrize("fan", ["left", "right"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, -0.11, 1.01])
def test_invalid_thrust_stops_at_once(value: float, fan: str) -> None:
    adapter = ready()
    adapter.offer(thrust(), NOW_US)
    assert adapter.offer(thrust(seq=8, **{fan: value}), NOW_US) is ZeroCause.INVALID
    applied = adapter.decide(NOW_US)
    assert (applied.left_n, applied.right_n, applied.zero_cause) == (0.0, 0.0, ZeroCause.INVALID)
    adapter.offer(thrust(seq=9), NOW_US)
    assert adapter.decide(NOW_US).zero_cause is ZeroCause.NONE


@pytest.mark.parametrize(("astern", "cause"), [(0.10, ZeroCause.NONE), (0.0, ZeroCause.INVALID)])
def test_astern_as_far_as_the_hull_allows(astern: float, cause: ZeroCause) -> None:
    """With fans that only push, an order astern is out of range, and both stop."""
    adapter = ready(msgspec.structs.replace(CONFIG, astern=astern))
    assert adapter.offer(thrust(left=-0.10), NOW_US) is cause
    given = adapter.decide(NOW_US)
    assert (given.left_n, given.right_n) == pytest.approx((-7.5, 3.0) if astern else (0.0, 0.0))


def test_a_burst_of_delayed_commands_is_refused_whole() -> None:
    """Commands held up by a link for a second echo stamps a second old."""
    adapter = ready()
    now_us = NOW_US + 1_000_000
    keep_alive(adapter, now_us)
    burst = [adapter.offer(thrust(seq=10 + n), now_us) for n in range(20)]
    assert set(burst) == {ZeroCause.STALE_ECHO}
    assert adapter.decide(now_us).right_n == 0.0


def test_a_restarted_controller_begins_again() -> None:
    adapter = ready()
    adapter.offer(thrust(), NOW_US)
    assert adapter.offer(thrust(epoch=101, seq=0), NOW_US) is ZeroCause.NONE


def test_a_controller_that_began_after_its_clock_was_set_back_is_heard_once_every_command_before_is_stale() -> None:
    """Until then the order of epochs refuses what came before; from then on the echo does."""
    adapter = ready()
    adapter.offer(thrust(echo_us=NOW_US), NOW_US)
    for after_us, cause in ((500_000, ZeroCause.OLD_EPOCH), (500_001, ZeroCause.NONE)):
        now_us = NOW_US + after_us
        assert adapter.offer(thrust(epoch=5, seq=0, echo_us=now_us), now_us) is cause


@given(
    st.lists(
        st.tuples(st.integers(0, 700_000), st.integers(0, 500_000), st.integers(0, 3), st.booleans()), max_size=12
    ),
    st.data(),
)
def test_no_command_from_before_the_newest_is_ever_taken_again(
    steps: list[tuple[int, int, int, bool]], data: st.DataObject
) -> None:
    """Whatever order epochs came in, with whatever pauses: a copy of an earlier command moves nothing."""
    adapter, now_us, sent = ready(), NOW_US, [thrust(echo_us=NOW_US)]
    adapter.offer(sent[0], NOW_US)
    for seq, (pause_us, echo_age_us, epoch, is_replay) in enumerate(steps):
        now_us += pause_us
        if is_replay:
            assert adapter.offer(data.draw(st.sampled_from(sent)), now_us) is not ZeroCause.NONE
            continue
        command = thrust(epoch=98 + epoch, seq=8 + seq, echo_us=max(sent[-1].echo_us, now_us - echo_age_us))
        if adapter.offer(command, now_us) is ZeroCause.NONE:
            sent.append(command)


def test_disabled_command_is_accepted_and_gives_zero() -> None:
    adapter = ready()
    assert adapter.offer(thrust(enabled=False), NOW_US) is ZeroCause.NONE
    assert adapter.decide(NOW_US).zero_cause is ZeroCause.NOT_ENABLED


@pytest.mark.parametrize(
    "arming",
    [None, Arming(source_us=1, armed=False), Arming(source_us=1, armed=True, stopped=True)],
)
def test_no_force_without_arming(arming: Arming | None) -> None:
    adapter = ThrustAdapter(CONFIG, domain=43)
    for service in CONFIG.require_pulses:
        adapter.receive_pulse(service, NOW_US)
    if arming is not None:
        adapter.receive_arming(arming, NOW_US)
    adapter.offer(thrust(), NOW_US)
    assert adapter.decide(NOW_US).zero_cause is ZeroCause.NOT_ARMED
    assert not adapter.is_armed


def test_arming_must_be_repeated() -> None:
    adapter = ready()
    now_us = NOW_US + 500_001
    for service in CONFIG.require_pulses:
        adapter.receive_pulse(service, now_us)
    adapter.offer(thrust(echo_us=now_us), now_us)
    assert adapter.decide(now_us).zero_cause is ZeroCause.ARMING_LOST
    adapter.receive_arming(ARMED, now_us)
    assert adapter.decide(now_us).zero_cause is ZeroCause.NONE


def test_a_latched_stop_holds_while_everything_else_resumes() -> None:
    adapter = ready()
    adapter.receive_arming(Arming(source_us=1, armed=False, stopped=True), NOW_US)
    for n in range(20):
        now_us = NOW_US + n * 100_000
        for service in CONFIG.require_pulses:
            adapter.receive_pulse(service, now_us)
        adapter.offer(thrust(seq=8 + n, echo_us=now_us), now_us)
        assert adapter.decide(now_us).zero_cause is ZeroCause.NOT_ARMED


@pytest.mark.parametrize("silent", CONFIG.require_pulses)
def test_each_vital_process_must_send_pulses(silent: str) -> None:
    """A process that hangs for longer than 0.35 s stops the boat; its next beat frees it."""
    adapter = ready()
    now_us = NOW_US + 350_001
    adapter.receive_arming(ARMED, now_us)
    for service in CONFIG.require_pulses:
        if service != silent:
            adapter.receive_pulse(service, now_us)
    adapter.offer(thrust(echo_us=now_us), now_us)
    applied = adapter.decide(now_us)
    assert (applied.zero_cause, applied.lost_pulse) == (ZeroCause.PULSE_LOST, silent)
    assert applied.left_n == applied.right_n == 0.0
    adapter.receive_pulse(silent, now_us)
    assert adapter.decide(now_us).zero_cause is ZeroCause.NONE


def test_a_vital_process_without_pulse_keeps_the_boat_still() -> None:
    adapter = ThrustAdapter(CONFIG, domain=43)
    adapter.receive_arming(ARMED, NOW_US)
    adapter.offer(thrust(), NOW_US)
    applied = adapter.decide(NOW_US)
    assert (applied.zero_cause, applied.lost_pulse) == (ZeroCause.PULSE_LOST, CONFIG.require_pulses[0])


def test_no_command_means_no_thrust() -> None:
    assert ready().decide(NOW_US).zero_cause is ZeroCause.NO_COMMAND


FAN = st.floats(-0.10, 1.0) | st.floats(-0.10, 1.0) | st.floats(-2.0, 2.0) | st.floats()
MOSTLY_TRUE = st.sampled_from((True, True, True, False))
DOMAIN = st.sampled_from((43, 43, 43, 42, 44))
ECHO_AGE_US = st.integers(0, 500_000) | st.integers(-NOW_US, NOW_US)
PRODUCER_NAME = st.sampled_from(("controller", "controller", "controller", "advisor"))
MIN_WITH_FORCE = 30  # of the 400 commands tried: about a tenth pass every check


def test_force_is_always_within_limits() -> None:
    """B12, B15: whatever is ordered, the force of each fan is 75 N per unit of it where every check passes, else 0."""
    with_force = 0

    @settings(max_examples=400, derandomize=True, deadline=None)
    @given(FAN, FAN, MOSTLY_TRUE, ECHO_AGE_US, DOMAIN, PRODUCER_NAME)
    def offer(left: float, right: float, enabled: bool, age_us: int, domain: int, producer: str) -> None:
        nonlocal with_force
        adapter = ready()
        command = thrust(
            left=left, right=right, enabled=enabled, echo_us=NOW_US - age_us, domain=domain, producer=producer
        )
        adapter.offer(command, NOW_US)
        applied = adapter.decide(NOW_US)
        is_valid = all(-0.10 <= fan <= 1.0 for fan in (left, right)) and 0 <= age_us <= 500_000
        if is_valid and enabled and domain == 43 and producer == "controller":
            with_force += 1
            assert (applied.left_n, applied.right_n) == (75.0 * left, 75.0 * right)
        else:
            assert (applied.left_n, applied.right_n) == (0.0, 0.0)

    offer()
    assert with_force >= MIN_WITH_FORCE


def test_what_is_applied_is_told_with_the_command_behind_it() -> None:
    adapter = ready()
    in_force = InForce()
    in_force.advance(adapter.decide(NOW_US), adapter.command, 3)
    none = applied_message(adapter, adapter.decide(NOW_US), 5, in_force)
    assert (none.source_us, none.since_us, none.zero_cause) == (5, 3, ZeroCause.NO_COMMAND)
    assert (none.command_seq, none.command_sent_us, none.command_source_us, none.rejected) == (0, 0, 0, 0)
    adapter.offer(thrust(producer="advisor"), NOW_US)
    adapter.offer(thrust(sent_us=11, source_us=12), NOW_US)
    message = applied_message(adapter, adapter.decide(NOW_US), 5, in_force)
    assert (message.left, message.right, message.left_n, message.right_n) == pytest.approx((0.02, 0.04, 1.5, 3.0))
    assert (message.command_seq, message.command_sent_us, message.command_source_us, message.rejected) == (7, 11, 12, 1)
    assert (message.zero_cause, message.lost_pulse) == (ZeroCause.NONE, "")


def test_what_is_in_force_is_told_with_its_beginning_and_no_thrust_with_its_own() -> None:
    """A command of no thrust after a zero for a cause is another command in force, and the same zero."""
    ahead, still = thrust(), thrust(left=0.0, right=0.0)
    moving = AppliedThrust(0.02, 0.04, 1.5, 3.0, ZeroCause.NONE)
    commanded, timed_out = (AppliedThrust(0.0, 0.0, 0.0, 0.0, cause) for cause in (ZeroCause.NONE, ZeroCause.TIMEOUT))
    in_force, reported = InForce(), []
    for now_us, (applied, newest) in enumerate(
        [
            (timed_out, None),
            (moving, ahead),
            (moving, ahead),
            (timed_out, ahead),
            (timed_out, ahead),
            (commanded, still),
        ]
    ):
        in_force.advance(applied, newest, 10 + now_us)
        message = applied_message(ready(), applied, 99, in_force)
        reported.append((in_force.command, message.since_us, message.zero_since_us))
    assert reported == [(None, 10, 10), (ahead, 11, 0), (ahead, 11, 0), (None, 13, 13), (None, 13, 13), (still, 15, 13)]


def test_a_message_of_a_lost_pulse_names_the_process() -> None:
    adapter = ThrustAdapter(CONFIG, domain=43)
    adapter.receive_arming(ARMED, NOW_US)
    message = applied_message(adapter, adapter.decide(NOW_US), 5, InForce())
    assert (message.zero_cause, message.lost_pulse) == (ZeroCause.PULSE_LOST, CONFIG.require_pulses[0])


@pytest.mark.parametrize(("armed", "stopped"), [(True, False), (True, True), (False, False), (False, True)])
def test_armed_is_the_operators_newest_word(armed: bool, stopped: bool) -> None:
    adapter = ThrustAdapter(CONFIG, domain=43)
    assert (adapter.has_heard_operator, adapter.is_armed) == (False, False)
    adapter.receive_arming(Arming(source_us=1, armed=armed, stopped=stopped), NOW_US)
    assert (adapter.has_heard_operator, adapter.is_armed) == (True, armed and not stopped)


def at_age(gate: str, age_us: int) -> ThrustAdapter:
    """A ready adapter with a command, of which one thing alone is as old as this."""
    adapter, then_us = ThrustAdapter(CONFIG, domain=43), NOW_US - age_us
    adapter.receive_arming(ARMED, then_us if gate == "arming" else NOW_US)
    for service in CONFIG.require_pulses:
        adapter.receive_pulse(service, then_us if gate == service else NOW_US)
    received_us = then_us if gate == "command" else NOW_US
    adapter.offer(thrust(echo_us=then_us if gate == "echo" else received_us - 100_000), received_us)
    return adapter


@pytest.mark.parametrize(
    ("gate", "limit_s", "cause", "lost_pulse"),
    [
        ("arming", CONFIG.arming_timeout_s, ZeroCause.ARMING_LOST, ""),
        ("command", CONFIG.timeout_s, ZeroCause.TIMEOUT, ""),
        ("echo", CONFIG.max_echo_age_s, ZeroCause.STALE_ECHO, ""),
        *((service, CONFIG.pulse_timeout_s, ZeroCause.PULSE_LOST, service) for service in CONFIG.require_pulses),
    ],
)
def test_each_gate_holds_to_the_microsecond(gate: str, limit_s: float, cause: ZeroCause, lost_pulse: str) -> None:
    """What is as old as its limit still counts; a microsecond older is zero of both fans, named by its cause."""
    limit_us = round(limit_s * 1e6)
    assert at_age(gate, limit_us).decide(NOW_US) == AppliedThrust(0.02, 0.04, 1.5, 3.0, ZeroCause.NONE)
    assert at_age(gate, limit_us + 1).decide(NOW_US) == AppliedThrust(0.0, 0.0, 0.0, 0.0, cause, lost_pulse)


def test_each_zero_is_of_both_fans_and_has_its_cause_alone() -> None:
    assert ThrustAdapter(CONFIG, 43).decide(NOW_US) == AppliedThrust(0.0, 0.0, 0.0, 0.0, ZeroCause.NOT_ARMED)
    assert ready().decide(NOW_US) == AppliedThrust(0.0, 0.0, 0.0, 0.0, ZeroCause.NO_COMMAND)
    disabled = ready()
    disabled.offer(thrust(enabled=False), NOW_US)
    assert disabled.decide(NOW_US) == AppliedThrust(0.0, 0.0, 0.0, 0.0, ZeroCause.NOT_ENABLED)


@pytest.mark.parametrize(("left", "right"), [(1.0, -CONFIG.astern), (-CONFIG.astern, 1.0), (0.0, 0.0)])
def test_the_limits_themselves_are_allowed(left: float, right: float) -> None:
    assert ready().offer(thrust(left=left, right=right), NOW_US) is ZeroCause.NONE


def test_the_first_command_of_a_start_counts_and_each_refusal_is_counted() -> None:
    adapter = ready()
    assert adapter.offer(thrust(epoch=0, seq=0), NOW_US) is ZeroCause.NONE
    for refused in (1, 2, 3):
        assert adapter.offer(thrust(epoch=0, seq=0), NOW_US) is ZeroCause.REPLAYED
        assert adapter.rejected == refused
