"""What a capture measured, as JSON that other programs and later versions read."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """Numbers, texts, lists and maps alone; what is not finite becomes None."""
    if isinstance(value, Mapping):
        return {str(key): plain(inner) for key, inner in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, str | int | bool):
        return value
    raise TypeError(f"a report holds no {type(value).__name__}")


def report_text(report: Mapping[str, Any]) -> str:
    """A report as JSON text, its keys in the order in which they were found."""
    return json.dumps(plain(report), ensure_ascii=False, indent=1)
