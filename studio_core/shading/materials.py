"""From a scene's materials to what kernels and pixels need."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from studio_core.brdfs.bound import Bound, bound, padded
from studio_core.contract import Brdf, Registry, TabulatedBrdf
from studio_core.errors import InputError, LucarneError, PluginError
from studio_core.params import Value, check, defaults, param_infos
from studio_core.scene.geometry import Image, Table, Texture
from studio_core.scene.nodes import Material, MaterialId, Scene
from studio_core.shading.artifacts import TERMS, Shapes
from studio_core.shading.normal_maps import mean_slope, slope_of

FALLBACK = "lambert"


@dataclass(frozen=True)
class Resolved:
    """A material with its model and all parameter values; `problem` says what had to be replaced.

    Textures multiply `values`: `textures` in each pixel those that colours are made of, `shaping` at each
    vertex those that the shape is made of. `tables` are those that the model reads; whoever keeps a shape of
    it keeps them alive.
    """

    brdf: Brdf
    values: Mapping[str, Value]
    textures: Mapping[str, Texture]
    problem: str = ""
    tables: tuple[Table, ...] = ()
    shaping: Mapping[str, Texture] = field(default_factory=dict)

    def scaled(self, texels: Iterable[float]) -> Mapping[str, Value]:
        """The values where the pictures of `shaping`, in their order, have these texels."""
        made = {**self.values}
        for name, texel in zip(self.shaping, texels, strict=True):
            made[name] = scalar(made[name]) * texel
        return made

    def typical(self, mean: Callable[[Image], float] | None = None) -> Mapping[str, Value]:
        """The values with the means of the pictures of `shaping`, found by `mean` (else `mean_texel`)."""
        return self.scaled((mean or mean_texel)(texture.image) for texture in self.shaping.values())


def resolve(material: Material, registry: Registry) -> Resolved:
    """Model and checked values; what is unknown or does not fit is replaced by defaults and said."""
    problem = ""
    try:
        brdf = registry.brdf(material.model)
        if brdf.terms > TERMS:
            raise PluginError(f"model {material.model!r} has {brdf.terms} terms, {TERMS} are possible")
    except LucarneError as error:
        problem = f"{material.name}: {error}; shown as matte grey"
        brdf = registry.brdf(FALLBACK)
        return Resolved(brdf, defaults(brdf.Params), {}, problem)
    infos, values = param_infos(brdf.Params), defaults(brdf.Params)
    for name, value in material.values.items():
        if name in infos:
            try:
                values[name] = check(name, infos[name], value)
            except InputError as error:
                problem = f"{material.name}: {error}"
    textures: dict[str, Texture] = {}
    shaping: dict[str, Texture] = {}
    for name, texture in material.textures.items():
        if name in shape_textures(brdf):
            shaping[name] = texture
        if name not in brdf.textures:
            continue
        if name not in infos:
            values[name] = (1.0, 1.0, 1.0)  # the map itself
        first = next(iter(textures.values()), texture)
        if texture.affine == first.affine:
            textures[name] = texture
        else:
            mean = linear_rgb(texture.image).mean(axis=(0, 1), dtype=np.float64)
            values[name] = _times(values[name], mean)
            problem = f"{material.name}: the textures of one material lie alike; {name} is shown as its mean"
    turning = getattr(brdf, "turning", "")
    if turning and textures:
        texture = next(iter(textures.values()))
        values[turning] = math.remainder(scalar(values[turning]) + texture.rotation, 360.0)
    if not getattr(brdf, "tables", ()):
        return Resolved(brdf, values, textures, problem, (), shaping)
    try:
        made = _with_tables(brdf, material, values)
        return Resolved(made, values, textures, problem, tuple(made.tables.values()), shaping)
    except LucarneError as error:
        problem = f"{material.name}: {error}; shown as matte grey"
        brdf = registry.brdf(FALLBACK)
        return Resolved(brdf, defaults(brdf.Params), {}, problem)


def _with_tables(brdf: Brdf, material: Material, values: Mapping[str, Value]) -> Bound:
    """The model bound to the material's tables; InputError when they are missing or do not fit."""
    tabulated = cast(TabulatedBrdf, brdf)
    missing = [name for name in tabulated.tables if name not in material.tables]
    if missing:
        raise InputError(f"it has no {' and no '.join(missing)}")
    made = bound(tabulated, material.tables)
    made.shape(values)
    return made


