"""Header of pictures on the bus."""

from __future__ import annotations

from enum import StrEnum

from paani.messages.header import Count, Message, Stamp, Text


class TimeBase(StrEnum):
    """Time base for motion between pictures (I17): `source_us` of a live camera, `media_us` of a recording.

    MEDIA is the recording's own time, FRAME_INDEX the frame's index over the playback rate. Freshness is always judged
    by `source_us`.
    """

    CAPTURE = "capture"
    MEDIA = "media"
    FRAME_INDEX = "frame_index"


class PictureHeader(Message, frozen=True, kw_only=True):
    """Attached to the bytes of an encoded picture. `frame_epoch` and `frame_seq` identify the camera frame it shows.

    `calibrated`: the camera's calibration is established as valid; without that there is none (B16).
    """

    frame_seq: Count
    frame_epoch: Count
    width_px: Count
    height_px: Count
    media_type: Text = "image/jpeg"
    time_base: TimeBase = TimeBase.CAPTURE
    calibrated: bool = False
    media_us: Stamp = 0
