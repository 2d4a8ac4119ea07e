"""The solver on pictures that others made: the right parameter, its value, and what cannot be told."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scenes import floor, sky

from studio_core.arrays import frozen_map
from studio_core.contract import Services
from studio_core.scene.geometry import Geometry, Image
from studio_core.scene.nodes import Camera, Environment, Material, MeshObject, PointLamp, Scene
from studio_core.scene.transform import Transform, looking
from studio_core.session import View
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params
from studio_core.strokes.painting import marks_of, stroke_of
from studio_core.strokes.session import Easel
from studio_core.strokes.stroke import Stroke
from studio_plugins.slf.solver import SOLVER, Params

JOB = Job("test")
LOOK = {"diffuse": (0.5, 0.3, 0.2), "specular": (0.08, 0.08, 0.08), "roughness": 0.5}


def ball(radius=0.5, around=64):
    """A smooth ball about the origin."""
    theta = np.linspace(0, np.pi, around // 2 + 1)
    phi = np.arange(around + 1) * 2 * np.pi / around
    t, p = np.meshgrid(theta, phi, indexing="ij")
    normal = np.stack([np.sin(t) * np.cos(p), np.cos(t), -np.sin(t) * np.sin(p)], axis=2).reshape(-1, 3)
    i = (np.arange(len(theta) - 1)[:, None] * (around + 1) + np.arange(around)).ravel()
    faces = np.concatenate(
        [np.stack([i, i + around + 1, i + 1], 1), np.stack([i + 1, i + around + 1, i + around + 2], 1)]
    )
    return Geometry((radius * normal).astype(np.float32), faces.astype(np.uint32), normal.astype(np.float32))


def room(values=LOOK, lamp=True, light=1.0):
    materials = (
        Material(id="glaze", name="Glaze", model="specgloss", values=frozen_map(values)),
        Material(id="wood", name="Wood", values=frozen_map({"base_color": (0.4, 0.35, 0.3)})),
    )
    place = looking((0.0, 1.1, 2.6), (0.0, 0.45, 0.0))
    nodes = [
        MeshObject(
            id="ball", name="Ball", geometry=ball(), materials=("glaze",), transform=Transform((0, 0.5, 0))
        ),
        MeshObject(id="floor", name="Floor", geometry=floor(6.0), materials=("wood",)),
        Environment(id="sky", name="Sky", image=Image(sky(64).pixels * np.float32(light))),
        Camera(id="camera", name="Camera", transform=place, fov=40.0),
    ]
    if lamp:
        nodes.append(PointLamp(id="lamp", name="Lamp", transform=Transform((1.0, 2.0, 1.5)), intensity=4.0))
    return Scene(frozen_map({n.id: n for n in nodes}), frozen_map({m.id: m for m in materials}))


@pytest.fixture(scope="module")
def services(host, workers):
    return Services(workers, host)


@pytest.fixture(scope="module")
def artist(services):
    return Artist(services)


class Artist:
    """Paints what another material would look like, as well as a hand can."""

    def __init__(self, services):
        self.backend, self.services = services.registry.get("backend", "reference"), services
        self.run = SOLVER.open(services)

    def picture(self, scene, width=160, height=120):
        values = {"directions": "4096", "vertices": "6000"}
        easel = Easel(self.backend, backend_params(self.backend, values), self.services)
        camera = scene["camera"]
        view = View(camera.transform, camera.fov, width, height)
        return easel.picture(scene, view, JOB), easel

    def stroke(self, before, after, node="ball", noise=0.0, part=0.9, **fields):
        shown, _ = self.picture(before)
        then, _ = self.picture(after)
        mask = (shown.node == shown.nodes.index(node)).astype(np.float32)
        rows = np.flatnonzero(mask.any(axis=1))
        mask[rows[int(part * len(rows)) :]] = 0
        rng = np.random.default_rng(5)
        wanted = then.linear * (1 + noise * rng.normal(size=then.linear.shape)).astype(np.float32)
        return stroke_of(marks_of(shown, mask, wanted), before, "replace", **fields)

    def solve(self, scene, *strokes):
        _, easel = self.picture(scene)
        there = scene.with_nodes(*strokes)
        solution = self.run.solve(there, [stroke.id for stroke in strokes], easel.lit(), Params(), JOB)
        return solution, there


def changed(**values):
    return room({**LOOK, **values})


@pytest.mark.parametrize("noise", [0.0, 0.02, 0.1])
@pytest.mark.parametrize(
    ("values", "meaning"),
    [
        ({"diffuse": (0.2, 0.4, 0.6)}, "colour"),
        ({"specular": (0.4, 0.4, 0.4)}, "shine"),
        ({"roughness": 0.35}, "gloss"),
        ({}, ""),
    ],
)
def test_what_changed_is_named_and_how_much(artist, values, meaning, noise):
    before = room()
    solution, there = artist.solve(before, artist.stroke(before, changed(**values), noise=noise))
    (finding,) = solution.findings
    assert (finding.node, finding.slot) == ("ball", 0)
    assert finding.reasons[0].meaning == meaning
    made = finding.reasons[0].values
    for name, value in values.items():
        np.testing.assert_allclose(made[name], value, rtol=0.08 if noise else 0.05)
    painted = solution.edit(there)["ball"].paint
    if not values:
        assert painted is None
        return
    (name,) = values
    np.testing.assert_allclose(
        painted.change(name)[0], np.atleast_1d(made[name]) - np.atleast_1d(LOOK[name]), atol=0.01
    )


def test_the_painted_scene_looks_as_was_wanted(artist):
    before, after = room(), changed(specular=(0.4, 0.4, 0.4))
    solution, there = artist.solve(before, artist.stroke(before, after))
    shown, wanted, plain = (
        artist.picture(scene)[0].linear for scene in (solution.edit(there), after, before)
    )
    assert np.abs(shown - wanted).mean() < 0.1 * np.abs(plain - wanted).mean()


def test_a_second_stroke_goes_on_from_the_first_and_can_be_taken_back(artist):
    bare = room()
    first = artist.stroke(bare, changed(diffuse=(0.2, 0.4, 0.6)))
    solution, there = artist.solve(bare, first)
    blue = solution.edit(there)
    second = artist.stroke(blue, changed(diffuse=(0.2, 0.4, 0.6), specular=(0.4, 0.4, 0.4)))
    solution, there = artist.solve(blue, blue[first.id], second)
    (finding,) = solution.findings
    assert finding.reasons[0].meaning == "shine"
    paint = solution.edit(there)["ball"].paint
    np.testing.assert_allclose(paint.change("diffuse")[0], [-0.3, 0.1, 0.4], atol=0.03)
    np.testing.assert_allclose(paint.change("specular")[0], [0.32] * 3, atol=0.03)
    off = there.with_nodes(dataclasses.replace(there[first.id], hidden=True))
    again, _ = artist.solve(off, off[first.id], second)
    alone = again.edit(off)["ball"].paint
    assert np.abs(alone.change("specular")[0] - 0.32).max() < 0.05


def test_what_somebody_chose_is_done_and_others_are_still_told(artist):
    before = room()
    stroke = artist.stroke(before, changed(specular=(0.4, 0.4, 0.4)), meaning="colour")
    solution, there = artist.solve(before, stroke)
    (finding,) = solution.findings
    assert [reason.meaning for reason in finding.reasons][:2] == ["colour", "shine"]
    assert finding.reasons[1].explained > finding.reasons[0].explained
    assert [*solution.edit(there)["ball"].paint.changes] == ["diffuse"]
    other = finding.reasons[1].edit(there)
    assert [*other["ball"].paint.changes] == ["specular"]
    assert other[stroke.id].meaning == "shine"


def test_matte_surface_can_become_glossy(artist):
    before = room({**LOOK, "specular": (0.0, 0.0, 0.0)})
    solution, there = artist.solve(before, artist.stroke(before, room({**LOOK, "specular": (0.3, 0.3, 0.3)})))
    assert solution.findings[0].reasons[0].meaning == "shine"
    wood = artist.stroke(
        before,
        before.with_materials(
            Material(id="wood", name="Wood", values=frozen_map({"base_color": (0.1, 0.35, 0.1)}))
        ),
        node="floor",
    )
    solution, there = artist.solve(before, wood)
    made = solution.edit(there)
    assert made.material("wood").model == "specgloss", "looks the same, and could shine"
    np.testing.assert_allclose(made["floor"].paint.change("diffuse")[0], [-0.3, 0, -0.2], atol=0.03)


def test_a_flat_colour_is_a_single_change(artist):
    before = room()
    shown, _ = artist.picture(before)
    mask = (shown.node == shown.nodes.index("ball")).astype(np.float32)
    wanted = np.broadcast_to(np.array([0.1, 0.3, 0.5], np.float32), shown.linear.shape)
    stroke = stroke_of(marks_of(shown, mask, wanted), before, "replace")
    assert stroke.flat
    solution, _ = artist.solve(before, stroke)
    assert solution.findings[0].reasons[0].meaning == "colour"
    assert all(" and " not in reason.meaning for reason in solution.findings[0].reasons)


@pytest.mark.parametrize("values", [{"specular": (0.4, 0.4, 0.4)}, {"diffuse": (0.2, 0.4, 0.6)}])
def test_to_explain_a_flat_colour_again_finds_the_same_amount(artist, values):
    coarse = dataclasses.replace(room()["ball"], geometry=ball(around=20))
    before, after = (scene.with_nodes(coarse) for scene in (room(), changed(**values)))
    stroke = artist.stroke(before, after, flat=True)
    solution, there = artist.solve(before, stroke)
    painted = solution.edit(there)
    again, _ = artist.solve(painted, painted[stroke.id])
    one, other = (found.findings[0].reasons[0] for found in (solution, again))
    assert one.meaning == other.meaning != ""
    for name, value in one.values.items():
        np.testing.assert_allclose(other.values[name], value, rtol=1e-3)


@pytest.mark.parametrize("near", [0.0, 2.0])
@pytest.mark.parametrize(
    "values", [{"diffuse": (0.2, 0.4, 0.6)}, {"specular": (0.4,) * 3}, {"roughness": 0.3}]
)
def test_what_is_shown_now_is_what_the_picture_has(artist, values, near):
    before = room()
    stroke = artist.stroke(before, changed(**values), near=near)
    solution, there = artist.solve(before, stroke)
    painted = solution.edit(there)
    shown, easel = artist.picture(painted)
    light = artist.run.shown(painted, [stroke.id], easel.lit(), JOB)[stroke.id]
    mask = (shown.node == shown.nodes.index("ball")).astype(np.float32)
    rows = np.flatnonzero(mask.any(axis=1))
    mask[rows[int(0.9 * len(rows)) :]] = 0
    again = marks_of(shown, mask, shown.linear).marks
    assert len(again) == len(light)
    np.testing.assert_allclose(light.mean(axis=0), again.shown.mean(axis=0), rtol=0.02)
    change = np.abs(again.shown - stroke.marks.shown).mean()
    assert np.abs(light - again.shown).mean() < 0.2 * change


def test_what_is_not_there_shows_nothing(artist):
    before = room()
    stroke = artist.stroke(before, changed(diffuse=(0.2, 0.4, 0.6)))
    gone = room().with_nodes(dataclasses.replace(before["ball"], hidden=True), stroke)
    _, easel = artist.picture(gone)
    assert np.isnan(artist.run.shown(gone, [stroke.id], easel.lit(), JOB)[stroke.id]).all()


def test_a_stroke_over_things_that_are_alike_changes_them_once(artist):
    def pair(values):
        left = dataclasses.replace(room()["ball"], transform=Transform((-0.55, 0.5, 0)))
        right = dataclasses.replace(left, id="other", transform=Transform((0.55, 0.5, 0)))
        return room(values).with_nodes(left, right)

    before, then = pair(LOOK), pair({**LOOK, "diffuse": (0.2, 0.4, 0.6)})
    shown, wanted = (artist.picture(scene)[0] for scene in (before, then))
    mask = np.isin(shown.node, [shown.nodes.index(name) for name in ("ball", "other")]).astype(np.float32)
    stroke = stroke_of(marks_of(shown, mask, wanted.linear), before, "replace", alike=20.0)
    assert set(stroke.objects) == {"ball", "other"}
    solution, there = artist.solve(before, stroke)
    after = solution.edit(there)
    for name in stroke.objects:
        np.testing.assert_allclose(after[name].paint.change("diffuse")[0], [-0.3, 0.1, 0.4], atol=0.03)


def test_what_says_nothing_changes_nothing(artist):
    before = room()
    stroke = artist.stroke(before, changed(diffuse=(0.2, 0.4, 0.6)))
    dark = room(light=0.0, lamp=False)
    solution, there = artist.solve(dark, stroke)
    assert solution.findings[0].reasons[0].meaning == ""
    assert {"colour", "shine", "gloss"} == set(solution.findings[0].silent)
    assert solution.edit(there)["ball"].paint is None
    empty = Stroke(id="empty", name="Empty")
    solution, there = artist.solve(before, empty)
    assert solution.findings == ()
    assert solution.notes == ("Empty lies on no surface",)
    gone = before.with_nodes(dataclasses.replace(before["ball"], hidden=True))
    solution, there = artist.solve(gone, stroke)
    assert solution.findings == ()
    assert solution.edit(there)["ball"] is there["ball"]
    assert artist.run.solve(there, ["nobody"], artist.picture(before)[1].lit(), Params(), JOB).findings == ()


def test_light_that_is_to_stay_argues_against_a_change(artist):
    before, after = room(), changed(diffuse=(0.2, 0.4, 0.6))
    change = artist.stroke(before, after, part=0.3)
    stay = dataclasses.replace(artist.stroke(before, before, part=0.9), tool="fixate", weight=20.0)
    free, _ = artist.solve(before, change)
    held, _ = artist.solve(before, change, stay)
    assert held.findings[0].reasons[0].explained < free.findings[0].reasons[0].explained
