"""From what a file says about a surface to the model of ours that comes nearest, with what is lost.

=================================================  ====================================================
surface                                            model
=================================================  ====================================================
metallic-roughness, index up to 1.79               ggx, exactly
no reflection at all                               lambert; oren-nayar where the matte part is rough
cloth: no metal, dull, under a sheen               cloth
dielectric with a coloured reflection              specgloss, exactly where all that grazes is reflected
dielectric under a clear coat                      plastic: the coat on the base's colour
reflection weakened, or an index beyond 1.79       plastic: its gloss and index
black and no metal                                 ggx-dielectric
metal with a tint of the rim                       ggx-conductor
metal with a grain                                 ward
dielectric with a highlight 2.5 times as long      ashikhmin-shirley
=================================================  ====================================================

Pictures of what a model has as one number become their mean. Everything that is left out is said.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from studio_core.arrays import frozen_map
from studio_core.exchange.surface import NORMAL, WHITE, Surface, alike, times
from studio_core.params import Colour, Value
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Material, new_id
from studio_core.shading.materials import first_channel, linear_rgb

F32 = npt.NDArray[np.float32]

MOST_TEXELS = 1 << 22
"""Of pictures of colour and metal together: a table of coefficients takes 48 bytes each."""
HIGHEST_F0 = 0.08
LEAST_F0 = 0.02
"""From which on `specgloss` reflects all that grazes."""
GRAZES_ALIKE = 0.01
"""Mean difference of two surfaces' share of what grazes."""
LEAST_GRAIN = 0.05
LONG = 0.4  # width over length of a highlight under which a grain tells more than a round one
COAT_COUNTS = 0.5
LEAST_SHEEN, DULL = 0.05, 0.4
Say = Callable[[str], object]

_WORDS = {
    "base_color": "colour",
    "metallic": "metal",
    "roughness": "roughness",
    "specular": "reflectance",
    "specular_color": "reflection's colour",
    "sheen_color": "sheen",
    "sheen_roughness": "sheen's roughness",
    "clearcoat": "clear coat",
    "clearcoat_roughness": "clear coat's roughness",
    "anisotropy": "grain",
    "diffuse_roughness": "matte part's roughness",
    "edge_tint": "rim's tint",
    "opacity": "opacity",
}


def material_of(surface: Surface, say: Say) -> Material:
    """A new material; what its model cannot express goes to `say`, a sentence each."""
    return _Choice(surface, say).material()


