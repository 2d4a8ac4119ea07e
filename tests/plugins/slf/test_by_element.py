"""The paper's solvers at the door of strokes: element by element, on pictures that others made."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from plugins.slf.test_solver import JOB, Artist, changed, room

from studio_core.contract import Services
from studio_core.session import View
from studio_core.shading.offline import backend_params
from studio_core.strokes.painting import marks_of, stroke_of
from studio_core.strokes.session import Easel
from studio_core.strokes.stroke import Stroke
from studio_plugins.slf.by_element import FULL, MIXED, SPARSE, Params

SOLVERS = {"mixed": MIXED, "l0": SPARSE, "l2": FULL}
BLUE = (0.2, 0.4, 0.6)
ROOM, BLUER = room(), changed(diffuse=BLUE)


class ByElementArtist(Artist):
    """With a run of each of the paper's solvers."""

    def __init__(self, services):
        super().__init__(services)
        self.runs = {name: solver.open(services) for name, solver in SOLVERS.items()}
        self.known = {}

    def picture(self, scene, width=80, height=60):
        """Each scene is pictured once."""
        if id(scene) not in self.known:
            values = {"directions": "1024", "vertices": "1500"}
            easel = Easel(self.backend, backend_params(self.backend, values), self.services)
            camera = scene["camera"]
            shown = easel.picture(scene, View(camera.transform, camera.fov, width, height), JOB)
            self.known[id(scene)] = scene, (shown, easel)
        return self.known[id(scene)][1]

    def ask(self, scene, *strokes, by="mixed", params=None):
        _, easel = self.picture(scene)
        there = scene.with_nodes(*strokes)
        ids = [stroke.id for stroke in strokes]
        return self.runs[by].solve(there, ids, easel.lit(), params or Params(), JOB), there


@pytest.fixture(scope="module")
def artist(host, workers):
    return ByElementArtist(Services(workers, host))


@pytest.fixture(scope="module")
def blue(artist):
    return artist.stroke(ROOM, BLUER, noise=0.02)


def values_are_valid(paint):
    return all(np.isfinite(table.values).all() for table in paint.changes.values())


@pytest.mark.parametrize("by", ["mixed", "l0"])
@pytest.mark.parametrize("literal", [True, False])
def test_another_colour_is_one_for_most_elements(artist, blue, by, literal):
    solution, there = artist.ask(ROOM, blue, by=by, params=Params(literal=literal))
    (finding,) = solution.findings
    first = finding.reasons[0]
    assert (finding.node, finding.slot, first.meaning) == ("ball", 0, "colour")
    np.testing.assert_allclose(first.values["diffuse"], BLUE, atol=0.05)
    assert first.explained > 0.8
    assert solution.counts["solved"] > 20
    paint = solution.edit(there)["ball"].paint
    assert len(paint.change("diffuse")) > 1, "each element has its own"
    assert values_are_valid(paint)
    meanings = [reason.meaning for reason in finding.reasons]
    assert len(set(meanings)) == len(meanings) > 2


def test_full_least_squares_changes_everything(artist, blue):
    solution, there = artist.ask(ROOM, blue, by="l2")
    first = solution.findings[0].reasons[0]
    assert "colour" in first.meaning or first.meaning == "everything"
    assert " and " in first.meaning or first.meaning == "everything"
    assert first.explained > 0.8
    assert values_are_valid(solution.edit(there)["ball"].paint)


def test_what_is_as_it_was_stays(artist):
    solution, there = artist.ask(ROOM, artist.stroke(ROOM, ROOM))
    assert solution.findings[0].reasons[0].meaning == ""
    paint = solution.edit(there)["ball"].paint
    assert paint is None or all(np.abs(t.values).max() < 0.02 for t in paint.changes.values())


def test_what_somebody_chose_comes_first_and_is_all_that_changes(artist, blue):
    solution, there = artist.ask(ROOM, dataclasses.replace(blue, meaning="shine"))
    reasons = solution.findings[0].reasons
    assert [reasons[0].meaning, reasons[1].meaning] == ["shine", "colour"]
    assert [*solution.edit(there)["ball"].paint.changes] == ["specular"]
    other = reasons[1].edit(there)
    assert "diffuse" in other["ball"].paint.changes
    assert other[blue.id].meaning == "colour"


