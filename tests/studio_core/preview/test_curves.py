"""Curves of materials."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.preview.curves import albedo, averaged, lobe
from studio_core.registry import PluginHost
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Material
from studio_core.shading.materials import Resolved, resolve
from studio_plugins.brdfs import plugin

HOST = PluginHost([plugin])


def material(model: str, **values: object) -> Resolved:
    return resolve(Material(id="m", name="M", model=model, values=values), HOST)  # type: ignore[arg-type]


@given(st.floats(0, 89), st.tuples(*[st.floats(0, 1)] * 3))
def test_a_matte_lobe_is_the_cosine(incidence: float, colour: tuple[float, float, float]) -> None:
    angles, values = lobe(material("lambert", base_color=colour), incidence)
    assert (np.diff(angles) > 0).all()
    assert (angles[0], angles[-1]) == (-90, 90)
    truth = np.cos(np.radians(angles))[:, None] * np.array(colour) / np.pi
    np.testing.assert_allclose(values, truth, atol=1e-6)
    _, plain = lobe(material("lambert", base_color=colour), incidence, cosine=False)
    flat = np.broadcast_to(np.array(colour) / np.pi, plain[1:-1].shape)
    np.testing.assert_allclose(plain[1:-1], flat, rtol=1e-5, atol=1e-7)


@given(st.floats(0, 70), st.floats(1e-3, 0.3))
def test_a_sharp_lobe_is_drawn_at_its_peak(incidence: float, roughness: float) -> None:
    angles, values = lobe(material("ggx", metallic=1.0, roughness=roughness), incidence, cosine=False)
    assert abs(angles[values[:, 1].argmax()] - incidence) < 5
    half = values[:, 1] > values[:, 1].max() / 2
    assert half.sum() >= 5  # not one spike between two points
    assert np.isfinite(values).all()


def test_albedo_of_what_is_known() -> None:
    angles = [0, 30, 60, 85, 90]
    white = albedo(material("lambert", base_color=(1.0, 0.5, 0.0)), angles)
    np.testing.assert_allclose(white, np.broadcast_to([1.0, 0.5, 0.0], (5, 3)), atol=5e-3)
    metal = albedo(material("ggx", base_color=(1.0, 0.5, 0.0), metallic=1.0, roughness=0.05), angles)
    assert metal[0] == pytest.approx([1.0, 0.5, 0.0], abs=0.01)
    assert (np.diff(metal[:, 2]) > -1e-3).all()  # Fresnel: black metal still shines at grazing angles


@given(st.floats(1e-3, 1), st.floats(0, 1))
def test_quick_albedo_is_the_exact_one_within_a_percent(roughness: float, metallic: float) -> None:
    made = material("ggx", roughness=roughness, metallic=metallic)
    angles = [0, 40, 70]
    np.testing.assert_allclose(albedo(made, angles, quick=True), albedo(made, angles), atol=0.015)


def test_pictures_count_as_their_mean() -> None:
    halves = np.zeros((4, 8, 3), np.uint8)
    halves[:, :4] = 255
    made = Material(
        id="m",
        name="M",
        values={"base_color": (1.0, 0.8, 0.2)},
        textures={"base_color": Texture(Image(halves))},
    )
    flat = averaged(resolve(made, HOST), lambda image: np.array([0.5, 0.5, 0.25]))
    assert flat.values["base_color"] == pytest.approx((0.5, 0.4, 0.05))
    assert not flat.textures
