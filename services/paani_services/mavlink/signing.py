"""MAVLink 2 message signing: https://mavlink.io/en/guide/message_signing.html. Pure but for reading the key's file."""

from __future__ import annotations

import hashlib
import hmac
import os
import stat
from pathlib import Path

from paani.errors import UserError

EPOCH_US = 1_420_070_400_000_000  # 2015-01-01 00:00 UTC, where the protocol's stamps begin, in steps of 10 us
SIGNATURE_BYTES = 6
BLOCK_BYTES = 13  # link id, stamp of 48 bits, signature
MAX_PASSPHRASE_BYTES = 4096


def stamp_of(unix_us: int) -> int:
    """The protocol's stamp of a time: 10 us since 2015."""
    return max(0, unix_us - EPOCH_US) // 10


class Signer:
    """The key of all links, and the newest stamp of each signed stream.

    A frame is authentic if its signature is the key's, and its stamp newer than that of its stream's last, and than the
    start of this process: what was recorded before that is never taken again.
    """

    def __init__(self, key: bytes, started_us: int) -> None:
        self.key = key
        self._started = self._newest_sent = stamp_of(started_us)
        self._newest: dict[tuple[int, int, int], int] = {}

    def is_authentic(self, frame: bytes, system: int, component: int) -> bool:
        """Whether a whole frame that ends in a signature block was signed with the key, and is no repetition."""
        expected = hashlib.sha256(self.key + frame[:-SIGNATURE_BYTES]).digest()[:SIGNATURE_BYTES]
        if not hmac.compare_digest(expected, frame[-SIGNATURE_BYTES:]):
            return False
        stream = (frame[-BLOCK_BYTES], system, component)
        stamp = int.from_bytes(frame[1 - BLOCK_BYTES : -SIGNATURE_BYTES], "little")
        if stamp <= self._newest.get(stream, self._started):
            return False
        self._newest[stream] = stamp
        return True

    def next_stamp(self, now_us: int) -> int:
        """A stamp for a frame that is sent now, newer than every one before, whatever becomes of the clock."""
        self._newest_sent = max(self._newest_sent + 1, stamp_of(now_us))
        return self._newest_sent


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
