"""Slow, obvious checks of meshes, shapes to check, and a plain OBJ reader for the shared furniture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from studio_core.scene.geometry import Geometry

Array = npt.NDArray[np.float64]


def box(size: tuple[float, float, float] = (1, 1, 1), at: tuple[float, float, float] = (0, 0, 0)) -> Geometry:
    """A closed box, wound outwards."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float) * size + at
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [tri for a, b, c, d in quads for tri in ((a, b, c), (a, c, d))]
    return Geometry(corners, np.array(faces))


def floor(width: float = 4.0, depth: float | None = None) -> Geometry:
    """Two triangles that look up, with uvs."""
    w, d = width, width if depth is None else depth
    corners = [[0, 0, 0], [0, 0, d], [w, 0, d], [w, 0, 0]]
    uvs = np.array([[0, 0], [0, 1], [1, 1], [1, 0]])
    return Geometry(np.array(corners), np.array([[0, 1, 2], [0, 2, 3]]), uvs=uvs)


def ring(across: int = 12, along: int = 9, inner: float = 0.4) -> Geometry:
    """A closed torus, wound outwards."""
    u, v = np.meshgrid(np.arange(across), np.arange(along), indexing="ij")
    a, b = 2 * np.pi * u.ravel() / across, 2 * np.pi * v.ravel() / along
    points = np.stack(
        [(1 + inner * np.cos(b)) * np.cos(a), inner * np.sin(b), (1 + inner * np.cos(b)) * np.sin(a)]
    )
    i, j = u.ravel(), v.ravel()
    at = [((i + di) % across) * along + (j + dj) % along for di, dj in ((0, 0), (0, 1), (1, 1), (1, 0))]
    faces = np.concatenate([np.stack([at[0], at[1], at[2]], 1), np.stack([at[0], at[2], at[3]], 1)])
    return Geometry(points.T, faces)


def joined(*parts: Geometry) -> Geometry:
    """Several meshes in one."""
    start = np.cumsum([0, *(len(part.positions) for part in parts)])
    return Geometry(
        np.concatenate([part.positions for part in parts]),
        np.concatenate([part.faces + np.uint32(s) for part, s in zip(parts, start, strict=False)]),
    )


def areas(points: npt.ArrayLike, faces: npt.ArrayLike) -> Array:
    """Area of each face."""
    a, b, c = (np.asarray(points, np.float64)[np.asarray(faces)[:, k]] for k in range(3))
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)


def volume(points: npt.ArrayLike, faces: npt.ArrayLike) -> float:
    """Signed volume enclosed by faces."""
    a, b, c = (np.asarray(points, np.float64)[np.asarray(faces)[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def barycentric(p: Array, a: Array, b: Array, c: Array) -> tuple[Array, Array]:
    """Weights (N, 3) of the corners at p's foot in the plane of a triangle, and p's distance from it."""
    u, v, w = b - a, c - a, p - a
    n = np.cross(u, v)
    size = (n * n).sum(axis=1)
    second = (np.cross(w, v) * n).sum(axis=1) / size
    third = (np.cross(u, w) * n).sum(axis=1) / size
    return np.stack([1 - second - third, second, third], axis=1), np.abs((w * n).sum(axis=1)) / np.sqrt(size)


def distances(p: Array, a: Array, b: Array, c: Array) -> Array:
    """Distance of each point from its triangle: from the plane inside, from the nearest side outside."""
    weights, off = barycentric(p, a, b, c)
    sides = []
    for one, other in ((a, b), (b, c), (c, a)):
        way = other - one
        share = np.clip(((p - one) * way).sum(axis=1) / (way * way).sum(axis=1), 0, 1)
        sides.append(np.linalg.norm(p - one - share[:, None] * way, axis=1))
    return np.where((weights >= 0).all(axis=1), off, np.min(sides, axis=0))


def edge_faces(faces: npt.ArrayLike) -> dict[tuple[int, int], int]:
    """How many faces every undirected edge has."""
    sides = np.asarray(faces).astype(np.int64)
    sides = np.concatenate([sides[:, [0, 1]], sides[:, [1, 2]], sides[:, [2, 0]]])
    ends, count = np.unique(np.sort(sides, axis=1), axis=0, return_counts=True)
    return {(a, b): n for (a, b), n in zip(ends.tolist(), count.tolist(), strict=True)}


def euler(faces: npt.ArrayLike) -> int:
    """Vertices - edges + faces."""
    faces = np.asarray(faces)
    return len(np.unique(faces)) - len(edge_faces(faces)) + len(faces)


def t_junctions(points: Array, faces: npt.ArrayLike, near: float) -> list[tuple[tuple[int, int], int]]:
    """Every vertex of a border that stands inside an edge of the border, by trying all."""
    border = [edge for edge, count in edge_faces(faces).items() if count == 1]
    rim = np.unique(np.array(border, np.int64).reshape(-1))
    found = []
    for low, high in border:
        a, along = points[low], points[high] - points[low]
        where = (points[rim] - a) @ along / (along @ along)
        away = np.linalg.norm(points[rim] - a - where[:, None] * along, axis=1)
        margin = 2 * near / np.linalg.norm(along)
        inside = (away < near) & (where > margin) & (where < 1 - margin)
        found += [((low, high), int(p)) for p in rim[inside]]
    return found


def read_obj(path: Path, scale: float = 0.01) -> Geometry:
    """Positions, uvs, faces and materials of a tidy OBJ file; no more than the shared furniture needs."""
    v: list[list[float]] = []
    vt: list[list[float]] = []
    corner: dict[str, int] = {}
    made: list[tuple[list[float], list[float]]] = []
    faces: list[list[int]] = []
    slots: list[int] = []
    names: dict[str, int] = {}
    slot = 0
    for line in path.read_text(errors="replace").splitlines():
        head, *rest = line.split() or [""]
        if head == "v":
            v.append([float(x) for x in rest[:3]])
        elif head == "vt":
            vt.append([float(x) for x in rest[:2]])
        elif head == "usemtl":
            slot = names.setdefault(rest[0], len(names))
        elif head == "f":
            for name in rest:
                if name not in corner:
                    corner[name] = len(made)
                    parts = name.split("/")
                    uv = vt[int(parts[1]) - 1] if len(parts) > 1 and parts[1] else [0.0, 0.0]
                    made.append((v[int(parts[0]) - 1], uv))
            loop = [corner[name] for name in rest]
            faces += [[loop[0], loop[k], loop[k + 1]] for k in range(1, len(loop) - 1)]
            slots += [slot] * (len(loop) - 2)
    positions = np.array([p for p, _ in made], np.float32) * np.float32(scale)
    return Geometry(positions, np.array(faces), uvs=np.array([uv for _, uv in made]), slots=np.array(slots))
