"""Which parameters of a material strokes may change, and materials that look alike and let them change more.

Matte paint has no shine to be painted on, and what is all metal or none has no colour of its shine beside
that of its matte part. The model `specgloss` has these looks as well, with a colour, a shine and a gloss.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping

import numpy as np

from studio_core.arrays import frozen_map
from studio_core.contract import Registry
from studio_core.errors import LucarneError
from studio_core.params import Colour, Value, param_infos
from studio_core.scene.geometry import Texture
from studio_core.scene.nodes import Material
from studio_core.shading.materials import Resolved, linear_rgb, resolve, scalar

PAINTABLE = "specgloss"
ROLES = ("diffuse", "specular", "gloss")
MOST = 0.08
"""F0 of what `ggx` has no metal of, at its reflectance 1."""
LEAST = 0.02
"""F0 from which on `specgloss` reflects all that grazes, as `ggx` always does."""
BLACK: Colour = (0.0, 0.0, 0.0)
_Look = tuple[dict[str, Value], dict[str, Texture]]


def material_roles(material: Material, registry: Registry) -> Mapping[str, str]:
    """The material's parameters by role (`studio_core.contract.PaintableBrdf`); empty where none is known."""
    try:
        model = registry.brdf(material.model)
    except LucarneError:
        return frozen_map()
    infos = param_infos(model.Params)
    roles: Mapping[str, str] = getattr(model, "roles", {})
    return frozen_map({role: name for role, name in roles.items() if role in ROLES and name in infos})


def paintable(material: Material, registry: Registry) -> Material:
    """The same look in a model with all three roles, or the material itself.

    It stays what it is where its model has them all, or where no model with them has its look exactly: then
    the roles that it has can be painted (`material_roles`).
    """
    made = _LOOKS.get(material.model)
    if made is None:
        return material
    resolved = resolve(material, registry)
    look = None if resolved.problem else made(resolved)
    if look is None or PAINTABLE not in registry.names("brdf"):
        return material
    models = resolved.brdf, registry.brdf(PAINTABLE)
    own = {name for model in models for name in (*param_infos(model.Params), *model.textures)}
    values = {name: value for name, value in material.values.items() if name not in own} | look[0]
    kept = {name: texture for name, texture in material.textures.items() if name not in own}
    textures = frozen_map(kept | look[1])
    return dataclasses.replace(material, model=PAINTABLE, values=frozen_map(values), textures=textures)


def _matte(resolved: Resolved) -> _Look:
    values: dict[str, Value] = {"diffuse": resolved.values["base_color"], "specular": BLACK}
    return values, _laid(resolved, diffuse="base_color")


def _facets(resolved: Resolved) -> _Look | None:
    """Of `ggx`, where it is all metal or none."""
    metal = scalar(resolved.values["metallic"])
    if metal == 1 and "metallic" not in resolved.textures:
        values, textures = _metal(resolved)
    elif metal == 0:
        values, textures = _no_metal(resolved)
    else:
        return None
    if _darkest(values["specular"], textures.get("specular")) < LEAST:
        return None
    roughness = resolved.shaping.get("roughness")
    if roughness is not None:
        textures["roughness"] = roughness
    return values | {name: resolved.values[name] for name in ("roughness", "keep_energy")}, textures


def _metal(resolved: Resolved) -> _Look:
    values: dict[str, Value] = {"diffuse": BLACK, "specular": resolved.values["base_color"]}
    return values, _laid(resolved, specular="base_color")


def _no_metal(resolved: Resolved) -> _Look:
    head_on = MOST * scalar(resolved.values["specular"])
    values: dict[str, Value] = {
        "diffuse": resolved.values["base_color"],
        "specular": (head_on, head_on, head_on),
    }
    textures = _laid(resolved, diffuse="base_color", specular="specular")
    picture = textures.get("specular")
    if picture is not None and picture.image.pixels.shape[2] > 1:  # of a number's the first channel counts
        grey = dataclasses.replace(picture.image, pixels=picture.image.pixels[..., :1])
        textures["specular"] = dataclasses.replace(picture, image=grey)
    return values, textures


def _laid(resolved: Resolved, **names: str) -> dict[str, Texture]:
    """Pictures by new names from their old ones."""
    return {new: resolved.textures[old] for new, old in names.items() if old in resolved.textures}


def _darkest(value: Value, texture: Texture | None) -> float:
    """The brightest channel of a colour, where its picture makes that least."""
    colour = np.asarray(value, np.float64)
    if texture is None:
        return float(colour.max())
    return float((linear_rgb(texture.image) * colour).max(axis=2).min())


_LOOKS: Mapping[str, Callable[[Resolved], _Look | None]] = {"lambert": _matte, "ggx": _facets}

__all__ = ["PAINTABLE", "ROLES", "material_roles", "paintable"]
