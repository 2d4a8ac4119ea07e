"""f_r: one reflectance model for the whole sample, by Levenberg–Marquardt within bounds (section 4.1).

Colours enter linearly, so that for each trial of the shapes (exponents, roughness) the best non-negative
colours are known (variable projection, Golub and Pereyra 1973); only shapes are searched, in logarithms,
from a grid of starts.

==========  ==========================================================================  ===========
model       terms (as radiance: the cosine is in them)                                  shapes
==========  ==========================================================================  ===========
lambert     n·l                                                                         –
paper       n·l, (n·h)^n without a cosine: equation 3                                   n 1 … 1e5
phong       n·l, (r·v)^n N n·l                                                          n 1 … 1e5
blinn       n·l, (n·h)^n N n·l: the program's `blinn-phong`                             n 1 … 1e5
two-blinn   n·l and two such lobes                                                      n1, n2
ggx         n·l, D G2 / (4 n·v) with height-correlated G2, without Fresnel              α 1e-3 … 1
two-ggx     n·l and two such lobes                                                      α1, α2
==========  ==========================================================================  ===========

`rough-` before a model's name adds the light that rough matte surfaces send back (Oren and Nayar 1994:
the term with max(0, cos Δφ) sin α tan β, whose strength is linear): its colour is the second of the matte
part.

Fresnel's change is left out: under one camera and lights within 60° of it, it stays under a hundredth.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_plugins.residual.samples import F32, F64, Flags, Samples

_PLAIN = {"lambert": 0, "paper": 1, "phong": 1, "blinn": 1, "two-blinn": 2, "ggx": 1, "two-ggx": 2}
_ROUGH = "rough-"
SHAPES = {**_PLAIN, **{_ROUGH + name: count for name, count in _PLAIN.items() if name != "paper"}}
"""Models and how many shapes they have."""
_EXPONENT, _ROUGHNESS = (1.0, 1e5), (1e-3, 1.0)
_STARTS = {"one": 13, "two": 7}
_MOST = 160_000  # samples of a fit


@dataclass(frozen=True, eq=False)
class Parametric:
    """A fitted model: its `shapes`, the `colours` (terms, 3) of its terms, and nMSE over what it was
    fitted to.

    `at_bound`: a shape wanted to go further than it may.
    """

    model: str
    shapes: tuple[float, ...]
    colours: F64
    nmse: float = 0.0
    at_bound: bool = False

    @property
    def matte_terms(self) -> int:
        """How many of the terms are matte; the others are highlights."""
        return 2 if self.model.startswith(_ROUGH) else 1

    def parts(self, normals: F32, views: F32, towards: npt.ArrayLike) -> tuple[F32, F32]:
        """Matte and glossy radiance (..., 3) of points under a light from there, of strength 1."""
        made = terms(self.model, self.shapes, normals, views, towards)
        colours = self.colours.astype(np.float32)
        sums = np.zeros((2, *made.shape[1:], 3), np.float32)
        for k in range(len(made)):
            sums[int(k >= self.matte_terms)] += made[k][..., None] * colours[k]
        return sums[0], sums[1]

    def radiance(self, normals: F32, views: F32, towards: npt.ArrayLike) -> F32:
        """Both together."""
        matte, glossy = self.parts(normals, views, towards)
        return np.asarray(matte + glossy, np.float32)


def half_vector(views: npt.NDArray[Any], towards: npt.ArrayLike) -> F32:
    """(..., 3) unit vectors between views and a light's direction."""
    half = views + np.asarray(towards, views.dtype)
    length = np.linalg.norm(half, axis=-1, keepdims=True)  # 0 for light from straight behind
    return np.asarray(half / np.maximum(length, 1e-12), np.float32)


