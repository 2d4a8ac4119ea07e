"""Materials for Mitsuba 3: native BSDFs where they say the same, our own Python BSDFs for the others.

=============  =====================================================================================
model          Mitsuba
=============  =====================================================================================
lambert        `diffuse`
phong          `lucarne_phong` (bsdfs.py)
blinn-phong    `lucarne_blinn_phong` (bsdfs.py)
ggx            `roughconductor` without material where F = 1 (white metal) and nothing bounces between
               facets (keep_energy off); else `lucarne_ggx`
specgloss      `lucarne_specgloss`
any other      the nearest of `diffuse` and `lucarne_ggx`, with a note that tells how far it is
=============  =====================================================================================

All are wrapped in `normalmap` where they have one, in `twosided`, and in `mask` where opacity is below 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import numpy.typing as npt

from studio_core.brdfs.albedo import mean_albedo
from studio_core.contract import Registry
from studio_core.exchange.measuring import between
from studio_core.exchange.outgoing import surface_of
from studio_core.imaging.encode import write_exr, write_png
from studio_core.params import Value, param_infos
from studio_core.scene.geometry import Texture
from studio_core.scene.nodes import Material, MaterialId, Scene
from studio_core.shading.materials import Resolved, linear, resolve
from studio_core.shading.normal_maps import normal_texture, strength, turn, unit_normals
from studio_plugins.export.mitsuba_xml import prop, put, ref, rgb

FACETS = {"ggx": "lucarne_ggx", "specgloss": "lucarne_specgloss"}
OWN = {"phong": "lucarne_phong", "blinn-phong": "lucarne_blinn_phong", **FACETS}
LEAST_ALPHA = 1e-4
MATTE = 1e-3  # reflectance head-on under which nobody sees a shine


@dataclass
class Materials:
    """Writes materials into `root` once each, and their textures into `folder`/textures."""

    scene: Scene
    registry: Registry
    root: Element
    folder: Path
    notes: list[str] = field(default_factory=list)
    _keys: dict[tuple[MaterialId, MaterialId], str] = field(default_factory=dict)
    _sides: dict[MaterialId, str] = field(default_factory=dict)
    _files: dict[tuple[Any, ...], str] = field(default_factory=dict)

    def use(self, parent: Element, front: MaterialId, back: MaterialId) -> None:
        """Refer to the material seen from the front and from behind."""
        if (front, back) not in self._keys:
            sides = [self._side(front), *([self._side(back)] if back != front else [])]
            material = self.scene.material(front)
            key = f"material-{len(self._keys)}"
            if material.opacity < 1:
                outer = put(self.root, "bsdf", "mask", key=key)
                prop(outer, "float", "opacity", float(material.opacity))
                both = put(outer, "bsdf", "twosided")
                self._note_opacity(material)
            else:
                both = put(self.root, "bsdf", "twosided", key=key)
            for side in sides:
                ref(both, side)
            self._keys[front, back] = key
        ref(parent, self._keys[front, back])

    def _note_opacity(self, material: Material) -> None:
        shadow = "no shadow" if not material.casts_shadow else "a full shadow"
        self.notes.append(
            f"{material.name}: Mitsuba lets {1 - material.opacity:.0%} of the light through its shadow "
            f"where the studio gives {shadow}, and counts passing through it as a bounce."
        )

    def _side(self, key: MaterialId) -> str:
        if key not in self._sides:
            self._sides[key] = f"side-{len(self._sides)}"
            material = self.scene.material(key)
            bumps, inner = normal_texture(material), self._sides[key]
            if bumps is not None:
                inner = f"{inner}-flat"
            self._bsdf(material, inner)
            if bumps is not None:
                made = put(self.root, "bsdf", "normalmap", key=self._sides[key])
                self._bitmap(made, "normalmap", self._normals(material, bumps), True, bumps)
                ref(made, inner)
        return self._sides[key]

    def _bsdf(self, material: Material, key: str) -> None:
        resolved = resolve(material, self.registry)
        if resolved.problem:
            self.notes.append(resolved.problem)
        model, values = resolved.brdf.id, resolved.typical()
        for name in resolved.shaping:
            self.notes.append(f"{material.name}: its picture of {name} was written as its mean.")
        if model == "lambert":
            made = put(self.root, "bsdf", "diffuse", key=key)
            self._parameter(made, "reflectance", resolved, "base_color")
        elif model == "ggx" and _is_white_mirror(resolved):
            made = put(self.root, "bsdf", "roughconductor", key=key)
            prop(made, "string", "material", "none")
            rgb(made, "specular_reflectance", (1, 1, 1))
            prop(made, "string", "distribution", "ggx")
            prop(made, "float", "alpha", _alpha(values))
            prop(made, "boolean", "sample_visible", True)
        elif model in OWN:
            made = put(self.root, "bsdf", OWN[model], key=key)
            for name in param_infos(resolved.brdf.Params):
                if model in FACETS and name == "roughness":
                    numbers = resolved.brdf.shape(values)
                    prop(made, "float", "alpha", float(numbers[0]))
                    prop(made, "string", "facets", " ".join(repr(float(v)) for v in numbers[1:]))
                elif name != "keep_energy":  # which the numbers of the facets say
                    self._parameter(made, name, resolved, name)
        else:
            near = nearest(material, resolved, self.registry)
            off = between(resolve(near, self.registry), resolved)
            label = self.registry.brdf(near.model).label
            told = f"Mitsuba has no {resolved.brdf.label}; written as {label}, {off:.1%} off."
            self.notes.append(f"{material.name}: {told}")
            self._bsdf(near, key)

    def _parameter(self, parent: Element, name: str, resolved: Resolved, source: str) -> None:
        value, texture = resolved.values[source], resolved.textures.get(source)
        if texture is not None:
            self._texture(parent, name, value, texture)
        elif isinstance(value, tuple):
            rgb(parent, name, np.clip(value, 0, 1))
        else:
            prop(parent, "float", name, float(value))

    def _texture(self, parent: Element, name: str, value: Value, texture: Texture) -> None:
        """A bitmap of texture · value, in the studio's texture coordinates."""
        file, raw = self._picture(value, texture)
        self._bitmap(parent, name, file, raw, texture)

    def _bitmap(self, parent: Element, name: str, file: str, raw: bool, texture: Texture) -> None:
        made = put(parent, "texture", "bitmap", name=name)
        prop(made, "string", "filename", file)
        prop(made, "boolean", "raw", raw)
        prop(made, "string", "filter_type", "bilinear")
        prop(made, "string", "wrap_mode", "repeat")
        # Mitsuba's v runs down the picture and the studio's runs up: 1 − (c u + d v + s).
        a, b, t, c, d, s = texture.affine
        rows = ((a, b, 0.0, t), (-c, -d, 0.0, 1.0 - s), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        held = put(made, "transform", name="to_uv")
        put(held, "matrix").attrib["value"] = " ".join(repr(number) for row in rows for number in row)

    def _normals(self, material: Material, texture: Texture) -> str:
        """The file of a normal map at the material's strength, turned as it lies on the surface."""
        strong, lies = strength(material), turn(texture)
        known = (texture.image.key, strong, lies)
        if known not in self._files:
            normals = unit_normals(texture.image, strong)
            normals[..., :2] = normals[..., :2] @ np.array(lies, np.float32).reshape(2, 2).T
            (self.folder / "textures").mkdir(exist_ok=True)
            self._files[known] = f"textures/{len(self._files)}.exr"
            write_exr(self.folder / self._files[known], (normals + 1) / 2)
        return self._files[known]

    def _picture(self, value: Value, texture: Texture) -> tuple[str, bool]:
        image, colour = texture.image, isinstance(value, tuple)
        known = (image.key, value, colour)
        as_it_is = value == (1.0, 1.0, 1.0) and image.pixels.dtype == np.uint8 and image.encoding == "srgb"
        suffix = "png" if as_it_is else "exr"
        if known not in self._files:
            (self.folder / "textures").mkdir(exist_ok=True)
            self._files[known] = f"textures/{len(self._files)}.{suffix}"
            target = self.folder / self._files[known]
            if as_it_is:
                write_png(target, _three(image.pixels))
            elif colour:
                write_exr(target, np.clip(_three(linear(image)) * np.asarray(value, np.float32), 0, 1))
            else:
                scalar = linear(image)[..., :1] * np.asarray(value, np.float32)
                write_exr(target, np.clip(scalar, 0, 1))
        return self._files[known], not as_it_is


def nearest(material: Material, resolved: Resolved, registry: Registry) -> Material:
    """The nearest that Mitsuba can have: matte where it hardly shines, else metallic-roughness."""
    found = surface_of(material, registry).surface.smooth()
    textures = {"base_color": found.textures["base_color"]} if "base_color" in found.textures else {}
    values: dict[str, Value] = {"base_color": found.base_color}
    if found.metallic <= 0 and found.specular * found.f0 < MATTE:
        if max(found.sheen_color) > 0 and not resolved.textures:
            red, green, blue = (float(c) for c in np.clip(mean_albedo(resolved.brdf, resolved.values), 0, 1))
            values["base_color"] = (red, green, blue)
        return replace(material, model="lambert", values=values, textures=textures)
    mean = found.mean()
    wide, narrow = mean.alphas
    strength = mean.f0 * mean.specular * max(mean.specular_color)
    values |= {
        "metallic": mean.metallic,
        "roughness": float((wide * narrow) ** 0.25),
        "specular": min(strength / 0.08, 1.0),
    }
    return replace(material, model="ggx", values=values, textures=textures)


def _three(pixels: npt.NDArray[Any]) -> npt.NDArray[Any]:
    return np.repeat(pixels, 3, axis=2) if pixels.shape[2] == 1 else pixels[..., :3]


def _alpha(values: Mapping[str, Value]) -> float:
    roughness = float(values["roughness"])  # type: ignore[arg-type]
    return max(roughness * roughness, LEAST_ALPHA)


def _is_white_mirror(resolved: Resolved) -> bool:
    if resolved.values["keep_energy"]:
        return False
    white = resolved.values["metallic"] == 1.0 and resolved.values["base_color"] == (1.0, 1.0, 1.0)
    return white and not {"metallic", "base_color"} & set(resolved.textures)
