"""The two networks: what they are, how they were trained and measured, and the catalogue the board loads them by."""

import paani as paani  # before onnxruntime
