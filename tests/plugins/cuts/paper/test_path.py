"""The paper's path against its own cuts put together leaf by leaf, and what moves cost."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from oracles import paper_cuts as oracle

from studio_core.errors import Cancelled
from studio_core.kernels.directions import direction_set
from studio_core.kernels.light_tree import LightTree
from studio_core.kernels.visibility import trace_visibility
from studio_core.parallel import Workers
from studio_core.scene.transform import Transform, axis_angle
from studio_plugins.cuts.paper.height_cuts import decode
from studio_plugins.cuts.paper.operations import ONE
from studio_plugins.cuts.paper.path import PaperPath
from studio_plugins.cuts.paper.placement import coarse_cones, hides_open
from studio_plugins.cuts.paper.settings import PaperParams
from studio_plugins.cuts.paper.shells import receivers

K = 10
COARSE = PaperParams(k=K, threshold=0.01, shells=8, cells=8, merge=0.0)


class StopsAt:
    """A job that is cancelled at its nth checkpoint."""

    def __init__(self, after: int) -> None:
        self.left = after

    def checkpoint(self, done: int, total: int, /) -> None:
        self.left -= 1
        if self.left < 0:
            raise Cancelled("test")


def every(room: Any, step: int = 1) -> np.ndarray:
    return np.arange(0, len(room.mesh), step, dtype=np.int64)


def path_of(room: Any, workers: Workers, params: PaperParams = COARSE) -> PaperPath:
    path = PaperPath(workers, params)
    path.place(room.mesh, room.shadow, room.identities)
    return path


def nodes_of(records: Any, number: int, binary: bool) -> list[tuple[int, float]]:
    cut = decode(records.data[records.starts[number] :].tobytes(), K, int(records.counts[number]), binary)
    return list(zip(cut.heights.tolist(), cut.values.astype(float).tolist(), strict=True))


def exact_irradiance(room: Any, points: np.ndarray, tree: LightTree, workers: Workers) -> np.ndarray:
    mesh, directions = room.mesh, direction_set(K)
    found = trace_visibility(
        room.shadow,
        mesh.positions[points] + mesh.origin,
        mesh.normals[points],
        directions,
        workers,
        geometric_normals=mesh.geometric[points],
        inset=mesh.inset[points],
    )
    bits = np.unpackbits(found.words.view(np.uint8), axis=1, bitorder="little")
    cosines = np.maximum(mesh.normals[points].astype(float) @ directions.directions.T, 0)
    return (bits * cosines) @ tree.coarsened(K).radiance.astype(float) * directions.solid_angle


def relative_rmse(found: np.ndarray, true: np.ndarray) -> float:
    return float(np.sqrt(((found - true) ** 2).mean()) / true.mean())


@pytest.mark.parametrize("operations", ["intervals", "counters"])
def test_products_are_those_of_the_expanded_cuts(
    room: Any, workers: Workers, sky_tree: LightTree, operations: str
) -> None:
    path = path_of(room, workers, dataclasses.replace(COARSE, operations=operations, hidden=False))
    points = every(room, 17)
    found = path.irradiance(points, sky_tree)
    light = sky_tree.coarsened(K).radiance.astype(float) * direction_set(K).solid_angle
    for row, point in enumerate(points.tolist()):
        own = int(room.mesh.object[point])
        item = path.placed.objects[own]
        slot = int(item.own.slots[point - room.mesh.vertex_offsets[own]])
        svc = nodes_of(item.own.records, slot, binary=False)
        factors, expected = [svc], oracle.expanded(svc)
        for index, other in enumerate(path.placed.objects):
            centre, radius = other.sphere[:3], other.sphere[3]
            seen_from = room.mesh.positions[point].astype(float) - centre
            if index == own or room.mesh.normals[point].astype(float) @ seen_from >= radius:
                continue
            samples, weights, _ = receivers(seen_from[None], radius, 8, 8)
            there = samples[0] >= 0
            cuts = [nodes_of(other.field.records, other.field.table[s] - 1, True) for s in samples[0, there]]
            hidden = sum(
                w / ONE * (1 - oracle.expanded(c)) for w, c in zip(weights[0, there], cuts, strict=True)
            )
            factors += cuts
            expected = expected * (1 - hidden)
        numbers, values = path.cut(point)
        leaves = np.zeros(1 << K)
        height = K + 1 - np.frexp(numbers)[1]
        first = (numbers << height) - (1 << K)
        for start, span, value in zip(first, 1 << height, values, strict=True):
            leaves[start : start + span] = value
        assert np.abs(leaves - expected).max() < 1e-5
        heights = np.array(oracle.common_heights(factors))
        starts = np.cumsum(1 << heights) - (1 << heights)
        lit = expected[starts] > 1e-9
        assert first[values > 1e-9].tolist() == starts[lit].tolist()
        assert np.allclose(found[row], expected @ light, rtol=1e-4)


def test_nodes_carry_the_irradiance(room: Any, workers: Workers, sky_tree: LightTree) -> None:
    path = path_of(room, workers)
    points = every(room, 3)[::-1].copy()
    irradiance = path.irradiance(points, sky_tree)
    blocks = path.nodes(points, sky_tree)
    assert np.concatenate([block.points for block in blocks]).tolist() == points.tolist()
    row = 0
    for block in blocks:
        for item in range(len(block.points)):
            n = int(block.first[item + 1] - block.first[item])
            part = block.data[6 * block.first[item] : 6 * block.first[item] + 6 * n].reshape(6, n)
            assert np.allclose(part[3:].sum(axis=1), irradiance[row], rtol=1e-4)
            assert np.allclose((part[:3] ** 2).sum(axis=0), 1, atol=1e-5)
            assert (part[2] > 0).all()
            assert (part[3:] > 0).all()
            row += 1


def test_finer_fields_come_closer_to_traced_light(room: Any, workers: Workers, sky_tree: LightTree) -> None:
    points = every(room, 4)
    true = exact_irradiance(room, points, sky_tree, workers)
    errors = []
    for n in (8, 64, 256):
        params = PaperParams(k=K, threshold=0.0, shells=n, cells=n, merge=0.0)
        errors.append(relative_rmse(path_of(room, workers, params).irradiance(points, sky_tree), true))
    assert errors[0] > 2 * errors[1] > 4 * errors[2]
    assert errors[2] < 0.02


def test_merging_keeps_light_and_saves_nodes(room: Any, workers: Workers, sky_tree: LightTree) -> None:
    points = every(room)
    whole = path_of(room, workers)
    merged = path_of(room, workers, dataclasses.replace(COARSE, merge=0.003))
    before, after = whole.irradiance(points, sky_tree), merged.irradiance(points, sky_tree)
    assert relative_rmse(after, before) < 0.02
    assert merged.counts.product_nodes < 0.7 * whole.counts.product_nodes


def test_a_translation_traces_no_vertex_again_and_gives_what_a_new_path_gives(
    room: Any, workers: Workers, sky_tree: LightTree
) -> None:
    path = path_of(room, workers)
    points = every(room)
    path.irradiance(points, sky_tree)
    before = path.counts
    shift = Transform((0.9, 0.31, 0.2), room.mesh.objects[2].transform.rotation)
    moved = room.moved(2, shift)
    path.place(moved.mesh, moved.shadow, moved.identities)
    found = path.irradiance(points, sky_tree)
    after = path.counts
    fresh = path_of(moved, workers)
    assert relative_rmse(found, fresh.irradiance(points, sky_tree)) < 1e-3  # rays that graze edges
    assert after.svc.cuts == before.svc.cuts
    own = len(room.mesh.objects[2].mesh)
    assert own < after.products - before.products < len(points)
    assert after.vcf.cuts > before.vcf.cuts


def test_two_moves_between_pictures_and_back_again(room: Any, workers: Workers, sky_tree: LightTree) -> None:
    path = path_of(room, workers)
    points = every(room)
    first = path.irradiance(points, sky_tree)
    start = room.mesh.objects[1].transform
    away = room.moved(1, Transform((0.0, 1.5, 1.0)))
    path.place(away.mesh, away.shadow, away.identities)
    back = away.moved(1, start)
    path.place(back.mesh, back.shadow, back.identities)
    assert np.array_equal(path.irradiance(points, sky_tree), first)


def test_turned_objects_get_new_cuts(room: Any, workers: Workers, sky_tree: LightTree) -> None:
    path = path_of(room, workers)
    points = every(room)
    path.irradiance(points, sky_tree)
    assert path.counts.fields == 3  # the floor, a straight cube, and one for both turned ones
    turned = room.moved(1, Transform((0.0, 0.31, 0.0), axis_angle((0, 1, 0), 50)))
    path.place(turned.mesh, turned.shadow, turned.identities)
    found = path.irradiance(points, sky_tree)
    assert np.allclose(found, path_of(turned, workers).irradiance(points, sky_tree), rtol=1e-5)


@pytest.mark.parametrize("operations", ["intervals", "counters"])
def test_drags_one_after_the_other(room: Any, workers: Workers, sky_tree: LightTree, operations: str) -> None:
    """Products without the moving objects are used again, and never once something else has moved."""
    path = path_of(room, workers, dataclasses.replace(COARSE, operations=operations))
    points = every(room, 2)
    path.irradiance(points, sky_tree)
    shown = room
    for index, x in ((3, -1.0), (3, -0.9), (3, -0.8), (2, 1.0), (3, -0.7), (2, 0.9), (2, 0.95)):
        old = shown.mesh.objects[index].transform
        shown = shown.moved(index, Transform((x, old.translation[1], 0.5 * x), old.rotation))
        path.place(shown.mesh, shown.shadow, shown.identities)
        found = path.irradiance(points, sky_tree)
        assert relative_rmse(found, path_of(shown, workers).irradiance(points, sky_tree)) < 1e-3
    both = shown.moved(2, Transform((1.3, 0.31, 0.0))).moved(3, Transform((-1.4, 0.31, 0.0)))
    path.place(both.mesh, both.shadow, both.identities)
    found = path.irradiance(every(room), sky_tree)
    assert relative_rmse(found, path_of(both, workers).irradiance(every(room), sky_tree)) < 1e-3


def test_cancelled_work_is_taken_up_again(room: Any, workers: Workers, sky_tree: LightTree) -> None:
    points = every(room)
    expected = path_of(room, workers).irradiance(points, sky_tree)
    path = path_of(room, workers)
    cancelled = 0
    for after in range(0, 400, 3):
        try:
            path.irradiance(points, sky_tree, StopsAt(after))
            break
        except Cancelled:
            cancelled += 1
    assert cancelled > 5
    assert np.array_equal(path.irradiance(points, sky_tree), expected)
    shift = room.moved(3, Transform((-0.8, 0.31, 0.5), room.mesh.objects[3].transform.rotation))
    path.place(shift.mesh, shift.shadow, shift.identities)
    for after in range(0, 40, 2):
        with pytest.raises(Cancelled):
            path.irradiance(points, sky_tree, StopsAt(0 if after % 4 else 1))
    found = path.irradiance(points, sky_tree)
    assert relative_rmse(found, path_of(shift, workers).irradiance(points, sky_tree)) < 1e-3


def test_threads_change_no_bit(room: Any, workers: Workers, sky_tree: LightTree) -> None:
    points = every(room)
    with Workers(1) as alone:
        one = path_of(room, alone, dataclasses.replace(COARSE, merge=0.001))
        two = path_of(room, workers, dataclasses.replace(COARSE, merge=0.001))
        assert np.array_equal(one.irradiance(points, sky_tree), two.irradiance(points, sky_tree))
        for a, b in zip(one.nodes(points, sky_tree), two.nodes(points, sky_tree), strict=True):
            assert np.array_equal(a.data, b.data)


def test_culling_leaves_out_only_what_hides_nothing() -> None:
    rng = np.random.default_rng(3)
    along = direction_set(K).directions.astype(float)
    cones = coarse_cones(K)
    left_out = 0
    for _ in range(400):
        mask = (rng.random(1 << 7) < 0.1).astype(np.uint8)
        place, radius = rng.normal(size=3), rng.uniform(0.05, 0.8)
        if hides_open(*place.tolist(), radius, cones, mask):
            continue
        left_out += 1
        nearest_pass = np.linalg.norm(np.cross(along, place), axis=1)
        met = (nearest_pass < radius) & (along @ place > 0)
        assert not (met & np.repeat(mask, (1 << K) // len(mask)).astype(bool)).any()
    assert left_out > 50


def test_objects_that_stop_no_light(place: Any, workers: Workers, sky_tree: LightTree) -> None:
    room = place(see_through=(1, 2, 3))
    path = path_of(room, workers)
    floor = every(room)[: room.mesh.vertex_offsets[1]]
    floor = floor[room.mesh.normals[floor, 1] > 0.9]
    found = path.irradiance(floor, sky_tree)
    assert relative_rmse(found, np.tile(found.mean(axis=0), (len(floor), 1))) < 1e-4
    assert path.counts.vcf.average == 1
    assert path.irradiance(every(room), sky_tree).min() > 0


def test_both_tracers_agree(place: Any, workers: Workers, sky_tree: LightTree) -> None:
    rooms = [place(backend=name) for name in ("embree", "bvh")]
    one, two = (path_of(room, workers).irradiance(every(room, 3), sky_tree) for room in rooms)
    assert relative_rmse(one, two) < 1e-3


def test_far_from_the_origin_nothing_changes(place: Any, workers: Workers, sky_tree: LightTree) -> None:
    near, far = place(), place(shift=(8192.0, -4096.0, 1024.0))
    found = path_of(far, workers).irradiance(every(far, 3), sky_tree)
    assert relative_rmse(found, path_of(near, workers).irradiance(every(near, 3), sky_tree)) < 2e-3


def test_an_object_more_is_another_room(place: Any, workers: Workers, sky_tree: LightTree) -> None:
    small, large = place(places=(Transform(), Transform((0.0, 0.31, 0.0)))), place()
    path = path_of(small, workers)
    path.irradiance(every(small), sky_tree)
    path.place(large.mesh, large.shadow, large.identities)
    found = path.irradiance(every(large), sky_tree)
    assert np.array_equal(found, path_of(large, workers).irradiance(every(large), sky_tree))


def test_what_does_not_fit_is_refused(room: Any, workers: Workers, sky_tree: LightTree) -> None:
    for wrong in (PaperParams(k=16), PaperParams(shells=1), PaperParams(threshold=-1.0)):
        with pytest.raises(ValueError, match=r"paper's cuts|a field needs"):
            PaperPath(workers, wrong)
    path = PaperPath(workers, COARSE)
    with pytest.raises(ValueError, match="nothing is placed"):
        path.irradiance(every(room), sky_tree)
    with pytest.raises(ValueError, match="the same objects"):
        path.place(room.mesh, room.shadow, room.identities[1:])
    fine = path_of(room, workers, PaperParams())
    with pytest.raises(ValueError, match="the light has 2"):
        fine.irradiance(every(room), sky_tree)
