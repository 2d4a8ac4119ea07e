"""What scripts do with strokes: paint the light that is wanted on what is looked at."""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from studio_core.contract import Registry, Services
from studio_core.document import Document
from studio_core.errors import InputError
from studio_core.params import ParamInfo, build, check, param_infos
from studio_core.scene.nodes import Camera, Scene
from studio_core.session import Session
from studio_core.shading.job import Job

if TYPE_CHECKING:
    from studio_core.strokes.planned import Planned
    from studio_core.strokes.solution import Finding, Solution


class Stroking(ABC):
    """Part of the names that scripts have."""

    _document: Document
    _session: Session
    _registry: Registry
    _services: Callable[[], Services]
    _run: Callable[[str, Callable[[Job], Any]], Any]

    @property
    @abstractmethod
    def scene(self) -> Scene:
        """The scene as it is now."""

    @abstractmethod
    def find(self, name: Any) -> Any:
        """A node as it is now."""

    @abstractmethod
    def _camera(self, camera: Any) -> Camera:
        """A camera as it is now."""

    def paint(
        self,
        path: npt.ArrayLike,
        tool: str = "replace",
        camera: Any = None,
        size: tuple[int, int] = (960, 540),
        **settings: Any,
    ) -> tuple[Finding, ...]:
        """Paint light along places (x, y), 0 … 1 of the picture; materials follow.

        `settings` are the brush's (`brush`, its diameter in parts of the height, `hardness`, `opacity`), the
        tool's (`colour` of radiance, `stops`, `radius`, `amount`, `shading`, `source`) and the stroke's
        (`indirect`, `meaning`, `weight`, `name`); `solver` says how materials are found. What was found.
        """
        from studio_core.strokes.brush import Brush
        from studio_core.strokes.planned import Look, PaintedStroke
        from studio_core.strokes.stroke import CLONE, TOOLS, Stroke
        from studio_core.strokes.tools import Gesture, ToolSettings

        check("tool", ParamInfo("choice", "Tool", choices=TOOLS), tool)
        source, solver = settings.pop("source", None), settings.pop("solver", "joint")
        held = {"size": settings.pop("brush", Brush().size)}
        held |= {name: settings.pop(name) for name in ("hardness", "opacity") if name in settings}
        own = {name: settings.pop(name) for name in param_infos(ToolSettings) if name in settings}
        chosen = dataclasses.replace(build(ToolSettings, own), source=source)
        known = param_infos(Stroke)
        for name in settings:
            if name not in known or name == "tool":
                told = ", ".join(
                    ("brush", "hardness", "opacity", *param_infos(ToolSettings), "source", *known)
                )
                raise InputError(f"there is no parameter {name!r}; known: {told}")
        fields = {name: check(name, known[name], value) for name, value in settings.items()}
        if tool == CLONE and source is None:
            raise InputError("a clone needs a source: the place (x, y) where it begins")
        try:
            along = Gesture.of(build(Brush, held), path)
        except ValueError as error:
            raise InputError(str(error)) from None
        width, height = size
        look = Look(width=width, height=height, standing=self._session.view)
        if camera is not None:
            look = Look(self._camera(camera).id, width=width, height=height)
        return self._paint([PaintedStroke(tool, along, chosen, look, fields)], solver)

    def paint_strokes(
        self, path: str | Path, solver: str = "joint", one_by_one: bool = False, rounds: int = 1
    ) -> tuple[Finding, ...]:
        """Paint the strokes of a JSON file (docs/strokes.md); materials follow.

        All on one picture and explained together, or each on what those before have made; in several
        `rounds`, each under the light that the last answer brings. What was found.
        """
        from studio_core.strokes.files import strokes_from_file

        return self._paint(strokes_from_file(Path(path)), solver, one_by_one, rounds)

    def match_strokes(self, *strokes: Any, most: int = 8, solver: str = "joint") -> float:
        """Explain strokes again, in the light that their change brings, until what was painted is seen.

        All of them, or those of these names with all that are explained with them; at most so many times. One
        step of the history. How far off it is then, relative: 0.01 is one percent.
        """
        from studio_core.strokes.edits import concerned
        from studio_core.strokes.matching import Match
        from studio_core.strokes.session import KIND, Easel, play
        from studio_core.strokes.stroke import Stroke

        scene, view, services = self.scene, self._session.view, self._services()
        chosen = [self.find(one) for one in strokes] or [*scene.of(Stroke)]
        for node in chosen:
            if not isinstance(node, Stroke):
                raise InputError(f"{node.name!r} is no stroke")
        names = concerned(scene, chosen)
        match = Match("Match strokes", scene, names, most=most)
        if not match.wishes:
            raise InputError("no stroke wants light that could be matched")

        def work(job: Job) -> None:
            finder, (backend, params, choice) = self._registry.get(KIND, solver), self._shaded_by()
            easel = Easel(backend, params, services, choice)
            play(match, scene, finder.open(services), finder.Params(), easel, view, job)

        self._run("Matching", work)
        self._document.apply(match.edit)
        return match.off

    def stylise(self, amount: float = 1.0, solver: str = "joint") -> None:
        """Paint all objects so that the scene's light is sharpened, or with a negative amount smoothed."""
        from studio_core.strokes.session import KIND, Easel
        from studio_core.strokes.stylising import Stylising, stylised

        scene, view, services = self.scene, self._session.view, self._services()
        wanted = build(Stylising, {"amount": amount})

        def work(job: Job) -> Solution:
            chosen, (backend, params, choice) = self._registry.get(KIND, solver), self._shaded_by()
            easel = Easel(backend, params, services, choice)
            return stylised(scene, view, wanted, chosen, easel, services, job)

        solution: Solution = self._run("Stylising", work)
        self._document.apply(solution.edit)
        for note in solution.notes:
            print(note)

    def _shaded_by(self) -> tuple[Any, Any, Any]:
        """The session's backend with its parameters, and how light goes on between surfaces."""
        from studio_core.shading.offline import backend_params, session_choice

        session, registry = self._session, self._registry
        backend = registry.get("backend", session.backend)
        return backend, backend_params(backend, session.params), session_choice(session, registry)

    def _paint(
        self, planned: Sequence[Planned], solver: str, one_by_one: bool = False, rounds: int = 1
    ) -> tuple[Finding, ...]:
        from studio_core.strokes.session import KIND, Easel, Painted, paint_and_solve

        scene, services = self.scene, self._services()

        def work(job: Job) -> Painted:
            chosen, (backend, params, choice) = self._registry.get(KIND, solver), self._shaded_by()
            easel = Easel(backend, params, services, choice)
            given = (scene, planned, chosen, chosen.Params(), easel, services, job)
            return paint_and_solve(*given, one_by_one=one_by_one, rounds=rounds)

        made: Painted = self._run("Painting", work)
        for edit in made.edits:
            self._document.apply(edit)
        for note in made.notes:
            print(note)
        return made.findings
