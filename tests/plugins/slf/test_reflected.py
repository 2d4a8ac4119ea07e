"""Indirect strokes: candidates, the edits that come of them, and strokes that say nothing."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from indirect_strokes import JOB, Painting, recoloured, separate
from path_rooms import furnished

from studio_core.contract import Services
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import AreaLamp, Camera, Material, MeshObject
from studio_core.scene.transform import looking
from studio_core.shading.artifacts import Surfaces
from studio_core.strokes.solution import Lit
from studio_plugins.slf.candidates import STEPS, Moments, _refined
from studio_plugins.slf.changeable import Look, changeables_of, mean_paint
from studio_plugins.slf.recolouring import painted_alike
from studio_plugins.slf.reflected import solve_reflected

LAMP = AreaLamp(
    id="lamp", intensity=6.0, width=1.0, height=0.6, transform=looking((0.8, 2.4, 0.9), (-0.5, 0, -0.5))
)
CAMERA = Camera(id="camera", transform=looking((0, 2.2, 4.5), (0, 0.8, 0)))


@pytest.fixture(scope="module")
def painting(workers: Any, host: Any) -> Painting:
    return Painting(separate(furnished((LAMP, CAMERA))), Services(workers, host), 2000)


def wanted_from(painting: Painting, some: Any, **values: Any) -> Any:
    return painting.after(recoloured(painting.scene, "side", **values), some)


def test_what_the_stroke_means_comes_first_and_all_else_is_offered(painting: Painting) -> None:
    some = painting.vertices("floor", (-1.3, 0, 0), 80)
    wanted = wanted_from(painting, some, base_color=(0.2, 0.6, 0.9))
    free = painting.solve(painting.stroke(some, wanted)).findings
    assert (free[0].node, free[0].reasons[0].meaning) == ("side", "colour")
    assert all(one.rivals for one in free)
    assert not painting.solve(painting.stroke(some, wanted, meaning="shine")).findings, "that is none"
    shiny = {"diffuse": (0.7, 0.6, 0.5), "specular": (0.8, 0.8, 0.8), "roughness": 0.35}
    brighter = painting.after(recoloured(painting.scene, "side", "specgloss", **shiny), some)
    assert painting.solve(painting.stroke(some, brighter)).findings[0].reasons[0].meaning == "shine"
    meant = painting.solve(painting.stroke(some, brighter, meaning="colour")).findings
    assert meant[0].reasons[0].meaning == "colour"
    assert any(reason.meaning == "shine" for one in meant for reason in one.reasons)
    second = meant[1].node
    other = painting.solve(painting.stroke(some, brighter, through=second)).findings
    assert [one.node for one in other][:2] == [second, "side"]
    assert painting.solve(painting.stroke(some, wanted, through="gone")).findings[0].node == "side"
    assert not painting.solve(painting.stroke(some, wanted, through="floor")).findings, "it lies on that"


def test_a_fixate_takes_its_object_out(painting: Painting) -> None:
    some = painting.vertices("floor", (-1.3, 0, 0), 80)
    stroke = painting.stroke(some, wanted_from(painting, some, base_color=(0.2, 0.6, 0.9)))
    assert painting.solve(stroke).findings[0].node == "side"
    fixed = painting.fixate(painting.vertices("side", (-2, 1.5, 0), 40))
    assert all(one.node not in ("side", "floor") for one in painting.solve(stroke, fixed).findings)
    hidden = dataclasses.replace(fixed, hidden=True)
    assert painting.solve(stroke, hidden).findings[0].node == "side"


def test_the_edit_changes_one_object_and_keeps_its_paint(painting: Painting) -> None:
    some = painting.vertices("floor", (-1.3, 0, 0), 80)
    stroke = painting.stroke(some, wanted_from(painting, some, base_color=(0.2, 0.6, 0.9)))
    reason = painting.solve(stroke).findings[0].reasons[0]
    once = reason.edit(painting.scene)
    changed = [name for name in once.nodes if once.nodes[name] is not painting.scene.nodes.get(name)]
    assert changed == ["side"]
    side = once["side"]
    assert isinstance(side, MeshObject)
    assert side.paint is not None
    before = np.array(painting.scene.material(side.materials[0]).values["base_color"])
    np.testing.assert_allclose(
        before + mean_paint(side.paint, 0)["base_color"], reason.values["base_color"], atol=1e-5
    )
    again = painted_alike(side, 0, {"base_color": np.array([0.1, 0.0, 0.0])}, {})
    added = mean_paint(again, 0)["base_color"] - mean_paint(side.paint, 0)["base_color"]
    np.testing.assert_allclose(added, (0.1, 0, 0), atol=1e-6)


def test_at_rest_candidates_are_carried_forward(painting: Painting) -> None:
    some = painting.vertices("floor", (-1.3, 0, 0), 80)
    stroke = painting.stroke(some, wanted_from(painting, some, base_color=(0.2, 0.6, 0.9)))
    in_hand = painting.solve(stroke)
    assert in_hand.counts["carried"] == 0
    before = painting.lit
    painting.lit = dataclasses.replace(before, final=True)
    at_rest = painting.solve(stroke)
    painting.lit = before
    assert at_rest.counts["carried"] >= 1
    for found in (in_hand, at_rest):
        assert (found.findings[0].node, found.findings[0].reasons[0].meaning) == ("side", "colour")
    wanted = np.array((0.2, 0.6, 0.9))
    off = [
        np.abs(np.array(found.findings[0].reasons[0].values["base_color"]) - wanted).max()
        for found in (in_hand, at_rest)
    ]
    assert max(off) < 0.08


def test_a_model_that_cannot_shine_becomes_one_that_can(painting: Painting) -> None:
    some = painting.vertices("floor", (-1.3, 0, 0), 80)
    values = {"diffuse": (0.7, 0.6, 0.5), "specular": (0.8, 0.8, 0.8), "roughness": 0.35}
    wanted = painting.after(recoloured(painting.scene, "side", "specgloss", **values), some)
    best = painting.solve(painting.stroke(some, wanted)).findings[0]
    assert (best.node, best.reasons[0].meaning) == ("side", "shine")
    made = best.reasons[0].edit(painting.scene)
    side = made["side"]
    assert isinstance(side, MeshObject)
    assert made.material(side.materials[0]).model == "specgloss"
    assert made.material("of floor") is painting.scene.material("of floor")
    left = painting.after(made, some) - wanted
    change = wanted - painting.radiance(painting.lit, some)
    assert (left**2).sum() < 0.1 * (change**2).sum()


def test_strokes_that_say_nothing_are_told_of(painting: Painting) -> None:
    some = painting.vertices("floor", (-1.3, 0, 0), 80)
    shown = painting.radiance(painting.lit, some)
    assert painting.solve(painting.stroke(some, shown)).notes
    assert painting.solve(dataclasses.replace(painting.stroke(some, shown + 1), indirect=False)).notes
    handed = painting.room.handed()
    lit = Lit(*(handed[kind] for kind in list(handed)[:4]), None, None)
    stroke = painting.stroke(some, shown + 1)
    assert solve_reflected(painting.scene, [stroke], lit, painting.services, None, JOB) == ()


def test_regions_are_slots_of_objects(painting: Painting) -> None:
    surfaces, registry = painting.room.handed()[Surfaces], painting.services.registry
    regions, number = changeables_of(painting.scene, surfaces, [("floor", 0)], registry)
    assert {one.name for one in regions} == {("side", 0), ("back", 0), ("box", 0)}
    mesh = surfaces.mesh
    assert (number[mesh.vertices_of(mesh.index_of("floor"))] == -1).all()
    assert all(one.now.material.model == "lambert" for one in regions)
    assert all(one.full.material.model == "specgloss" for one in regions)


def test_looks_know_pictures_and_paint(painting: Painting) -> None:
    grey = Image(np.full((2, 2, 3), 0.5, np.float32), "linear")
    material = Material(
        id="m", model="phong", values={"diffuse": (0.8, 0.8, 0.8), "exponent": 20.0},
        textures={"diffuse": Texture(grey)},
    )  # fmt: skip
    registry = painting.services.registry
    look = Look.of(material, {"exponent": np.asarray(np.log(2.0))}, registry)
    np.testing.assert_allclose(look.at("diffuse"), 0.4)
    assert look.at("gloss") == pytest.approx(40)
    np.testing.assert_allclose(look.change("diffuse", np.full(3, 0.5)), 0.1)
    assert look.change("gloss", 80.0) == pytest.approx(np.log(2))
    assert look.gloss_at(look.level) == pytest.approx(40, rel=1e-5)
    np.testing.assert_allclose(look.coefficients({"diffuse": look.at("diffuse")[None]})[0], look.plain)


def test_moments_are_what_is_left() -> None:
    rng = np.random.default_rng(1)
    gram = rng.random((1, 3, 2, 4))
    made = Moments(np.zeros(1), gram @ gram.transpose(0, 1, 3, 2), rng.random((1, 3, 2)), rng.random((1, 3)))
    changes = rng.random((5, 2, 3))
    wanted = [
        [
            made.rest[0, c] + d[:, c] @ made.gram[0, c] @ d[:, c] - 2 * d[:, c] @ made.light[0, c]
            for c in range(3)
        ]
        for d in changes
    ]
    np.testing.assert_allclose(made.left(changes)[0], wanted)


def test_the_best_of_a_grid_is_refined() -> None:
    grid = np.linspace(0, 1, STEPS) ** 2
    for best in (0.0, 0.013, 0.3, 0.77, 1.0):
        assert _refined(grid, (grid - best) ** 2) == pytest.approx(best, abs=1e-9)
