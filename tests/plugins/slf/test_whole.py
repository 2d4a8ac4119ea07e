"""All elements of a scene: what they see, lamps, skies, bounces, and the solve over one bounce or several."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from oracles.source_light import cell
from path_rooms import furnished, globe, stand
from scenes import sky

from studio_core.contract import Services
from studio_core.parallel import Workers
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Environment, Light, Material, MeshObject, PointLamp, Scene
from studio_core.scene.transform import Transform
from studio_core.transport.cells import CELLS, PARTS, RINGS
from studio_core.transport.hits import BLACK, NOTHING
from studio_core.transport.operator import Transport
from studio_plugins.slf.links import cell_pattern
from studio_plugins.slf.lobes import albedos, spectra
from studio_plugins.slf.lumitexels import LightField
from studio_plugins.slf.paper import DIFFUSE, KEPT
from studio_plugins.slf.series import light_of, matte_of, series_of
from studio_plugins.slf.whole import Reflectances, Whole

SKY = Environment(id="sky", name="Sky", image=sky(), intensity=1.0)
BULB = PointLamp(id="bulb", name="Bulb", transform=Transform((0.5, 1.8, 1.0)), intensity=2.0)


@pytest.fixture(scope="module")
def services(host):
    return Services(Workers(2), host)


def whole_of(scene, services, count=300, vertices=1500):
    made = stand(scene, services, vertices)
    whole = Whole(services.workers, count)
    follow(whole, scene, made)
    return whole, made


def follow(whole, scene, made):
    lights = {light.id: light for light in scene.of(Light) if scene.shown(light.id)}
    everything = np.ones(len(made.surfaces.unrefined.mesh), np.bool_)
    return whole.update(made.surfaces, made.casters, made.lighting, lights, everything)


def same(count, diffuse, specular=0.0, level=8.0):
    return Reflectances(
        np.full((count, 3), diffuse), np.full((count, 3), specular), np.full(count, float(level))
    )


def ball(radius=1.0):
    inside = globe(3, radius)
    return dataclasses.replace(inside, faces=inside.faces[:, ::-1].copy(), normals=-inside.normals)


def alone(*lights):
    paint = Material(id="paint", name="Paint", values={"base_color": (0.5, 0.5, 0.5)})
    body = MeshObject(id="ball", name="Ball", geometry=ball(), materials=("paint",))
    return Scene().with_materials(paint).with_nodes(body, *lights)


def test_links_name_what_rays_meet(services):
    whole, made = whole_of(furnished([SKY]), services)
    mesh, elements = made.surfaces.unrefined.mesh, whole.elements
    some = np.zeros(len(mesh), np.bool_)
    some[elements.vertex] = True
    traced = Transport(services.workers, cell_pattern())
    traced.update(made.surfaces, made.casters, some, None)
    rng = np.random.default_rng(0)
    missed = 0
    for e in rng.choice(len(elements), 12, replace=False):
        row = traced.row_of[elements.vertex[e]]
        axes = whole.frames[e].astype(np.float64)
        for ray in rng.choice(CELLS, 40, replace=False):
            vertex, link = int(traced.table.vertex[row, ray]), int(whole.links[e, ray])
            if vertex == NOTHING:
                assert len(elements) * CELLS <= link < LightField.rows_of(len(elements)) - 1
            elif vertex == BLACK:
                assert link == LightField.rows_of(len(elements)) - 1
            else:
                other = int(elements.owner[vertex])
                assert link // CELLS == other
                way = axes.T @ cell_pattern().directions[traced.variant[row], ray]
                missed += link % CELLS != cell(whole.frames[other].astype(np.float64) @ -way)
    assert missed <= 3  # on the edge of a cell


def test_every_ray_of_the_pattern_lies_in_its_cell():
    for variant in (0, 5):
        assert [cell(ray) for ray in cell_pattern().directions[variant].astype(np.float64)] == list(
            range(CELLS)
        )


def test_under_an_even_sky_a_ball_sends_its_albedo(services):
    even = dataclasses.replace(SKY, image=Image(np.ones((16, 32, 3), np.float32)))
    whole, _ = whole_of(alone(even), services)
    count = len(whole.elements)
    made = whole.after(1, same(count, 0.4, 0.3, 12)).of(0, count)
    expected = 0.4 + 0.3 * albedos(spectra())[12]
    assert np.allclose(made, expected[:, None], rtol=2e-3)


def test_a_lamp_lights_both_columns(services):
    lamp = dataclasses.replace(BULB, transform=Transform((0.0, 4.0, 0.0)))
    whole, made = whole_of(alone(lamp), services)
    count, mesh = len(whole.elements), made.surfaces.unrefined.mesh
    series = whole.incident(whole.dark(), 0, count)
    place = mesh.positions[whole.elements.vertex] + mesh.origin
    way = [0, 4, 0] - place
    far = np.linalg.norm(way, axis=1)
    cosine = (way * mesh.normals[whole.elements.vertex]).sum(axis=1) / far
    irradiance = np.where(cosine > 0, 2.0 * cosine / far**2, 0)
    sure = np.abs(cosine) > 0.05
    assert np.allclose(matte_of(series)[sure, 1] * math.pi, irradiance[sure], rtol=1e-4, atol=1e-6)
    shine = light_of(whole.sent(series, same(count, 0.0, 1.0, 10), 0))
    brightest = np.flatnonzero(cosine > 0.8)
    for e in brightest[:20]:
        ring, part = divmod(int(shine[e, 1].argmax()), PARTS)
        local = whole.frames[e].astype(np.float64) @ (way[e] / far[e]) * [-1, -1, 1]
        true_ring, true_part = divmod(cell(local), PARTS)
        assert abs(ring - true_ring) <= 1
        assert ring == 0 or min(abs(part - true_part), PARTS - abs(part - true_part)) <= 2 * (
            16 // (ring + 1) + 1
        )


def test_a_move_gives_what_a_new_start_gives(services):
    scene = furnished([SKY, BULB])
    whole, _ = whole_of(scene, services)
    box = dataclasses.replace(scene["box"], transform=Transform((0.6, 0.5, 0.4)))
    moved = scene.with_nodes(box)
    there = stand(moved, services)
    follow(whole, moved, there)
    fresh, _ = whole_of(moved, services)
    of = same(len(whole.elements), 0.5, 0.2)
    count = len(fresh.elements)
    assert np.array_equal(whole.elements.vertex, fresh.elements.vertex)
    assert (whole.links != fresh.links).mean() < 0.01  # rays along edges
    was, now = (one.after(2, of).of(0, count) for one in (whole, fresh))
    assert np.abs(was - now).mean() < 0.01 * now.mean()


def test_lights_that_are_off_light_nothing(services):
    whole, made = whole_of(furnished([SKY, BULB]), services)
    everything = np.ones(len(made.surfaces.unrefined.mesh), np.bool_)
    whole.update(made.surfaces, made.casters, made.lighting, {}, everything)
    assert not whole.after(2, same(len(whole.elements), 0.5)).of(0, len(whole.elements)).any()
    now = same(len(whole.elements), 0.5)
    solved = whole.solve(lambda own, sent: sent + 1, now, whole.dark())
    assert solved.counts == {"solved": 0, "skipped": len(whole.elements)}
    assert np.array_equal(solved.reflectances.diffuse, now.diffuse)


def test_any_number_of_threads_gives_the_same(services, host):
    scene = furnished([SKY, BULB])
    one, _ = whole_of(scene, Services(Workers(1), host), 150)
    two, _ = whole_of(scene, services, 150)
    of = same(len(one.elements), 0.5, 0.2)
    count = len(one.elements)
    assert np.array_equal(one.after(2, of).of(0, count), two.after(2, of).of(0, count))


def test_what_another_reflectance_would_send_is_found(services):
    whole, _ = whole_of(furnished([SKY, BULB]), services, 400)
    count = len(whole.elements)
    rng = np.random.default_rng(2)
    now = Reflectances(np.full((count, 3), 0.3), np.full((count, 3), 0.2), np.full(count, 6.0))
    true = Reflectances(rng.uniform(0.1, 0.7, (count, 3)), now.specular, now.level)
    dark = whole.dark()
    goal = np.concatenate(
        [
            whole.sent(whole.incident(dark, start, min(start + 32, count)), true, start)
            for start in range(0, count, 32)
        ]
    )
    made = whole.solve(lambda own, sent: goal[own], now, dark, "l0")
    lit = ~made.flagged
    assert lit.mean() > 0.8
    assert (made.kind[lit] == DIFFUSE).mean() > 0.97
    found = made.reflectances.diffuse[lit & (made.kind == DIFFUSE)]
    assert np.abs(found - true.diffuse[lit & (made.kind == DIFFUSE)]).max() < 0.02
    assert (made.kind[~lit] == KEPT).all()


def test_solving_again_comes_nearer_to_the_painted_colour(services):
    """Figure 15: one bounce's answer does not know of the light that it brings itself."""
    whole, _ = whole_of(furnished([SKY, BULB]), services, 300)
    count = len(whole.elements)
    now = same(count, 0.6)
    shown = whole.after(3, now)
    goal = 0.8 * series_of(shown.of(0, count))
    made = whole.settled(lambda own, sent: goal[own], now, 3, "l2")

    def off(one):
        return (
            np.abs(whole.after(3, one.reflectances).of(0, count) - light_of(goal)).mean()
            / light_of(goal).mean()
        )

    errors = [off(one) for one in made]
    assert errors[1] < 0.3 * errors[0]
    assert errors[2] < 0.02


def test_memory_is_as_said(services):
    whole, _ = whole_of(furnished([SKY]), services, 200)
    assert whole.nbytes >= whole.links.nbytes + 8 * CELLS * len(whole.elements)
    assert whole.dark().nbytes < 7 * (LightField.rows_of(len(whole.elements)))
    assert RINGS * PARTS == CELLS