def terms(model: str, shapes: Sequence[float], normals: F32, views: F32, towards: npt.ArrayLike) -> F32:
    """(terms, ...) of the table above at normals and views (..., 3) under light from there (3,) or (...,
    3).
    """
    light = np.asarray(towards, np.float32)
    nl = np.maximum((normals * light).sum(axis=-1), np.float32(0))
    made = [nl]
    if model.startswith(_ROUGH):
        made.append(_sent_back(normals, views, light, nl))
        model = model.removeprefix(_ROUGH)
    if model != "lambert":
        lit = nl > 0
        nv = np.maximum((normals * views).sum(axis=-1), np.float32(1e-4))
        if model == "phong":
            mirrored = 2 * (normals * light).sum(axis=-1)[..., None] * normals - light
            tilt = ((mirrored - views) ** 2).sum(axis=-1) / 4
        else:
            tilt = ((half_vector(views, light) - normals) ** 2).sum(axis=-1) / 4
        tilt = np.minimum(tilt, np.float32(1))  # sin² of half the angle: exact where cosines are not
        for shape in shapes:
            made.append(np.where(lit, _lobe(model, np.float32(shape), tilt, nl, nv), np.float32(0)))
    return np.stack(made).astype(np.float32, copy=False)


def _sent_back(normals: F32, views: F32, light: F32, nl: F32) -> F32:
    """cos θ_i max(0, cos Δφ) sin α tan β of Oren and Nayar's qualitative model."""
    nv = np.clip((normals * views).sum(axis=-1), 1e-4, 1)
    across = (light * views).sum(axis=-1) - nl * nv  # cos Δφ sin θ_i sin θ_o = cos Δφ sin α tan β max(cos)
    return np.asarray(nl * np.maximum(across, 0) / np.maximum(np.maximum(nl, nv), 1e-4), np.float32)


def _lobe(model: str, shape: Any, tilt: F32, nl: F32, nv: F32) -> F32:
    cosine = 1 - 2 * tilt
    if model.endswith("ggx"):
        square = shape * shape
        d = square / (square * cosine**2 + 4 * tilt * (1 - tilt)) ** 2
        into, out = nl * np.sqrt(nv**2 * (1 - square) + square), nv * np.sqrt(nl**2 * (1 - square) + square)
        return np.asarray(d * 0.5 / np.maximum(into + out, 1e-12) * nl, np.float32)  # π of D against light's
    power = np.where(cosine > 0, np.exp(shape * np.log1p(-2 * np.minimum(tilt, np.float32(0.4999)))), 0)
    if model == "paper":
        return np.asarray(power, np.float32)
    n = float(shape)
    if model == "phong":
        return np.asarray(power * (n + 2) / 2 * nl, np.float32)
    return np.asarray(power * (n + 2) * (n + 4) / (8 * (2 ** (-n / 2) + n)) * nl, np.float32)


def fit_parametric(samples: Samples, model: str, use: Flags | None = None) -> Parametric:
    """The best shapes and colours over what is usable and lit (or `use`, (n, h, w)).

    ValueError for an unknown model. Without any sample: black.
    """
    if model not in SHAPES:
        raise ValueError(f"there is no model {model!r}; known: {', '.join(SHAPES)}")
    chosen = _Chosen.of(samples, use)
    count = SHAPES[model]
    if not len(chosen.values):
        return Parametric(model, (1.0,) * count, np.zeros((count + 1 + model.startswith(_ROUGH), 3)))
    low, high = np.log(_ROUGHNESS if model.endswith("ggx") else _EXPONENT)
    if count == 0:
        return _made(model, (), chosen, False)
    from scipy.optimize import least_squares

    def misfit(shapes: F64) -> F64:
        colours, design = _colours(model, np.exp(shapes), chosen)
        off = (design @ colours - chosen.values) * chosen.root[:, None]
        return np.asarray(off.ravel() / chosen.scale, np.float64)

    grid = np.linspace(low, high, _STARTS["one" if count == 1 else "two"] + 2)[1:-1]
    starts = list(itertools.combinations(grid, count))
    rated = sorted(starts, key=lambda start: float((misfit(np.array(start)) ** 2).sum()))
    best: Any = None
    for start in rated[: 1 if count == 1 else 2]:
        found = least_squares(
            misfit, start, bounds=(low, high), method="trf", diff_step=1e-3, xtol=1e-5, ftol=1e-7, max_nfev=30
        )
        if best is None or found.cost < best.cost:
            best = found
    shapes = np.exp(best.x)
    order = np.argsort(shapes)[:: 1 if model.endswith("ggx") else -1]  # sharpest first
    at_bound = bool(((best.x < low + 1e-3) | (best.x > high - 1e-3)).any())
    return _made(model, tuple(float(s) for s in shapes[order]), chosen, at_bound)