@dataclass
class _Choice:
    surface: Surface
    say: Say

    def material(self) -> Material:
        s = self.surface
        textures = s.textures
        black = max(s.base_color) == 0 and "base_color" not in textures
        metal = s.metallic >= 0.5 or "metallic" in textures
        f0 = s.f0 * s.specular * max(s.specular_color)
        dull = s.roughness >= DULL or s.specular <= 0
        if max(s.sheen_color) >= LEAST_SHEEN and dull and not metal and s.clearcoat < COAT_COUNTS:
            return self._cloth()
        if s.specular <= 0 and s.metallic <= 0 and s.clearcoat < COAT_COUNTS:
            return self._matte()
        if s.metallic >= 0.5 and s.anisotropy > LEAST_GRAIN:
            return self._brushed()
        if s.metallic >= 0.99 and s.edge_tint != WHITE:
            return self._conductor()
        if s.alphas[1] < LONG * s.alphas[0] and not metal and s.clearcoat < COAT_COUNTS:
            return self._satin()
        if s.clearcoat >= COAT_COUNTS and not metal:
            return self._coated()
        if black and s.metallic <= 0:
            return self._clear()
        shine = self._shine() if not metal else None
        if shine is not None:
            return self._shining(shine)
        if not metal and (s.specular < 1 or f0 > HIGHEST_F0 + 1e-9):
            return self._glossy()
        return self._ggx(f0)

    def _matte(self) -> Material:
        s = self.surface
        values: dict[str, Value] = {"base_color": s.base_color}
        model = "lambert"
        if s.diffuse_roughness > 0:
            model = "oren-nayar"
            values["roughness"] = s.diffuse_roughness
        return self._made(
            model,
            values,
            {"base_color": "base_color"},
            "diffuse_roughness",
            "roughness",
            rough="diffuse_roughness",
        )

    def _cloth(self) -> Material:
        s = self.surface
        if s.specular > 0:
            self._tell("what lies below its sheen is matte")
        values: dict[str, Value] = {
            "base_color": s.base_color,
            "sheen": s.sheen_color,
            "roughness": s.sheen_roughness,
        }
        known = {"base_color": "base_color", "sheen_color": "sheen"}
        told = ("sheen_color", "roughness", "metallic", "specular", "specular_color")
        return self._made("cloth", values, known, *told, rough="sheen_roughness")

    def _ggx(self, f0: float) -> Material:
        s = self.surface
        if s.metallic < 1 or "metallic" in s.textures:
            if s.specular < 1:
                self._tell("its weakened reflection keeps its full strength at the rim")
            if f0 > HIGHEST_F0 + 1e-9:
                self._tell(f"it reflects {HIGHEST_F0:.0%} head-on instead of {f0:.0%}")
            if s.specular_color != WHITE:
                self._tell("the colour of its reflection became grey")
        grey = sum(s.specular_color) / 3
        values: dict[str, Value] = {
            "base_color": s.base_color,
            "metallic": s.metallic,
            "roughness": s.roughness,
            "specular": min(s.f0 * s.specular * grey / HIGHEST_F0, 1.0),
        }
        known = {name: name for name in ("base_color", "metallic", "roughness", "specular")}
        return self._made("ggx", values, known, "specular_color")

    def _shine(self) -> Surface | None:
        """With F0 as the reflection's colour, where it is not grey and F90 is that of `specgloss`."""
        s = self.surface
        colour, weight = s.textures.get("specular_color"), s.textures.get("specular")
        if s.specular_color == WHITE and colour is None:
            return None
        share: F32 = np.array([s.specular], np.float32)
        tint = np.asarray(s.specular_color, np.float32)
        if colour is not None:
            tint = tint * linear_rgb(colour.image)
        if weight is not None:
            if colour is None or not alike(colour, weight) or not _same_size(colour, weight):
                return None
            share = share * first_channel(weight.image)[..., None]
        f0 = np.float32(s.f0) * share * tint
        grazing = np.minimum(f0.max(axis=-1, keepdims=True) / np.float32(LEAST_F0), np.float32(1))
        if np.abs(grazing - share).mean() > GRAZES_ALIKE:
            return None
        if colour is None:
            return replace(s, specular_color=_triple(f0))
        if weight is None:
            return replace(s, specular_color=_triple(np.float32(s.f0) * share * np.asarray(s.specular_color)))
        textures = {name: texture for name, texture in s.textures.items() if name != "specular"}
        textures["specular_color"] = replace(colour, image=Image(f0))
        return replace(s, specular_color=WHITE, textures=frozen_map(textures))

    def _shining(self, shine: Surface) -> Material:
        values: dict[str, Value] = {
            "diffuse": shine.base_color,
            "specular": shine.specular_color,
            "roughness": shine.roughness,
        }
        known = {"base_color": "diffuse", "specular_color": "specular", "roughness": "roughness"}
        return _Choice(shine, self.say)._made("specgloss", values, known)

    def _glossy(self) -> Material:
        s = self.surface
        if s.specular_color != WHITE:
            self._tell("the colour of its reflection became white")
        values: dict[str, Value] = {
            "base_color": s.base_color,
            "roughness": s.roughness,
            "ior": min(max(s.ior, 1.01), 3.0),
            "gloss": min(s.specular * max(s.f0 / 0.25, 1.0), 1.0),
            "depth": 0.0,
        }
        if s.ior > 3:
            self._tell(f"its index of refraction became 3 instead of {s.ior:.3g}")
        known = {"base_color": "base_color", "specular": "gloss", "roughness": "roughness"}
        return self._made("plastic", values, known, "specular_color")

    def _coated(self) -> Material:
        s = self.surface
        if s.clearcoat < 1:
            self._tell("its clear coat lies on all of it, thinned")
        if s.specular > 0:
            self._tell("what lies below its clear coat is matte")
        values: dict[str, Value] = {
            "base_color": s.base_color,
            "roughness": s.clearcoat_roughness,
            "ior": 1.5,
            "gloss": s.clearcoat,
            "depth": 0.0,
        }
        known = {"base_color": "base_color", "clearcoat": "gloss"}
        told = (
            "clearcoat",
            "clearcoat_roughness",
            "roughness",
            "specular",
            "specular_color",
            "ior",
            "metallic",
        )
        return self._made("plastic", values, known, *told, rough="clearcoat_roughness")

    def _clear(self) -> Material:
        s = self.surface
        if s.ior > 3:
            self._tell(f"its index of refraction became 3 instead of {s.ior:.3g}")
        red, green, blue = (s.specular * c for c in s.specular_color)
        tint: Colour = (red, green, blue)
        values: dict[str, Value] = {"tint": tint, "ior": min(max(s.ior, 1.01), 3.0), "roughness": s.roughness}
        known = {"specular_color": "tint", "roughness": "roughness"}
        return self._made("ggx-dielectric", values, known, "base_color", "specular_color")

    def _conductor(self) -> Material:
        s = self.surface
        values: dict[str, Value] = {
            "base_color": s.base_color,
            "edge_tint": s.edge_tint,
            "roughness": s.roughness,
        }
        known = {"base_color": "base_color", "edge_tint": "edge_tint"}
        return self._made(
            "ggx-conductor", values, known, "metallic", "edge_tint", "specular", "specular_color"
        )

    def _brushed(self) -> Material:
        s = self.surface
        wide, narrow = s.alphas
        ratio = narrow / max(wide, 1e-9)
        if ratio < 0.1:
            self._tell("its highlight became ten times as long as wide")
        self._tell("metal with a grain has no brighter rim here")
        if s.metallic < 1:
            self._tell("it became metal altogether")
        values: dict[str, Value] = {
            "diffuse": (0.0, 0.0, 0.0),
            "specular": s.base_color,
            "roughness": float((wide * narrow) ** 0.25),
            "anisotropy": min((1 - ratio) / 0.9, 1.0),
            "direction": self._grain(),
        }
        known = {"base_color": "specular"}
        told = ("metallic", "anisotropy", "specular", "specular_color", "edge_tint")
        return self._made("ward", values, known, *told)

    def _satin(self) -> Material:
        s = self.surface
        wide, narrow = (max(alpha, 4.5e-3) for alpha in s.alphas)
        if s.specular < 1:
            self._tell("its weakened reflection keeps its full strength at the rim")
        red, green, blue = (min(s.f0 * s.specular * c, 1.0) for c in s.specular_color)
        values: dict[str, Value] = {
            "diffuse": s.base_color,
            "specular": (red, green, blue),
            "sharpness_along": min(max(2 / narrow**2 - 2, 1.0), 1e5),
            "sharpness_across": min(max(2 / wide**2 - 2, 1.0), 1e5),
            "direction": self._grain(),
        }
        known = {"base_color": "diffuse", "specular_color": "specular"}
        return self._made("ashikhmin-shirley", values, known, "anisotropy", "metallic", "specular_color")

    def _grain(self) -> float:
        """Of the grain, which lies across the wide direction."""
        return (self.surface.anisotropy_rotation + 90) % 360 - 180

    def _made(
        self,
        model: str,
        values: dict[str, Value],
        known: dict[str, str],
        *told: str,
        rough: str = "roughness",
    ) -> Material:
        """`known`: our parameter for a picture of a field; `told`: fields whose loss was said or is none.

        `rough`: the field that became the model's roughness; a picture of it counts as its mean.
        """
        s = self.surface
        for name, word in (
            ("sheen_color", "sheen is"),
            ("clearcoat", "clear coat is"),
            ("anisotropy", "grain is"),
            ("diffuse_roughness", "matte part's roughness is"),
            ("edge_tint", "rim's tint is"),
        ):
            if name not in told and getattr(s, name) != getattr(Surface, name):
                self._tell(f"its {word} left out")
        textures: dict[str, Texture] = {}
        for name, texture in s.textures.items():
            if name == NORMAL:
                textures[name] = texture
                values[NORMAL] = s.normal_strength
            elif name in known:
                self._lay(known[name], name, texture, values, textures, model)
            elif name == rough and "roughness" in values:
                values["roughness"] = times(values["roughness"], texture)
                self._mean(name)
            elif name not in told:
                self._mean(name)
        return Material(
            id=new_id("material"),
            name=s.name,
            model=model,
            values=frozen_map(values),
            textures=frozen_map(textures),
            opacity=s.opacity,
        )

    def _lay(
        self,
        parameter: str,
        name: str,
        texture: Texture,
        values: dict[str, Value],
        textures: dict[str, Texture],
        model: str,
    ) -> None:
        """The picture as it is, or its mean where the model's pictures must lie alike."""
        first = next((t for n, t in textures.items() if n not in ("roughness", NORMAL)), None)
        if name != "roughness" and first is not None:
            large = max(_texels(first), _texels(texture)) > MOST_TEXELS
            if large or not alike(first, texture):
                why = "is too large" if large else "lies otherwise than its colour"
                self.say(
                    f"The picture of the {_WORDS[name]} of {self.surface.name!r} {why}: its mean is used."
                )
                values[parameter] = times(values[parameter], texture)
                return
        textures[parameter] = texture

    def _mean(self, name: str) -> None:
        self.say(f"The mean of the picture of the {_WORDS.get(name, name)} of {self.surface.name!r} is used.")

    def _tell(self, what: str) -> None:
        self.say(f"{self.surface.name}: {what}.")


def _triple(colour: F32) -> Colour:
    red, green, blue = (float(min(max(c, 0.0), 1.0)) for c in colour)
    return (red, green, blue)


def _same_size(a: Texture, b: Texture) -> bool:
    return a.image.pixels.shape[:2] == b.image.pixels.shape[:2]


def _texels(texture: Texture) -> int:
    return int(texture.image.pixels[..., 0].size)