def shape_textures(brdf: Brdf) -> tuple[str, ...]:
    """Parameters of the model's shape that may have a picture; see `studio_core.contract.Brdf`."""
    return tuple(getattr(brdf, "shape_textures", ()))


def shape_paints(brdf: Brdf) -> tuple[str, ...]:
    """Parameters of the model's shape that strokes may change from vertex to vertex: these, and its gloss."""
    gloss = getattr(brdf, "roles", {}).get("gloss")
    return tuple(dict.fromkeys((*shape_textures(brdf), *([gloss] if gloss else []))))


def first_channel(image: Image) -> npt.NDArray[np.float32]:
    """(H, W) what a picture multiplies numbers with, linear."""
    return linear(Image(image.pixels[:, :, :1], image.encoding))[..., 0]


def mean_texel(image: Image) -> float:
    """Mean of a picture that multiplies a number."""
    return float(first_channel(image).mean(dtype=np.float64))


def scalar(value: Value) -> float:
    """Of a value that must be one; PluginError else."""
    if isinstance(value, tuple | str):
        raise PluginError("only numbers of a shape may have pictures")
    return float(value)


def _times(value: Value, colour: npt.NDArray[np.float64]) -> Value:
    """A colour, or a number (by the first channel, as texels are read)."""
    if isinstance(value, tuple):
        red, green, blue = (float(v * c) for v, c in zip(value, colour, strict=True))
        return (red, green, blue)
    return float(value) * float(colour[0])


def shapes(
    scene: Scene,
    materials: Sequence[MaterialId],
    registry: Registry,
    mean: Callable[[Image], float] | None = None,
    steep: Callable[[Image], float] = mean_slope,
) -> Shapes:
    """The table of BRDF kernels for `materials`; see `Resolved.typical` and `slope_of` for the means."""
    address, terms, offset, problems = [], [], [], []
    data: list[npt.NDArray[np.float32]] = []
    tables: list[Table] = []
    length = 0
    for material in materials:
        resolved = resolve(scene.material(material), registry)
        shape = finite_shape(resolved.brdf, resolved.typical(mean))
        address.append(resolved.brdf.address)
        terms.append(resolved.brdf.terms)
        offset.append(length)
        data.append(shape)
        length += len(shape)
        tables += resolved.tables
        if resolved.problem:
            problems.append(resolved.problem)
    flat = np.concatenate([*data, np.zeros(1, np.float32)])
    made = (np.array(address, np.int64), np.array(terms, np.int64), np.array(offset, np.int64))
    tilt = np.array([slope_of(scene.material(name), steep) for name in materials], np.float32)
    return Shapes(*made, flat, tuple(problems), tuple(tables), tilt=tilt if tilt.any() else None)


def finite_shapes(brdf: Brdf, rows: Sequence[Mapping[str, Value]]) -> list[npt.NDArray[np.float32]]:
    """`finite_shape` of many values of a material, by the model's own way to make them where it has one."""
    many = getattr(brdf, "shapes", None)
    if many is None or not rows:
        return [finite_shape(brdf, values) for values in rows]
    return [_finite(brdf, made) for made in many(rows)]


def finite_shape(brdf: Brdf, values: Mapping[str, Value]) -> npt.NDArray[np.float32]:
    """What the model's kernel reads; PluginError when it is not finite."""
    return _finite(brdf, brdf.shape(values))


def _finite(brdf: Brdf, shape: npt.ArrayLike) -> npt.NDArray[np.float32]:
    made = np.atleast_1d(np.asarray(shape, np.float32))
    if not np.isfinite(made).all():
        raise PluginError(f"model {brdf.id!r} gave a shape that is not finite")
    return made


