"""The bus: typed publishers and bounded inboxes over one Zenoh session. Only this package imports zenoh."""

from paani.bus.bus import Bus, Picture, PulledPicture, open_bus
from paani.bus.inbox import Latest, Queue
from paani.bus.publish import Numbering, PicturePublisher, Publisher
from paani.bus.stepping import Stepper

__all__ = [
    "Bus",
    "Latest",
    "Numbering",
    "Picture",
    "PicturePublisher",
    "Publisher",
    "PulledPicture",
    "Queue",
    "Stepper",
    "open_bus",
]