def test_a_second_stroke_goes_on_from_the_first(artist, blue):
    solution, there = artist.ask(ROOM, blue)
    once = solution.edit(there)
    black = artist.stroke(BLUER, changed(diffuse=(0.1, 0.2, 0.3)))
    solution, there = artist.ask(once, once[blue.id], black)
    made = solution.findings[0].reasons[0]
    assert made.meaning == "colour"
    np.testing.assert_allclose(made.values["diffuse"], (0.1, 0.2, 0.3), atol=0.06)


def test_reach_ends_what_elements_change(artist, blue):
    near = artist.stroke(ROOM, BLUER, part=0.35, near=30.0)
    solution, there = artist.ask(ROOM, near)
    paint = solution.edit(there)["ball"].paint
    height = paint.places[:, 1]
    change = np.abs(paint.change("diffuse")).max(axis=1)
    assert change[height > 0.3].max() > 0.1
    assert not change[height < -0.4].any()


@pytest.mark.parametrize("by", [*SOLVERS])
def test_what_says_nothing_changes_nothing(artist, blue, by):
    """No light, a stroke on nothing, a hidden object; `joint` is asked the same in test_solver."""

    def ask(scene, *strokes):
        return artist.ask(scene, *strokes, by=by)

    solution, there = ask(room(light=0.0, lamp=False), blue)
    assert solution.findings[0].reasons[0].meaning == ""
    assert {"colour", "shine", "gloss"} == set(solution.findings[0].silent)
    assert solution.edit(there)["ball"].paint is None
    assert solution.counts["solved"] == 0
    assert solution.counts["skipped"] > 0
    solution, _ = ask(ROOM, Stroke(id="empty", name="Empty"))
    assert (solution.findings, solution.notes) == ((), ("Empty lies on no surface",))
    hidden = ROOM.with_nodes(dataclasses.replace(ROOM["ball"], hidden=True))
    solution, there = ask(hidden, blue)
    assert solution.findings == ()
    assert solution.edit(there)["ball"] is there["ball"]


@pytest.mark.parametrize("by", [*SOLVERS])
def test_elements_in_full_shadow_are_skipped_and_stay(artist, blue, by):
    solution, there = artist.ask(room(light=0.0), blue, by=by)
    assert solution.counts["solved"] > 0
    assert solution.counts["skipped"] > 0
    assert values_are_valid(solution.edit(there)["ball"].paint)


@pytest.mark.parametrize("by", [*SOLVERS, "joint"])
def test_a_stroke_across_objects_and_the_sky_is_solved_on_each(artist, by):
    before = ROOM
    shown, _ = artist.picture(before)
    wanted = np.where(
        np.arange(shown.linear.size).reshape(shown.linear.shape) % 7 == 0, 1e6, 0.3 * shown.linear
    )
    mask = np.ones(shown.node.shape, np.float32)
    stroke = stroke_of(marks_of(shown, mask, wanted.astype(np.float32)), before, "replace")
    solution, there = artist.solve(before, stroke) if by == "joint" else artist.ask(before, stroke, by=by)
    assert {finding.node for finding in solution.findings} == {"ball", "floor"}
    after = solution.edit(there)
    for finding in solution.findings:
        for reason in finding.reasons:
            assert np.isfinite([reason.explained, reason.score]).all()
            assert all(np.isfinite(value).all() for value in reason.values.values())
    for node in ("ball", "floor"):
        if after[node].paint is not None:
            assert values_are_valid(after[node].paint)


def test_the_window_can_name_them(artist):
    registry = artist.services.registry
    assert {"joint", "mixed", "l0", "l2"} <= set(registry.names("solver"))
    for name in SOLVERS:
        assert registry.get("solver", name).id == name
        assert registry.get("solver", name).label
