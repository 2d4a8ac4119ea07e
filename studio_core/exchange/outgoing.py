"""From a material of ours to what files of other programs can say, as near as it comes.

=================  ==================================================================================
model              surface
=================  ==================================================================================
lambert            matte: no reflection at all; oren-nayar with the roughness of its matte part
ggx                metallic-roughness; its reflectance as an index of refraction
specgloss          its matte colour, F0 as index and colour of the reflection, F90 as its weight; metal where
                   it has no matte part
ggx-conductor      metal with the tint of its rim
ggx-dielectric     black with its index and the tint as the reflection's colour
plastic            the light its ground sends back as base colour (depth included), under its index; gloss
                   as the reflection's weight
cloth              matte with a sheen
phong,             roughness = √α with α² = 2 / (4n + 2); blinn-phong α² = 2 / (n + 2); then the width at
blinn-phong        which GGX, of longer tails, comes nearest up to 60°. Highlight colours become F0 of a
                   dielectric, or a metal where there is no matte part
ward,              the same with the α along and across the grain (α² = 2 / (n + 2) of both exponents);
ashikhmin-shirley  metals have the width that is nearest at all angles
any other          fitted (`nearest`); a picture of how much light each texel returns
=================  ==================================================================================

Only lambert, ggx and specgloss are exact; of all others the distance can be measured (`measuring`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.arrays import frozen_map
from studio_core.brdfs.albedo import term_albedo
from studio_core.brdfs.samples import Samples
from studio_core.contract import Registry
from studio_core.exchange.measuring import Flat, distance
from studio_core.exchange.nearest import fitted, rescaled
from studio_core.exchange.surface import NORMAL, WHITE, Surface, ior_of, stretched
from studio_core.params import Colour
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Material
from studio_core.shading.materials import Resolved, coefficients, first_channel, linear_rgb, resolve
from studio_core.shading.normal_maps import normal_texture, strength

COMMON = 0.5  # cosine of the flattest directions by which Phong's highlights are compared: theirs don't
# grow towards grazing angles, as those of facets do, and would become far too wide head-on
F32 = npt.NDArray[np.float32]
SAME = 5e-4  # of the metric: nobody sees it
NO_MATTE = 0.02  # albedo under which a material with a highlight counts as metal
HIGHEST_F0 = 0.08
LEAST_F0 = 0.02
"""Under which `specgloss` reflects less than all that grazes."""
BAND = 128
GLOSSY_GROUND = 1


@dataclass(frozen=True)
class Outgoing:
    """A surface for a material; `notes` in sentences, `label` of the model where it is not the same."""

    surface: Surface
    notes: tuple[str, ...]
    label: str = ""
    samples: Samples | None = None

    def told(self, written: Surface, name: str) -> tuple[str, ...]:
        """What to say of the surface as a file can have it: how far it is from the material."""
        if self.samples is None:
            return self.notes
        metric = distance(written, self.samples).metric
        if metric < SAME:
            return self.notes
        nearest = f"{written.name}: {name} has no {self.label}; its nearest was written, {metric:.1%} off."
        return (*self.notes, nearest)


def surface_of(material: Material, registry: Registry) -> Outgoing:
    """The nearest surface; InputError where a model cannot be evaluated at all."""
    resolved = resolve(material, registry)
    notes = [resolved.problem] if resolved.problem else []
    model = resolved.brdf.id
    exact = model in ("lambert", "ggx", "specgloss")
    flat = Flat.of(resolved)
    samples = None if exact else flat.samples()
    if samples is None or model in _KNOWN:
        made = _KNOWN[model](resolved, notes)
        if samples is not None and model in ("phong", "blinn-phong"):
            made = rescaled(made, samples, COMMON)
        elif samples is not None and _KNOWN[model] is _highlight and made.metallic > 0:
            made = rescaled(made, samples)
    else:
        made = _fitted(resolved, flat, samples)
    textures = dict(made.textures)
    strong = 1.0
    bumps = normal_texture(material)
    if bumps is not None:
        textures[NORMAL] = bumps
        strong = strength(material)
    made = replace(
        made,
        name=material.name,
        opacity=float(material.opacity),
        normal_strength=strong,
        textures=frozen_map(textures),
    )
    named = tuple(note if note.startswith(material.name) else f"{material.name}: {note}" for note in notes)
    return Outgoing(made, named, "" if exact else str(resolved.brdf.label), samples)


def _values(resolved: Resolved) -> Mapping[str, Any]:
    return resolved.values


def _laid(resolved: Resolved, **names: str) -> Mapping[str, Texture]:
    """Pictures by our field from parameters of the model, as they are."""
    every = {**resolved.textures, **resolved.shaping}
    return frozen_map({ours: every[name] for ours, name in names.items() if name in every})


def _matte(resolved: Resolved, notes: list[str]) -> Surface:
    v = _values(resolved)
    rough = float(v["roughness"]) if resolved.brdf.id == "oren-nayar" else 0.0
    return Surface(
        base_color=v["base_color"],
        roughness=1.0,
        specular=0.0,
        diffuse_roughness=rough,
        textures=_laid(resolved, base_color="base_color"),
    )


def _ggx(resolved: Resolved, notes: list[str]) -> Surface:
    v = _values(resolved)
    specular = float(v["specular"])
    if "specular" in resolved.textures:
        specular *= float(first_channel(resolved.textures["specular"].image).mean(dtype=np.float64))
        notes.append("files of other programs take one reflectance; its picture's mean was written.")
    return Surface(
        base_color=v["base_color"],
        metallic=float(v["metallic"]),
        roughness=float(v["roughness"]),
        ior=ior_of(HIGHEST_F0 * specular),
        textures=_laid(resolved, base_color="base_color", metallic="metallic", roughness="roughness"),
    )


def _shining(resolved: Resolved, notes: list[str]) -> Surface:
    """F0 of a dielectric is that of its index, times the weight and the colour; F90 is the weight."""
    v = _values(resolved)
    picture = resolved.textures.get("specular")
    f0 = np.clip(np.asarray(v["specular"], np.float32), 0, 1)
    texels = f0 if picture is None else f0 * linear_rgb(picture.image)
    brightest = texels.max(axis=-1, keepdims=True)
    made = Surface(roughness=float(v["roughness"]))
    if max(v["diffuse"]) <= 0 and float(brightest.min()) >= LEAST_F0:
        laid = _laid(resolved, base_color="specular", roughness="roughness")
        return replace(made, base_color=_colour(f0), metallic=1.0, textures=laid)
    made = replace(made, base_color=_colour(v["diffuse"]))
    textures = dict(_laid(resolved, base_color="diffuse", roughness="roughness"))
    weight = np.minimum(brightest / np.float32(LEAST_F0), np.float32(1))
    if not weight.any():
        return replace(made, specular=0.0, textures=frozen_map(textures))
    strongest = max(float(brightest.max()), LEAST_F0)
    colour = texels / np.maximum(weight * np.float32(strongest), np.float32(1e-9))
    made = replace(made, ior=ior_of(strongest))
    if picture is None:
        return replace(
            made, specular=float(weight.max()), specular_color=_colour(colour), textures=frozen_map(textures)
        )
    textures["specular_color"] = _picture(colour, picture)
    if weight.min() < 1:
        textures["specular"] = _picture(weight, picture)
    return replace(made, textures=frozen_map(textures))


def _conductor(resolved: Resolved, notes: list[str]) -> Surface:
    v = _values(resolved)
    return Surface(
        base_color=v["base_color"],
        metallic=1.0,
        roughness=float(v["roughness"]),
        edge_tint=v["edge_tint"],
        textures=_laid(resolved, base_color="base_color", edge_tint="edge_tint", roughness="roughness"),
    )


def _clear(resolved: Resolved, notes: list[str]) -> Surface:
    v = _values(resolved)
    return Surface(
        base_color=(0.0, 0.0, 0.0),
        ior=float(v["ior"]),
        roughness=float(v["roughness"]),
        specular_color=v["tint"],
        textures=_laid(resolved, specular_color="tint", roughness="roughness"),
    )


def _plastic(resolved: Resolved, notes: list[str]) -> Surface:
    v = _values(resolved)
    textures = dict(_laid(resolved, specular="gloss", roughness="roughness"))
    base: Colour = WHITE
    if "base_color" in resolved.textures:
        ground = _by_texel(resolved, lambda made: made[..., GLOSSY_GROUND, :])
        textures["base_color"] = _picture(ground, resolved.textures["base_color"])
    else:
        base = _colour(Flat.of(resolved).colours[GLOSSY_GROUND])
    return Surface(
        base_color=base,
        ior=float(v["ior"]),
        roughness=float(v["roughness"]),
        specular=float(v["gloss"]),
        textures=frozen_map(textures),
    )


def _cloth(resolved: Resolved, notes: list[str]) -> Surface:
    v = _values(resolved)
    return Surface(
        base_color=v["base_color"],
        roughness=1.0,
        specular=0.0,
        sheen_color=v["sheen"],
        sheen_roughness=float(v["roughness"]),
        textures=_laid(resolved, base_color="base_color", sheen_color="sheen", sheen_roughness="roughness"),
    )


def _highlight(resolved: Resolved, notes: list[str]) -> Surface:
    """A matte part and a highlight whose width is known along and across its grain."""
    v = _values(resolved)
    along, across = _widths(resolved.brdf.id, v)
    roughness, strength = stretched(max(along, across), min(along, across))
    turn = float(v.get("direction", 0.0)) + (90.0 if across > along else 0.0)
    coat = resolved.brdf.id == "ashikhmin-shirley"  # there the highlight takes its light from what is below
    diffuse, specular = np.clip(v["diffuse"], 0, 1), np.clip(v["specular"], 0, 1)
    excess = 1.0 if coat else np.maximum(diffuse + specular, 1.0)
    diffuse, specular = diffuse / excess, specular / excess
    made = Surface(roughness=roughness, anisotropy=strength, anisotropy_rotation=turn if strength else 0.0)
    if diffuse.max() < NO_MATTE:
        laid = _laid(resolved, base_color="specular", roughness="roughness")
        return replace(made, base_color=_colour(specular), metallic=1.0, textures=laid)
    strongest = float(specular.max())
    # No coat: the rim reflects at most four times what the middle does.
    weight = 1.0 if coat else min(max(4 * strongest, 1e-3), 1.0)
    base = diffuse if coat else np.minimum(diffuse / max(1 - strongest, 1e-3), 1.0)
    return replace(
        made,
        base_color=_colour(base),
        ior=ior_of(strongest / weight),
        specular=weight,
        specular_color=_colour(specular / strongest) if strongest > 0 else WHITE,
        textures=_laid(resolved, base_color="diffuse", specular_color="specular", roughness="roughness"),
    )


def _widths(model: str, v: Mapping[str, Any]) -> tuple[float, float]:
    """α along and across the grain."""
    if model == "ward":
        lean = np.sqrt(1 - 0.9 * float(v["anisotropy"]))
        alpha = float(v["roughness"]) ** 2
        return alpha * lean, min(alpha / lean, 1.0)
    if model == "ashikhmin-shirley":
        sharp = (float(v["sharpness_along"]), float(v["sharpness_across"]))
        return (2 / (sharp[0] + 2)) ** 0.5, (2 / (sharp[1] + 2)) ** 0.5
    alpha = (2 / (float(v["exponent"]) * (4 if model == "phong" else 1) + 2)) ** 0.5
    return alpha, alpha


def _fitted(resolved: Resolved, flat: Flat, samples: Samples) -> Surface:
    """Fitted to the material at the mean of its pictures, its colour varied as its albedo does."""
    made = fitted(samples)
    base = made.base_color
    made = replace(made, textures=_laid(resolved, roughness="roughness"))
    if not resolved.textures:
        return made
    first = next(iter(resolved.textures.values()))
    shares = _mean_terms(flat).astype(np.float32)
    albedo = _by_texel(resolved, lambda made: np.maximum(np.einsum("hwkc,k->hwc", made, shares), 0))
    mean = albedo.mean(axis=(0, 1), dtype=np.float64)
    gain = (np.asarray(base) / np.maximum(mean, 1e-6)).astype(np.float32)
    picture = _picture(albedo * gain, first)
    return replace(made, base_color=WHITE, textures=frozen_map({**made.textures, "base_color": picture}))


def _by_texel(resolved: Resolved, what: Callable[[F32], F32]) -> F32:
    """(H, W, 3) of the coefficients (rows, W, T, 3), rows from the top; by bands where pictures are alike."""
    sizes = {texture.image.pixels.shape[:2] for texture in resolved.textures.values()}
    if len(sizes) > 1:
        return what(coefficients(resolved)[::-1])
    made = []
    for top in range(0, next(iter(sizes))[0], BAND):
        cut = {
            name: replace(t, image=replace(t.image, pixels=t.image.pixels[top : top + BAND]))
            for name, t in resolved.textures.items()
        }
        made.append(what(coefficients(replace(resolved, textures=cut))[::-1]))
    return np.concatenate(made)


def _mean_terms(flat: Flat) -> Any:
    """(T,) share of each term under a white sky."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    mu = (nodes + 1) / 2
    found = term_albedo(flat.resolved.brdf, flat.shape, np.arccos(mu))
    return np.einsum("a,ak->k", weights * mu, found)


def _picture(pixels: Any, like: Texture) -> Texture:
    image = Image(np.ascontiguousarray(np.clip(pixels, 0, 1), np.float32))
    return replace(like, image=image)


def _colour(value: Any) -> Colour:
    red, green, blue = (float(min(max(v, 0.0), 1.0)) for v in value)
    return (red, green, blue)


_KNOWN: dict[str, Callable[[Resolved, list[str]], Surface]] = {
    "lambert": _matte,
    "oren-nayar": _matte,
    "ggx": _ggx,
    "specgloss": _shining,
    "ggx-conductor": _conductor,
    "ggx-dielectric": _clear,
    "plastic": _plastic,
    "cloth": _cloth,
    "phong": _highlight,
    "blinn-phong": _highlight,
    "ward": _highlight,
    "ashikhmin-shirley": _highlight,
}

__all__ = ["Outgoing", "surface_of"]
