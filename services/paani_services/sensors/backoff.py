"""How long to wait before a line is opened again. Pure."""

FIRST_S, LONGEST_S = 0.25, 5.0  # a cable that slipped is back within a second; a missing device costs nothing


class Backoff:
    """Doubles from 0.25 s to 5 s; a line that was useful begins again at 0.25 s."""

    def __init__(self) -> None:
        self._next_s = FIRST_S

    def after(self, *, is_useful: bool) -> float:
        """Seconds to wait after the line was lost."""
        wait_s = FIRST_S if is_useful else self._next_s
        self._next_s = min(2.0 * wait_s, LONGEST_S)
        return wait_s
