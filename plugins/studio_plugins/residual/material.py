"""A fit as a material of the scene: what all texels share as a `Capture`, what each has of its own as maps.

The scene's model has one matte curve and one highlight, each with a colour; a fit's matte terms, lobes and
table have a colour each. The colours that come nearest over all lights of the fit are taken, and the
difference that remains is told (`SceneMaterial.off`).

A ball's map has a texel a slope. On a flat surface the pattern would be wide in the middle and narrow at
the rim, so it is laid out anew, by equal lengths on the ball from its middle; the vectors s(P) turn with it,
from the ball's meridians to the map's own axes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import cast

import numpy as np

from studio_core.arrays import frozen_map
from studio_core.brdfs.albedo import albedo_table
from studio_core.brdfs.bound import bound
from studio_core.brdfs.calls import evaluate
from studio_core.colour import LUMINANCE
from studio_core.contract import Brdf, TabulatedBrdf
from studio_core.errors import InputError
from studio_core.params import Value, defaults
from studio_core.scene.geometry import Image, Table, Texture
from studio_core.scene.nodes import Material
from studio_plugins.residual.frames import tangent_frames
from studio_plugins.residual.model import (
    BLINN,
    GGX,
    HALF_VECTOR,
    LIGHT,
    MODEL,
    NO_LOBE,
    PHONG,
    RESIDUAL,
    SLOT,
    Capture,
)
from studio_plugins.residual.result import ResidualFit
from studio_plugins.residual.samples import F32, F64
from studio_plugins.residual.shading import shade

SHOWN = ("none", "albedo", "albedo-gloss", "half", "albedo-half", "albedo-light")
"""Bases that a scene can show."""
_LUMINANCE = np.array(LUMINANCE)
_LOBES = {"blinn": BLINN, "two-blinn": BLINN, "phong": PHONG, "ggx": GGX, "two-ggx": GGX}
_FAINT = 1e-6
_ASKED = 1500  # texels, and up to
_ANGLES = np.radians([0.0, 15, 30, 45, 60])


@dataclass(frozen=True, eq=False)
class SceneMaterial:
    """A material and how far it is from its fit: nMSE over the fit's own lights. `width`: the pattern's, in
    radii of the ball, 0 where the sample was flat; `notes`: sentences.
    """

    material: Material
    off: float
    width: float = 0.0
    notes: tuple[str, ...] = ()


def scene_material(fit: ResidualFit, name: str = "Captured") -> SceneMaterial:
    """The fit as a material. InputError where its basis or model is none that a scene shows."""
    capture, albedo, shine = _shared(fit)
    maps: dict[str, F32] = {}
    own, residual = fit.coefficients, fit.coefficients
    if fit.basis.name.startswith("albedo"):
        maps["albedo"] = np.maximum(albedo + own[:, :, 0], 0).astype(np.float32)
        residual = own[:, :, 1:]
    if fit.basis.name == "albedo-gloss":
        maps["shine"] = np.maximum(shine + own[:, :, 1], 0).astype(np.float32)
    elif residual.shape[2] == 3:
        maps |= {axis: np.ascontiguousarray(residual[:, :, k]) for k, axis in enumerate(RESIDUAL)}
    notes = []
    scale = _soundness(capture, maps, albedo, shine)
    if scale < 1:
        notes.append(
            "the photographs say that more light comes back than arrives: all colours are"
            f" {scale:.0%} of theirs, for the brightness of the lamps is not known"
        )
    albedo, shine = albedo * scale, shine * scale
    maps = {name: one * np.float32(scale) for name, one in maps.items()}
    off = _difference(fit, _material(name, capture, albedo, shine, maps), scale)
    flat = bool((fit.normals[..., 2] > 1 - 1e-6).all())
    laid, width = (maps, 0.0) if flat else _laid_out(fit.normals, maps)
    return SceneMaterial(_material(name, capture, albedo, shine, laid), off, width, tuple(notes))


def _shared(fit: ResidualFit) -> tuple[Capture, F64, F64]:
    """What all texels share, and the colours (3,) of its matte part and of its highlight."""
    p, basis = fit.shared.parametric, fit.basis.name
    if basis not in SHOWN:
        raise InputError(f"the basis {basis!r} has too many parts for a scene; possible: {', '.join(SHOWN)}")
    kind = p.model.removeprefix("rough-")
    if kind != "lambert" and kind not in _LOBES:
        raise InputError(f"the model {p.model!r} is none that a scene shows")
    luminance = p.colours @ _LUMINANCE
    matte, lobes = max(float(luminance[0]), _FAINT), luminance[p.matte_terms :]
    shine = float(lobes.sum())
    glossy = shine > _FAINT
    pair = [*p.shapes, *p.shapes][:2] or [1.0, 1.0]
    weights = [*(lobes / shine).tolist(), 0.0][:2] if glossy else [0.0, 0.0]
    table = fit.shared.table
    with_residual = basis in ("half", "albedo-half", "albedo-light")
    capture = Capture(
        terms=5 if with_residual else 2 if glossy else 1,
        rough=min(float(luminance[1]) / matte, 1e5) if p.matte_terms == 2 else 0.0,
        lobe=_LOBES[kind] if glossy else NO_LOBE,
        shapes=(float(pair[0]), float(pair[1])),
        weights=(float(weights[0]), float(weights[1])),
        columns=LIGHT if basis == "albedo-light" else HALF_VECTOR,
        nodes=None if table is None else (table.nodes @ _LUMINANCE / matte).astype(np.float32),
    )
    return capture, *_colours(fit, glossy)


def _colours(fit: ResidualFit, glossy: bool) -> tuple[F64, F64]:
    """Of the two curves, such that together they come nearest to what all texels share."""
    from scipy.optimize import nnls

    step = max(int(fit.normals.shape[0] * fit.normals.shape[1] / _ASKED), 1)
    normals, views = fit.normals.reshape(-1, 3)[::step], fit.views.reshape(-1, 3)[::step]
    shades = [shade(fit.shared, normals, views, towards) for towards in fit.lights.directions]
    lit = np.concatenate([s.cosine > 0 for s in shades])
    curves = [np.concatenate([s.matte for s in shades])]
    if glossy:
        curves.append(np.concatenate([s.gloss for s in shades]))
    design = np.stack(curves, axis=1)[lit].astype(np.float64)
    wanted = np.concatenate([s.shared for s in shades])[lit].astype(np.float64)
    size = np.maximum(np.linalg.norm(design, axis=0), 1e-12)
    found = np.stack([nnls(design / size, wanted[:, c])[0] / size for c in range(3)], axis=1)
    return found[0], found[1] if glossy else np.zeros(3)


def _material(name: str, capture: Capture, albedo: F64, shine: F64, maps: dict[str, F32]) -> Material:
    """Maps over parameters that are 1 then, so that a colour chosen for them tints."""
    values: dict[str, Value] = {
        key: (1.0, 1.0, 1.0) if key in maps else _colour(colour)
        for key, colour in (("albedo", albedo), ("shine", shine))
    }
    return Material(
        id="captured",
        name=name,
        model=MODEL.id,
        values=frozen_map(values),
        textures=frozen_map({key: Texture(Image(pixels)) for key, pixels in maps.items()}),
        tables=frozen_map({SLOT: capture.table(name)}),
    )


def _bound(tables: Mapping[str, Table]) -> Brdf:
    return cast(Brdf, bound(cast(TabulatedBrdf, MODEL), tables))


def _colour(of: F64) -> tuple[float, float, float]:
    red, green, blue = (min(max(float(v), 0.0), 1.0) for v in of)
    return red, green, blue


def _soundness(capture: Capture, maps: dict[str, F32], albedo: F64, shine: F64) -> float:
    """What all colours must be multiplied with, so that the mean of the material returns no more than
    arrives and no spot's albedo is over 1 but for a hundredth of them.
    """
    bright = maps.get("albedo", np.asarray(albedo, np.float32)) + maps.get(
        "shine", np.asarray(shine, np.float32)
    )
    most = float(np.quantile(bright, 0.99))
    model = _bound({SLOT: capture.table()})
    mean = {"albedo": albedo, "shine": shine}
    mean |= {name: maps[name].mean(axis=(0, 1)) for name in mean if name in maps}
    safe = max(most, 1.0)
    values = {
        **defaults(MODEL.Params),
        **{name: _colour(np.asarray(one) / safe) for name, one in mean.items()},
    }
    furnace = float(albedo_table(model, values, _ANGLES).max()) * safe
    return 1 / max(most, furnace, 1.0)


def _difference(fit: ResidualFit, material: Material, scale: float) -> float:
    """nMSE between what the scene's kernel and the fit, scaled, say of the fit's own texels and lights."""
    model = _bound(material.tables)
    values = {**defaults(MODEL.Params), **material.values}
    shape = model.shape(values)
    flat_n, flat_v = fit.normals.reshape(-1, 3), fit.views.reshape(-1, 3)
    step = max(len(flat_n) // _ASKED, 1)
    chosen = np.arange(0, len(flat_n), step)
    texels = {
        name: texture.image.pixels.reshape(-1, 3)[chosen] * np.float32(1)
        for name, texture in material.textures.items()
    }
    numbers = {
        name: np.broadcast_to(np.asarray(value, np.float32), (len(chosen), *np.shape(value)))
        for name, value in values.items()
    }
    c = model.coefficients({**numbers, **texels})
    frames = tangent_frames(flat_n[chosen]).astype(np.float64)
    truth = scale * fit.predict(fit.lights).reshape(len(fit.lights), -1, 3)[:, chosen]
    off = power = 0.0
    for k in range(len(chosen)):
        wi = fit.lights.directions @ frames[k].T
        b = evaluate(model, shape, frames[k] @ flat_v[chosen[k]].astype(np.float64), wi)
        made = np.maximum(b @ c[k], 0) * np.pi * np.maximum(wi[:, 2:], 0)
        off += float(((made - truth[:, k]) ** 2).sum())
        power += float((truth[:, k].astype(np.float64) ** 2).sum())
    return off / power if power > 0 else 0.0


def _laid_out(normals: F32, maps: dict[str, F32]) -> tuple[dict[str, F32], float]:
    """Maps of a texel a slope as maps of equal lengths on the ball, and how wide they are, in its radii."""
    import cv2

    size = normals.shape[0]
    reach = float(normals[0, -1, 0] / normals[0, -1, 2]) * size / (size - 1)
    corner = math.atan(reach * math.sqrt(2)) / math.sqrt(2)
    at = ((np.arange(size) + 0.5) / size * 2 - 1) * corner
    x, y = np.meshgrid(at, -at)
    n, u = _on_ball(x, y)
    p, q = n[..., 0] / n[..., 2], n[..., 1] / n[..., 2]
    column = ((p / reach + 1) * size / 2 - 0.5).astype(np.float32)
    row = ((1 - q / reach) * size / 2 - 0.5).astype(np.float32)
    made: dict[str, F32] = {
        name: np.asarray(
            cv2.remap(one, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float32
        )
        for name, one in maps.items()
    }
    if RESIDUAL[0] in made:
        frames = tangent_frames(n)
        cosine = (frames[..., 0, :] * u).sum(axis=-1, keepdims=True).astype(np.float32)
        sine = (frames[..., 1, :] * u).sum(axis=-1, keepdims=True).astype(np.float32)
        along, across = made[RESIDUAL[0]], made[RESIDUAL[1]]
        made[RESIDUAL[0]] = cosine * along + sine * across
        made[RESIDUAL[1]] = cosine * across - sine * along
    return made, 2 * corner


def _on_ball(x: F64, y: F64) -> tuple[F64, F64]:
    """Normals where one comes to by going (x, y) radians from the ball's middle, and the way of growing x."""

    def normal(x: F64, y: F64) -> F64:
        away = np.hypot(x, y)
        rate = np.sinc(away / np.pi)
        return np.stack([x * rate, y * rate, np.cos(away)], axis=-1)

    n, step = normal(x, y), 1e-5
    u = normal(x + step, y) - normal(x - step, y)
    u -= (u * n).sum(axis=-1, keepdims=True) * n
    return n, u / np.linalg.norm(u, axis=-1, keepdims=True)


__all__ = ["SHOWN", "SceneMaterial", "scene_material"]
