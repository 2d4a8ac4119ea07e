"""What scripts do to patterns: lay pictures by size, turn them, grow them; coordinates to lay them on."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any

from studio_core.document import Document
from studio_core.edits import Compound, LayTextures, SetTexture
from studio_core.errors import EditError
from studio_core.scene.geometry import Texture
from studio_core.scene.nodes import Material, Scene
from studio_core.scene.pattern import PLAIN, PatternRuler, pattern_size, with_rotation, with_size
from studio_core.shading.grown_textures import grown, lying_alike
from studio_core.shading.job import Job
from studio_core.texture_coordinates import Coordinates, bare_objects, coordinates_for


class Patterns(ABC):
    """Part of the names that scripts have; each call is one entry of the history."""

    _document: Document
    _run: Callable[[str, Callable[[Job], Any]], Any]

    @property
    @abstractmethod
    def scene(self) -> Scene:
        """The scene as it is now."""

    @abstractmethod
    def find(self, name: Any) -> Any:
        """A node as it is now."""

    @abstractmethod
    def material(self, name: Any) -> Material:
        """A material as it is now."""

    def lay_pattern(
        self,
        material: Any,
        size: float | tuple[float, float] | None = None,
        turned: float | None = None,
    ) -> None:
        """Make all pictures of a material `size` metres wide (or wide and high), `turned` by degrees.

        Sizes are those on the objects that have it; with one number the proportion stays.
        """
        found = self.material(material)
        if not found.textures:
            raise EditError(f"{found.name!r} has no pictures")
        lengths = PatternRuler().lengths(self.scene, found.id) or PLAIN
        edits = []
        for name, texture in found.textures.items():
            made = texture if turned is None else with_rotation(texture, lengths, float(turned))
            if size is not None:
                old = pattern_size(made, lengths)
                both = size if isinstance(size, tuple) else (size, size * old[1] / old[0])
                if not all(0 < side < float("inf") for side in both):
                    raise EditError(f"a pattern cannot be {size} m large")
                made = with_size(made, lengths, both)
            laid = (made.scale, made.offset, made.rotation, made.aspect)
            edits.append(LayTextures(found.id, *laid, (name,)))
        self._document.apply(Compound(f"Pattern of {found.name}", tuple(edits)))

    def unwrap(self, *things: Any) -> int:
        """Texture coordinates in metres for what has none at and under some things; how many objects."""
        bare = bare_objects(self.scene, [self.find(thing).id for thing in things])

        def work(job: Job) -> Coordinates:
            return coordinates_for(self.scene, bare, job)

        if bare:
            self._document.apply(self._run("Making texture coordinates", work).edit)
        return len(bare)

    def grow_pattern(self, material: Any, times: float = 4.0, seed: int = 0) -> None:
        """Make the pictures of a material `times` as wide and high without a seam and without repetition.

        Their texels stay as large on the objects; another `seed` is another arrangement.
        """
        found = self.material(material)
        edits: list[SetTexture] = []
        left = dict(found.textures)
        while left:
            alike = lying_alike(left, next(iter(left)))

            def work(job: Job, alike: Mapping[str, Texture] = alike) -> dict[str, Texture]:
                return grown(alike, times, seed=seed, job=job)

            made = self._run(f"Growing the pattern of {found.name}", work)
            edits += [SetTexture(found.id, name, one) for name, one in made.items()]
            left = {name: one for name, one in left.items() if name not in alike}
        if not edits:
            raise EditError(f"{found.name!r} has no pictures")
        self._document.apply(Compound(f"Larger pattern of {found.name}", tuple(edits)))
