"""Pictures of a material grown together: as large on the surface as before, whatever they are made of."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from studio.bench.pattern_samples import marble, weave
from studio_core.errors import InputError
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.pattern import UnitLengths, pattern_size
from studio_core.shading.grown_textures import grown, lying_alike

CLOTH = Image((255 * weave(64, 16.0)).astype(np.uint8), "srgb")
ROUGH = Image(np.ascontiguousarray(weave(64, 16.0)[..., :1]), "data")
METRES = UnitLengths(2.0, 3.0, (2.0, 2.0), (3.0, 3.0))


def test_all_maps_show_the_same_places_and_texels_stay_as_large():
    laid = Texture(CLOTH, (4.0, 3.0), (0.25, 0.5), 30.0, 1.5)
    textures = {"base_color": laid, "roughness": dataclasses.replace(laid, image=ROUGH)}
    made = grown(textures, 2.0, seed=3)
    assert set(made) == set(textures)
    colour, rough = made["base_color"].image, made["roughness"].image
    assert colour.pixels.shape == (128, 128, 3)
    assert rough.pixels.shape == (128, 128, 1)
    assert (colour.encoding, rough.encoding) == ("srgb", "data")
    np.testing.assert_allclose(rough.pixels[..., 0], colour.pixels[..., 0] / 255, atol=1 / 128)
    one, other = pattern_size(laid, METRES), pattern_size(made["base_color"], METRES)
    assert other == pytest.approx((2 * one[0], 2 * one[1]))
    assert made["roughness"].affine == made["base_color"].affine
    assert made["base_color"].rotation == 30.0


def test_smaller_pictures_are_enlarged_first():
    small = Image(np.full((16, 16, 1), 0.5, np.float32), "data")
    made = grown({"a": Texture(CLOTH), "b": Texture(small)}, 1.5)
    assert made["a"].image.pixels.shape[:2] == made["b"].image.pixels.shape[:2]
    np.testing.assert_allclose(made["b"].image.pixels, 0.5)


def test_only_what_lies_alike_is_grown_together():
    one = Texture(CLOTH)
    textures = {"a": one, "b": Texture(CLOTH, (2.0, 2.0)), "c": Texture(ROUGH)}
    assert set(lying_alike(textures, "a")) == {"a", "c"}
    with pytest.raises(InputError, match="lie alike"):
        grown(textures, 2.0)
    with pytest.raises(InputError, match="no picture"):
        grown({}, 2.0)
    with pytest.raises(InputError, match=r"up to 64\.0 times"):
        grown({"a": one}, 65.0)


def test_alpha_is_carried_along():
    sample = np.concatenate([marble(48), np.linspace(0, 1, 48 * 48).reshape(48, 48, 1)], axis=2)
    made = grown({"a": Texture(Image(sample.astype(np.float32)))}, 1.5)["a"].image.pixels
    assert made.shape == (72, 72, 4)
    assert 0 <= made[..., 3].min() <= made[..., 3].max() <= 1


def test_maps_with_signs_count_as_they_are():
    signed = Image(weave(64, 16.0) - 0.4, "data")
    made = grown({"s": Texture(signed), "flat": Texture(Image(np.ones((64, 64, 3), np.float32)))}, 1.5)
    assert made["s"].image.pixels.min() < -0.2
    np.testing.assert_allclose(made["flat"].image.pixels, 1.0)
