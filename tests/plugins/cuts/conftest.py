"""Rooms whose objects come, go and move, as the exact path sees them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from oracles import cuts as oracle
from scenes import cube, floor

from studio_core.kernels.directions import direction_set
from studio_core.kernels.raycast import CasterObject, RayCaster
from studio_core.kernels.visibility import trace_visibility
from studio_core.scene.geometry import Geometry
from studio_core.scene.transform import Transform, axis_angle
from studio_core.scene.world_mesh import MeshCache, world_mesh
from studio_core.shading.artifacts import Casters, Surfaces
from studio_core.shading.job import Job
from studio_plugins.cuts.glimpse import BEFORE
from studio_plugins.cuts.occluders import Occluders, alone

CACHE = MeshCache()


@dataclass(frozen=True)
class Thing:
    """An object of a room."""

    geometry: Geometry
    transform: Transform = Transform()
    opaque: bool = True


@dataclass(frozen=True, eq=False)
class Room:
    """Objects by name; every change makes another room, whose meshes are the same."""

    things: Mapping[str, Thing]
    surfaces: Surfaces
    casters: Casters
    occluders: Occluders
    options: Mapping[str, Any]
    keep: list[Room]

    @staticmethod
    def of(
        things: Mapping[str, Thing],
        keep: list[Room],
        edge: float = 0.5,
        backend: str = "auto",
        origin: Any = (0.0, 0.0, 0.0),
    ) -> Room:
        items = [(name, one.geometry, one.transform, [0]) for name, one in things.items()]
        mesh = world_mesh(items, edge, origin=origin, cache=CACHE)
        sources = tuple((name, one.geometry, ("m",)) for name, one in things.items())
        objects = [
            CasterObject(
                one.geometry.positions,
                one.geometry.faces,
                one.geometry.key,
                one.transform.matrix(),
                np.full(len(one.geometry.faces), one.opaque),
            )
            for one in things.values()
        ]
        shadow = RayCaster(objects, backend)
        meshes = tuple((one.geometry.key, (one.opaque,)) for one in things.values())
        casters = Casters(shadow, shadow, meshes, tuple(one.transform for one in things.values()))
        surfaces = Surfaces(sources, ("m",), mesh, np.ones(1, np.float32), np.zeros(1, np.bool_), 0)
        options = {"edge": edge, "backend": backend, "origin": origin}
        made = Room(dict(things), surfaces, casters, alone(surfaces, casters), options, keep)
        keep.append(made)
        return made

    def with_things(self, things: Mapping[str, Thing]) -> Room:
        return Room.of(things, self.keep, **self.options)

    def placed(self, **transforms: Transform) -> Room:
        """With objects elsewhere."""
        moved = {n: dataclasses.replace(self.things[n], transform=t) for n, t in transforms.items()}
        return self.with_things({**self.things, **moved})

    def shifted(self, name: str, by: tuple[float, float, float]) -> Room:
        """With an object moved."""
        return self.placed(**{name: Transform(by) @ self.things[name].transform})

    def without(self, name: str) -> Room:
        return self.with_things({n: one for n, one in self.things.items() if n != name})

    def with_thing(self, name: str, thing: Thing) -> Room:
        return self.with_things({**self.things, name: thing})

    @property
    def mesh(self) -> Any:
        return self.surfaces.mesh

    @property
    def everything(self) -> npt.NDArray[np.int64]:
        """All vertices."""
        return np.arange(len(self.mesh), dtype=np.int64)

    def truth(self, k: int, workers: Any) -> npt.NDArray[np.bool_]:
        """(V, S) which leaves every vertex sees, by one ray after the other against the whole scene."""
        mesh = self.mesh
        found = trace_visibility(
            self.casters.shadow,
            mesh.positions + mesh.origin,
            mesh.normals,
            direction_set(k),
            workers,
            geometric_normals=mesh.geometric,
            inset=mesh.inset,
        )
        return oracle.unpacked(found.words)


def records(store: Any) -> list[list[int]]:
    """The exact record of every vertex."""
    exact = store.exact
    return [exact.pool[s : s + n].tolist() for s, n in zip(exact.start, exact.length, strict=True)]


def seen_by(store: Any) -> npt.NDArray[np.bool_]:
    """(V, S) what is to be read for every vertex: exact records, or coarse ones over them."""
    sources = store.sources()
    size = 1 << store.k
    made = np.zeros((len(store.exact), size), np.bool_)
    for p, r in enumerate(sources.owner):
        exact = sources.pool[sources.start[p] : sources.start[p] + sources.length[p]]
        first = sources.coarse_start[p]
        coarse = sources.coarse_pool[first : first + sources.coarse_length[p]]
        if len(exact) + len(coarse):
            skip = np.flatnonzero(sources.skip[sources.row[p], r])
            made[p] = oracle.seen(exact, size, skip) & oracle.seen(coarse, size, [BEFORE])
    return made


def soup(seed: int, faces: int = 12, size: float = 0.6) -> Geometry:
    """Triangles anywhere, open and through each other; coordinates are multiples of 2⁻¹²."""
    rng = np.random.default_rng(seed)
    corners = np.round(rng.uniform(-size / 2, size / 2, (3 * faces, 3)) * 4096) / 4096
    return Geometry(corners.astype(np.float32), np.arange(3 * faces, dtype=np.uint32).reshape(-1, 3))


def sheet(size: float = 0.8) -> Geometry:
    """One square without thickness, standing upright."""
    half = size / 2
    corners = np.array([(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)], np.float32)
    return Geometry(corners, np.array([(0, 1, 2), (0, 2, 3)], np.uint32))


TURN = axis_angle((0.3, 1.0, -0.2), 37.0)


@dataclass(frozen=True)
class Kit:
    """What tests make rooms from."""

    make: Callable[..., Room]
    room: Room
    Thing: type[Thing] = Thing
    records: Callable[[Any], list[list[int]]] = records
    seen_by: Callable[[Any], npt.NDArray[np.bool_]] = seen_by
    soup: Callable[..., Geometry] = soup
    sheet: Callable[..., Geometry] = sheet


@pytest.fixture
def kit() -> Iterator[Kit]:
    """A floor with two boxes, an open thing and a sheet, and the means to make others."""
    keep: list[Room] = []

    def make(things: Mapping[str, Thing], **options: Any) -> Room:
        return Room.of(things, keep, **options)

    box = cube(0.5)
    room = make(
        {
            "floor": Thing(floor(4.0)),
            "box": Thing(box, Transform((0.5, 0.25, 0.25))),
            "twin": Thing(box, Transform((-0.75, 0.5, 0.0), TURN)),
            "soup": Thing(soup(3), Transform((0.25, 0.75, -0.75))),
            "sheet": Thing(sheet(), Transform((-0.25, 0.5, 0.75), axis_angle((0, 1, 0), 20.0), 0.8)),
        }
    )
    yield Kit(make, room)
    for one in keep:
        one.casters.shadow.close()


@pytest.fixture
def job() -> Job:
    """Nobody listens and nobody stops it."""
    return Job("test")
