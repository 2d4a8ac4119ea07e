"""Light at the elements that strokes touch: as all elements have it, for those alone."""

from __future__ import annotations

import numpy as np
import pytest
from path_rooms import furnished, stand
from scenes import sky

from studio_core.contract import Services
from studio_core.parallel import Workers
from studio_core.scene.nodes import Environment, Light, PointLamp
from studio_core.scene.transform import Transform
from studio_core.strokes.solution import Lit
from studio_plugins.slf.touched import Touched
from studio_plugins.slf.whole import Whole

SKY = Environment(id="sky", name="Sky", image=sky(), intensity=0.7)
BULB = PointLamp(id="bulb", name="Bulb", transform=Transform((0.5, 1.8, 1.0)), intensity=2.0)


@pytest.fixture(scope="module")
def services(host):
    return Services(Workers(2), host)


def lit_of(scene, services):
    made = stand(scene, services, 800)
    return Lit(made.surfaces, made.casters, made.shapes, made.lighting, made.hits, None)


def test_light_is_what_all_elements_have(services):
    scene = furnished([SKY, BULB])
    lit = lit_of(scene, services)
    mesh = lit.surfaces.unrefined.mesh
    some = np.arange(3, len(mesh), 40)
    touched = Touched(services.workers)
    made = touched.light(scene, lit, some)
    whole = Whole(services.workers)
    lights = {light.id: light for light in scene.of(Light)}
    wanted = np.zeros(len(mesh), np.bool_)
    wanted[some] = True
    whole.update(lit.surfaces, lit.casters, lit.lighting, lights, wanted)
    true = whole.incident(whole.dark(), 0, len(some))
    true[whole.buried] = 0
    np.testing.assert_allclose(made.series, true, atol=2e-3 * np.abs(true).max())
    np.testing.assert_array_equal(made.frames, whole.frames)
    assert made.rays > 0
    assert touched.light(scene, lit, some[::2]).rays <= len(some), "but for the lamp's, rays are kept"


def test_lights_that_are_off_light_nothing(services):
    scene = furnished([SKY, BULB])
    lit = lit_of(scene, services)
    dark = furnished([])
    assert not Touched(services.workers).light(dark, lit, np.array([5, 60])).series.any()


def test_vertices_belong_to_elements_of_their_object(services):
    lit = lit_of(furnished([SKY]), services)
    mesh = lit.surfaces.unrefined.mesh
    every = np.arange(len(mesh))
    found = Touched(services.workers).owners(mesh, lit.casters.meshes, every)
    assert (mesh.object[found] == mesh.object).all()
