"""The mesh that light is computed on: the source repaired, split to an edge length, seen from both sides."""

from __future__ import annotations

import dataclasses
import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.arrays import readonly
from studio_core.scene.bisection import longest, split
from studio_core.scene.geometry import Geometry
from studio_core.scene.normals import NONE, Fan, fan
from studio_core.scene.surface import surface
from studio_core.scene.tangents import vertex_tangents
from studio_core.scene.tessellate import SLACK, Estimate, subdivide
from studio_core.scene.topology import Floats, Ints, edges, ranks

CREASE_DEGREES = 40.0  # between the 36° of a ten-sided column and the 45° of a chamfer
BUDGET = 30_000
LIMIT = 2_000_000
INSET = 1e-3
LADDER = 2  # edges to an octave
NO_BACK = 0xFFFFFFFF

F32 = npt.NDArray[np.float32]
U32 = npt.NDArray[np.uint32]


@dataclass(frozen=True, eq=False)
class ShadingMesh:
    """Shading vertices and faces of one geometry in its own frame, metres. All arrays are read-only.

    A vertex belongs to one point, one material slot, one smooth group and one side. For each vertex:
    positions (V, 3); normals (V, 3) unit shading normals towards the vertex' own side; tangents (V, 4) along
    the picture's u with its handedness (see `scene.tangents`); geometric (V, 3) unit, area-weighted over its
    faces; inset (V, 3), 1e-3 of the way to the mean centroid of its faces and never below the tangent plane,
    to start rays at position + inset + ε·normal; area (V,), a third of its faces'; uvs (V, 2) or None; slot
    (V,); side (V,) +1 front, -1 back; welded (V,) number of its point: vertices of equal number stand at the
    same place; parents (V, 2): the two ends that `refine` put it between, or twice itself.
    faces (F, 3) front vertices; back_faces (F, 3), corner by corner at the same points, the vertices to use
    where face f is seen from behind, or NO_BACK: a closed part has no back. source_face (F,) index into
    geometry.faces; slots (F,). `edge` is the length that no edge exceeds.
    """

    positions: F32
    normals: F32
    tangents: F32
    geometric: F32
    inset: F32
    area: F32
    uvs: F32 | None
    slot: npt.NDArray[np.uint16]
    side: npt.NDArray[np.int8]
    welded: U32
    parents: U32
    faces: U32
    back_faces: U32
    source_face: U32
    slots: npt.NDArray[np.uint16]
    edge: float

    def __post_init__(self) -> None:
        types = {
            np.float32: ("positions", "normals", "tangents", "geometric", "inset", "area"),
            np.uint16: ("slot", "slots"),
            np.uint32: ("welded", "parents", "faces", "back_faces", "source_face"),
            np.int8: ("side",),
        }
        for dtype, names in types.items():
            for name in names:
                object.__setattr__(self, name, readonly(getattr(self, name), dtype))
        if self.uvs is not None:
            object.__setattr__(self, "uvs", readonly(self.uvs, np.float32))

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        values = (getattr(self, f.name) for f in dataclasses.fields(self))
        return sum(value.nbytes for value in values if isinstance(value, np.ndarray))


def prepare(geometry: Geometry, crease_degrees: float = CREASE_DEGREES) -> Fan:
    """The repaired source with its shading vertices, not yet split: the same for every edge length."""
    return fan(surface(geometry), crease_degrees)


def shade_mesh(
    geometry: Geometry,
    edge: float,
    *,
    crease_degrees: float = CREASE_DEGREES,
    limit: int = LIMIT,
    prepared: Fan | None = None,
) -> ShadingMesh:
    """A geometry's shading mesh with no edge longer than `edge` (own frame). Pure and deterministic.

    Where that would take more than about `limit` vertices (estimated; needles and tiny edges) the edge is
    made longer until it does not; the mesh says which edge it has. Raises ValueError unless edge and limit
    are positive.
    """
    if not (edge > 0 and limit > 0):
        raise ValueError("the target edge and the limit of vertices must be positive")
    base = prepared or prepare(geometry, crease_degrees)
    expected = Estimate(base)
    if expected.longest > 0:
        whole = edge * (1 - SLACK) >= expected.longest  # nothing is split: one mesh, whatever was asked for
        edge = 2 * expected.longest if whole else max(edge, expected.longest / 2**20)
    while edge < expected.longest and (count := expected.at(edge)) > max(limit, expected.vertices):
        edge *= max(1.02, math.sqrt(count / limit))
    return _finished(_in_order(subdivide(base, edge)), edge, geometry.uvs is not None)