def same_shapes(a: Shapes, b: Shapes) -> bool:
    """Whether the kernels would compute the same."""
    pairs = ((a.address, b.address), (a.terms, b.terms), (a.offset, b.offset), (a.data, b.data))
    if (a.row is None) != (b.row is None) or not all(np.array_equal(x, y) for x, y in pairs):
        return False
    if (a.tilt is None) != (b.tilt is None) or not np.array_equal(_of(a.tilt), _of(b.tilt)):
        return False
    return a.row is None or b.row is None or a.row is b.row or np.array_equal(a.row, b.row)


def _of(tilt: npt.NDArray[np.float32] | None) -> npt.NDArray[np.float32]:
    return np.zeros(0, np.float32) if tilt is None else tilt


def coefficients(resolved: Resolved, width: int = 0) -> npt.NDArray[np.float32]:
    """(T, 3) of an untextured material, or (H, W, T, 3) with rows from v = 0 up.

    T is the model's number of terms, or `width` where that is more: zeros follow.
    """
    values: dict[str, Any] = {
        name: np.asarray(v, np.float32) for name, v in resolved.values.items() if _numeric(v)
    }
    sizes = [texture.image.pixels.shape[:2] for texture in resolved.textures.values()]
    size = (max(h for h, _ in sizes), max(w for _, w in sizes)) if sizes else None
    for name, texture in resolved.textures.items():
        texels = linear_rgb(texture.image)[::-1]
        if size is not None and texels.shape[:2] != size:
            rows = np.arange(size[0]) * texels.shape[0] // size[0]
            columns = np.arange(size[1]) * texels.shape[1] // size[1]
            texels = texels[rows][:, columns]
        values[name] = values[name] * (texels[..., 0] if values[name].ndim == 0 else texels)
    if size is not None:
        for name, value in values.items():
            tail = value.shape[-1:] if value.ndim in (1, 3) else ()
            values[name] = np.broadcast_to(value, (*size, *tail))
    return padded(np.asarray(resolved.brdf.coefficients(values), np.float32), width)


def _numeric(value: Value) -> bool:
    return not isinstance(value, str | bool)


def linear(image: Image) -> npt.NDArray[np.float32]:
    """(H, W, C) scene-linear float32 (alpha untouched)."""
    pixels = image.pixels
    if pixels.dtype == np.uint8:
        ramp = np.arange(256, dtype=np.float64) / 255
        if image.encoding == "srgb":
            decoded = np.where(ramp <= 0.04045, ramp / 12.92, ((ramp + 0.055) / 1.055) ** 2.4)
            made: npt.NDArray[np.float32] = decoded.astype(np.float32)[pixels]
            if pixels.shape[2] == 4:
                made[..., 3] = ramp.astype(np.float32)[pixels[..., 3]]
            return made
        plain: npt.NDArray[np.float32] = ramp.astype(np.float32)[pixels]
        return plain
    if image.encoding == "srgb":
        bent = np.where(pixels <= 0.04045, pixels / 12.92, ((np.maximum(pixels, 0.0) + 0.055) / 1.055) ** 2.4)
        if pixels.shape[2] == 4:
            bent[..., 3] = pixels[..., 3]
        return bent.astype(np.float32)
    straight: npt.NDArray[np.float32] = pixels
    return straight


def linear_rgb(image: Image) -> npt.NDArray[np.float32]:
    """(H, W, 3) scene-linear, contiguous; grey is taken for all three, alpha is left out."""
    pixels = linear(image)[..., :3]
    return np.ascontiguousarray(np.broadcast_to(pixels, (*pixels.shape[:2], 3)))


__all__ = [
    "Resolved",
    "coefficients",
    "finite_shape",
    "finite_shapes",
    "first_channel",
    "linear",
    "linear_rgb",
    "mean_texel",
    "resolve",
    "same_shapes",
    "scalar",
    "shape_paints",
    "shape_textures",
    "shapes",
]
