"""Brute force: what is summed over, what is kept, and closed forms it must meet."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scenes import sky

from studio_core.contract import Services
from studio_core.kernels.directions import DirectionList, direction_set
from studio_core.kernels.light_tree import LightTree
from studio_core.kernels.raycast import CasterObject, RayCaster
from studio_core.kernels.visibility import trace_visibility
from studio_core.parallel import Workers
from studio_core.scene.diff import Changes, diff, view_changed
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Environment, MeshObject
from studio_core.scene.transform import Transform
from studio_core.shading import lighting
from studio_core.shading.artifacts import Lighting
from studio_core.shading.brute_force import HEAVY, VisibilityBits, split_light
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params, scene_view, shade
from studio_core.shading.pipeline import Pipeline


@pytest.fixture(scope="module")
def services(host, workers):
    return Services(workers, host)


def tree(seed=0, sun=True):
    rng = np.random.default_rng(seed)
    leaves = rng.gamma(0.3, 1, (1 << 14, 3))
    if sun:
        leaves[77] = 1e4
    return LightTree.build(leaves.astype(np.float32))


def test_splitting_keeps_the_light_and_bounds_what_a_ray_stands_for():
    whole = tree()
    parts = split_light(whole, 12)
    total = sum(part.light.sum(axis=0) * part.directions.solid_angle for part in parts)
    np.testing.assert_allclose(total, whole.prefix_power[-1], rtol=1e-5)
    share = parts[0].light.sum(axis=1) / (whole.coarsened(12).radiance.sum())
    assert share.max() <= max(HEAVY, 4 / (1 << 12))
    leaves = direction_set(14).leaf_of(parts[1].directions.given)
    assert len(leaves) % 4 == 0
    np.testing.assert_array_equal(np.unique(leaves >> 2), leaves[::4] >> 2)


def test_the_finest_directions_are_not_split():
    assert len(split_light(tree(), 14)) == 1


def test_a_list_of_directions_sees_what_the_set_sees(workers):
    rng = np.random.default_rng(1)
    corners = rng.uniform(-1, 1, (60, 3)).astype(np.float32)
    faces = np.arange(60, dtype=np.uint32).reshape(-1, 3)
    points = rng.uniform(-1, 1, (20, 3))
    normals = rng.normal(size=(20, 3)).astype(np.float32)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    every = direction_set(10)
    chosen = np.sort(rng.choice(1024, 200, replace=False)).astype(np.int64)
    some = DirectionList.of_leaves(10, chosen)
    with RayCaster([CasterObject(corners, faces, "soup", np.eye(4), None)]) as caster:
        full = trace_visibility(caster, points, normals, every, workers).words
        part = trace_visibility(caster, points, normals, some, workers).words
    bits = np.unpackbits(full.view(np.uint8), axis=1, bitorder="little")
    own = np.unpackbits(part.view(np.uint8), axis=1, bitorder="little")
    np.testing.assert_array_equal(own[:, : len(chosen)], bits[:, chosen])
    assert not own[:, len(chosen) :].any()


def pipeline(services, host):
    return Pipeline(host.get("backend", "reference").stages(services))


def test_light_material_and_view_cost_no_rays(services, host, little_scene):
    scene = little_scene()
    params = backend_params(
        host.get("backend", "reference"), {"directions": "1024", "vertices": 600, "everywhere": True}
    )
    view = scene_view(scene, None, 40, 30)
    pipe = pipeline(services, host)
    pipe.update(Frame(scene, view, params, 1), Changes(), Job("first"))
    rays = pipe.artifact(VisibilityBits).rays
    assert rays > 0
    environment = next(scene.of(Environment))
    material = next(iter(scene.materials.values()))
    for changed in (
        scene.with_nodes(dataclasses.replace(environment, intensity=3.0)),
        scene.with_materials(dataclasses.replace(material, model="ggx", values={"roughness": 0.3})),
    ):
        pipe.update(Frame(changed, view, params, 2), diff(scene, changed), Job("again"))
        assert pipe.artifact(VisibilityBits).rays == rays
        scene = changed


def test_changing_a_colour_or_a_gain_reruns_no_light_sum(services, host, little_scene):
    scene = little_scene()
    params = backend_params(host.get("backend", "reference"), {"directions": "1024", "vertices": 600})
    view = scene_view(scene, None, 40, 30)
    pipe = pipeline(services, host)
    first = pipe.update(Frame(scene, view, params, 1), Changes(), Job("first"))
    material = next(iter(scene.materials.values()))
    recoloured = scene.with_materials(dataclasses.replace(material, values={"base_color": (0.1, 0.7, 0.2)}))
    again = pipe.update(Frame(recoloured, view, params, 2), diff(scene, recoloured), Job("colour"))
    assert again is first
    environment = next(scene.of(Environment))
    brighter = recoloured.with_nodes(dataclasses.replace(environment, intensity=2.0))
    lit = pipe.update(Frame(brighter, view, params, 3), diff(recoloured, brighter), Job("gain"))
    assert lit is first
    assert [run.name for run in pipe.report if run.ran] == []


def test_moving_an_object_equals_starting_afresh(services, host, little_scene):
    scene = little_scene()
    backend = host.get("backend", "reference")
    params = backend_params(backend, {"directions": "1024", "vertices": 600, "everywhere": True})
    view = scene_view(scene, None, 40, 30)
    pipe = pipeline(services, host)
    pipe.update(Frame(scene, view, params, 1), Changes(), Job("first"))
    node = list(scene.of(MeshObject))[-1]
    moved = scene.with_nodes(
        dataclasses.replace(node, transform=Transform((0.3, 0.6, -0.2)) @ node.transform)
    )
    kept = pipe.update(Frame(moved, view, params, 2), diff(scene, moved), Job("moved"))
    fresh = shade(moved, view, backend, params, services)
    for layer in fresh.layers:
        np.testing.assert_allclose(
            kept.layers[layer].irradiance, fresh.layers[layer].irradiance, rtol=2e-3, atol=2e-3
        )
        assert np.abs(kept.layers[layer].irradiance - fresh.layers[layer].irradiance).mean() < 1e-5


def test_a_turning_light_is_summed_over_the_leaves_there_are(services, host, little_scene, monkeypatch):
    monkeypatch.setattr(lighting, "TURNING", 11)
    image = np.array(sky(64).pixels)
    image[9, 20] = [9e3, 7e3, 4e3]
    scene = little_scene(environment=Image(image))
    backend = host.get("backend", "reference")
    params = backend_params(backend, {"directions": "4096", "vertices": 600})
    view = scene_view(scene, None, 40, 30)
    pipe = pipeline(services, host)
    assert pipe.update(Frame(scene, view, params, 1), Changes(), Job("first")).directions == 4096
    turned = scene.with_nodes(dataclasses.replace(next(scene.of(Environment)), azimuth=30.0))
    moving = pipe.update(Frame(turned, view, params, 2, True), diff(scene, turned), Job("turned"))
    assert moving.directions == 2048
    rest = pipe.update(Frame(turned, view, params, 3), view_changed(), Job("rest"))
    assert rest.directions == 4096
    fresh = shade(turned, view, backend, params, services)
    np.testing.assert_array_equal(rest.layers["sky"].irradiance, fresh.layers["sky"].irradiance)
    lit = fresh.layers["sky"].irradiance
    assert np.sqrt(((moving.layers["sky"].irradiance - lit) ** 2).mean()) < 0.05 * lit.mean()


def test_a_sun_casts_the_shadow_of_its_own_direction(services, host, little_scene):
    """The floor in the cube's shadow loses the sun's irradiance, the open floor has all of it."""
    image = np.full((64, 128, 3), 1e-3, np.float32)
    image[16, 32] = 1e4
    scene = little_scene(environment=Image(image))
    params = backend_params(
        host.get("backend", "reference"), {"directions": "1024", "vertices": 3000, "everywhere": True}
    )
    pipe = pipeline(services, host)
    made = pipe.update(Frame(scene, scene_view(scene, None, 16, 12), params, 1), Changes(), Job("first"))
    sun = pipe.artifact(Lighting).sun
    towards = (sun.directions * sun.irradiance.sum(axis=1, keepdims=True)).sum(axis=0)
    towards /= np.linalg.norm(towards)
    mesh = made.surfaces.mesh
    places = mesh.positions + mesh.origin
    floor = (mesh.object == made.surfaces.nodes.index("floor")) & (mesh.normals[:, 1] > 0.9)
    expected = float((sun.irradiance[:, 0] * sun.directions[:, 1]).sum())
    along = places + np.linspace(0.02, 3, 300)[:, None, None] * towards

    def behind(grown):  # a cube that is larger or smaller by what a penumbra takes
        inside = (np.abs(along[..., [0, 2]]) < 0.5 + grown).all(axis=2) & (along[..., 1] < 1.0 + grown)
        return inside.any(axis=0)

    open_floor = np.abs(places[:, [0, 2]]).max(axis=1) > 0.55
    found = made.layers["sky"].irradiance[:, 0] / expected
    well_lit, dark = floor & open_floor & ~behind(0.25), floor & open_floor & behind(-0.2)
    assert well_lit.sum() > 50
    assert dark.sum() > 5
    np.testing.assert_allclose(found[well_lit], 1, atol=0.02)
    assert found[dark].max() < 0.1


def test_one_and_two_threads_agree_bit_for_bit(host, little_scene):
    scene = little_scene()
    backend = host.get("backend", "reference")
    params = backend_params(backend, {"directions": "4096", "vertices": 800, "everywhere": True})
    view = scene_view(scene, None, 40, 30)
    made = []
    for threads in (1, 2):
        with Workers(threads) as own:
            made.append(shade(scene, view, backend, params, Services(own, host)))
    for layer in made[0].layers:
        np.testing.assert_array_equal(made[0].layers[layer].terms, made[1].layers[layer].terms)
        np.testing.assert_array_equal(made[0].layers[layer].irradiance, made[1].layers[layer].irradiance)
