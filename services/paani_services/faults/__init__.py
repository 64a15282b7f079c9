"""How well the gate knows a picture that cannot be used: every fault in every severity, against the segmenter's own error."""