def _in_order(mesh: Fan) -> Fan:
    """Vertices and points numbered as faces use them first; unused ones dropped."""
    both = np.concatenate([mesh.faces, mesh.back], axis=1).reshape(-1)
    first, number = ranks(both)
    used = both[first]
    if (gap := np.flatnonzero(used == NONE)).size:
        number = np.where(number == gap[0], NONE, number - (number > gap[0]))
        used = np.delete(used, gap)
    number = number.reshape(-1, 6)
    at, weld = ranks(mesh.weld[used])
    return dataclasses.replace(
        mesh,
        points=mesh.points[mesh.weld[used][at]],
        weld=weld,
        normals=mesh.normals[used],
        uvs=mesh.uvs[used],
        slot=mesh.slot[used],
        side=mesh.side[used],
        faces=number[:, :3],
        back=number[:, 3:],
    )


def _finished(mesh: Fan, edge: float, has_uvs: bool) -> ShadingMesh:
    count = len(mesh.weld)
    geometric, inset, area = _around(mesh)
    seen = np.flatnonzero(mesh.back[:, 0] != NONE)
    tangents = vertex_tangents(
        mesh.points,
        mesh.weld[np.concatenate([mesh.faces, mesh.faces[seen]])],
        np.concatenate([mesh.faces, mesh.back[seen]]),
        mesh.uvs,
        np.repeat([1, -1], [len(mesh.faces), len(seen)]),
        mesh.normals,
    )
    itself = np.arange(count)
    return ShadingMesh(
        positions=mesh.points[mesh.weld].astype(np.float32),
        normals=mesh.normals.astype(np.float32),
        tangents=tangents,
        geometric=geometric,
        inset=inset,
        area=area,
        uvs=mesh.uvs.astype(np.float32) if has_uvs else None,
        slot=mesh.slot.astype(np.uint16),
        side=mesh.side.astype(np.int8),
        welded=mesh.weld.astype(np.uint32),
        parents=np.stack([itself, itself], axis=1),
        faces=mesh.faces.astype(np.uint32),
        back_faces=np.where(mesh.back == NONE, NO_BACK, mesh.back).astype(np.uint32),
        source_face=mesh.source.astype(np.uint32),
        slots=mesh.slots.astype(np.uint16),
        edge=edge,
    )


def _around(mesh: Fan) -> tuple[F32, F32, F32]:
    """Geometric normal, inset and area of each vertex, from the faces around it."""
    count = len(mesh.weld)
    corners = mesh.weld[mesh.faces]
    a, b, c = (mesh.points[corners[:, k]] for k in range(3))
    doubled, centre = np.cross(b - a, c - a), (a + b + c) / 3
    size = np.linalg.norm(doubled, axis=1)
    seen = np.flatnonzero(mesh.back[:, 0] != NONE)
    vertex = np.concatenate([mesh.faces.reshape(-1), mesh.back[seen].reshape(-1)])
    face = np.repeat(np.concatenate([np.arange(len(corners)), seen]), 3)

    def total(values: Floats) -> Floats:
        return np.asarray(np.bincount(vertex, values[face], minlength=count))

    towards = np.stack([total(doubled[:, k]) for k in range(3)], axis=1) * mesh.side[:, None]
    length = np.linalg.norm(towards, axis=1, keepdims=True)
    geometric = np.where(length > 0, towards / np.maximum(length, 1e-300), mesh.normals)
    number = np.maximum(np.bincount(vertex, minlength=count), 1)[:, None]
    inset = np.stack([total(centre[:, k]) for k in range(3)], axis=1) / number - mesh.points[mesh.weld]
    under = np.minimum((inset * geometric).sum(axis=1, keepdims=True), 0)
    inset = INSET * (inset - under * geometric)
    return geometric.astype(np.float32), inset.astype(np.float32), (total(size) / 6).astype(np.float32)


def _areas(mesh: Fan) -> F32:
    """(V,) a third of the area of the faces around each vertex."""
    a, b, c = (mesh.points[mesh.weld[mesh.faces[:, k]]] for k in range(3))
    size = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    seen = np.flatnonzero(mesh.back[:, 0] != NONE)
    vertex = np.concatenate([mesh.faces.reshape(-1), mesh.back[seen].reshape(-1)])
    face = np.repeat(np.concatenate([np.arange(len(size)), seen]), 3)
    return np.asarray(np.bincount(vertex, size[face], minlength=len(mesh.weld)) / 6, np.float32)


