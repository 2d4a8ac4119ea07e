"""Which samples a residual may learn from: lit, not clipped, not in a shadow, not in the highlight.

What a low order of directions cannot follow only bends it elsewhere: in trials, plain least squares were
worse than no residual at all.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.colour import LUMINANCE
from studio_plugins.residual.samples import F32, Flags, Samples
from studio_plugins.residual.shading import GRAZING, Shade

_LUMINANCE = np.array(LUMINANCE, np.float32)
_SHADOW = 0.4  # of what a texel shows under other lights, against the model
_HIGHLIGHT = 0.15  # share of the model's light that is its highlight
HIGHLIGHT_ANGLE = np.radians(10.0)


@dataclass(frozen=True)
class Masks:
    """Which masks are used; all of them are, by default."""

    clipped: bool = True
    shadow: bool = True
    highlight: bool = True


def lit(samples: Samples) -> Flags:
    """(n, h, w) whether a light is above a texel's horizon by more than grazes it."""
    cosine = np.einsum("hwc,nc->nhw", samples.normals, samples.lights.directions.astype(np.float32))
    return np.asarray(cosine > GRAZING)


def outside_highlight(samples: Samples) -> Flags:
    """(n, h, w) whether the half vector is more than 10° from the normal."""
    made = np.empty(samples.usable.shape, np.bool_)
    for i, towards in enumerate(samples.lights.directions):
        half = samples.views + towards.astype(np.float32)
        half /= np.linalg.norm(half, axis=-1, keepdims=True)
        made[i] = (half * samples.normals).sum(axis=-1) < np.cos(HIGHLIGHT_ANGLE)
    return made


def sample_weights(values: F32, usable: Flags, shades: list[Shade], masks: Masks) -> F32:
    """(n, ...) weights 0 or 1 of values (n, ..., 3); `shades` are the model's under each light."""
    weights = np.ones(usable.shape, np.float32)
    if masks.clipped:
        weights *= usable
    cosine = np.stack([s.cosine for s in shades])
    weights *= cosine > (GRAZING if masks.shadow else 0.0)
    model = np.stack([s.alone @ _LUMINANCE for s in shades])
    if masks.shadow:
        ratio = _ratio(values @ _LUMINANCE, model)
        counted = np.where((weights > 0) & ~_glossy(shades, model), ratio, np.nan)
        weights *= ~(ratio < _SHADOW * _median(counted))
    if masks.highlight:
        weights *= ~_glossy(shades, model)
    return weights


def _glossy(shades: list[Shade], model: F32) -> Flags:
    """Where the highlight is more than a share of the model."""
    shine = np.stack([s.shine for s in shades])
    return np.asarray(shine > _HIGHLIGHT * np.maximum(model, 1e-6))


def _ratio(seen: F32, model: F32) -> F32:
    return np.asarray(seen / np.maximum(model, 1e-5), np.float32)


def _median(values: npt.NDArray[np.floating]) -> F32:
    none = np.isnan(values).all(axis=0)
    return np.asarray(np.nanmedian(np.where(none, 0, values), axis=0), np.float32)
