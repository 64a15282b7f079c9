"""Sizes and overlaps of boxes in the picture, normalised x1, y1, x2, y2. Pure."""

from paani.messages import BoxXyxy


def area(box: BoxXyxy) -> float:
    """Area of a box as a fraction of the picture."""
    return (box[2] - box[0]) * (box[3] - box[1])


def shared_area(a: BoxXyxy, b: BoxXyxy) -> float:
    """Area that two boxes share."""
    width = min(a[2], b[2]) - max(a[0], b[0])
    if width <= 0.0:
        return 0.0
    height = min(a[3], b[3]) - max(a[1], b[1])
    return width * height if height > 0.0 else 0.0


def iou(a: BoxXyxy, b: BoxXyxy) -> float:
    """Intersection over union of two valid boxes."""
    both = shared_area(a, b)
    return both / (area(a) + area(b) - both) if both > 0.0 else 0.0


def covered_frac(box: BoxXyxy, other: BoxXyxy) -> float:
    """Fraction of a valid box's area that lies inside another."""
    return shared_area(box, other) / area(box)
