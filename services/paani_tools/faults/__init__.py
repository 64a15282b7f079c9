"""Measure the image-quality check on synthetic picture faults, against the segmenter's error on the same pictures."""
