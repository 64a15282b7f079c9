"""How long a lost line waits before it is opened again."""

from paani_services.sensors.backoff import Backoff


def test_each_try_in_vain_waits_twice_as_long_up_to_five_seconds() -> None:
    backoff = Backoff()
    assert [backoff.after(is_useful=False) for _ in range(7)] == [0.25, 0.5, 1.0, 2.0, 4.0, 5.0, 5.0]


def test_a_line_that_was_useful_is_tried_again_at_once() -> None:
    backoff = Backoff()
    for _ in range(5):
        backoff.after(is_useful=False)
    assert [backoff.after(is_useful=True), backoff.after(is_useful=False)] == [0.25, 0.5]
