"""The paper's figures rebuilt: sizes that add up, and errors that fall with the number of samples."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from studio_core.kernels.directions import direction_set
from studio_core.kernels.light_tree import LightTree
from studio_core.parallel import Workers
from studio_core.scene.transform import Transform
from studio_plugins.cuts.paper.path import PaperPath
from studio_plugins.cuts.paper.settings import PaperParams
from studio_plugins.cuts.paper.table import exact_irradiance, shell_rows, size_rows, whole_fields
from studio_plugins.meshes.obj import IMPORTER as OBJ

K = 10


def test_sizes_of_lazy_and_of_whole_fields(room: Any, workers: Workers) -> None:
    path = PaperPath(workers, PaperParams(k=K, shells=4, cells=4))
    path.place(room.mesh, room.shadow, room.identities)
    path.prepare(np.arange(0, len(room.mesh), 9))
    whole = whole_fields(path, samples=10_000)
    for index, item in enumerate(path.placed.objects):  # all samples there are: the estimate is the truth
        item.field.table[item.field.table == 0] = -1
        part = room.shadow.part(index)
        occluded8 = room.shadow.handles().occluded8
        item.field.trace(item.field.wanted(), part, occluded8, direction_set(K), workers)
    assert whole == path.counts.vcf
    assert whole.cuts == path.counts.vcf_possible == 3 * 4 * 96
    rows = {row.what: row for row in size_rows(path, whole)}
    heights = rows["SVC and VCF with heights, whole fields"]
    indices = rows["SVC and VCF with 2-byte indices, whole fields"]
    assert heights.ours < 0.7 * indices.ours
    assert rows["saved by heights, whole fields"].ours == pytest.approx(1 - heights.ours / indices.ours)
    assert rows["saved by heights, whole fields"].paper == pytest.approx(0.607, abs=1e-3)
    assert rows["SVC and VCF with split bits, whole fields"].ours < heights.ours


def test_exact_irradiance_of_an_open_floor(place: Any, workers: Workers, sky_tree: LightTree) -> None:
    room = place(places=(Transform(),))
    up = np.flatnonzero(room.mesh.normals[:, 1] > 0.9)[:5]
    found = exact_irradiance(room.mesh, room.shadow, up, sky_tree, K, workers)
    leaves = sky_tree.coarsened(K).radiance.astype(float)
    expected = np.maximum(direction_set(K).directions[:, 1], 0) @ leaves * direction_set(K).solid_angle
    assert np.allclose(found, expected, rtol=1e-5)


def test_figure_8(place: Any, shared_data: Path, workers: Workers, sky_tree: LightTree) -> None:
    """The teapot on a floor of figure 8: finer fields, smaller errors."""
    model = OBJ.load(shared_data / "third_party" / "teapot" / "teapot.obj")
    parts = [item.geometry for item in model.objects]
    assert len(parts) == 1
    low, high = parts[0].positions.min(axis=0), parts[0].positions.max(axis=0)
    scale = 0.8 / float((high - low).max())
    middle = scale * (low + high) / 2
    stands = Transform((-middle[0], -scale * float(low[1]) + 0.005, -middle[2]), scale=scale)
    room = place(places=(Transform(), stands), box=parts[0], edge=0.2)
    points = np.flatnonzero((room.mesh.normals[:, 1] > 0.9) & (room.mesh.object == 0))
    points = points[np.linalg.norm(room.mesh.positions[points][:, [0, 2]], axis=1) < 1.2][::2]
    params = PaperParams(k=K, threshold=0.0, merge=0.0)
    rows = shell_rows(
        room.mesh, room.shadow, room.identities, points, sky_tree, workers, params, shells=(8, 16, 32)
    )
    coarse, middling, fine = (row.relative_rmse for row in rows)
    assert coarse > 1.3 * middling > 1.3 * 1.3 * fine
    assert fine < 0.1
    assert all(0 < row.samples < row.possible for row in rows)
    assert all(row.worst >= row.relative_rmse >= abs(row.bias) for row in rows)
