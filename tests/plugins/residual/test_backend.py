"""The paper's equation 6 pixel by pixel, against the fit's own functions and against the error meter."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from captured_fits import made_up
from oracles.radiance import bilinear_repeat
from scenes import cube, floor

from studio_core.contract import Services
from studio_core.kernels.camera import sample_directions
from studio_core.raster import PictureStage
from studio_core.scene.diff import Changes, diff
from studio_core.scene.geometry import Texture
from studio_core.scene.nodes import Camera, DirectionalLamp, MeshObject, PointLamp, Scene
from studio_core.scene.transform import Transform, looking
from studio_core.session import View
from studio_core.shading.artifacts import Picture, Radiance
from studio_core.shading.error_meter import ErrorMeter
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params
from studio_core.shading.pipeline import Pipeline
from studio_core.shading.primary import pinhole
from studio_plugins.residual.material import scene_material
from studio_plugins.residual.shading import shade

EYE = looking((0.3, 0.9, 1.6), (0.0, 0.0, 0.0))


def flat_fit(model: str = "blinn", basis: str = "albedo-half") -> Any:
    fit = made_up(model, basis)
    normals = np.zeros_like(fit.normals)
    normals[..., 2] = 1
    return dataclasses.replace(fit, normals=normals)


def of(fit: Any, *nodes: Any, scale: float = 1.0) -> Scene:
    material = scene_material(fit, "cloth").material
    laid = {name: Texture(t.image, (scale, scale)) for name, t in material.textures.items()}
    material = dataclasses.replace(material, textures=laid)
    sheet = MeshObject(id="floor", name="Floor", geometry=floor(2.0), materials=(material.id,))
    camera = Camera(id="camera", name="Camera", transform=EYE)
    return Scene().with_materials(material).with_nodes(sheet, camera, *nodes)


LAMP = PointLamp(
    id="lamp", name="Lamp", transform=Transform((0.4, 0.8, -0.2)), intensity=2.0, tint=(1.0, 0.8, 0.5)
)
PLACE = np.array(LAMP.transform.translation)
SUN = DirectionalLamp(id="sun", name="Sun", transform=looking((1, 2, 1), (0, 0, 0)), intensity=0.5, angle=0.0)


def made(scene: Scene, host: Any, workers: Any, backend: str = "residual", **wanted: Any) -> Any:
    found = host.get("backend", backend)
    view = dataclasses.replace(View(EYE, 45.0, 48, 32), antialias=1)
    frame = Frame(scene, view, backend_params(found, {"vertices": 600, **wanted}), 1)
    services = Services(workers, host)
    pipeline = Pipeline([*found.stages(services), PictureStage(services)])
    picture: Picture = pipeline.update(frame, Changes(), Job("shade"))
    return picture, pipeline, frame


@pytest.mark.parametrize("basis", ["albedo-half", "albedo-light", "albedo-gloss"])
def test_a_pixel_is_what_the_fit_says_of_its_texel_under_the_lamp(
    basis: str, host: Any, workers: Any
) -> None:
    fit = flat_fit("blinn", basis)
    picture, _, frame = made(of(fit, LAMP), host, workers)
    assert picture.colours is None
    directions = np.empty((48 * 32, 3), np.float32)
    sample_directions(pinhole(frame.view), np.arange(48 * 32), directions)
    eye = np.asarray(EYE.translation)
    places = eye - directions * (eye[1] / directions[:, 1])[:, None]
    seen = (directions[:, 1] < 0) & (np.abs(places[:, [0, 2]]) < 0.98).all(axis=1)
    # The floor's u runs along +x, its v along −z; its map is repeated once over 2 m.
    axes = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    own = fit.coefficients[::-1].astype(np.float64)
    expected = np.zeros((len(places), 3))
    for k in np.flatnonzero(seen):
        towards = PLACE - places[k]
        light = axes @ towards / np.linalg.norm(towards)
        view = (axes @ -directions[k]).astype(np.float32)
        up = np.array([0, 0, 1], np.float32)
        now = shade(fit.shared, up, view, light)
        columns = now.columns(basis, np.eye(3, dtype=np.float32))
        u, v = (places[k, 0] + 1) / 2, (1 - places[k, 2]) / 2
        texel = bilinear_repeat(own, u, v)
        value = np.maximum(now.shared + columns @ texel, 0) / np.pi
        expected[k] = value * np.asarray(LAMP.gain()) / (towards @ towards)
    pixels = picture.linear.reshape(-1, 3)
    # A texel is wider than pixels here, so no coarser level of the map is shown.
    np.testing.assert_allclose(pixels[seen], expected[seen], rtol=2e-3, atol=2e-4 * expected.max())


def test_lamps_in_every_pixel_are_as_true_as_brute_force(host: Any, workers: Any) -> None:
    """The error meter sees nothing but what maps do between texels; vertices alone are far off."""
    at = Transform((0.2, 0.2, 0.1))
    box = MeshObject(id="box", name="Box", geometry=cube(0.4), materials=("captured",), transform=at)
    scene = of(flat_fit("blinn"), LAMP, SUN, box)
    errors = {}
    for backend, wanted in (("residual", {}), ("cuts", {"pixel_lamps": True}), ("cuts", {})):
        _, pipeline, frame = made(scene, host, workers, backend, **wanted)
        meter = ErrorMeter(Services(workers, host), 400)(pipeline, frame, Job("measure"))
        assert meter is not None
        assert set(meter.layers) == {"lamp", "sun"}
        errors[backend, bool(wanted)] = meter.picture.relative_rmse
    assert errors["residual", False] < 1e-5
    assert errors["cuts", True] < 1e-5
    assert errors["cuts", False] > 1e-2, errors


def test_a_brighter_lamp_traces_nothing_again(host: Any, workers: Any) -> None:
    scene = of(flat_fit(), LAMP)
    picture, pipeline, frame = made(scene, host, workers)
    radiance = pipeline.artifact(Radiance)
    assert radiance is not None
    assert radiance.pixel is not None
    lit = radiance.pixel.counts["hits_lit"]  # type: ignore[attr-defined]
    assert lit > 500
    brighter = scene.with_nodes(dataclasses.replace(LAMP, intensity=4.0))
    again = pipeline.update(
        dataclasses.replace(frame, scene=brighter, revision=2), diff(scene, brighter), Job("again")
    )
    np.testing.assert_allclose(again.linear, 2 * picture.linear, rtol=1e-5)
    after = pipeline.artifact(Radiance)
    assert after is not None
    assert after.pixel is radiance.pixel
    assert radiance.pixel.counts["hits_lit"] == lit  # type: ignore[attr-defined]
