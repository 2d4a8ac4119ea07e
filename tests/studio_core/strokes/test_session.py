"""From planned strokes to a painted scene, with a solver that is easily foreseen."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scenes import little_scene
from stroke_support import MeanSolver, Params

from studio_core.contract import Services
from studio_core.errors import Cancelled, EditError, InputError
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Scene
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params
from studio_core.strokes.brush import Brush
from studio_core.strokes.files import strokes_from_json, strokes_json
from studio_core.strokes.planned import Look, PaintedStroke
from studio_core.strokes.session import Easel, paint_and_solve
from studio_core.strokes.stroke import Stroke
from studio_core.strokes.tools import Gesture, ToolSettings

SIZE = {"width": 96, "height": 64}
ON_CUBE, ON_FLOOR = [(0.5, 0.45)], [(0.2, 0.8)]


@pytest.fixture(scope="module")
def services(host, workers):
    return Services(workers, host)


@pytest.fixture
def easel(services):
    return easel_of(services, "reference", directions="1024", vertices="600")


def easel_of(services, backend, **values):
    made = services.registry.get("backend", backend)
    return Easel(made, backend_params(made, values), services)


def scene() -> Scene:
    made = little_scene()
    grey = {"base_color": (0.4, 0.4, 0.4)}
    return made.with_materials(dataclasses.replace(made.material("paint"), values=grey))


def plan(path, tool="brighten", fields=None, **settings):
    gesture = Gesture.of(Brush(size=0.2), path)
    return PaintedStroke(tool, gesture, ToolSettings(**settings), Look(**SIZE), fields or {})


def test_strokes_are_painted_explained_and_undone_as_one(services, easel):
    solver = MeanSolver()
    before = scene()
    planned = [plan(ON_CUBE, stops=1.0), plan(ON_FLOOR, "darken", stops=1.0)]
    made = paint_and_solve(before, planned, solver, Params(), easel, services)
    assert [stroke.name for stroke in made.strokes] == ["Brighten on Cube", "Darken on Floor"]
    assert [stroke.together for stroke in made.strokes] == [False, True]
    assert solver.runs[0].asked == [tuple(stroke.id for stroke in made.strokes)]
    assert len(made.edits) == 1
    assert made.edits[0].label == "Paint 2 strokes"
    assert made.edits[0](before).nodes.keys() == made.scene.nodes.keys()
    np.testing.assert_allclose(made.scene["cube"].paint.change("base_color"), [[0.4] * 3], rtol=1e-4)
    np.testing.assert_allclose(made.scene["floor"].paint.change("base_color"), [[-0.25] * 3], rtol=1e-4)
    assert {finding.node for finding in made.findings} == {"cube", "floor"}
    assert made.notes == ("the mean alone",)
    assert made.counts["places"] == sum(len(stroke.marks) for stroke in made.strokes) > 50


def test_one_by_one_each_is_painted_on_what_those_before_have_made(services, easel):
    solver = MeanSolver()
    planned = [plan(ON_CUBE, stops=1.0), plan(ON_CUBE, "darken", stops=1.0)]
    made = paint_and_solve(scene(), planned, solver, Params(), easel, services, one_by_one=True)
    first, second = (stroke.marks for stroke in made.strokes)
    np.testing.assert_allclose(second.shown, 2 * first.shown, rtol=2e-3)
    np.testing.assert_allclose(second.wanted, first.shown, rtol=2e-3)
    assert [len(asked) for asked in solver.runs[0].asked] == [1, 1]
    assert [edit.label for edit in made.edits] == ["Brighten on Cube", "Darken on Cube"]
    assert len(solver.runs) == 1, "one run remembers what surfaces see of each other"


def test_rounds_ask_again_and_strokes_keep_what_they_say(services, easel):
    before, solver = scene(), MeanSolver()
    planned = [plan(ON_CUBE, stops=0.5)]
    made = paint_and_solve(before, planned, solver, Params(), easel, services, rounds=3)
    assert len(solver.runs[0].asked) == 3
    assert len(made.edits) == 1
    (stroke,) = made.scene.of(Stroke)
    assert np.array_equal(stroke.marks.wanted, made.strokes[0].marks.wanted)
    assert stroke.meaning == "automatic"
    far = [plan(ON_CUBE, fields={"indirect": True}, stops=0.5)]
    paint_and_solve(before, far, solver, Params(), easel, services, rounds=3)
    assert len(solver.runs[1].asked) == 1, "what is reflected answers for all bounces already"


def test_solvers_get_rows_of_meshes_that_are_not_refined(services):
    base = scene()
    rough = Texture(Image(np.random.default_rng(1).random((8, 8, 1), np.float32)))
    looks = {"model": "ggx", "values": {"base_color": (0.4,) * 3}, "textures": {"roughness": rough}}
    base = base.with_materials(dataclasses.replace(base.material("paint"), **looks))
    solver = MeanSolver()
    easel = easel_of(services, "cuts", vertices="500")
    paint_and_solve(base, [plan(ON_CUBE)], solver, Params(), easel, services)
    (lit,) = solver.runs[0].lit
    assert lit.shapes.row is not None
    assert len(lit.shapes.row) == len(lit.surfaces.unrefined.mesh)
    assert lit.hits is not None
    assert lit.indirect is None


def test_strokes_on_the_background_alone_are_left_out_and_said(services, easel):
    before, solver = scene(), MeanSolver()
    made = paint_and_solve(before, [plan([(0.5, 0.02)])], solver, Params(), easel, services)
    assert made.scene is before
    assert made.strokes == made.edits == ()
    assert "background" in made.notes[0]
    assert solver.runs[0].asked == []
    both = paint_and_solve(before, [plan([(0.5, 0.02)]), plan(ON_CUBE)], solver, Params(), easel, services)
    assert [stroke.together for stroke in both.strokes] == [False]


def test_what_was_written_is_read_and_painted_again(services, easel):
    solver = MeanSolver()
    planned = [plan(ON_CUBE, fields={"name": "Lighter", "weight": 2.0}), plan(ON_FLOOR, "darken")]
    made = paint_and_solve(scene(), planned, solver, Params(), easel, services)
    text = strokes_json(made.scene)
    again = paint_and_solve(scene(), strokes_from_json(text), solver, Params(), easel, services)
    for one, other in zip(made.strokes, again.strokes, strict=True):
        assert one.table.key == other.table.key
        assert dataclasses.replace(other, id=one.id, table=one.table) == one
    assert again.scene["cube"].paint.key == made.scene["cube"].paint.key
    assert strokes_json(again.scene) == text
    assert len([*again.scene.of(Stroke)]) == 2


def test_objects_and_cameras_that_are_not_there(services, easel):
    solver = MeanSolver()
    nowhere = dataclasses.replace(plan(ON_CUBE), look=Look("Attic"))
    with pytest.raises(EditError, match="Attic"):
        paint_and_solve(scene(), [nowhere], solver, Params(), easel, services)
    made = paint_and_solve(scene(), [plan(ON_CUBE)], solver, Params(), easel, services)
    (told,) = strokes_from_json(strokes_json(made.scene))
    for name, error in (("Chair", EditError), ("Camera", InputError)):
        with pytest.raises(error, match=name):
            other = dataclasses.replace(told, objects=(name,))
            paint_and_solve(scene(), [other], solver, Params(), easel, services)


def test_it_can_be_stopped(services, easel):
    job = Job("Painting")
    job.cancel()
    with pytest.raises(Cancelled):
        paint_and_solve(scene(), [plan(ON_CUBE)], MeanSolver(), Params(), easel, services, job)
