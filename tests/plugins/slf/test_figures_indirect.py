"""The paper's sessions in indirect mode on small scenes: figures 17, 18 and 19.

What is found is put into the scene, and light goes on between surfaces anew: then the light under the stroke
is what was wanted.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from indirect_strokes import Painting, band, recoloured, separate
from path_rooms import furnished
from scenes import floor

from studio_core.contract import Services
from studio_core.scene.nodes import AreaLamp, Camera, Material, MeshObject, Scene, SpotLamp
from studio_core.scene.transform import Transform, axis_angle, looking
from studio_core.shading.job import Job
from studio_core.strokes.edits import bared
from studio_plugins.slf.reflected import Reflections
from studio_plugins.slf.solver import SOLVER, Params

LAMP = AreaLamp(
    id="lamp", intensity=6.0, width=1.0, height=0.6, transform=looking((0.8, 2.4, 0.9), (-0.5, 0, -0.5))
)
CAMERA = Camera(id="camera", transform=looking((0, 2.2, 4.5), (0, 0.8, 0)))
MATTE = {"base_color": (0.7, 0.7, 0.7)}
NOISE = 0.1
JOB = Job("test")


@pytest.fixture(scope="module")
def services(workers: Any, host: Any) -> Services:
    return Services(workers, host)


def noisy(change: Any, seed: int = 0) -> Any:
    """With noise of a tenth of its size."""
    size = np.sqrt((change**2).mean())
    return change + NOISE * size * np.random.default_rng(seed).normal(size=change.shape)


def left_after(painting: Painting, found: Reflections, some: Any, change: Any) -> Any:
    """Of a wanted change, the share (squared) that the best reason's edit leaves; and the mean of its own."""
    before = painting.radiance(painting.lit, some)
    made = painting.after(found.findings[0].reasons[0].edit(painting.scene), some) - before
    return ((made - change) ** 2).sum() / (change**2).sum(), made.mean(axis=0)


def test_figure_17_green_light_comes_from_a_wall(services: Services) -> None:
    painting = Painting(separate(furnished((LAMP, CAMERA))), services)
    some = painting.vertices("floor", (-1.4, 0, 0.3), 150)
    before = painting.radiance(painting.lit, some)
    change = painting.after(recoloured(painting.scene, "side", base_color=(0.2, 0.75, 0.25)), some) - before
    found = painting.solve(painting.stroke(some, before + noisy(change)))
    best = found.findings[0]
    assert (best.node, best.reasons[0].meaning) == ("side", "colour")
    np.testing.assert_allclose(best.reasons[0].values["base_color"], (0.2, 0.75, 0.25), atol=0.06)
    left, mean = left_after(painting, found, some, change)
    assert left < 0.03
    np.testing.assert_allclose(mean, change.mean(axis=0), rtol=0.15)


def test_through_the_door_it_is_one_edit_that_is_not_made_twice(services: Services) -> None:
    painting = Painting(separate(furnished((LAMP, CAMERA))), services)
    some = painting.vertices("floor", (-1.4, 0, 0.3), 150)
    before = painting.radiance(painting.lit, some)
    change = painting.after(recoloured(painting.scene, "side", base_color=(0.2, 0.75, 0.25)), some) - before
    stroke = painting.stroke(some, before + change)
    there, run = painting.scene.with_nodes(stroke), SOLVER.open(services)
    solution = run.solve(there, [stroke.id], painting.given(), Params(), JOB)
    best = solution.findings[0]
    assert (best.node, best.reasons[0].meaning) == ("side", "colour")
    made = solution.edit(there)
    assert made["floor"].paint is None
    (once,) = np.unique(made["side"].paint.change("base_color"), axis=0)
    plain = np.asarray(there.material("of side").values["base_color"])
    np.testing.assert_allclose(plain + once, (0.2, 0.75, 0.25), atol=0.06)
    assert made[stroke.id].reached == ("side",)
    again = run.solve(made, [stroke.id], painting.given(), Params(), JOB).edit(made)
    (twice,) = np.unique(again["side"].paint.change("base_color"), axis=0)
    np.testing.assert_allclose(twice, once, atol=0.02)
    assert best.reasons[0].edit(there)[stroke.id].meaning == "colour"
    off = made.with_nodes(dataclasses.replace(made[stroke.id], hidden=True))
    assert "side" in bared(made, off)


def test_what_is_taken_instead_takes_the_first_back_and_is_remembered(services: Services) -> None:
    painting = Painting(separate(furnished((LAMP, CAMERA))), services)
    some = painting.vertices("floor", (-1.4, 0, 0.3), 150)
    before = painting.radiance(painting.lit, some)
    stroke = painting.stroke(some, before * (0.9, 1.15, 0.9), flat=True)
    there, run = painting.scene.with_nodes(stroke), SOLVER.open(services)
    solution = run.solve(there, [stroke.id], painting.given(), Params(), JOB)
    first, second = solution.findings[:2]
    made = solution.edit(there)
    assert made[first.node].paint is not None
    taken = second.reasons[0].edit(made)
    assert taken[first.node] == there[first.node]
    assert taken[second.node].paint is not None
    now = taken[stroke.id]
    assert (now.through, now.through_slot, now.reached) == (second.node, second.slot, (second.node,))
    back = first.reasons[0].edit(taken)
    assert back[second.node] == there[second.node]
    again = run.solve(taken, [stroke.id], painting.given(), Params(), JOB)
    assert again.findings[0].node == second.node
    assert again.edit(taken)[first.node].paint is None


