"""What every part of the configuration shares."""

from __future__ import annotations

from typing import Annotated

import msgspec

Positive = Annotated[float, msgspec.Meta(gt=0.0, le=1e9)]
NonNegative = Annotated[float, msgspec.Meta(ge=0.0, le=1e9)]
Fraction = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]
Size = Annotated[int, msgspec.Meta(ge=1, le=10_000)]
JpegQuality = Annotated[int, msgspec.Meta(ge=1, le=100)]
Tilt = Annotated[float, msgspec.Meta(ge=-60.0, le=60.0)]  # degrees of a camera's mount
Offset = Annotated[float, msgspec.Meta(ge=-50.0, le=50.0)]  # metres of a camera's mount


class Section(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A part of the tree. Unknown keys are errors, so a typo never becomes a default."""
