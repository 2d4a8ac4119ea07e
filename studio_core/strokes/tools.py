"""The tools: what light is wanted under a brush, made from the light that is shown.

Everything is scene-linear radiance (colours of the screen become such by `picking`). After section 4.1 of
slf-strokes.txt, a tool M changes what is shown, L, to L + opacity · (M L − L) where the brush's mask is not
0; the mask itself says how much a place counts, and is no part of that.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.colour import LUMINANCE
from studio_core.params import Colour, param
from studio_core.shading.artifacts import Picture
from studio_core.strokes.brush import LEAST_RADIUS, Brush, lay, path_of
from studio_core.strokes.stroke import BLUR, BRIGHTEN, CLONE, DARKEN, FIXATE, REPLACE, SHARPEN, SMEAR, TOOLS

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
Bools = npt.NDArray[np.bool_]

REACH = 4.0
"""Standard deviations after which a blur ends."""
STEPS_OF_RADIUS = 4
MOST_STEPS = 20_000
_LUMINANCE = np.array(LUMINANCE, np.float32)


@dataclass(frozen=True, kw_only=True)
class ToolSettings:
    """What tools are set to; each reads its own. `source` (x, y) of the picture is where a clone begins."""

    colour: Colour = param((0.5, 0.5, 0.5), "Colour", "Radiance that is wanted", low=0.0, high=1e9)
    shading: bool = param(False, "Keep shading", "The colour gets brighter and darker as the picture does")
    stops: float = param(0.5, "Stops", "How much brighter or darker", unit="EV", low=0.0, high=16.0)
    radius: float = param(
        0.01, "Radius", "Standard deviation of the blur, in parts of the height", low=0.0, high=0.1
    )
    amount: float = param(
        0.7, "Strength", "Of sharpening; of smearing: how far colour is carried", low=0.0, high=4.0
    )
    source: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Seen:
    """What is painted on: light (H, W, 3), and which object each pixel shows, surface (H, W), −1 for none."""

    light: F32
    surface: I32

    @classmethod
    def of(cls, picture: Picture) -> Seen:
        """A picture's."""
        return cls(picture.linear, picture.node)


@dataclass(frozen=True, eq=False)
class Gesture:
    """A brush along a path (N, 3), see `brush.path_of`."""

    brush: Brush
    path: F64

    @classmethod
    def of(cls, brush: Brush, path: npt.ArrayLike) -> Gesture:
        """Along places (x, y) or (x, y, pressure). ValueError for others."""
        return cls(brush, path_of(path))

    def mask(self, seen: Seen) -> F32:
        """(H, W) over what is painted on."""
        height, width = seen.surface.shape
        return self.brush.mask(self.path, width, height)


@dataclass(frozen=True, eq=False)
class _Task:
    """A tool's work: what is seen and the mask in a part of the picture that begins at `corner` (y, x)."""

    seen: Seen
    mask: F32
    corner: tuple[int, int]
    whole: Seen
    gesture: Gesture
    settings: ToolSettings

    @property
    def height(self) -> int:
        """Pixels down the whole picture."""
        return int(self.whole.surface.shape[0])


def wanted(tool: str, seen: Seen, gesture: Gesture, settings: ToolSettings, mask: F32 | None = None) -> F32:
    """(H, W, 3) what is wanted where the gesture's mask (H, W) is not 0, else what is shown.

    NaN where the tool has nothing to say, as where a clone's source is outside the picture. ValueError for an
    unknown tool, and for a clone without a source.
    """
    if tool not in TOOLS:
        raise ValueError(f"there is no tool {tool!r}; known: {', '.join(TOOLS)}")
    mask = gesture.mask(seen) if mask is None else mask
    out = seen.light.copy()
    if not mask.any() or tool == FIXATE:
        return out
    part = _box(mask > 0, _margin(tool, settings, len(mask)))
    own = Seen(seen.light[part], seen.surface[part])
    task = _Task(own, mask[part], (part[0].start, part[1].start), seen, gesture, settings)
    made = _TOOLS[tool](task)
    under = task.mask > 0
    light = own.light[under]
    out[part][under] = light + np.float32(gesture.brush.opacity) * (made[under] - light)
    return out


def laid_over(light: F32, wish: F32, mask: F32) -> F32:
    """(H, W, 3) how a picture looks with what is wanted on it, faded by the mask (H, W)."""
    told = np.where(np.isfinite(wish), wish, light)
    return np.asarray(light + mask[..., None] * (told - light), np.float32)


def _box(marked: Bools, margin: int) -> tuple[slice, slice]:
    """Rows and columns around what is marked (H, W), of which there is some."""
    rows, columns = np.flatnonzero(marked.any(axis=1)), np.flatnonzero(marked.any(axis=0))
    down, across = (slice(max(int(one[0]) - margin, 0), int(one[-1]) + 1 + margin) for one in (rows, columns))
    return down, across


def _margin(tool: str, settings: ToolSettings, height: int) -> int:
    return math.ceil(REACH * settings.radius * height) if tool in (BLUR, SHARPEN) else 0


