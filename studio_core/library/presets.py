"""Materials of interiors to begin with, by name and kind. Colours are what such surfaces return, not pictures
of them; metals are the measured ones of `studio_core.metals`.
"""

from __future__ import annotations

from studio_core.arrays import frozen_map
from studio_core.library.lucmat import Kept
from studio_core.metals import METALS
from studio_core.params import Colour, Value, parse_colour
from studio_core.scene.nodes import Material

_METAL = {metal.name: metal.colour for metal in METALS}


def _kept(name: str, tags: str, model: str, opacity: float = 1.0, **values: Value) -> Kept:
    ident = f"preset-{name.lower().replace(' ', '-').replace(',', '')}"
    material = Material(id=ident, name=name, model=model, values=frozen_map(values), opacity=opacity)
    return Kept(material, tuple(tags.split()))


def _srgb(text: str) -> Colour:
    return parse_colour("colour", text)


def _rough(name: str, tags: str, colour: str, roughness: float) -> Kept:
    return _kept(name, tags, "oren-nayar", base_color=_srgb(colour), roughness=roughness)


def _cloth(name: str, tags: str, colour: str, sheen: str, roughness: float) -> Kept:
    words = f"fabric {tags}"
    return _kept(name, words, "cloth", base_color=_srgb(colour), sheen=_srgb(sheen), roughness=roughness)


def _coated(name: str, tags: str, colour: str, roughness: float, gloss: float = 1.0) -> Kept:
    return _kept(name, tags, "plastic", base_color=_srgb(colour), roughness=roughness, gloss=gloss)


def _metal(name: str, metal: str, roughness: float, tags: str = "") -> Kept:
    words = f"metal {tags}"
    return _kept(name, words, "ggx-conductor", base_color=_METAL[metal], roughness=roughness)


PRESETS: tuple[Kept, ...] = (
    _rough("Wall paint, white", "paint matt wall", "#f0eee8", 0.4),
    _rough("Wall paint, warm grey", "paint matt wall", "#c8c0b4", 0.4),
    _rough("Wall paint, sage green", "paint matt wall", "#98a48c", 0.4),
    _rough("Wall paint, deep blue", "paint matt wall", "#2f4258", 0.4),
    _rough("Plaster", "stone wall matt", "#dcd6ca", 0.9),
    _coated("Satin paint, white", "paint satin door", "#f1efea", 0.45, 0.7),
    _coated("Lacquer, white", "paint gloss furniture", "#f3f2ee", 0.08),
    _coated("Lacquer, black", "paint gloss furniture", "#0d0d0e", 0.06),
    _coated("Lacquer, red", "paint gloss furniture", "#9c1c1a", 0.08),
    _coated("Oak, oiled", "wood floor furniture", "#b08a5c", 0.5, 0.7),
    _coated("Oak, bleached", "wood floor furniture", "#d2c0a2", 0.55, 0.6),
    _coated("Walnut, oiled", "wood furniture", "#5e4330", 0.45, 0.7),
    _coated("Beech, varnished", "wood furniture", "#c99c6e", 0.2),
    _coated("Ebony, polished", "wood furniture gloss", "#221a16", 0.12),
    _metal("Brass, polished", "Brass (70 % copper)", 0.12, "gloss"),
    _metal("Brass, satin", "Brass (70 % copper)", 0.38, "satin"),
    _metal("Copper, polished", "Copper", 0.12, "gloss"),
    _metal("Gold leaf", "Gold", 0.3, "satin"),
    _metal("Silver, polished", "Silver", 0.08, "gloss"),
    _metal("Chrome", "Chrome", 0.04, "gloss tap"),
    _metal("Aluminium, anodised", "Aluminium", 0.5, "satin"),
    _metal("Stainless steel, fine", "Stainless steel", 0.25, "satin kitchen"),
    _metal("Iron, raw", "Iron", 0.55, "matt"),
    _kept(
        "Stainless steel, brushed", "metal brushed kitchen", "ward",
        diffuse=(0.0, 0.0, 0.0), specular=_METAL["Stainless steel"], roughness=0.45, anisotropy=0.85,
    ),
    _kept(
        "Aluminium, brushed", "metal brushed", "ward",
        diffuse=(0.0, 0.0, 0.0), specular=_METAL["Aluminium"], roughness=0.5, anisotropy=0.8,
    ),
    _kept(
        "Anthracite lacquer, brushed", "paint brushed furniture", "ashikhmin-shirley",
        diffuse=_srgb("#35373a"), specular=(0.06, 0.06, 0.06), sharpness_along=4000.0, sharpness_across=60.0,
    ),
    _coated("Plastic, white", "plastic", "#ebebe8", 0.25),
    _coated("Plastic, black", "plastic", "#1a1a1b", 0.35),
    _coated("Plastic, orange", "plastic gloss", "#d05a1c", 0.12),
    _rough("Rubber, black", "plastic matt", "#202021", 0.8),
    _cloth("Linen, natural", "curtain", "#c4b79e", "#6b6455", 0.8),
    _rough("Cotton, white", "fabric curtain", "#ecebe6", 0.7),
    _cloth("Felt, grey", "", "#6c6c6f", "#8a8a8c", 1.0),
    _cloth("Wool, petrol", "upholstery", "#264a55", "#6d8f97", 0.9),
    _cloth("Velvet, bottle green", "upholstery curtain", "#0f2a1e", "#7fae95", 0.35),
    _cloth("Velvet, burgundy", "upholstery curtain", "#3a0d14", "#c4808a", 0.35),
    _cloth("Suede, sand", "leather upholstery", "#a2845f", "#b39b7c", 0.6),
    _kept(
        "Satin, champagne", "fabric satin curtain", "ashikhmin-shirley",
        diffuse=_srgb("#b8a27e"), specular=_srgb("#6e6350"), sharpness_along=120.0, sharpness_across=6.0,
    ),
    _coated("Leather, cognac", "leather upholstery", "#8a4f2a", 0.5, 0.8),
    _coated("Leather, black", "leather upholstery", "#1c1b1a", 0.42, 0.9),
    _coated("Marble, white, polished", "stone floor gloss", "#e6e3de", 0.1),
    _coated("Granite, dark, polished", "stone kitchen gloss", "#3a3a3c", 0.1),
    _coated("Slate, honed", "stone floor", "#3f4347", 0.6, 0.7),
    _rough("Concrete", "stone floor matt", "#9a978f", 0.9),
    _rough("Terracotta", "stone tile matt", "#b0663f", 0.8),
    _coated("Porcelain, white", "ceramic tile gloss", "#f2f1ed", 0.05),
    _coated("Glazed tile, bottle green", "ceramic tile gloss", "#1d4a3a", 0.06),
    _kept("Glass, clear", "glass gloss", "ggx-dielectric", 0.12, ior=1.5, roughness=0.02),
    _kept("Glass, frosted", "glass satin", "ggx-dielectric", 0.4, ior=1.5, roughness=0.45),
)  # fmt: skip

__all__ = ["PRESETS"]
