"""A fit's numbers in a designer's words: pure functions."""

from __future__ import annotations

from pathlib import Path

from studio_core.fitting import CHECKERBOARD, INNER_OUTER, NONE, ONE_ROW, Figures, LampError

HELD = {
    CHECKERBOARD: "Every other one",
    INNER_OUTER: "Those further from the camera",
    ONE_ROW: "All but one row",
    NONE: "None: nothing is known of lamps not seen",
}
"""What each way of holding lamps back is called."""
_CLOSE, _USEFUL, _FAR = 0.002, 0.01, 0.05
_KILO = 1000


def percent(share: float) -> str:
    """Two digits of a share: 0.51 %, 12 %."""
    value = 100 * share
    if value < 1e-3:
        return "under 0.001 %"
    text = f"{value:.2g}"
    return f"{float(text):g} %"


def amount(count: int) -> str:
    """Bytes in words."""
    if count < _KILO:
        return f"{count} bytes"
    if count < _KILO**2:
        return f"{count / _KILO:.0f} kB"
    return f"{count / _KILO**2:.1f} MB"


def verdict(figures: Figures) -> str:
    """How good it is, in a sentence."""
    if figures.unseen is None:
        return "No lamp was held back: how it looks under other lamps is not known."
    error = figures.unseen.whole
    if error < _CLOSE:
        how = "It can hardly be told from photographs under lamps that it has not seen."
    elif error < _USEFUL:
        how = "It is close to the photographs under lamps that it has not seen."
    elif error < _FAR:
        how = "It is near the photographs under lamps that it has not seen; look at highlights and rims."
    else:
        how = "It is far from the photographs under lamps that it has not seen: see which lamps are wrong."
    if figures.unseen.alone <= error * 1.05 and figures.columns:
        return f"{how} What each spot has of its own hardly helps there."
    return how


def rows(figures: Figures) -> tuple[tuple[str, str, str], ...]:
    """Name, value and what it means, of every number worth telling."""
    made = []
    off = "Squared differences over squared light, over all that is lit and not clipped"
    near = "More than 10° from the middle of the highlight"
    if figures.unseen is not None:
        made.append(("Lamps not seen", percent(figures.unseen.whole), off))
        made.append(("… outside highlights", percent(figures.unseen.outside), near))
        alone = "What all spots share, without what each has of its own"
        made.append(("… model alone", percent(figures.unseen.alone), alone))
    made.append(("Lamps it was fitted to", percent(figures.seen.whole), off))
    made.append(("… outside highlights", percent(figures.seen.outside), near))
    made.append(("All spots share", figures.model, "The reflectance model"))
    made.append(("Each spot has", figures.basis, "Chosen by error on lamps held back, and by memory"))
    if figures.columns:
        told = f"{figures.rank} of {figures.columns}"
        made.append(("Told by the lamps", told, "How many of each spot's numbers the lamps can tell apart"))
    wide, high = figures.texels
    memory = f"{figures.bytes_per_texel} bytes a spot, {amount(figures.bytes_in_all)} in all"
    made.append(("Memory", memory, f"{wide} × {high} spots; in all as the program holds it"))
    return tuple(made)


def lamp_title(lamp: LampError) -> str:
    """A lamp by its place."""
    return f"{Path(lamp.name).stem}: {lamp_place(lamp.azimuth, lamp.height)}"


def lamp_place(azimuth: float, height: float) -> str:
    """Where a lamp is, seen from the camera: 30° right, 40° up."""
    side = "right" if azimuth > 0 else "left"
    up = "up" if height > 0 else "down"
    parts = [f"{abs(azimuth):.0f}° {side}"] * (abs(azimuth) >= 0.5)
    parts += [f"{abs(height):.0f}° {up}"] * (abs(height) >= 0.5)
    return ", ".join(parts) or "at the camera"


def lamp_told(lamp: LampError) -> str:
    """Its error in words."""
    held = "held back" if lamp.held else "fitted to"
    return (
        f"{lamp_title(lamp)} ({held}) · error {percent(lamp.whole)},"
        f" outside highlights {percent(lamp.outside)}, model alone {percent(lamp.alone)}"
    )


__all__ = ["HELD", "amount", "lamp_place", "lamp_title", "lamp_told", "percent", "rows", "verdict"]