def test_figure_17_a_flat_stroke_makes_the_light_as_green(services: Services) -> None:
    painting = Painting(separate(furnished((LAMP, CAMERA))), services)
    some = painting.vertices("floor", (-1.4, 0, 0.3), 150)
    before = painting.radiance(painting.lit, some)
    wanted = before * (0.9, 1.15, 0.9)
    found = painting.solve(painting.stroke(some, wanted, flat=True))
    assert found.findings[0].node != "floor"
    _, mean = left_after(painting, found, some, wanted - before)
    assert mean[1] > 0 > max(mean[0], mean[2])
    np.testing.assert_allclose(mean, (wanted - before).mean(axis=0), rtol=0.35)


def test_figure_18_what_shows_in_a_glossy_floor_turns_orange(services: Services) -> None:
    metal = {"base_color": (0.8, 0.8, 0.8), "roughness": 0.4, "metallic": 1.0}
    scene = recoloured(separate(furnished((LAMP, CAMERA))), "floor", "ggx", **metal)
    painting = Painting(scene, services)
    some = painting.vertices("floor", (0.2, 0, -0.9), 150)
    before = painting.radiance(painting.lit, some)
    orange = scene.material("of back")
    then = scene.with_materials(Material(id=orange.id, name="B", values={"base_color": (0.8, 0.4, 0.1)}))
    change = painting.after(then, some) - before
    found = painting.solve(painting.stroke(some, before + noisy(change)))
    best = found.findings[0]
    assert (best.node, best.reasons[0].meaning) == ("back", "colour")
    left, _ = left_after(painting, found, some, change)
    assert left < 0.03


def ring_on_a_table() -> Scene:
    materials = [Material(id=name, name=name, values=MATTE) for name in ("table", "wall", "side")]
    ring = Material(id="ring", name="Ring", values={"base_color": (0.15, 0.2, 0.6)})
    nodes = [
        MeshObject(id="table", geometry=floor(), materials=("table",)),
        MeshObject(
            id="wall", geometry=floor(), materials=("wall",),
            transform=Transform((0, 2, -2), axis_angle((1, 0, 0), 90)),
        ),
        MeshObject(
            id="side", geometry=floor(), materials=("side",),
            transform=Transform((-2, 2, 0), axis_angle((0, 0, 1), -90)),
        ),
        MeshObject(id="ring", geometry=band(), materials=("ring",)),
        SpotLamp(
            id="lamp", transform=looking((1.5, 1.4, 0.4), (0, 0.1, 0)), intensity=8.0, cone=40.0, inner=30.0
        ),
        Camera(id="camera", transform=looking((0, 2.4, 2.6), (0, 0, 0))),
    ]  # fmt: skip
    return Scene().with_materials(*materials, ring).with_nodes(*nodes)


def test_figure_19_a_caustic_makes_the_ring_shine_and_a_yellow_stroke_makes_it_gold(
    services: Services,
) -> None:
    painting = Painting(ring_on_a_table(), services, 5000)
    some = painting.vertices("table", (-0.15, 0, 0), 200)
    before = painting.radiance(painting.lit, some)
    shine = {"diffuse": (0.15, 0.2, 0.6), "specular": (0.9, 0.9, 0.9), "roughness": 0.3}
    change = painting.after(recoloured(painting.scene, "ring", "specgloss", **shine), some) - before
    bright = change.mean(axis=1) > np.quantile(change.mean(axis=1), 0.6)
    flat = painting.stroke(some[bright], before[bright] + 2 * change.mean(), flat=True)
    fixates = [
        painting.fixate(painting.vertices("wall", (0, 1, -2), 80), 7),
        painting.fixate(painting.vertices("side", (-2, 1, 0), 80), 8),
    ]
    sketched = painting.solve(flat, *fixates)
    assert {one.node for one in sketched.findings} == {"ring"}
    assert "shine" in sketched.findings[0].reasons[0].meaning

    found = painting.solve(painting.stroke(some, before + noisy(change)), *fixates)
    best = found.findings[0].reasons[0]
    assert (found.findings[0].node, best.meaning) == ("ring", "shine")
    made = best.edit(painting.scene)
    left, _ = left_after(painting, found, some, change)
    assert left < 0.08

    painting.become(made)
    white = painting.radiance(painting.lit, some)
    yellow = (white - before) * (0.0, -0.15, -0.6)
    golden = painting.solve(painting.stroke(some, white + yellow))
    best = golden.findings[0].reasons[0]
    assert (golden.findings[0].node, best.meaning) == ("ring", "shine")
    red, green, blue = np.atleast_1d(best.values["specular"])
    assert red >= green > 1.5 * blue
    left, _ = left_after(painting, golden, some, yellow)
    assert left < 0.08
