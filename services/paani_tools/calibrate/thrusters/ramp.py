"""A pulse that leaves rest slowly while a key is held, and what follows from where a thruster began to turn. Pure."""

from __future__ import annotations

from paani.config import EscConfig
from paani.errors import UserError

# Between two repeats of a held key. Keyboards repeat at 10 Hz or more, after 0.25 to 0.7 s.
RELEASED_S = 0.25
FIRST_REPEAT_S = 0.8
RATE_US_PER_S = 20.0  # who lets go within 0.3 s is 6 us late
MAX_OFFSET_US = 250.0  # a trim and a deadband as large as may be set lie 300 apart; what begins later is no controller
MAX_TRIM_US, MAX_DEADBAND_US = 200, 100


class DeadMan:
    """Whether a key is held: it repeats. A single press is none, and neither is the time before the first repeat."""

    def __init__(self) -> None:
        self._pressed_s: float | None = None
        self._is_repeating = False

    def press(self, now_s: float) -> None:
        """The key was sent, pressed or repeated."""
        since_s = None if self._pressed_s is None else now_s - self._pressed_s
        patience_s = RELEASED_S if self._is_repeating else FIRST_REPEAT_S
        self._is_repeating = since_s is not None and since_s <= patience_s
        self._pressed_s = now_s

    def is_held(self, now_s: float) -> bool:
        return self._is_repeating and self._pressed_s is not None and now_s - self._pressed_s <= RELEASED_S


class Ramp:
    """How far the pulse is from rest; it grows while the thruster is driven, to full thrust at most."""

    def __init__(self, span_us: float) -> None:
        self._most_us = min(MAX_OFFSET_US, span_us)
        self.offset_us = 0.0
        self._marked_us = 0.0

    def mark(self) -> None:
        """The key was sent: until here it was held."""
        self._marked_us = self.offset_us

    def release(self) -> None:
        """Back to where the key was last sent; what came after is how long it takes to see that it was let go."""
        self.offset_us = self._marked_us

    def advance(self, elapsed_s: float) -> None:
        self.offset_us = min(self._most_us, self.offset_us + RATE_US_PER_S * elapsed_s)

    def restart(self) -> None:
        self.offset_us = self._marked_us = 0.0


def fit_esc(side: str, longer_us: float, shorter_us: float, *, is_reversed: bool) -> EscConfig:
    """The settings of a side that began to turn so far from the neutral pulse, to both sides of it.

    Raises UserError for what no setting holds.
    """
    trim_us, deadband_us = round((longer_us - shorter_us) / 2), round((longer_us + shorter_us) / 2)
    found = f"{side}: began to turn {longer_us:.0f} us above and {shorter_us:.0f} us below the neutral pulse"
    if abs(trim_us) > MAX_TRIM_US:
        raise UserError(f"{found}: a trim of {trim_us} us, more than {MAX_TRIM_US} (thrusters.neutral_us)")
    if deadband_us > MAX_DEADBAND_US:
        raise UserError(f"{found}: a deadband of {deadband_us} us, more than {MAX_DEADBAND_US}")
    return EscConfig(reversed=is_reversed, trim_us=trim_us, deadband_us=deadband_us)


def settings_toml(line: str, neutral_us: int, span_us: int, left: EscConfig, right: EscConfig) -> str:
    """The section as TOML, for `--config`."""
    text = f'[thrusters]\nline = "{line}"\nneutral_us = {neutral_us}\nspan_us = {span_us}\n'
    for name, esc in (("left", left), ("right", right)):
        text += (
            f"\n[thrusters.{name}]\nreversed = {str(esc.reversed).lower()}\n"
            f"trim_us = {esc.trim_us}\ndeadband_us = {esc.deadband_us}\n"
        )
    return text