def refine(
    mesh: ShadingMesh, *, faces: npt.ArrayLike | None = None, marked: npt.ArrayLike | None = None
) -> ShadingMesh:
    """Longest edges of marked faces, and marked edges, cut in the middle; neighbours follow, conformingly.

    faces: indices or a mask (F,); marked: edges as pairs of vertices (N, 2), wherever their points meet.
    A face with a cut edge has its longest edge cut too (Rivara), which keeps repeated refinement from
    making needles. Old vertices keep their number and everything but `area`; new ones come after them,
    with `parents`. Raises ValueError when a marked pair is no edge.
    """
    return refined(mesh, faces=faces, marked=marked)[0]


def refined(
    mesh: ShadingMesh, *, faces: npt.ArrayLike | None = None, marked: npt.ArrayLike | None = None
) -> tuple[ShadingMesh, Ints]:
    """The same, and of each new face (F,) the face of `mesh` that it is (a part of): 1 to 4, in order."""
    made, ends, parts = _cut(mesh, faces, marked)
    same = np.arange(len(mesh.faces))
    if not len(ends):
        return mesh, same
    grown = _finished(made, mesh.edge, mesh.uvs is not None)

    def kept(old: F32, new: F32) -> F32:
        return np.concatenate([old, new[len(mesh) :]])

    result = dataclasses.replace(
        grown,
        positions=kept(mesh.positions, grown.positions),
        normals=kept(mesh.normals, grown.normals),
        tangents=kept(mesh.tangents, grown.tangents),
        geometric=kept(mesh.geometric, grown.geometric),
        inset=kept(mesh.inset, grown.inset),
        parents=np.concatenate([mesh.parents, ends.astype(np.uint32)]),
    )
    return result, np.repeat(same, parts)


def places_between(mesh: ShadingMesh, marked: npt.ArrayLike) -> ShadingMesh:
    """As `refine`, where only places and looks matter, in a third of the time.

    Tangents, geometric normals and insets of new vertices are 0: no light can be computed on it.
    """
    made, ends, _ = _cut(mesh, None, marked)
    if not len(ends):
        return mesh
    new = slice(len(mesh), None)

    def longer(old: F32, more: Floats | None = None) -> F32:
        zeros = np.zeros((len(ends), *old.shape[1:]), np.float32)
        return np.concatenate([old, zeros if more is None else more.astype(np.float32)])

    return dataclasses.replace(
        mesh,
        positions=longer(mesh.positions, made.points[made.weld[new]]),
        normals=longer(mesh.normals, made.normals[new]),
        tangents=longer(mesh.tangents),
        geometric=longer(mesh.geometric),
        inset=longer(mesh.inset),
        area=_areas(made),
        uvs=None if mesh.uvs is None else longer(mesh.uvs, made.uvs[new]),
        slot=made.slot.astype(np.uint16),
        side=made.side.astype(np.int8),
        welded=made.weld.astype(np.uint32),
        parents=np.concatenate([mesh.parents, ends.astype(np.uint32)]),
        faces=made.faces.astype(np.uint32),
        back_faces=np.where(made.back == NONE, NO_BACK, made.back).astype(np.uint32),
        source_face=made.source.astype(np.uint32),
        slots=made.slots.astype(np.uint16),
    )


