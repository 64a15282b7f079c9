"""Settings of the hardware button that stops the boat."""

from __future__ import annotations

from paani.config.section import Section

BUTTON_KINDS = ("input:", "level:")


class ButtonConfig(Section, frozen=True):
    """`line`: `input:/dev/input/by-id/NAME`, an input device of which any key stops, or `level:/PATH`, a file that
    holds `1` while the boat may move, as the value of a GPIO line does. Empty: no button.
    """

    # Where it is set, a button that is missing or cannot be read stops the boat, and so does its process by its end.
    line: str = ""

    def __post_init__(self) -> None:
        """The line is one of the two kinds, with an absolute path."""
        if self.line and not self.line.startswith(tuple(f"{kind}/" for kind in BUTTON_KINDS)):
            raise ValueError(f"button.line {self.line}: is neither input:/dev/input/NAME nor level:/PATH")
