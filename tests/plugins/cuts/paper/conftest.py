"""A floor, a cube and a turned cube, as the paper's path sees them."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from scenes import cube, floor

from studio_core.kernels.light_tree import LightTree
from studio_core.kernels.raycast import CasterObject, RayCaster
from studio_core.scene.geometry import Geometry
from studio_core.scene.transform import Transform, axis_angle
from studio_core.scene.world_mesh import MeshCache, WorldMesh, world_mesh

TURN = axis_angle((0, 1, 0), 30)
PLACES = (
    Transform(),
    Transform((0.0, 0.31, 0.0)),
    Transform((1.1, 0.31, 0.4), TURN),
    Transform((-1.2, 0.36, -0.3), TURN),
)


@dataclass
class Little:
    """Objects and how they are placed: a floor and three cubes of one mesh, two of them turned alike."""

    mesh: WorldMesh
    shadow: RayCaster
    identities: list[Hashable]
    geometries: list[Geometry]

    def moved(self, index: int, transform: Transform) -> Little:
        """With an object elsewhere; the caster moves in place."""
        self.shadow.move(index, transform.matrix())
        return Little(self.mesh.moved(index, transform), self.shadow, self.identities, self.geometries)


def made_of(
    places: tuple[Transform, ...] = PLACES,
    see_through: tuple[int, ...] = (),
    edge: float = 0.3,
    box: Geometry | None = None,
    backend: str = "auto",
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Little:
    """A floor and boxes of 0.6 m, or other things, at places, all shifted."""
    places = tuple(Transform(shift) @ place for place in places)
    geometries = [floor(4.0), *([box or cube(0.6)] * (len(places) - 1))]
    items = [(f"o{i}", g, place, [0]) for i, (g, place) in enumerate(zip(geometries, places, strict=True))]
    mesh = world_mesh(items, edge, origin=shift, cache=MeshCache())
    objects, identities = [], []
    for index, (geometry, place) in enumerate(zip(geometries, places, strict=True)):
        stops = np.full(len(geometry.faces), index not in see_through)
        objects.append(CasterObject(geometry.positions, geometry.faces, geometry.key, place.matrix(), stops))
        identities.append((geometry.key, index in see_through))
    return Little(mesh, RayCaster(objects, backend), identities, geometries)


@pytest.fixture
def place() -> Iterator[Callable[..., Little]]:
    """Makes rooms; see `made_of`."""
    made: list[Little] = []

    def make(**options: Any) -> Little:
        made.append(made_of(**options))
        return made[-1]

    yield make
    for one in made:
        one.shadow.close()


@pytest.fixture
def room(place: Callable[..., Little]) -> Little:
    """The floor and the three cubes."""
    return place()


@pytest.fixture(scope="session")
def sky_tree() -> LightTree:
    """Light of 2^12 leaves, brighter towards one side, with no two alike."""
    rng = np.random.default_rng(5)
    leaves = rng.uniform(0.5, 1.5, (1 << 12, 3)) * np.linspace(0.2, 2.0, 1 << 12)[:, None]
    return LightTree.build(leaves)
