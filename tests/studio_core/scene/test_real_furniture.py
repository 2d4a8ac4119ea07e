"""Twenty real pieces of furniture as shading meshes (shared data; skipped where it is absent)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from oracles.meshes import areas, distances, edge_faces, euler, read_obj

from studio_core.scene.shading_mesh import choose_edge, prepare, refine, shade_mesh
from studio_core.scene.surface import surface
from studio_core.scene.topology import tolerance

NAMES = [
    "JapaneseLantern",
    "armchair2",
    "bedWithTexture",
    "bedsideTable2",
    "bookcase",
    "chair2",
    "desklamp",
    "glassDoorCabinet",
    "lamp2",
    "oakChair",
    "oakTable",
    "osakaChair",
    "pianoAQueue",
    "plant",
    "sofa2",
    "table",
    "tableWithTablecloth",
    "tatami",
    "teddyBear",
    "winchesterSofa",
]


@pytest.mark.parametrize("name", NAMES)
def test_real_furniture_is_shaded(name: str, shared_data: Path) -> None:
    geometry = read_obj(shared_data / "cc0" / "furniture_blendswap_cc0" / name / f"{name}.obj")
    source = surface(geometry)
    mesh = shade_mesh(geometry, 0.08)
    near = 12 * tolerance(geometry.positions)
    total = areas(source.points, source.faces).sum()
    assert areas(mesh.positions, mesh.faces).sum() == pytest.approx(total, rel=1e-5)
    sides = mesh.positions[mesh.faces] - mesh.positions[np.roll(mesh.faces, 1, axis=1)]
    assert np.linalg.norm(sides, axis=2).max() <= 0.08 + near
    welded = mesh.welded[mesh.faces]
    # Coincident faces of two solids stay two discs, whose inner edges may join the same points.
    twins = len(source.faces) - len(np.unique(np.sort(source.faces, axis=1), axis=0))
    assert 0 <= euler(welded) - euler(source.faces) <= 20 * twins
    before, after = edge_faces(source.faces), edge_faces(welded)
    assert list(after.values()).count(1) >= list(before.values()).count(1)
    assert set(after.values()) <= set(before.values()) | ({2, 4} if twins else {2})
    used = geometry.faces[mesh.source_face]
    corners = [geometry.positions[used[:, k]].astype(float) for k in range(3)]
    for k in range(3):
        assert distances(mesh.positions[mesh.faces[:, k]].astype(float), *corners).max() <= near
    a, b, c = (mesh.positions[mesh.faces[:, k]].astype(np.float64) for k in range(3))
    flat = np.cross(b - a, c - a)
    along = np.einsum("fkc,fc->fk", mesh.normals[mesh.faces], flat) / np.linalg.norm(flat, axis=1)[:, None]
    assert along.min() > 0
    finer = refine(mesh, faces=np.arange(0, len(mesh.faces), 3))
    assert twins or euler(finer.welded[finer.faces]) == euler(source.faces)


def test_a_furnished_room_meets_its_budget(shared_data: Path) -> None:
    folder = shared_data / "cc0" / "furniture_blendswap_cc0"
    room = [
        read_obj(folder / name / f"{name}.obj") for name in ("chair2", "table", "tatami", "glassDoorCabinet")
    ]
    items = [(geometry, 1.0) for geometry in room] + [(room[0], 0.7)]
    edge = choose_edge(items, 30_000)
    made = sum(len(shade_mesh(geometry, edge / scale)) for geometry, scale in items)
    assert sum(len(prepare(geometry).weld) for geometry, _ in items) < 10_000
    assert made == pytest.approx(30_000, rel=0.15)
