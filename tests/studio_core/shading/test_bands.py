"""Pictures in bands: the same as in one piece, with alpha and by light."""

from __future__ import annotations

import dataclasses
import gc
import weakref
from itertools import pairwise

import numpy as np
import pytest
from bouncing import Bounce, BounceParams, BouncingHost
from hypothesis import given
from hypothesis import strategies as st
from scenes import little_scene as make_little_scene

from studio_core.arrays import frozen_map
from studio_core.contract import Services
from studio_core.errors import Cancelled
from studio_core.raster import CoefficientTable, Compositor
from studio_core.scene.diff import everything
from studio_core.scene.nodes import Camera, Material, PointLamp
from studio_core.scene.transform import Transform
from studio_core.session import INDIRECT, View
from studio_core.shading.artifacts import Casters, Surfaces
from studio_core.shading.bands import BETWEEN, Parts, PictureMaker, guide, rows_of
from studio_core.shading.frame import IndirectChoice
from studio_core.shading.job import Job
from studio_core.shading.job_parts import STEPS, JobPart
from studio_core.shading.offline import backend_params, picture
from studio_core.shading.pipeline import Inputs
from studio_core.shading.refinement import LocatedPrimaryStage

PARAMS = {"directions": "1024", "vertices": 500}


def scene_with_glass():
    """The little scene with a pane before the cube, and a lamp."""
    scene = make_little_scene()
    pane = dataclasses.replace(
        scene["cube"], id="pane", materials=("glass",), transform=Transform((0.5, 0.4, 1.2), scale=0.5)
    )
    lamp = PointLamp(id="lamp", name="Lamp", transform=Transform((0.5, 2.0, 1.0)), intensity=2.0)
    glass = Material(id="glass", values=frozen_map({"base_color": (0.2, 0.6, 0.3)}), opacity=0.25)
    return scene.with_materials(glass).with_nodes(pane, lamp)


def view_of(scene, width=50, height=37, antialias=2):
    view = View.of(next(scene.of(Camera)), scene, width, height)
    return dataclasses.replace(view, antialias=antialias, fine_edges=antialias > 1)


@pytest.fixture
def make(host, workers):
    services = Services(workers, host)
    backend = host.get("backend", "reference")

    def build(**values):
        return PictureMaker(backend, backend_params(backend, {**PARAMS, **values}), services)

    build.services, build.backend = services, backend
    return build


def whole_of(maker, bands, attribute="linear"):
    return np.concatenate([getattr(band, attribute) for band in bands])


@pytest.mark.parametrize("antialias", [1, 2, 4])
def test_bands_put_together_are_the_picture_in_one_piece(make, monkeypatch, antialias):
    scene = scene_with_glass()
    view = view_of(scene, antialias=antialias)
    maker = make(everywhere=True)
    maker.shade(scene, view, Job("Shading"))
    (one,) = maker.bands(Job("Rendering"))
    monkeypatch.setattr("studio_core.shading.bands.GUIDE_SAMPLES", 0)
    bands = list(maker.bands(Job("Rendering"), most=50 * 6 * antialias**2))
    assert [band.top for band in bands] == list(range(0, 37, 6))
    np.testing.assert_array_equal(whole_of(maker, bands), one.linear)


def test_a_picture_within_the_guide_is_the_one_that_is_shown(make):
    scene = scene_with_glass()
    view = view_of(scene)
    maker = make()
    maker.shade(scene, view, Job("Shading"))
    (band,) = maker.bands(Job("Rendering"))
    shown = picture(scene, view, make.backend, backend_params(make.backend, PARAMS), make.services)
    np.testing.assert_array_equal(band.linear, shown.linear)


def test_what_the_guide_did_not_see_is_lit_in_a_larger_picture(make, monkeypatch):
    monkeypatch.setattr("studio_core.shading.bands.GUIDE_SAMPLES", 40)
    scene = scene_with_glass()
    view = view_of(scene, 64, 48, 1)
    maker = make()
    radiance = maker.shade(scene, view, Job("Shading"))
    assert radiance.valid.all()
    bands = list(maker.bands(Job("Rendering"), most=640))
    made = np.concatenate([band.linear for band in bands])
    # the same, seen in one piece
    given = {Surfaces: radiance.surfaces, Casters: maker._pipeline.artifact(Casters)}
    frame = dataclasses.replace(maker._frame, view=view)
    hits = LocatedPrimaryStage(make.services).run(frame, Inputs(given, everything(scene)), Job("Looking"))
    table = CoefficientTable(make.services.registry)(scene, radiance.surfaces)
    one = Compositor(make.services.workers).picture(scene, radiance, hits, table)
    np.testing.assert_array_equal(made, one.linear)
    assert one.linear.min() > 0


