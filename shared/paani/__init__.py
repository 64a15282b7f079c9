"""PAANI's contract: messages, keys, authority, configuration, bus, clock, health."""

import os

# OpenCV otherwise takes what a picture's header claims, gigabytes for a file of a kilobyte; it looks when loaded.
# Twice what is taken from the bus (`MAX_PIXELS` of perception), as a camera's files are shrunk only after reading.
os.environ["OPENCV_IO_MAX_IMAGE_PIXELS"] = str(2**26)
# onnxruntime 1.29 and later otherwise writes a device's identity to disk and sends figures of what runs to its maker;
# it looks before its first import alone, and every package of ours imports this one first.
os.environ["ORT_DISABLE_TELEMETRY"] = "1"
