"""Pictures on the bus."""

from __future__ import annotations

from enum import StrEnum

from paani.messages.header import Count, Message, Stamp, Text


class TimeBase(StrEnum):
    """Which time tells the motion between pictures (I17): `source_us` live, `media_us` in a replay.

    MEDIA is the recording's own time, FRAME_INDEX the index over the replay rate. Freshness is always `source_us`.
    """

    CAPTURE = "capture"
    MEDIA = "media"
    FRAME_INDEX = "frame_index"


class PictureHeader(Message, frozen=True, kw_only=True):
    """Travels beside encoded picture bytes. `frame_seq`/`frame_epoch` name the camera frame they show."""

    frame_seq: Count
    frame_epoch: Count
    width_px: Count
    height_px: Count
    media_type: Text = "image/jpeg"
    time_base: TimeBase = TimeBase.CAPTURE
    calibrated: bool = False
    media_us: Stamp = 0
