"""How well the gate knows a picture that cannot be used: every fault, every severity, against the segmenter's error."""
