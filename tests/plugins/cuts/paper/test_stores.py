"""Self-visibility cuts and visibility cut fields against rays traced one by one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from oracles.raycast import nearest

from studio_core.errors import Cancelled
from studio_core.kernels.directions import direction_set
from studio_core.kernels.visibility import lifted
from studio_core.parallel import Workers
from studio_plugins.cuts.paper.height_cuts import decode
from studio_plugins.cuts.paper.records import CutSizes, Records
from studio_plugins.cuts.paper.shells import sample_points
from studio_plugins.cuts.paper.svc import SelfVisibility
from studio_plugins.cuts.paper.vcf import WANTED, VisibilityCutField

K = 10


def leaves_of(records: Records, number: int, binary: bool) -> np.ndarray:
    data = records.data[records.starts[number] :].tobytes()
    return decode(data, K, int(records.counts[number]), binary).expanded()


class StopsAt:
    """A job that is cancelled at its nth checkpoint."""

    def __init__(self, after: int) -> None:
        self.left = after

    def checkpoint(self, done: int, total: int, /) -> None:
        self.left -= 1
        if self.left < 0:
            raise Cancelled("test")


def seen_past(room: Any, index: int, starts: np.ndarray) -> np.ndarray:
    """(N, S): whether rays from places in all directions miss one object."""
    geometry, transform = room.geometries[index], room.mesh.objects[index].transform
    along = direction_set(K).directions.astype(float)
    alone = [(geometry.positions.astype(float), geometry.faces, transform.matrix())]
    hits = nearest(alone, np.repeat(starts, len(along), axis=0), np.tile(along, (len(starts), 1)))
    return (hits.object < 0).reshape(len(starts), -1)


@pytest.mark.parametrize("index", [0, 2])
def test_self_visibility_is_that_of_the_own_object_alone(room: Any, index: int, workers: Workers) -> None:
    mesh = room.mesh
    rows = np.arange(0, len(mesh.objects[index].mesh), 7)
    points = rows + mesh.vertex_offsets[index]
    world = mesh.positions[points] + mesh.origin
    lifts = lifted(room.shadow, world, mesh.geometric[points], mesh.inset[points])
    starts = room.shadow.centre + lifts.astype(float)
    normals = mesh.normals[points].astype(float)
    store = SelfVisibility(len(mesh.objects[index].mesh))
    part, occluded8 = room.shadow.part(index), room.shadow.handles().occluded8
    store.trace(rows, starts, normals, part, occluded8, direction_set(K), 0.0, workers)
    cosines = np.maximum(normals @ direction_set(K).directions.astype(float).T, 0)
    expected = seen_past(room, index, starts) * cosines
    found = np.stack([leaves_of(store.records, store.slots[row], binary=False) for row in rows])
    assert (np.abs(found - expected) > 1e-4).sum() <= len(points)  # rays that graze an edge
    assert (store.slots >= 0).sum() == len(points)


def test_a_field_holds_what_each_sample_sees(room: Any, workers: Workers) -> None:
    index, shells, m = 2, 4, 2
    part = room.shadow.part(index)
    field = VisibilityCutField(part.radius, shells, m)
    every = np.arange(len(field.table))
    field.trace(every, part, room.shadow.handles().occluded8, direction_set(K), workers)
    expected = seen_past(room, index, part.centre + sample_points(every, part.radius, shells, m))
    found = np.stack([leaves_of(field.records, field.table[s] - 1, binary=True) for s in every])
    assert (~expected).sum() > 1000
    assert (found != expected).sum() <= 0.002 * (~expected).sum()


def test_only_wanted_samples_are_traced_and_none_of_a_cancelled_run(room: Any, workers: Workers) -> None:
    part = room.shadow.part(1)
    field = VisibilityCutField(part.radius, 8, 8)
    field.table[[5, 700, 701, 2000]] = WANTED
    occluded8 = room.shadow.handles().occluded8
    with pytest.raises(Cancelled):
        field.trace(field.wanted(), part, occluded8, direction_set(K), workers, StopsAt(0))
    assert len(field.records) == 0
    assert field.wanted().tolist() == [5, 700, 701, 2000]
    field.trace(field.wanted(), part, occluded8, direction_set(K), workers)
    assert field.wanted().tolist() == []
    assert (field.table > 0).sum() == len(field.records) == 4
    assert field.records.sizes.cuts == 4


def test_vertices_that_are_not_finite_see_nothing(room: Any, workers: Workers) -> None:
    store = SelfVisibility(3)
    starts = np.array([[0.0, 3.0, 0.0], [np.nan, 0.0, 0.0], [0.0, 3.0, 0.0]])
    normals = np.array([[0.0, 1.0, 0.0], [0.0, 1.0, 0.0], [0.0, np.inf, 0.0]])
    part, occluded8 = room.shadow.part(1), room.shadow.handles().occluded8
    store.trace(np.arange(3), starts, normals, part, occluded8, direction_set(K), 0.01, workers)
    assert leaves_of(store.records, 0, binary=False).max() > 0.9
    assert leaves_of(store.records, 1, binary=False).tolist() == [0.0] * (1 << K)
    assert leaves_of(store.records, 2, binary=False).tolist() == [0.0] * (1 << K)


def test_sizes_in_three_codes() -> None:
    sizes = CutSizes(2, 100, 30) + CutSizes(1, 20, 0)
    assert sizes == CutSizes(3, 120, 30)
    assert sizes.average == 40
    assert sizes.height_bytes(1) == 75
    assert sizes.index_bytes(1) == 255
    assert sizes.split_bytes(1) == (2 * 120 - 3 - 30 + 120) / 8
