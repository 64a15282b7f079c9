"""Numbers of the pictures that leave this process."""

import msgspec

from paani import keys
from paani import messages as m
from paani.bus import Bus, Numbering
from paani.clock import Clock


class PicturePublisher:
    """Numbers the pictures and publishes them; each picture is a distinct frame.

    is_calibrated: somebody measured the camera that takes them (`calibration.valid`); every header says so (B16).
    """

    def __init__(self, bus: Bus, clock: Clock, *, is_calibrated: bool) -> None:
        self._is_calibrated = is_calibrated
        self._publisher, self._frames = bus.picture_publisher(keys.PICTURE), Numbering(clock)

    def start_new_epoch(self) -> None:
        """The source started again: frame numbers and stamps before do not compare with those that follow."""
        self._publisher.new_epoch()
        self._frames.new_epoch()

    def put(self, data: bytes, header: m.PictureHeader) -> None:
        """Publish one picture; its frame number and epoch, and whether its camera is calibrated, are set here."""
        self._frames.advance()
        numbered = msgspec.structs.replace(
            header, frame_seq=self._frames.seq, frame_epoch=self._frames.epoch, calibrated=self._is_calibrated
        )
        self._publisher.put_picture(numbered, data)
