"""Materials as kernels and coefficients."""

from __future__ import annotations

import numpy as np
import pytest

from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Material, Scene
from studio_core.shading.materials import coefficients, linear, padded, resolve, same_shapes, shapes


def ggx(**values):
    return Material(id="m", name="Wood", model="ggx", values=values)


def test_missing_values_are_defaults_and_wrong_ones_are_said(host):
    resolved = resolve(ggx(roughness=7.0, colour="red"), host)
    assert resolved.values["roughness"] == 0.5
    assert "roughness" in resolved.problem
    assert "Wood" in resolved.problem


def test_an_unknown_model_is_shown_grey_and_said(host):
    resolved = resolve(Material(id="m", name="Silk", model="silk"), host)
    assert resolved.brdf.id == "lambert"
    assert "silk" in resolved.problem


def test_a_change_of_colour_keeps_the_shapes(host):
    def table(**values):
        return shapes(Scene().with_materials(ggx(**values)), ("m",), host)

    assert same_shapes(table(base_color=(1, 0, 0)), table(base_color=(0, 1, 0)))
    assert not same_shapes(table(roughness=0.2), table(roughness=0.3))


def test_untextured_coefficients_are_the_models(host):
    made = coefficients(resolve(Material(id="m", name="m", values={"base_color": (0.2, 0.4, 0.6)}), host))
    assert made.shape == (1, 3)
    np.testing.assert_allclose(made[0] * np.pi, (0.2, 0.4, 0.6), rtol=1e-6)
    wider = padded(made, 4)
    assert wider.shape == (4, 3)
    np.testing.assert_array_equal(wider[0], made[0])
    assert not wider[1:].any()
    assert padded(wider, 2) is wider


def test_a_texture_multiplies_its_parameter_with_rows_upwards(host):
    pixels = np.zeros((2, 1, 3), np.float32)
    pixels[0], pixels[1] = (1, 0, 0), (0, 1, 0)
    material = Material(
        id="m",
        name="m",
        values={"base_color": (0.5, 0.5, 0.5)},
        textures={"base_color": Texture(Image(pixels))},
    )
    made = coefficients(resolve(material, host)) * np.pi
    np.testing.assert_allclose(made[0, 0, 0], (0, 0.5, 0), atol=1e-6)  # v = 0 is the picture's last row
    np.testing.assert_allclose(made[1, 0, 0], (0.5, 0, 0), atol=1e-6)


def test_textures_of_different_sizes_and_scalars_meet(host):
    material = Material(
        id="m",
        name="m",
        model="ggx",
        values={"base_color": (1.0, 1.0, 1.0), "metallic": 1.0},
        textures={
            "base_color": Texture(Image(np.full((4, 4, 3), 128, np.uint8), "srgb")),
            "metallic": Texture(Image(np.array([[[0.0], [1.0]]], np.float32), "data")),
        },
    )
    made = coefficients(resolve(material, host))
    assert made.shape == (4, 4, 4, 3)
    assert (made[:, :2, 0] > 0).all()  # left half is no metal: it has a matte part
    assert not made[:, 2:, 0].any()


def test_a_texture_that_lies_otherwise_than_the_first_is_its_mean_and_said(host):
    lines = np.array([[[0.0], [1.0]]], np.float32)
    material = Material(
        id="m",
        name="Oak",
        model="ggx",
        values={"metallic": 0.8},
        textures={
            "base_color": Texture(Image(np.full((4, 4, 3), 0.5, np.float32)), scale=(2.0, 2.0)),
            "metallic": Texture(Image(lines, "data")),
        },
    )
    found = resolve(material, host)
    assert set(found.textures) == {"base_color"}
    assert found.values["metallic"] == pytest.approx(0.4)
    assert "Oak" in found.problem
    assert "metallic" in found.problem


def test_maps_of_any_shape_keep_their_finest_rows_and_columns(host):
    textures = {
        "base_color": Texture(Image(np.ones((8, 2, 3), np.float32))),
        "metallic": Texture(Image(np.ones((2, 16, 1), np.float32), "data")),
    }
    material = Material(id="m", name="m", model="ggx", textures=textures)
    assert coefficients(resolve(material, host)).shape[:2] == (8, 16)


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_srgb_bytes_become_linear_and_alpha_stays(channels):
    made = linear(Image(np.full((1, 1, channels), 188, np.uint8), "srgb"))
    assert made[0, 0, 0] == pytest.approx(0.5029, abs=1e-3)
    if channels == 4:
        assert made[0, 0, 3] == pytest.approx(188 / 255)