def _cut(
    mesh: ShadingMesh, faces: npt.ArrayLike | None, marked: npt.ArrayLike | None
) -> tuple[Fan, Ints, Ints]:
    """The mesh with edges cut, the ends (N, 2) that new vertices are between, parts (F,) of each face."""
    back = np.where(mesh.back_faces == NO_BACK, NONE, mesh.back_faces.astype(np.int64))
    weld = mesh.welded.astype(np.int64)
    points = np.zeros((int(weld.max(initial=-1)) + 1, 3))
    points[weld] = mesh.positions
    base = Fan(
        points=points,
        weld=weld,
        normals=mesh.normals.astype(np.float64),
        uvs=np.zeros((len(mesh), 2)) if mesh.uvs is None else mesh.uvs.astype(np.float64),
        slot=mesh.slot.astype(np.int64),
        side=mesh.side.astype(np.int64),
        faces=mesh.faces.astype(np.int64),
        back=back,
        source=mesh.source_face.astype(np.int64),
        slots=mesh.slots.astype(np.int64),
    )
    corners = weld[base.faces]
    nothing = base, np.zeros((0, 2), np.int64), np.ones(len(corners), np.int64)
    if not len(corners):
        return nothing
    around = edges(corners)
    rows = np.arange(len(corners))
    top = around.of[rows, longest(points, corners)]
    cut = np.zeros(len(around.ends), bool)
    if faces is not None:
        cut[top[np.asarray(faces)]] = True
    if marked is not None:
        cut[_named(around.ends, weld[np.asarray(marked, np.int64).reshape(-1, 2)])] = True
    while True:
        needed = top[cut[around.of].any(axis=1)]
        if cut[needed].all():
            break
        cut[needed] = True
    if not cut.any():
        return nothing
    halves = cut[around.of]
    made, ends = split(base, halves, np.full(corners.shape, 0.5))
    return made, ends, 1 + halves.sum(axis=1)


def _named(ends: Ints, pairs: Ints) -> Ints:
    """The edges that join the given pairs of points."""
    span = int(ends.max()) + 1
    wanted = pairs.min(axis=1) * span + pairs.max(axis=1)
    keys = ends[:, 0] * span + ends[:, 1]  # sorted: that is how edges are numbered
    found = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    if (keys[found] != wanted).any():
        raise ValueError("a marked pair of vertices is no edge of the mesh")
    return np.asarray(found)


def choose_edge(
    items: Sequence[tuple[Geometry, float]],
    budget: int = BUDGET,
    *,
    prepared: Callable[[Geometry], Fan] = prepare,
) -> float:
    """The target edge in world metres with which objects (geometry, scale) have about `budget` vertices.

    Where the sources alone take more than three quarters of the budget, a quarter of it is still given to
    splitting: a floor of two triangles beside one heavy armchair is not left unshaded. The estimate of each
    geometry is corrected once by splitting it. 1.0 without objects. Raises ValueError when the budget is
    under 1. What each object gets is the `rung` next to it.
    """
    if budget < 1:
        raise ValueError("the vertex budget must be positive")
    unique = {geometry.key: geometry for geometry, _ in items}
    bases = {key: prepared(geometry) for key, geometry in unique.items()}
    expected = {key: Estimate(base) for key, base in bases.items()}
    uses = [(geometry.key, scale) for geometry, scale in items if expected[geometry.key].longest > 0]
    if not uses:
        return 1.0
    need = sum(expected[key].vertices for key, _ in uses)
    allowed = max(budget, need + budget // 4)
    factor = dict.fromkeys(unique, 1.0)
    largest = max(scale * expected[key].longest for key, scale in uses)

    def total(edge: float) -> float:
        made = 0.0
        for key, scale in uses:
            least = expected[key].vertices
            made += least
            if edge < scale * expected[key].longest:
                made += factor[key] * (expected[key].at(edge / scale) - least)
        return made

    chosen = _largest_within(total, largest, allowed)
    finest = {key: min(chosen / scale for other, scale in uses if other == key) for key, _ in uses}
    for key, edge in finest.items():
        guess = expected[key].at(edge) - expected[key].vertices
        if guess > 0.02 * allowed:
            factor[key] = (len(subdivide(bases[key], edge).weld) - expected[key].vertices) / guess
    return _largest_within(total, largest, allowed)


def rung(geometry: Geometry, edge: float) -> float:
    """The edge nearest to `edge` (own frame) on the geometry's ladder, whose rungs are a factor of √2 apart.

    So an object keeps its mesh while a scene grows and shrinks a little, and what it gets depends on the
    scene alone, not on how it came to be. Every geometry has its ladder somewhere else: where a scene grows
    much, objects are split anew one by one, and together they take what `choose_edge` reckoned with.
    """
    place = int.from_bytes(hashlib.sha256(geometry.key.encode()).digest()[:4], "big") / 2**32
    return float(2 ** ((round(LADDER * math.log2(edge) - place) + place) / LADDER))


def _largest_within(total: Callable[[float], float], largest: float, allowed: float) -> float:
    """The shortest edge whose total stays within what is allowed, by bisection."""
    low, high = largest / 4096, largest
    for _ in range(24):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if total(middle) <= allowed else (middle, high)
    return high
