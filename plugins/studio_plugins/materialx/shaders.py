"""Surface shaders of MaterialX as a `Surface`: OpenPBR, Standard Surface, glTF PBR, UsdPreviewSurface.

Sources: OpenPBR 1.1 (Academy Software Foundation 2024), Autodesk Standard Surface 1.0.1, the node graphs of
MaterialX 1.39's own library, UsdPreviewSurface 2.6.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from studio_core.exchange.surface import BLACK, WHITE, Surface, ior_of, stretched
from studio_core.params import Colour
from studio_plugins.materialx.slots import Slots

COAT_IOR = 1.5


def _open_pbr(s: Slots) -> Surface:
    """Before its version 1.0 the grain was given as in Standard Surface."""
    metallic = s.number("metallic", "base_metalness", 0.0)
    ior = s.plain("specular_ior", 1.5)
    weight = s.plain("specular_weight", 1.0)
    f0 = Surface(ior=max(ior, 1.0)).f0 * min(max(weight, 0.0), 1.0)
    tint = s.colour("specular_color", "specular_color", WHITE)
    edge = WHITE
    strongest = max(tint)
    if metallic > 0:
        edge = tint
        if metallic >= 1:
            s.move("specular_color", "edge_tint")
    roughness, strength = _widths(
        s.number("roughness", "specular_roughness", 0.3),
        _open_pbr_widths(s.plain("specular_roughness_anisotropy", s.plain("specular_anisotropy", 0.0))),
    )
    s.left_out("subsurface_weight", "light that goes below its surface")
    s.left_out("thin_film_weight", "its thin film")
    s.left_out("emission_luminance", "the light that it gives", "add a lamp for it")
    coat = s.number("clearcoat", "coat_weight", 0.0)
    base = s.product("base_color", "base_weight", "base_color", 1.0, (0.8,) * 3)
    return Surface(
        base_color=s.below("base_color", base, coat, "coat_color"),
        diffuse_roughness=s.plain("base_diffuse_roughness", 0.0),
        metallic=metallic,
        roughness=roughness,
        anisotropy=strength,
        anisotropy_rotation=s.turned("geometry_tangent") + 360 * s.plain("specular_rotation", 0.0),
        ior=ior_of(f0),
        specular=0.0 if weight <= 0 else strongest,
        specular_color=_over(tint, strongest),
        edge_tint=edge,
        sheen_color=s.product("sheen_color", "fuzz_weight", "fuzz_color", 0.0, WHITE),
        sheen_roughness=s.number("sheen_roughness", "fuzz_roughness", 0.5),
        clearcoat=coat,
        clearcoat_roughness=s.number("clearcoat_roughness", "coat_roughness", 0.0),
        opacity=s.plain("geometry_opacity", 1.0) * (1 - s.plain("transmission_weight", 0.0)),
        normal_strength=s.normal("geometry_normal"),
    )


def _standard(s: Slots) -> Surface:
    metallic = s.number("metallic", "metalness", 0.0)
    weight = s.plain("specular", 1.0)
    tint = s.colour("specular_color", "specular_color", WHITE)
    aspect = math.sqrt(1 - min(max(s.plain("specular_anisotropy", 0.0), 0.0), 0.98))
    roughness, strength = _widths(s.number("roughness", "specular_roughness", 0.2), (1 / aspect, aspect))
    s.left_out("subsurface", "light that goes below its surface")
    s.left_out("thin_film_thickness", "its thin film")
    s.left_out("emission", "the light that it gives", "add a lamp for it")
    coat = s.number("clearcoat", "coat", 0.0)
    if metallic > 0 and tint != WHITE:
        s.say("the tint of its rim is left out")
    opacity = s.plain_colour("opacity", WHITE)
    strongest = max(tint)
    version = s.node.getVersionString()
    weight_of, grey = (0.8, 1.0) if version.startswith("1.0.0") else (1.0, 0.8)
    base = s.product("base_color", "base", "base_color", weight_of, (grey,) * 3)
    return Surface(
        base_color=s.below("base_color", base, coat, "coat_color"),
        diffuse_roughness=s.plain("diffuse_roughness", 0.0),
        metallic=metallic,
        roughness=roughness,
        anisotropy=strength,
        anisotropy_rotation=360 * s.plain("specular_rotation", 0.0),
        ior=max(s.plain("specular_IOR", 1.5), 1.0),
        specular=min(max(weight, 0.0), 1.0) * strongest,
        specular_color=_over(tint, strongest),
        sheen_color=s.product("sheen_color", "sheen", "sheen_color", 0.0, WHITE),
        sheen_roughness=s.number("sheen_roughness", "sheen_roughness", 0.3),
        clearcoat=coat,
        clearcoat_roughness=s.number("clearcoat_roughness", "coat_roughness", 0.1),
        opacity=sum(opacity) / 3 * (1 - s.plain("transmission", 0.0)),
        normal_strength=s.normal("normal"),
    )


def _gltf(s: Slots) -> Surface:
    for name, word in (("iridescence", "its iridescence"), ("dispersion", "its dispersion")):
        s.left_out(name, word)
    if max(s.plain_colour("emissive", BLACK)) > 0:
        s.say("the light that it gives is left out; add a lamp for it")
    blended = s.plain("alpha_mode", 0.0) > 0
    alpha = s.plain("alpha", 1.0) if blended else 1.0
    return Surface(
        base_color=s.colour("base_color", "base_color", WHITE),
        metallic=s.number("metallic", "metallic", 1.0),
        roughness=s.number("roughness", "roughness", 1.0),
        ior=max(s.plain("ior", 1.5), 1.0),
        specular=s.number("specular", "specular", 1.0),
        specular_color=s.colour("specular_color", "specular_color", WHITE),
        anisotropy=s.plain("anisotropy_strength", 0.0),
        anisotropy_rotation=math.degrees(s.plain("anisotropy_rotation", 0.0)),
        sheen_color=s.colour("sheen_color", "sheen_color", BLACK),
        sheen_roughness=s.number("sheen_roughness", "sheen_roughness", 0.0),
        clearcoat=s.number("clearcoat", "clearcoat", 0.0),
        clearcoat_roughness=s.number("clearcoat_roughness", "clearcoat_roughness", 0.0),
        opacity=alpha * (1 - s.plain("transmission", 0.0)),
        normal_strength=s.normal("normal"),
    )


def _usd(s: Slots) -> Surface:
    if max(s.plain_colour("emissiveColor", BLACK)) > 0:
        s.say("the light that it gives is left out; add a lamp for it")
    made: dict[str, Any] = {"ior": max(s.plain("ior", 1.5), 1.0)}
    if s.plain("useSpecularWorkflow", 0.0) >= 1:
        f0 = s.colour("specular_color", "specularColor", BLACK)
        made |= {"ior": ior_of(max(f0)), "specular_color": _over(f0, max(f0)), "metallic": 0.0}
    else:
        made["metallic"] = s.number("metallic", "metallic", 0.0)
    return Surface(
        base_color=s.colour("base_color", "diffuseColor", (0.18,) * 3),
        roughness=s.number("roughness", "roughness", 0.5),
        clearcoat=s.number("clearcoat", "clearcoat", 0.0),
        clearcoat_roughness=s.number("clearcoat_roughness", "clearcoatRoughness", 0.01),
        opacity=s.plain("opacity", 1.0),
        normal_strength=s.normal("normal"),
        **made,
    )


def _open_pbr_widths(anisotropy: float) -> tuple[float, float]:
    """α along and across over roughness² (OpenPBR 1.1, "Microfacet model")."""
    narrow = 1 - min(max(anisotropy, 0.0), 1.0)
    along = math.sqrt(2 / (1 + narrow * narrow))
    return along, along * narrow


def _widths(roughness: float, stretch: tuple[float, float]) -> tuple[float, float]:
    """Our roughness and anisotropy."""
    if stretch == (1.0, 1.0):
        return roughness, 0.0
    along, across = (min(max(roughness, 0.0) ** 2 * s, 1.0) for s in stretch)
    return stretched(along, across)


def _over(tint: Colour, strongest: float) -> Colour:
    if strongest <= 0:
        return WHITE
    red, green, blue = (t / strongest for t in tint)
    return (red, green, blue)


SHADERS: dict[str, Callable[[Slots], Surface]] = {
    "open_pbr_surface": _open_pbr,
    "standard_surface": _standard,
    "gltf_pbr": _gltf,
    "UsdPreviewSurface": _usd,
}
