"""When data were measured, by the device's own clock. Pure.

Data that waited on the way, in a buffer or behind a broken network link, come in a piece and are old. The device's
clock tells: the shortest time that data ever took from there is taken for the way itself; what took longer has waited.
"""

CLOCK_DRIFT = 2e-4  # two cheap crystals differ by less; so fast the shortest way is forgotten
MAX_WAIT_S = 1.0  # what waited longer is of no use; `MAX_LAG_S` of the estimator
# Once all data were late for so long, it is not they that are late: a clock was set, as of a board that found its time.
RESET_S = 5.0


class ReceiptClock:
    """Turns the times of one device into ours."""

    def __init__(self) -> None:
        self._offset_us: float | None = None  # ours less the device's, of data that did not wait
        self._observed_us = self._late_since_us = 0

    def observe(self, device_us: int, now_us: int) -> None:
        """The newest data that have come are of this time by the device."""
        offset_us = float(now_us - device_us)
        if self._offset_us is None:
            self._offset_us = offset_us
        self._offset_us += min(CLOCK_DRIFT * (now_us - self._observed_us), offset_us - self._offset_us)
        self._observed_us = now_us
        if offset_us - self._offset_us <= MAX_WAIT_S * 1e6:
            self._late_since_us = 0
        elif not self._late_since_us:
            self._late_since_us = now_us
        elif now_us - self._late_since_us > RESET_S * 1e6:
            self._offset_us, self._late_since_us = offset_us, 0

    def date(self, device_us: int) -> int | None:
        """When data of this time were measured, plus the way itself; None for what waited too long."""
        assert self._offset_us is not None
        at_us = round(device_us + self._offset_us)
        return None if self._observed_us - at_us > MAX_WAIT_S * 1e6 else at_us
