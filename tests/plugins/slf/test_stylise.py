"""Stylised scenes: neighbours, and light that is sharper than before with materials that stay valid."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from path_rooms import furnished, stand
from scenes import sky

from studio_core.contract import Services
from studio_core.edits import Compound, SetPaint
from studio_core.parallel import Workers
from studio_core.scene.nodes import Environment, Material, MeshObject, PointLamp
from studio_core.scene.paint import Paint
from studio_core.scene.transform import Transform
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params, scene_view, shade
from studio_core.shading.vertex_radiance import vertex_radiance
from studio_core.strokes.solution import Lit
from studio_plugins.slf.stylise import AROUND, Style, neighbours, stylise
from studio_plugins.slf.whole import Whole

SKY = Environment(id="sky", name="Sky", image=sky(), intensity=0.4)
BULB = PointLamp(id="bulb", name="Bulb", transform=Transform((0.5, 1.8, 1.0)), intensity=3.0)
PAINT = Material(
    id="paint",
    name="Paint",
    model="phong",
    values={"diffuse": (0.3, 0.3, 0.3), "specular": (0.2, 0.2, 0.2), "exponent": 20.0},
)


@pytest.fixture(scope="module")
def services(host):
    return Services(Workers(2), host)


def solved(services, amount, *edits):
    scene = Compound("Before", edits)(furnished([SKY, BULB], PAINT))
    made = stand(scene, services, 1500)
    lit = Lit(made.surfaces, made.casters, made.shapes, made.lighting, made.hits, None)
    whole = Whole(services.workers, 400)
    return scene, made, stylise(scene, lit, Style(amount), services, Job("test"), whole), whole


def radiance(scene, services, host):
    view = dataclasses.replace(scene_view(scene, None, 64, 40), antialias=1)
    backend = host.get("backend", "reference")
    params = backend_params(backend, {"vertices": 1500, "directions": "1024", "everywhere": True})
    return vertex_radiance(scene, shade(scene, view, backend, params, services), host)


def test_light_is_sharper_than_before_and_softer_the_other_way(host, services):
    scene, made, sharper, whole = solved(services, 1.5)
    softer = solved(services, -0.8)[2]
    mesh = made.surfaces.unrefined.mesh
    at = whole.elements.vertex
    around = neighbours(mesh, at)
    floor = mesh.object[at] == mesh.index_of("floor")

    def contrast(one):
        light = radiance(one, services, host)[at].mean(axis=1)
        return np.abs(light - light[around].mean(axis=1))[floor].mean() / light[floor].mean()

    before = contrast(scene)
    assert contrast(sharper.edit(scene)) > 1.2 * before
    assert contrast(softer.edit(scene)) < 0.95 * before
    assert sharper.counts["solved"] > 0.6 * len(at)


def test_every_object_is_painted_and_can_be_undone(services):
    scene, _, solution, _ = solved(services, 1.0)
    after = solution.edit(scene)
    painted = [node for node in after.of(MeshObject) if node.paint is not None]
    assert {node.id for node in painted} == {"floor", "back", "side", "box"}
    for node in painted:
        assert all(np.isfinite(table.values).all() for table in node.paint.changes.values())


def test_paint_that_is_there_stays_under_it(services):
    change = {"diffuse": [[0.3, -0.1, 0.2]], "exponent": [1.0]}
    paint = Paint.of([[0, 0, 0]], [[0, 1, 0]], [0], change)
    solution = solved(services, 0.0, SetPaint("box", paint))[2]
    made = solution.edit(solved(services, 0.0)[0])["box"].paint
    for name, value in change.items():
        assert np.allclose(made.change(name), np.reshape(value, (1, -1)), atol=2e-3), name


def test_neighbours_are_of_the_same_object(services):
    scene = furnished([SKY])
    mesh = stand(scene, services, 800).surfaces.unrefined.mesh
    at = np.arange(0, len(mesh), 2)
    found = neighbours(mesh, at)
    assert found.shape == (len(at), AROUND)
    assert (mesh.object[at[found]] == mesh.object[at][:, None]).all()
