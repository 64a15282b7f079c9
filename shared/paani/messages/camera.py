"""Pictures on the bus."""

from __future__ import annotations

from enum import StrEnum

from paani.messages.header import Count, Message, Text


class TimeBase(StrEnum):
    """What `source_us` of a picture counts (checklist I17)."""

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
