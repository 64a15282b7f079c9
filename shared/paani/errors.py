"""The one exception that the command line turns into a line and exit code 2."""

MAX_CHARACTERS, KEPT_AT_END = 1000, 200


class UserError(Exception):
    """A mistake of the user's: one line that names the setting, file or device at fault."""

    def __str__(self) -> str:
        return one_line(super().__str__())


def one_line(text: str) -> str:
    """A line that any terminal can show, of about `MAX_CHARACTERS` at most, whatever foreign text it quotes.

    What is not printable is escaped, and of what is too long the middle is left out.
    """
    line = " ".join(text.split())
    if len(line) > MAX_CHARACTERS:
        line = f"{line[: MAX_CHARACTERS - KEPT_AT_END - 5]} ... {line[-KEPT_AT_END:]}"
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in line)
