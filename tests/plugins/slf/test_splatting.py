"""Splats: shares, look-ups between cells; the picture of elements beside the reference."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from path_rooms import furnished
from scenes import sky
from transport_support import Stand, ball, scene_of, thing, walls

from studio_core.contract import Services
from studio_core.parallel import Workers
from studio_core.scene.nodes import Environment, Material, PointLamp
from studio_core.scene.transform import Transform
from studio_core.shading.offline import backend_params, scene_view, shade
from studio_core.shading.vertex_radiance import vertex_radiance
from studio_core.transport.cells import CELLS, PARTS, RINGS, cell_directions
from studio_plugins.slf.elements import Elements
from studio_plugins.slf.splatting import NEAR, Splats, blocks, look_up

SKY = Environment(id="sky", name="Sky", image=sky(), intensity=1.5)
BULB = PointLamp(id="bulb", name="Bulb", transform=Transform((0.5, 1.8, 1.0)), intensity=2.0)


@pytest.fixture(scope="module")
def services(host):
    return Services(Workers(2), host)


def test_shares_sum_to_one_and_come_from_what_faces_alike():
    mesh = Stand(scene_of(thing("room", walls(4, 3, 5)), thing("ball", ball(0.5, 24), (0, 1, 0))), 4000).mesh
    elements = Elements.of(mesh, np.ones(len(mesh), np.bool_), 800)
    points, inside = np.arange(0, len(mesh), 3), np.zeros(len(mesh), np.bool_)
    splats = Splats.of(mesh, elements, points, np.zeros(len(mesh), np.int64), inside)
    assert np.allclose(np.bincount(splats.vertex, splats.share, len(points)), 1)
    assert np.bincount(splats.vertex).max() <= NEAR + 1
    element = np.repeat(np.arange(len(elements)), np.diff(splats.start))
    at, of = elements.vertex[element], points[splats.vertex]
    assert (mesh.object[at] == mesh.object[of]).all()
    assert ((mesh.normals[at] * mesh.normals[of]).sum(axis=1) > 0.5).mean() > 0.99
    place = mesh.positions[at].astype(np.float64)
    assert np.linalg.norm(splats.sums(place) - mesh.positions[points], axis=1).max() < 0.5
    inside[mesh.object == 1] = True
    inside[elements.vertex] = False
    dark = Splats.of(mesh, elements, points, np.zeros(len(mesh), np.int64), inside)
    assert not np.isin(dark.vertex, np.flatnonzero(inside[points])).any()


def test_looking_up_the_middle_of_a_cell_gives_its_light():
    rng = np.random.default_rng(0)
    light = rng.uniform(0, 1, (1, 3, RINGS, PARTS)).astype(np.float32)
    out = np.empty((CELLS, 3), np.float32)
    nothing, every = np.zeros(CELLS, np.int64), np.arange(CELLS)
    frames = np.eye(3, dtype=np.float32)[None]
    look_up(light, frames, nothing, every, cell_directions(), out)
    assert np.allclose(out, light[0].reshape(3, -1).T, atol=1e-4)
    up = np.array([[0, 0, 1], [1e-4, 0, 1], [-1e-4, 0, 1], [1, 0, 0]], np.float32)
    look_up(light, frames, nothing[:4], every[:4], up, out)
    assert np.allclose(out[1], out[2], atol=5e-3)  # across the pole
    assert np.isfinite(out[:4]).all()


def test_blocks_leave_out_what_nobody_uses():
    used = np.zeros(100, np.bool_)
    used[[3, 70]] = True
    assert blocks(used, 32) == [(0, 32), (64, 96)]


def pictures(host, services, *materials):
    scene = furnished([SKY, BULB], *materials)
    view = dataclasses.replace(scene_view(scene, None, 96, 64), antialias=1)
    made = []
    for name, more in (("reference", {"directions": "4096"}), ("slf", {})):
        backend = host.get("backend", name)
        made.append(
            shade(scene, view, backend, backend_params(backend, {"vertices": 3000, **more}), services)
        )
    return scene, made[0], made[1]


SHINY = {"diffuse": (0.3, 0.2, 0.1), "specular": (0.4, 0.4, 0.4), "exponent": 20.0}


@pytest.mark.parametrize("model", ["lambert", "phong"])
def test_it_looks_like_the_reference(host, services, model):
    paint = Material(id="paint", name="Paint", model=model, values=SHINY if model == "phong" else {})
    scene, true, made = pictures(host, services, paint)
    both = true.valid & made.valid
    assert np.array_equal(true.valid, made.valid)
    assert np.array_equal(made.layers["bulb"].terms, true.layers["bulb"].terms)
    a, b = (vertex_radiance(scene, one, host)[both] for one in (true, made))
    assert abs(b.mean() / a.mean() - 1) < 0.03
    assert math.sqrt(((a - b) ** 2).mean()) < 0.12 * a.mean()
    assert made.counts["elements"] > 0
