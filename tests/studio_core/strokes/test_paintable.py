"""Materials that strokes can change altogether look as before, or stay what they are."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studio_core.arrays import frozen_map
from studio_core.brdfs.calls import evaluate
from studio_core.brdfs.promises import hard_directions, seen_from
from studio_core.brdfs.ranges import at_fraction
from studio_core.params import param_infos
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Material
from studio_core.shading.coefficients import CoefficientTable
from studio_core.shading.materials import coefficients, resolve
from studio_core.shading.normal_maps import NORMAL
from studio_core.strokes.paintable import PAINTABLE, ROLES, material_roles, paintable

WI = hard_directions(64)
share = st.one_of(st.sampled_from([0.0, 1.0]), st.floats(0, 1))
colour = st.tuples(share, share, share)


def material(model, textures=None, **values):
    return Material(
        id="m", model=model, values=frozen_map(values), textures=frozen_map(textures or {}), opacity=0.7
    )


def picture(seed=0, low=0, channels=3, encoding="srgb"):
    pixels = np.random.default_rng(seed).integers(low, 256, (4, 6, channels), np.uint8)
    return Texture(Image(pixels, encoding), (2.0, 3.0), (0.1, 0.2), 15.0)


def sent(made, host, angle):
    """(..., directions, 3) light by kernels and coefficients, for every texel where there are such."""
    resolved = resolve(made, host)
    assert not resolved.problem
    terms = evaluate(resolved.brdf, resolved.brdf.shape(resolved.typical()), seen_from(angle, 0.3), WI)
    return np.einsum("nt,...tc->...nc", terms.astype(np.float64), coefficients(resolved).astype(np.float64))


def same(one, other, host, angle):
    made, expected = sent(other, host, angle), sent(one, host, angle)
    cosine = np.maximum(WI[:, 2:], 0)
    np.testing.assert_allclose(made * cosine, expected * cosine, rtol=2e-5, atol=1e-6)


@settings(max_examples=60, deadline=None)
@given(base=colour, angle=st.floats(0, 1.55))
def test_matte_paint_gets_a_shine_of_nothing(host, base, angle):
    plain = material("lambert", base_color=base)
    made = paintable(plain, host)
    assert made.model == PAINTABLE
    assert (made.id, made.name, made.opacity) == (plain.id, plain.name, plain.opacity)
    same(plain, made, host, angle)


@settings(max_examples=150, deadline=None)
@given(
    base=colour, metal=st.sampled_from([0.0, 1.0]), specular=share, rough=share, keep=st.booleans(),
    angle=st.floats(0, 1.55),
)  # fmt: skip
def test_what_is_all_metal_or_none_looks_the_same(host, base, metal, specular, rough, keep, angle):
    values = {"base_color": base, "metallic": metal, "specular": specular, "roughness": rough}
    plain = material("ggx", **values, keep_energy=keep)
    made = paintable(plain, host)
    head_on = max(base) if metal else 0.08 * specular
    assert made.model == (PAINTABLE if head_on >= 0.02 else "ggx")
    same(plain, made, host, angle)


@pytest.mark.parametrize("metallic", [0.0, 1.0])
def test_pictures_go_along(host, metallic):
    textures = {
        "base_color": picture(1, 90),
        "roughness": picture(2, 10, 1, "data"),
        NORMAL: picture(3, 100, 3, "data"),
    }
    plain = material("ggx", textures, base_color=(0.9, 0.7, 0.8), metallic=metallic, normal=2.0)
    made = paintable(plain, host)
    assert made.model == PAINTABLE
    assert set(made.textures) == {"specular" if metallic else "diffuse", "roughness", NORMAL}
    assert made.values[NORMAL] == 2.0
    same(plain, made, host, 0.7)
    table = CoefficientTable(host)
    before, after = table._look(plain, {}), table._look(made, {})
    assert before.kind == after.kind
    np.testing.assert_allclose(after.plain[:12], before.plain, atol=1e-6)
    np.testing.assert_allclose(after.slope[:12], before.slope, atol=1e-6)


def test_a_picture_of_the_reflectance_counts_by_its_first_channel(host):
    textures = {"base_color": picture(1), "specular": picture(2, 200)}
    plain = material("ggx", textures, specular=1.0)
    made = paintable(plain, host)
    assert made.model == PAINTABLE
    assert made.textures["specular"].image.pixels.shape[2] == 1
    same(plain, made, host, 0.4)


def test_matte_pictures_go_along_and_what_lay_about_does_not(host):
    stale = {"base_color": picture(1), "diffuse": picture(2), "roughness": picture(3)}
    plain = material("lambert", stale, base_color=(0.9, 0.8, 0.7), roughness=0.2, specular=(1.0, 1.0, 1.0))
    made = paintable(plain, host)
    assert made.textures == frozen_map({"diffuse": stale["base_color"]})
    assert made.values["specular"] == (0.0, 0.0, 0.0)
    assert "roughness" not in made.values
    same(plain, made, host, 0.9)


@pytest.mark.parametrize(
    "plain",
    [
        material("ggx", metallic=0.5),
        material("ggx", {"metallic": picture()}, metallic=1.0),
        material("ggx", {"base_color": picture(0, 0)}, metallic=1.0, base_color=(0.05, 0.05, 0.05)),
        material("ggx", {"base_color": picture(), "specular": Texture(picture().image)}),  # lie otherwise
        material("ggx", base_color="red"),
        material("ggx", specular=0.1),
        material("oren-nayar"),
        material("phong"),
        material(PAINTABLE, specular=(0.01, 0.2, 0.0)),
        material("measured"),
        material("no such model"),
    ],
)
def test_what_has_no_such_look_stays(host, plain):
    assert paintable(plain, host) is plain


def test_roles_by_material(host):
    assert material_roles(material("lambert"), host) == {"diffuse": "base_color"}
    assert material_roles(material("phong"), host)["gloss"] == "exponent"
    assert set(material_roles(paintable(material("lambert"), host), host)) == set(ROLES)
    assert material_roles(material("measured"), host) == {}
    assert material_roles(material("no such model"), host) == {}


@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_nothing_is_ever_raised(host, data):
    model = data.draw(st.sampled_from([*host.names("brdf"), "none"]))
    values = {}
    if model != "none":
        infos = param_infos(host.brdf(model).Params)
        drawn = {name: data.draw(st.sampled_from([0.0, 0.5, 1.0, None]), name) for name in infos}
        values = {n: at_fraction(infos[n], f) if f is not None else "odd" for n, f in drawn.items()}
    plain = material(model, **values)
    made = paintable(plain, host)
    assert dataclasses.replace(made, model=plain.model, values=plain.values, textures=plain.textures) == plain
    assert set(material_roles(plain, host)) <= set(material_roles(made, host))
