"""MAVLink 2 message signing: https://mavlink.io/en/guide/message_signing.html. Pure but for its files."""

from __future__ import annotations

import asyncio
import hashlib
import hmac
import logging
import os
import stat
from pathlib import Path

from paani.errors import UserError
from paani.runtime import write_private

LOG = logging.getLogger(__name__)

EPOCH_US = 1_420_070_400_000_000  # 2015-01-01 00:00 UTC, where the protocol's stamps begin, in steps of 10 us
SIGNATURE_BYTES = 6
BLOCK_BYTES = 13  # link id, stamp of 48 bits, signature
MAX_PASSPHRASE_BYTES = 4096
MINUTE = 6_000_000  # stamps; a stream that is new is no further behind
MAX_DIGITS = 15  # of 48 bits
STAMP_FILE = "mavlink-stamp"  # in the runtime folder
SAVE_PERIOD_S = 10.0  # the standard asks for a minute at most


def stamp_of(unix_us: int) -> int:
    """The protocol's stamp of a time: 10 us since 2015."""
    return max(0, unix_us - EPOCH_US) // 10


class Signer:
    """The key of all links, the newest stamp of each signed stream, and the newest of all, sent or taken.

    A frame is authentic if its signature is the key's, and its stamp newer than that of its stream's last. The first
    of a stream is newer than the start of this process, by the clock and by `saved`, the newest of an earlier run, and
    at most a minute behind the newest of all: what was recorded before is never taken again, whatever the clock says.
    """

    def __init__(self, key: bytes, started_us: int, saved: int = 0) -> None:
        self.key = key
        self._started = self.newest = max(stamp_of(started_us), saved)
        self._streams: dict[tuple[int, int, int], int] = {}

    def is_authentic(self, frame: bytes, system: int, component: int) -> bool:
        """Whether a whole frame that ends in a signature block was signed with the key, and is no repetition."""
        expected = hashlib.sha256(self.key + frame[:-SIGNATURE_BYTES]).digest()[:SIGNATURE_BYTES]
        if not hmac.compare_digest(expected, frame[-SIGNATURE_BYTES:]):
            return False
        stream = (frame[-BLOCK_BYTES], system, component)
        stamp = int.from_bytes(frame[1 - BLOCK_BYTES : -SIGNATURE_BYTES], "little")
        if stamp <= self._streams.get(stream, max(self._started, self.newest - MINUTE)):
            return False
        self._streams[stream] = stamp
        self.newest = max(self.newest, stamp)  # a station whose clock is ahead of ours takes nothing that is far behind
        return True

    def next_stamp(self, now_us: int) -> int:
        """A stamp for a frame that is sent now, newer than every one before, whatever becomes of the clock."""
        self.newest = max(self.newest + 1, stamp_of(now_us))
        return self.newest


def read_stamp(file: Path) -> int:
    """The newest stamp of an earlier run; 0 where there was none. Raises UserError for a file that does not say it."""
    try:
        digits = file.read_bytes()
    except FileNotFoundError:
        return 0
    except OSError as error:
        raise UserError(f"{file}: {error.strerror}") from error
    if not digits.isdigit() or len(digits) > MAX_DIGITS:
        raise UserError(f"{file}: holds no stamp; set the clock, and remove the file")
    return int(digits)


async def save_stamps(file: Path, signer: Signer) -> None:
    """Save the newest stamp now and regularly, for ever.

    Where that fails, which is told once, the next run knows this one by the clock alone.
    """
    last_problem = ""
    while True:
        try:
            await asyncio.to_thread(write_private, file, str(signer.newest))
        except OSError as error:
            problem = f"{file}: {error.strerror}; the clock alone tells the next start what was signed before"
            if problem != last_problem:
                LOG.warning("%s", problem)
            last_problem = problem
        await asyncio.sleep(SAVE_PERIOD_S)


def read_signing_key(file: str) -> bytes:
    """The 32 bytes of the key: SHA-256 of the passphrase in the file, as ground stations make it.

    Raises UserError for a file that cannot be read, that others can read, or that holds no passphrase.
    """
    try:
        with os.fdopen(os.open(Path(file), os.O_RDONLY | os.O_CLOEXEC), "rb") as stream:
            if stat.S_IMODE(os.fstat(stream.fileno()).st_mode) & 0o077:
                raise UserError(f"mavlink.signing_key_file {file}: others can read it (chmod 600)")
            passphrase = stream.read(MAX_PASSPHRASE_BYTES).strip()
    except OSError as error:
        raise UserError(f"mavlink.signing_key_file {file}: {error.strerror}") from error
    if not passphrase:
        raise UserError(f"mavlink.signing_key_file {file}: holds no passphrase")
    return hashlib.sha256(passphrase).digest()
