"""What decoders raise for bytes that anybody may have written, so that nobody forgets one of them.

msgspec reports what does not fit a type as its own errors, invalid UTF-8 within a text as UnicodeDecodeError, and what
is nested too deep as RecursionError; tomllib's errors, and a number of too many digits, are ValueErrors;
a whole number that no float holds is an OverflowError.
"""

import msgspec

UNDECODABLE: tuple[type[Exception], ...] = (msgspec.MsgspecError, ValueError, RecursionError, OverflowError)
UNREADABLE: tuple[type[Exception], ...] = (OSError, *UNDECODABLE)  # of a file
