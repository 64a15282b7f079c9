"""How well the image-quality check knows unusable pictures: each fault and severity, against the segmenter's error."""