def _replace(task: _Task) -> F32:
    colour = np.asarray(task.settings.colour, np.float32)
    made = np.broadcast_to(colour, task.seen.light.shape)
    if not task.settings.shading:
        return made
    level = task.seen.light @ _LUMINANCE
    some = (task.mask > 0) & (task.seen.surface >= 0) & np.isfinite(level)
    weight = task.mask[some].astype(np.float64)
    mean = float((weight * level[some]).sum() / max(weight.sum(), 1e-30))
    return made * np.float32(1 / mean) * level[..., None] if mean > 0 else made


def _brighten(task: _Task) -> F32:
    return np.asarray(task.seen.light * np.float32(2.0**task.settings.stops))


def _darken(task: _Task) -> F32:
    return np.asarray(task.seen.light * np.float32(2.0**-task.settings.stops))


def _blur(task: _Task) -> F32:
    """Of every object by itself: nothing runs over its edge."""
    from scipy.ndimage import gaussian_filter

    light, surface = task.seen.light, task.seen.surface
    sigma = task.settings.radius * task.height
    made = light.copy()
    finite = np.isfinite(light).all(axis=2)
    margin = math.ceil(REACH * sigma)
    for one in np.unique(surface[task.mask > 0]).tolist() if sigma > 0 else []:
        part = _box((surface == one) & (task.mask > 0), margin)
        own, level = ((surface == one) & finite)[part], light[part]
        share = gaussian_filter(own.astype(np.float32), sigma, mode="constant", truncate=REACH)
        inside = own & (share > 0)
        for channel in range(3):
            lit = np.where(own, level[..., channel], 0)
            spread = gaussian_filter(lit, sigma, mode="constant", truncate=REACH)
            made[part][inside, channel] = spread[inside] / share[inside]
    return made


def _sharpen(task: _Task) -> F32:
    light = task.seen.light
    return np.asarray(np.maximum(light + np.float32(task.settings.amount) * (light - _blur(task)), 0))


def _clone(task: _Task) -> F32:
    """What lies as far from each place as the source from the path's beginning, between pixels."""
    from scipy.ndimage import map_coordinates

    if task.settings.source is None:
        raise ValueError("a clone needs the place where its source begins")
    height, width = task.whole.surface.shape
    x, y = (np.asarray(task.settings.source, np.float64) - task.gesture.path[0, :2]) * (width, height)
    rows, columns = np.indices(task.mask.shape)
    places = np.stack([rows + task.corner[0] + y, columns + task.corner[1] + x])
    limits = np.array([height - 1, width - 1])[:, None, None]
    inside = ((places >= 0) & (places <= limits)).all(axis=0)
    made = np.full(task.seen.light.shape, np.nan, np.float32)
    for channel in range(3):
        made[inside, channel] = map_coordinates(
            task.whole.light[..., channel], places[:, inside], order=1, mode="nearest"
        )
    return made


def _smear(task: _Task) -> F32:
    """A finger over wet paint: it carries colour with it, and leaves some of it at each step."""
    height, width = task.whole.surface.shape
    brush = task.gesture.brush
    radius = max(brush.size / 2 * height, LEAST_RADIUS)
    points = task.gesture.path[:, :2] * (width, height)
    steps = _steps(points, max(1.0, radius / STEPS_OF_RADIUS))
    length = float(np.hypot(*np.diff(steps, axis=0).T).mean()) if len(steps) > 1 else radius
    keeps = np.float32(min(task.settings.amount, 1.0) ** (length / radius))
    reach = math.ceil(radius) + 1
    dab = np.zeros((2 * reach + 1, 2 * reach + 1), np.float32)
    lay(np.array([[reach + 0.5, reach + 0.5, radius]]), brush.hardness, dab)
    edge = 2 * reach  # around the picture there is no colour
    canvas = np.full((*(np.array(task.mask.shape) + 2 * edge), 3), np.nan, np.float32)
    canvas[edge:-edge, edge:-edge] = task.seen.light
    places = np.floor(steps[:, ::-1]).astype(np.int64) - task.corner + reach
    carried: F32 | None = None
    for y, x in places.tolist():
        if min(y, x) < 0:
            continue
        under = canvas[y : y + len(dab), x : x + len(dab)]
        if under.shape[:2] != dab.shape:
            continue
        if carried is not None:
            mixed = under + (keeps * dab)[..., None] * (carried - under)
            under[...] = np.where(np.isfinite(mixed), mixed, under)
        carried = under.copy()
    return canvas[edge:-edge, edge:-edge]


def _steps(points: F64, spacing: float) -> F64:
    """(M, 2) places along points (N, 2), about evenly spaced, with the ends."""
    lengths = np.hypot(*np.diff(points, axis=0).T) if len(points) > 1 else np.zeros(0)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    count = 1 + min(math.ceil(along[-1] / spacing), MOST_STEPS)
    at = np.linspace(0, along[-1], count)
    return np.stack([np.interp(at, along, points[:, axis]) for axis in (0, 1)], axis=1)


_TOOLS: Mapping[str, Callable[[_Task], F32]] = {
    REPLACE: _replace,
    BRIGHTEN: _brighten,
    DARKEN: _darken,
    BLUR: _blur,
    SHARPEN: _sharpen,
    CLONE: _clone,
    SMEAR: _smear,
}

__all__ = ["Gesture", "Seen", "ToolSettings", "laid_over", "wanted"]
