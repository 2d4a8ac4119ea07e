"""Texture coordinates for what has none: made in the background, one step of the history."""

from __future__ import annotations

from collections.abc import Callable

from studio_core.scene.nodes import MeshObject
from studio_core.shading.job import Job
from studio_core.texture_coordinates import Coordinates, bare_objects, coordinates_for
from studio_ui.context import Context


class TextureCoordinates:
    """Handler and condition of the action; `make` is for panels."""

    def __init__(self, context: Context) -> None:
        self._context = context

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        return {"object.coordinates": lambda: self.make(self._chosen())}

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """By name, as actions use them."""
        return {"bare": lambda: bool(self._chosen())}

    def make(self, objects: tuple[MeshObject, ...]) -> None:
        """For some objects of the scene as it is now."""
        context = self._context
        if not objects:
            return
        scene = context.document.scene

        def work(job: Job) -> Coordinates:
            return coordinates_for(scene, objects, job)

        def done(found: Coordinates) -> None:
            now = context.document.scene
            if any(now.nodes.get(node.id) is not node for node in objects):
                context.journal.write("Texture coordinates were left out: the objects changed meanwhile.")
                return
            if context.editing.apply(found.edit):
                for line in found.notes:
                    context.journal.write(line)

        what = objects[0].name if len(objects) == 1 else f"{len(objects)} objects"
        context.tasks.run(f"Texture coordinates of {what}", work, done)

    def _chosen(self) -> tuple[MeshObject, ...]:
        scene = self._context.document.scene
        return bare_objects(scene, [n for n in self._context.session.selection if n in scene.nodes])
