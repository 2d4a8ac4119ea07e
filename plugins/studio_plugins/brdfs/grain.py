"""What models of brushed and woven surfaces share: the direction of their grain.

The grain lies `direction` degrees from the shading frame's x axis, the way of the texture's u,
counter-clockwise seen from outside.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from studio_core.params import Value, param


def grain_direction() -> Any:
    """The field of the direction."""
    doc = "Of the brush strokes or threads, from the picture's horizontal"
    return param(0.0, "Grain direction", doc, unit="°", low=-180.0, high=180.0)


def along(values: Mapping[str, Value]) -> tuple[float, float]:
    """Cosine and sine of the grain's direction."""
    angle = math.radians(float(values["direction"]))  # type: ignore[arg-type]
    return math.cos(angle), math.sin(angle)