def test_lights_add_up_to_the_picture(make):
    scene = scene_with_glass()
    maker = make()
    maker.shade(scene, view_of(scene), Job("Shading"))
    (band,) = maker.bands(Job("Rendering"), Parts(lights=True))
    assert set(band.lights) == {"sky", "lamp"}
    np.testing.assert_allclose(sum(band.lights.values()), band.linear, rtol=1e-5, atol=1e-6)
    assert all(light.max() > 0.01 for light in band.lights.values())


def test_light_between_surfaces_is_one_of_the_lights(host, workers, monkeypatch):
    monkeypatch.setattr("studio_core.shading.bands.GUIDE_SAMPLES", 2000)
    services = Services(workers, BouncingHost(host, {"bounce": Bounce()}))
    backend, scene = host.get("backend", "reference"), scene_with_glass()
    choice = IndirectChoice("bounce", BounceParams())
    maker = PictureMaker(backend, backend_params(backend, PARAMS), services, indirect=choice)
    maker.shade(scene, view_of(scene), Job("Shading"))
    for transparent in (False, True):
        parts = Parts(lights=True, transparent=transparent)
        for band in maker.bands(Job("Rendering"), parts, most=2000):
            assert set(band.lights) == {"sky", "lamp", BETWEEN}
            np.testing.assert_allclose(sum(band.lights.values()), band.linear, rtol=1e-4, atol=1e-5)
            assert transparent is (band.alpha is not None)
    alone = PictureMaker(backend, backend_params(backend, PARAMS), services, indirect=choice, light=INDIRECT)
    alone.shade(scene, view_of(scene), Job("Shading"))
    bands = [band.linear for band in alone.bands(Job("Rendering"), Parts(transparent=True), most=2000)]
    lit = [b.lights[BETWEEN] for b in maker.bands(Job(""), Parts(transparent=True, lights=True), most=2000)]
    np.testing.assert_array_equal(np.concatenate(bands), np.concatenate(lit))


def test_over_its_background_a_transparent_picture_is_the_opaque_one(make):
    """What compositing does: premultiplied + (1 − alpha) · behind, behind a constant sky."""
    scene = scene_with_glass()
    sky = scene["sky"]
    grey = dataclasses.replace(sky.image, pixels=np.full((4, 8, 3), 0.7, np.float32))
    scene = scene.with_nodes(dataclasses.replace(sky, image=grey))
    maker = make()
    maker.shade(scene, view_of(scene), Job("Shading"))
    (opaque,) = maker.bands(Job("Rendering"))
    (band,) = maker.bands(Job("Rendering"), Parts(transparent=True))
    assert band.alpha is not None
    assert band.alpha.min() == 0
    assert band.alpha.max() == 1
    assert ((band.alpha > 0.2) & (band.alpha < 0.3)).any()  # one side of the glass against the sky
    behind = (1 - band.alpha[:, :, None]) * np.float32(0.7)
    np.testing.assert_allclose(band.linear + behind, opaque.linear, rtol=1e-5, atol=2e-6)
    assert opaque.alpha is None


def photographed(scene, level=0.7):
    """The scene with a floor that catches shadows, under a constant sky."""
    sky = scene["sky"]
    grey = dataclasses.replace(sky.image, pixels=np.full((4, 8, 3), level, np.float32))
    floor = dataclasses.replace(scene.material("matt"), catches=True)
    return scene.with_materials(floor).with_nodes(dataclasses.replace(sky, image=grey))


def test_caught_shadows_are_alpha(make):
    scene = photographed(make_little_scene())
    maker = make()
    maker.shade(scene, view_of(scene), Job("Shading"))
    (opaque,) = maker.bands(Job("Rendering"))
    (band,) = maker.bands(Job("Rendering"), Parts(transparent=True))
    behind = (1 - band.alpha[:, :, None]) * np.float32(0.7)
    np.testing.assert_allclose(band.linear + behind, opaque.linear, rtol=2e-3, atol=2e-3)
    shaded = (band.linear == 0).all(axis=2) & (band.alpha > 0.05)
    assert shaded.mean() > 0.02  # black with some alpha: the shadow of the cube


