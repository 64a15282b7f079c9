"""PAANI's contract: messages, keys, authority, configuration, bus, clock, health."""

import os

# onnxruntime 1.29 and later otherwise writes a device's identity to disk and sends figures of what runs to its maker;
# it looks before its first import alone, and every package of ours imports this one first.
os.environ["ORT_DISABLE_TELEMETRY"] = "1"
