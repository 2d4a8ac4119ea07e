"""Materials whose parameters are pictures: in their own model, or in the nearest that takes such pictures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.arrays import frozen_map
from studio_core.contract import Registry
from studio_core.params import Value, param_infos
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Material
from studio_core.shading.materials import Resolved, shape_textures
from studio_core.shading.normal_maps import NORMAL

F32 = npt.NDArray[np.float32]
MOST = 0.08  # F0 of what ggx has no metal of, at its reflectance 1
ALIKE = 1e-6
Arrays = Mapping[str, F32]
"""By parameter, (N,) numbers or (N, 3) colours."""


@dataclass(frozen=True)
class Look:
    """A model with the parameters that vary, the others, and the label of another model that was painted."""

    model: str
    varying: Arrays
    values: Mapping[str, Value]
    stands_for: str = ""


def look_of(resolved: Resolved, varying: Arrays) -> tuple[Look, tuple[str, ...]]:
    """The model that can have these as pictures, and the names of those that none can have."""
    model = resolved.brdf
    alike = {name: _value(values) for name, values in varying.items() if is_constant(values)}
    varying = {name: values for name, values in varying.items() if name not in alike}
    values = {**resolved.values, **alike}
    convert, exact = _CONVERTED.get(model.id, (None, True))
    takes = {*model.textures, *shape_textures(model)} - _ONE_NUMBER.get(model.id, set())
    if convert is not None and not set(varying) <= takes:
        count = len(next(iter(varying.values())))
        every = {name: _wide(value, count) for name, value in values.items() if _numeric(value)}
        made = convert(every | varying)
        kept = {"keep_energy": values["keep_energy"]} if "keep_energy" in values else {}
        became = "ggx" if "base_color" in made else "specgloss"
        return Look(became, made, kept, "" if exact else model.label), ()
    lost = tuple(name for name in varying if name not in takes)
    return Look(model.id, {n: v for n, v in varying.items() if n in takes}, values), lost


def material_of(
    look: Look, painted: Material, textures: Mapping[str, Texture], key: str, name: str, registry: Registry
) -> Material:
    """A new material; what varies has pictures (`textures`, by parameter), the rest is as before."""
    infos = param_infos(registry.brdf(look.model).Params)
    values = {name: value for name, value in look.values.items() if name in infos or name == NORMAL}
    for parameter in textures:
        if parameter in infos:
            values[parameter] = (1.0, 1.0, 1.0) if infos[parameter].kind == "colour" else 1.0
    for parameter, array in look.varying.items():
        if parameter not in textures:
            values[parameter] = _value(array)
    if NORMAL in painted.values and NORMAL not in values:
        values[NORMAL] = painted.values[NORMAL]
    return Material(
        id=key,
        name=name,
        model=look.model,
        values=frozen_map(values),
        textures=frozen_map(textures),
        tables=painted.tables,
        opacity=painted.opacity,
        catches=painted.catches,
    )


def picture(values: F32) -> Image:
    """Of (H, W, C) linear texels."""
    return Image(np.ascontiguousarray(values, np.float32))


def is_constant(values: F32) -> bool:
    """Whether one value stands for all of (N,) or (N, C)."""
    return bool(np.ptp(values, axis=0).max(initial=0) <= ALIKE)


def _value(values: F32) -> Value:
    first = values[0]
    if first.ndim == 0:
        return float(first)
    red, green, blue = (float(c) for c in first)
    return (red, green, blue)


def _numeric(value: Value) -> bool:
    return not isinstance(value, str | bool)


def _wide(value: Value, count: int) -> F32:
    one = np.asarray(value, np.float32)
    return np.broadcast_to(one, (count, *one.shape))


def _facets(v: Mapping[str, F32]) -> Arrays:
    metal, base = v["metallic"][:, None], v["base_color"]
    head_on = MOST * v["specular"][:, None]
    shine = head_on * (1 - metal) + base * metal
    return {"diffuse": base * (1 - metal), "specular": shine, "roughness": v["roughness"]}


def _conductor(v: Mapping[str, F32]) -> Arrays:
    whole = np.ones(len(v["roughness"]), np.float32)
    return {"base_color": v["base_color"], "metallic": whole, "roughness": v["roughness"]}


def _two_lobes(power: float) -> Callable[[Mapping[str, F32]], Arrays]:
    """`power`: how many times as large the exponent of half vectors is."""

    def made(v: Mapping[str, F32]) -> Arrays:
        excess = np.maximum(v["diffuse"] + v["specular"], 1)
        alpha = np.sqrt(2 / (power * v["exponent"] + 2))
        return {
            "diffuse": v["diffuse"] / excess, "specular": v["specular"] / excess, "roughness": np.sqrt(alpha)
        }  # fmt: skip

    return made


_ONE_NUMBER = {"ggx": {"specular"}}
"""Pictures that other programs' files have no place for."""
_CONVERTED: Mapping[str, tuple[Callable[[Mapping[str, F32]], Arrays] | None, bool]] = {
    "ggx": (_facets, True),
    "ggx-conductor": (_conductor, False),
    "phong": (_two_lobes(4), False),
    "blinn-phong": (_two_lobes(1), False),
}
"""How a model's parameters become those of `specgloss` or `ggx`, and whether these say the same."""

__all__ = ["Look", "is_constant", "look_of", "material_of", "picture"]
