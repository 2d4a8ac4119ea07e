"""Light directions and strengths from the pictures themselves.

A degree in a lamp's place is more than all a residual can mend. With the model and each texel's albedo
held, each light has three unknowns (two angles, a gain) and thousands of texels that tell; what does not
fit counts little (soft l1). A weak prior keeps what nothing tells. Model and lights are refitted in turn.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_plugins.residual.parametric import half_vector
from studio_plugins.residual.samples import F32, F64, Flags, Lights, Samples
from studio_plugins.residual.shading import GRAZING, Shared, shade

Indices = npt.NDArray[np.intp]
_FARTHEST = np.radians(4.0)
_PRIOR = np.radians(1.0), 0.1  # of a direction, of ln strength
_UNIT = np.array([0.1, 0.1, 0.5])  # radians, and ln strength
_TEXELS, _NEAR = 2500, 1500


def refined(samples: Samples, shared: Shared, extra: F32, use: Flags) -> Lights:
    """Lights that agree with the pictures better, given what each texel's albedo has more (h, w, 3).

    Strengths are as bright as before in the median. `use` (n, h, w): samples to trust.
    """
    directions = samples.lights.directions.copy()
    gains = np.ones((len(samples.lights), 1))
    for i in range(len(samples.lights)):
        directions[i], gains[i, 0] = _one(samples, i, shared, extra, use[i])
    gains /= np.median(gains)
    lights = samples.lights
    parametric = shared.parametric
    if parametric.matte_terms == len(parametric.colours):
        directions = _without_spread(lights.directions, directions)
    return Lights(
        directions, lights.strengths * gains, lights.names, f"{lights.source}, refined".lstrip(", ")
    )


def _one(samples: Samples, index: int, shared: Shared, extra: F32, use: Flags) -> tuple[F64, float]:
    from scipy.optimize import least_squares

    towards = samples.lights.directions[index]
    flat_n, flat_v = samples.normals.reshape(-1, 3), samples.views.reshape(-1, 3)
    ok = use.ravel() & (flat_n @ towards.astype(np.float32) > GRAZING + 0.03)
    near = (half_vector(flat_v, towards) * flat_n).sum(axis=-1) > np.cos(np.radians(8.0))
    rng = np.random.default_rng(index)
    some = np.concatenate(
        [_few(np.flatnonzero(ok), _TEXELS, rng), _few(np.flatnonzero(ok & near), _NEAR, rng)]
    )
    if len(some) < 30:
        return towards, 1.0
    n, v, own = flat_n[some], flat_v[some], extra.reshape(-1, 3)[some]
    seen = samples.values[index].reshape(-1, 3)[some]
    across, up = _around(towards)

    def model(y: F64) -> F32:
        x = (y - 1) * _UNIT
        light = towards + x[0] * across + x[1] * up
        now = shade(shared, n, v, light / np.linalg.norm(light))
        part = now.shared + own * now.matte[:, None]
        return np.asarray(part * np.float32(np.exp(x[2])), np.float32)

    start = np.ones(3)  # unknowns are about 1, so that a relative step is one that single precision shows
    scale = max(1.4826 * float(np.median(np.abs(model(start) - seen))), 1e-5)
    prior = np.array([_PRIOR[0], _PRIOR[0], _PRIOR[1]])

    def misfit(y: F64) -> F64:
        held = 3 * (y - 1) * _UNIT / prior
        return np.concatenate([((model(y) - seen) / scale).ravel(), held]).astype(float)

    reach = np.array([_FARTHEST, _FARTHEST, 0.5]) / _UNIT
    found = least_squares(
        misfit,
        start,
        bounds=(1 - reach, 1 + reach),
        loss="soft_l1",
        f_scale=2.0,
        max_nfev=15,
        diff_step=2e-3,
        ftol=1e-5,
        xtol=1e-5,
    )
    x = (found.x - 1) * _UNIT
    made = towards + x[0] * across + x[1] * up
    return made / np.linalg.norm(made), float(np.exp(x[2]))


def _without_spread(told: F64, found: F64) -> F64:
    """Found directions without what all have in common: being further from the camera, or nearer to it.

    Without a highlight a matte surface that is a little less than Lambert's looks like lights further out.
    """
    away = np.stack([told[:, 0] * told[:, 2], told[:, 1] * told[:, 2], told[:, 2] ** 2 - 1], axis=1)
    common = float(((found - told) * away).sum()) / max(float((away**2).sum()), 1e-12)
    made = found - common * away
    return np.asarray(made / np.linalg.norm(made, axis=1, keepdims=True), np.float64)


def _few(which: Indices, most: int, rng: np.random.Generator) -> Indices:
    return which if len(which) <= most else rng.choice(which, most, replace=False)


def _around(towards: F64) -> tuple[F64, F64]:
    """Two unit vectors across a direction."""
    across = np.cross(towards, [0.0, 1.0, 0.0] if abs(towards[1]) < 0.9 else [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    return across, np.cross(across, towards)