def best_parametric(
    samples: Samples,
    models: Sequence[str],
    use: Flags | None = None,
    gain: float = 0.03,
    step: Callable[[], object] = lambda: None,
) -> Parametric:
    """Of several models the first whose error none of the later ones betters by more than `gain` of it.

    `step()` is called after each of them.
    """
    made = []
    for model in models:
        made.append(fit_parametric(samples, model, use))
        step()
    best = made[0]
    for one in made[1:]:
        if one.nmse < best.nmse * (1 - gain):
            best = one
    return best


@dataclass(frozen=True, eq=False)
class _Chosen:
    """Samples of a fit in rows: values (m, 3), √weight, normals, views, lights (m, 3), scale of the
    misfit.
    """

    values: F64
    root: F64
    normals: F32
    views: F32
    towards: F32
    scale: float

    @classmethod
    def of(cls, samples: Samples, use: Flags | None) -> _Chosen:
        """All near highlights, and of the rest so many that the whole stays quick."""
        rows: list[tuple[int, Any, float]] = []
        height, width = samples.size
        flat_n, flat_v = samples.normals.reshape(-1, 3), samples.views.reshape(-1, 3)
        rng = np.random.default_rng(height * width)
        near_all, far_all = [], []
        for i in range(len(samples.lights)):
            ok = (samples.usable[i] if use is None else use[i]).ravel()
            towards = samples.lights.directions[i]
            ok = ok & (flat_n @ towards.astype(np.float32) > 0.03)
            close = (half_vector(flat_v, towards) * flat_n).sum(axis=-1) > np.cos(np.radians(12.0))
            near_all.append(np.flatnonzero(ok & close))
            far_all.append(np.flatnonzero(ok & ~close))
        near, far = sum(map(len, near_all)), sum(map(len, far_all))
        keep_near, keep_far = min(1.0, _MOST / 2 / max(near, 1)), min(1.0, _MOST / 2 / max(far, 1))
        for i, (a, b) in enumerate(zip(near_all, far_all, strict=True)):
            for which, share in ((a, keep_near), (b, keep_far)):
                some = which if share == 1 else which[rng.random(len(which)) < share]
                rows.append((i, some, 1 / share))
        if not sum(len(some) for _, some, _ in rows):
            none = np.zeros((0, 3), np.float32)
            return cls(np.zeros((0, 3)), np.zeros(0), none, none, none, 1.0)
        values = np.concatenate([samples.values[i].reshape(-1, 3)[some] for i, some, _ in rows]).astype(float)
        root = np.sqrt(np.concatenate([np.full(len(some), weight) for _, some, weight in rows]))
        at = np.concatenate([some for _, some, _ in rows])
        towards = np.concatenate(
            [np.tile(samples.lights.directions[i], (len(some), 1)) for i, some, _ in rows]
        )
        scale = float(np.sqrt(((values * root[:, None]) ** 2).sum())) or 1.0
        return cls(values, root, flat_n[at], flat_v[at], towards.astype(np.float32), scale)


def _colours(model: str, shapes: Sequence[float] | F64, chosen: _Chosen) -> tuple[F64, F64]:
    """The best colours ≥ 0 (terms, 3) and the terms (m, terms)."""
    from scipy.optimize import nnls

    design = terms(model, [float(s) for s in shapes], chosen.normals, chosen.views, chosen.towards).T.astype(
        float
    )
    q, r = np.linalg.qr(design * chosen.root[:, None])
    wanted = q.T @ (chosen.values * chosen.root[:, None])
    size = np.maximum(np.linalg.norm(r, axis=0), 1e-12)  # columns of one size: lobes' peaks go up to 1e5
    return np.stack([nnls(r / size, wanted[:, c])[0] / size for c in range(3)], axis=1), design


def _made(model: str, shapes: tuple[float, ...], chosen: _Chosen, at_bound: bool) -> Parametric:
    colours, design = _colours(model, shapes, chosen)
    off = (design @ colours - chosen.values) * chosen.root[:, None]
    return Parametric(model, shapes, colours, float((off**2).sum()) / chosen.scale**2, at_bound)
