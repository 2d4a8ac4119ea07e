"""The room's palette: warm oak, grey-blue wool, terracotta, brass, glazed clay. Scene-linear."""

from __future__ import annotations

from studio_core.scene.geometry import Texture
from studio_core.scene.nodes import Material

from ..modelling import textures
from ..modelling.parts import material


def palette() -> dict[str, Material]:
    """Materials by the short names that the furniture modules use."""
    return {
        "fabric": material("Grey-blue wool", "lambert", base_color=(0.23, 0.285, 0.335)),
        "wool": material("Sand bouclé", "lambert", base_color=(0.52, 0.46, 0.37)),
        "terracotta wool": material("Terracotta wool", "lambert", base_color=(0.47, 0.17, 0.085)),
        "ochre linen": material("Ochre linen", "lambert", base_color=(0.56, 0.36, 0.11)),
        "leather": material("Cognac leather", "ggx", base_color=(0.42, 0.165, 0.06), roughness=0.45),
        "oak": material(
            "Oiled oak",
            "blinn-phong",
            diffuse=(0.42, 0.265, 0.145),
            specular=(0.05, 0.05, 0.05),
            exponent=35.0,
        ),
        "dark oak": material(
            "Smoked oak",
            "blinn-phong",
            diffuse=(0.105, 0.062, 0.036),
            specular=(0.06, 0.06, 0.06),
            exponent=45.0,
        ),
        "walnut": material("Walnut", "ggx", base_color=(0.24, 0.125, 0.066), roughness=0.45),
        "grained walnut": material(
            "Walnut, grained",
            "ggx",
            {"base_color": Texture(textures.grain())},
            base_color=(0.34, 0.18, 0.095),
            roughness=0.42,
        ),
        "lacquer": material(
            "White lacquer",
            "blinn-phong",
            diffuse=(0.72, 0.71, 0.68),
            specular=(0.06, 0.06, 0.06),
            exponent=60.0,
        ),
        "brass": material(
            "Brushed brass", "ggx", base_color=(0.81, 0.58, 0.29), metallic=1.0, roughness=0.42
        ),
        "linen shade": material("Linen shade", "lambert", base_color=(0.76, 0.71, 0.61)),
        "opal glass": material(
            "Opal glass", "phong", diffuse=(0.78, 0.77, 0.74), specular=(0.05, 0.05, 0.05), exponent=60.0
        ),
        "glaze": material(
            "Petrol glaze", "phong", diffuse=(0.045, 0.125, 0.135), specular=(0.14, 0.14, 0.14), exponent=90.0
        ),
        "stoneware": material(
            "Speckled stoneware",
            "phong",
            diffuse=(0.50, 0.46, 0.40),
            specular=(0.05, 0.05, 0.05),
            exponent=40.0,
        ),
        "lemon": material(
            "Lemon", "blinn-phong", diffuse=(0.66, 0.47, 0.06), specular=(0.04, 0.04, 0.04), exponent=50.0
        ),
        "stem": material("Stem", "lambert", base_color=(0.16, 0.13, 0.08)),
        "eucalyptus": material("Eucalyptus leaf", "lambert", base_color=(0.20, 0.27, 0.20)),
        "fig leaf": material(
            "Fig leaf",
            "blinn-phong",
            diffuse=(0.055, 0.125, 0.04),
            specular=(0.07, 0.07, 0.07),
            exponent=30.0,
        ),
        "bark": material("Bark", "lambert", base_color=(0.17, 0.12, 0.08)),
        "soil": material("Soil", "lambert", base_color=(0.045, 0.033, 0.024)),
        "clay": material("Terracotta clay", "lambert", base_color=(0.50, 0.235, 0.13)),
        "blue cloth": material("Bookcloth blue", "lambert", base_color=(0.07, 0.12, 0.19)),
        "cream cloth": material("Bookcloth cream", "lambert", base_color=(0.62, 0.55, 0.43)),
        "rust cloth": material("Bookcloth rust", "lambert", base_color=(0.37, 0.12, 0.06)),
        "paper": material("Paper", "lambert", base_color=(0.74, 0.71, 0.63)),
        "print": material(
            "Art print",
            "lambert",
            {"base_color": Texture(textures.abstract_print())},
            base_color=(1.0, 1.0, 1.0),
        ),
        "rug": material(
            "Woven rug", "lambert", {"base_color": Texture(textures.weave())}, base_color=(1.0, 1.0, 1.0)
        ),
        "floor": material(
            "Oak planks",
            "ggx",
            {"base_color": Texture(textures.planks())},
            base_color=(1.0, 1.0, 1.0),
            roughness=0.5,
        ),
        "painted wood": material("Painted wood", "lambert", base_color=(0.76, 0.74, 0.70)),
    }
