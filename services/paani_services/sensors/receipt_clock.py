"""When data were measured, by the device's own clock. Pure.

Data that waited on the way, in a buffer or behind a broken network link, come in a piece and are old. The device's
clock tells: the shortest time that data ever took from there is taken for the way itself; what took longer has waited.
A way that has become longer for all data is no way: our clock is one that is never set, and for a device's that was, a
clock is made anew.
"""

CLOCK_DRIFT = 2e-4  # two cheap crystals differ by less; so fast the shortest way is forgotten
MAX_WAIT_S = 1.0  # what waited longer is of no use; `MAX_LAG_S` of the estimator


class ReceiptClock:
    """Turns the times of one device into ours."""

    def __init__(self) -> None:
        self._offset_us: float | None = None  # ours less the device's, of data that did not wait
        self._observed_us = 0

    def observe(self, device_us: int, now_us: int) -> None:
        """The newest data that have come are of this time by the device."""
        offset_us = float(now_us - device_us)
        if self._offset_us is None:
            self._offset_us = offset_us
        self._offset_us += min(CLOCK_DRIFT * (now_us - self._observed_us), offset_us - self._offset_us)
        self._observed_us = now_us

    def date(self, device_us: int) -> int | None:
        """When data of this time were measured, plus the way itself; None for what waited too long."""
        assert self._offset_us is not None
        at_us = round(device_us + self._offset_us)
        return None if self._observed_us - at_us > MAX_WAIT_S * 1e6 else at_us
