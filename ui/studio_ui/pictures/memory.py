"""What the window remembers of pictures: the last choices, and how long pictures took."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from studio_ui.pictures.forms import LookForm, SizeForm
from studio_ui.pictures.order import KINDS, MOST_PIXELS, QUALITIES, SAMPLES, Look, Size, learned
from studio_ui.settings import Settings

_CHOICES, _PAST = "picture", "picture_seconds"


class PictureMemory:
    """In the settings; what does not fit is not believed."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings

    @property
    def past(self) -> dict[str, Any]:
        """Seconds by quality; see `order.guessed`."""
        found: dict[str, Any] = self._settings.get(_PAST, {})
        return found

    def took(self, look: Look, seconds: Mapping[str, float], kind: str = "one") -> None:
        """A picture, or one of many, took so long for shading and composing."""
        self._settings.set(_PAST, learned(look, seconds, self.past, kind))

    def size(self) -> Size | None:
        """The last size; None: there is none."""
        width, height, dpi = (self._number(name) for name in ("width", "height", "dpi"))
        sides = 1 <= width <= MOST_PIXELS and 1 <= height <= MOST_PIXELS
        return Size(int(width), int(height), dpi) if sides and 0 <= dpi <= 1e5 else None

    def look(self) -> tuple[str, int, int]:
        """The last quality, samples and kind of file."""
        found = self._choices()
        quality, samples = found.get("quality"), found.get("samples")
        kind = self._number("kind")
        return (
            quality if quality in QUALITIES else "screen",
            samples if samples in SAMPLES else 2,
            int(kind) if 0 <= kind < len(KINDS) else 0,
        )

    def count(self) -> int:
        """The last number of pictures in a series."""
        return int(min(max(self._number("count", 48), 1), 10_000))

    def keep(self, size: SizeForm, look: LookForm, **more: int) -> None:
        """What was chosen."""
        meant = size.size_()
        chosen = {"width": meant.width, "height": meant.height, "dpi": meant.dpi}
        chosen = dict.fromkeys(chosen, 0) if size.as_window else chosen  # it may be another one
        look_ = {"quality": look.quality.currentData(), "samples": look.samples.currentData()}
        kind = {"kind": look.kind.currentIndex()}
        self._settings.set(_CHOICES, {**self._choices(), **chosen, **look_, **kind, **more})

    def _choices(self) -> dict[str, Any]:
        found: dict[str, Any] = self._settings.get(_CHOICES, {})
        return found

    def _number(self, name: str, default: float = 0.0) -> float:
        found = self._choices().get(name, default)
        return float(found) if isinstance(found, int | float) and not isinstance(found, bool) else default