def test_lights_add_up_where_shadows_are_caught(make):
    scene = photographed(scene_with_glass())
    maker = make()
    maker.shade(scene, view_of(scene), Job("Shading"))
    for transparent in (False, True):
        (band,) = maker.bands(Job("Rendering"), Parts(transparent=transparent, lights=True))
        np.testing.assert_allclose(sum(band.lights.values()), band.linear, rtol=1e-4, atol=1e-5)


def test_without_an_environment_alpha_is_what_objects_cover(make):
    scene = scene_with_glass()
    nodes = {name: node for name, node in scene.nodes.items() if name != "sky"}
    scene = dataclasses.replace(scene, nodes=frozen_map(nodes))
    maker = make()
    maker.shade(scene, view_of(scene), Job("Shading"))
    (band,) = maker.bands(Job("Rendering"), Parts(transparent=True, lights=True))
    assert set(band.lights) == {"lamp"}
    assert (band.alpha.min(), band.alpha.max()) == (0, 1)
    assert not band.linear[band.alpha == 0].any()


def test_the_next_view_is_as_if_it_were_the_first(make):
    scene = scene_with_glass()
    view = view_of(scene)
    other = dataclasses.replace(view, transform=Transform((0.3, 0, 0.1)) @ view.transform)
    darker = scene.with_nodes(dataclasses.replace(scene["lamp"], intensity=0.5))
    maker, fresh = make(), make()
    maker.shade(scene, view, Job("Shading"))
    maker.shade(darker, other, Job("Shading"))
    fresh.shade(darker, other, Job("Shading"))
    np.testing.assert_array_equal(
        whole_of(maker, maker.bands(Job("a"))), whole_of(fresh, fresh.bands(Job("b")))
    )


def test_a_cancelled_picture_ends_between_bands(make, monkeypatch):
    monkeypatch.setattr("studio_core.shading.bands.GUIDE_SAMPLES", 0)
    scene = scene_with_glass()
    maker, job = make(), Job("Rendering")
    maker.shade(scene, view_of(scene), Job("Shading"))
    bands = maker.bands(job, most=600)
    next(bands)
    job.cancel()
    with pytest.raises(Cancelled):
        next(bands)


def test_bands_that_were_written_are_let_go_at_once(make, monkeypatch):
    """Memory stays that of a band: nothing waits for cycles to be looked for."""
    monkeypatch.setattr("studio_core.shading.bands.GUIDE_SAMPLES", 0)
    seen = []
    real = LocatedPrimaryStage.run

    def spy(self, frame, inputs, job):
        hits = real(self, frame, inputs, job)
        seen.append(weakref.ref(hits))
        return hits

    scene = scene_with_glass()
    maker = make()
    maker.shade(scene, view_of(scene), Job("Shading"))
    monkeypatch.setattr(LocatedPrimaryStage, "run", spy)
    gc.disable()
    try:
        for _ in maker.bands(Job("Rendering"), Parts(transparent=True, lights=True), most=600):
            pass
        assert len(seen) > 10
        assert sum(hits() is not None for hits in seen) <= 2
    finally:
        gc.enable()


def test_the_bar_only_moves_on_and_ends_full(make):
    heard = []
    job = Job("Rendering", lambda job: heard.append((job.done, job.total)))
    scene = scene_with_glass()
    maker = make()
    maker.shade(scene, view_of(scene), JobPart(job, 0.0, 0.6))
    list(maker.bands(JobPart(job, 0.6, 1.0)))
    JobPart(job, 0.6, 1.0).at(1)
    done = [done for done, total in heard if total == STEPS]
    assert len(done) > 5
    assert done == sorted(done)
    assert heard[-1] == (STEPS, STEPS)


@given(st.integers(1, 20000), st.integers(1, 20000), st.integers(1, 8), st.integers(1, 1 << 24))
def test_bands_cover_every_row_once(width, height, antialias, most):
    view = View(width=width, height=height, antialias=antialias)
    rows = rows_of(view, most)
    assert rows[0][0] == 0
    assert sum(height for _, height in rows) == height
    assert all(top + height == after for (top, height), (after, _) in pairwise(rows))
    assert all(top % 2 == 0 for top, _ in rows)
    small = guide(view, most)
    assert small is view or small.width * small.height * antialias**2 <= max(
        most, antialias**2 * max(small.width, small.height)
    )
