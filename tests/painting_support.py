"""A solver that explains strokes by rule of thumb, and scenes and windows to paint in."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pytestqt.qtbot import QtBot
from ui_support import Answers, Driver, Fake, room

from studio.app import assemble
from studio_core.contract import API, Plugin, Services
from studio_core.edits import Add, Compound, SetFields, SetPaint
from studio_core.params import param
from studio_core.registry import PluginHost
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Environment, MeshObject, NodeId, Scene
from studio_core.scene.paint import Paint
from studio_core.shading.job import Job
from studio_core.strokes.solution import Finding, Lit, Reason, Solution
from studio_core.strokes.stroke import AUTOMATIC, COLOUR, GLOSS, Stroke
from studio_plugins.brdfs import plugin as brdfs
from studio_plugins.export import plugin as export
from studio_plugins.meshes import plugin as meshes
from studio_plugins.reference import plugin as reference
from studio_ui.settings import Settings
from studio_ui.strokes.controls import StrokeControls
from studio_ui.strokes.desk import StrokeDesk

PLUGIN = Plugin(
    id="rule", label="Rule of thumb", api=API, provides={"solver": {"rule": "painting_support:SOLVER"}}
)


@dataclass(frozen=True)
class Params:
    """None that matters."""

    strength: float = param(1.0, "Strength", low=0.0, high=2.0)


class Rule:
    """Each object gets, at its marks, as much more of its colour as was painted more light; or less gloss."""

    id = "rule"
    label = "Rule of thumb"
    Params = Params

    def __init__(self) -> None:
        self.calls: list[tuple[NodeId, ...]] = []
        self.problem: Exception | None = None
        self.before: Any = lambda: None

    def open(self, services: Services) -> Rule:
        return self

    def solve(self, scene: Scene, strokes: Sequence[NodeId], lit: Lit, params: Any, job: Job) -> Solution:
        self.calls.append(tuple(strokes))
        self.before()
        if self.problem is not None:
            raise self.problem
        shown = [node for node in map(scene.nodes.get, strokes) if isinstance(node, Stroke)]
        shown = [stroke for stroke in shown if not stroke.hidden and stroke.marks is not None]
        objects = {node for stroke in shown for node in stroke.objects if node in scene.nodes}
        edits, findings = [], []
        for node in sorted(objects):
            assert node in lit.surfaces.nodes
            mine = [stroke for stroke in shown if node in stroke.objects]
            meaning = next((s.meaning for s in mine if s.meaning != AUTOMATIC), COLOUR)
            reasons = {word: self._reason(scene, node, mine, word) for word in (COLOUR, GLOSS)}
            ranked = sorted(reasons.values(), key=lambda reason: reason.meaning != meaning)
            edits.append(SetPaint(node, self._paint(scene, node, mine, meaning)))
            ids = tuple(stroke.id for stroke in mine)
            findings.append(Finding(node, 0, ids, tuple(ranked), close=1, silent=("shine",)))
        return Solution(Compound("Rule", tuple(edits)), tuple(findings), counts={"places": len(objects)})

    def shown(self, scene: Scene, strokes: Sequence[NodeId], lit: Lit, job: Job) -> dict[NodeId, Any]:
        """As it was painted."""
        found = [node for node in map(scene.nodes.get, strokes) if isinstance(node, Stroke)]
        return {stroke.id: stroke.marks.wanted for stroke in found if stroke.marks is not None}

    def stylise(self, scene: Scene, amount: float, lit: Lit, job: Job) -> Solution:
        """Every object gets as much more of its colour."""
        self.before()
        if self.problem is not None:
            raise self.problem
        place, normal, change = np.zeros((1, 3)), np.array([[0.0, 1.0, 0.0]]), np.full((1, 3), 0.1 * amount)
        paint = Paint.of(place, normal, np.zeros(1), {"base_color": change})
        nodes = [node.id for node in scene.of(MeshObject)]
        return Solution(Compound("Stylise", tuple(SetPaint(node, paint) for node in nodes)))

    def likeness(self, scene: Scene, stroke: NodeId, lit: Lit, params: Any, job: Job) -> Any:
        mesh = lit.surfaces.unrefined.mesh
        made = np.zeros(len(mesh.positions), np.float32)
        for node in scene[stroke].objects:  # type: ignore[attr-defined]
            made[mesh.vertices_of(mesh.index_of(node))] = 1
        return made

    def _reason(self, scene: Scene, node: NodeId, strokes: list[Stroke], word: str) -> Reason:
        paint = self._paint(scene, node, strokes, word)
        told = [SetFields(stroke.id, {"meaning": word}) for stroke in strokes]
        edit = Compound(word, (SetPaint(node, paint), *told))
        values = {"base_color": (0.5, 0.4, 0.3)} if word == COLOUR else {"roughness": 0.2}
        return Reason(word, 0.93 if word == COLOUR else 0.9, float(word != COLOUR), values, edit)

    @staticmethod
    def _paint(scene: Scene, node: NodeId, strokes: list[Stroke], word: str) -> Paint:
        """One change all over; more light asks for more of it."""
        mesh = scene[node]
        assert isinstance(mesh, MeshObject)
        more = np.zeros(3)
        for stroke in strokes:
            marks = stroke.marks
            assert marks is not None
            more = more + stroke.weight * (marks.wanted - marks.shown).mean(axis=0)
        change = np.clip(0.5 * more, -0.5, 0.5)[None] if word == COLOUR else np.full(1, -0.3)
        name = "base_color" if word == COLOUR else "roughness"
        place, normal = np.zeros((1, 3)), np.array([[0.0, 1.0, 0.0]])
        return Paint.of(place, normal, np.zeros(1), {name: change})


SOLVER = Rule()


def lit_room() -> Scene:
    """Chair and stool under a grey sky."""
    sky = Environment(id="sky", name="Sky", image=Image(np.full((8, 16, 3), 0.5, np.float32)))
    return Add((sky,))(room())


def studio_of(folder: Path, bot: QtBot, *plugins: Plugin) -> Driver:
    """A window over the real core with the quickest backend, and no solver but those given."""
    host = PluginHost([brdfs, reference, meshes, export, *plugins])
    answers = Answers()
    settings = Settings(folder)
    settings.set("animate_view", False)
    studio = assemble(settings=settings, host=host, ask=answers, threads=1, thumbnails=folder / "thumbs")
    driver = Driver(studio, Fake(), answers, bot)
    driver.patience = 120_000  # kernels may have to be compiled first
    driver.window.resize(900, 600)
    driver.session.shade_with("reference", {"vertices": 500, "directions": "1024"})
    driver.session.bounce(False)
    return driver


def brush_in_hand(driver: Driver) -> Iterator[Driver]:
    """Over a lit room, until the test is over."""
    try:
        driver.show(lit_room())
        driver.until(lambda: driver.context.warm)
        driver.do("tool.stroke")
        yield driver
    finally:
        driver.close()


def desk(driver: Driver) -> StrokeDesk:
    return driver.window.strokes.desk()


def controls(driver: Driver) -> StrokeControls:
    """The panel's inside, when it tells what is now."""
    found = driver.window.panels["strokes"].controls
    assert found is not None
    driver.until(lambda: not found.soon.isActive())
    return found
