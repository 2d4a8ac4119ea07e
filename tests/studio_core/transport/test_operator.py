"""Rows of hits: as rays looped over triangles, and after moves as if traced afresh."""

from __future__ import annotations

import contextlib
import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles import transport as oracle
from oracles.meshes import box, joined
from transport_support import Stand, ball, furnished, scene_of, somewhere, thing, walls

from studio_core.errors import Cancelled
from studio_core.parallel import Workers
from studio_core.scene.nodes import MeshObject
from studio_core.scene.transform import Transform
from studio_core.shading.cache import DiskCache
from studio_core.shading.job import Job
from studio_core.transport.hits import BLACK, NOTHING, gather_matte
from studio_core.transport.operator import RayTransport, Rows, Transport
from studio_core.transport.patterns import cosine_pattern

PATTERN = cosine_pattern(16)
FAR = (12_000.0, 3.0, -9_000.0)


@pytest.fixture(params=["embree", "bvh"])
def tracer(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setenv("LUCARNE_RAYCASTER", request.param)
    return str(request.param)


def update(transport: Transport, stand: Stand, wanted: Any = None, job: Any = None) -> Any:
    return transport.update(stand.surfaces, stand.casters, stand.all() if wanted is None else wanted, job)


def world_rays(transport: Transport, stand: Stand, rows: np.ndarray) -> np.ndarray:
    """(n, N, 3) the rays of some rows in the world."""
    made = []
    for row in rows:
        frame = oracle.frame_of(stand.mesh, transport.rows[row])
        made.append(transport.pattern.directions[transport.variant[row]].astype(float) @ frame)
    return np.array(made)


def by_vertex(operator: Rows) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Hits in the order of vertices, whatever the order of rows."""
    order = np.argsort(operator.rows)
    return tuple(array[order] for array in operator.table.arrays)  # type: ignore[return-value]


def gathered(operator: Rows, radiance: np.ndarray) -> np.ndarray:
    out = np.zeros((len(operator), 3), np.float32)
    gather_matte(0, len(operator), np.arange(len(operator)), operator.table.vertex, radiance, out)
    return out[np.argsort(operator.rows)]


@pytest.mark.parametrize("offset", [(0, 0, 0), FAR])
def test_hits_are_those_of_a_loop_over_triangles(
    tracer: str, workers: Workers, offset: tuple[float, float, float]
) -> None:
    stand = Stand(furnished(offset), 1500)
    transport = Transport(workers, PATTERN)
    counts = update(transport, stand)
    assert stand.casters.primary.backend == tracer
    assert counts.rays == counts.rows * 16 == len(stand.mesh) * 16
    mesh, opaque = stand.mesh, np.ones(len(stand.mesh.faces), bool)
    rows = np.random.default_rng(4).choice(len(transport), 60, replace=False)
    rays = world_rays(transport, stand, rows)
    expected = oracle.rows(mesh, opaque, transport.rows[rows], rays, stand.casters.primary.epsilon)
    vertex, cell, distance = (array.reshape(-1) for array in transport.table[rows].arrays)
    clear = wrong = chosen = 0
    for ray in np.flatnonzero(expected.margin > 1e-3):
        clear += 1
        corners = expected.corners[ray].tolist()
        if vertex[ray] not in corners:
            wrong += 1
        elif corners[0] not in (NOTHING, BLACK):
            chosen += 1
            wrong += abs(int(cell[ray]) - expected.cells[ray, corners.index(vertex[ray])]) not in (
                0,
                1,
                63,
                64,
            )
            assert float(distance[ray]) == pytest.approx(expected.distance[ray], rel=2e-3, abs=1e-4)
    assert clear > 700
    assert chosen > 300
    assert wrong <= 0.002 * clear


def test_corners_are_met_as_often_as_they_weigh(workers: Workers) -> None:
    """A radiance that is linear over each face comes through without bias."""
    stand = Stand(furnished(), 300)
    mesh = stand.mesh
    radiance = np.ascontiguousarray(mesh.positions + np.float32(5))
    vertex = int(np.flatnonzero(mesh.object == 0)[40])
    wanted = np.zeros(len(mesh), bool)
    wanted[vertex] = True
    transport = Transport(workers, cosine_pattern(4096, 4))
    update(transport, stand, wanted)
    (rays,) = world_rays(transport, stand, np.arange(1))
    opaque = np.ones(len(mesh.faces), bool)
    expected = oracle.rows(mesh, opaque, np.array([vertex]), rays[None], stand.casters.primary.epsilon)
    lit = ~np.isin(expected.corners[:, 0], (NOTHING, BLACK))
    exact = np.zeros((len(rays), 3))
    exact[lit] = np.einsum("rk,rkc->rc", expected.weights[lit], radiance[expected.corners[lit]])
    noise = np.sqrt(
        np.einsum(
            "rk,rkc->rc", expected.weights[lit], (radiance[expected.corners[lit]] - exact[lit][:, None]) ** 2
        )
    )
    found = gathered(transport, radiance)[0]
    allowed = 4 * np.sqrt((noise**2).sum(axis=0)) / len(rays) + 2e-3
    assert (np.abs(found - exact.mean(axis=0)) < allowed).all()


@pytest.mark.parametrize("offset", [(0, 0, 0), FAR])
def test_nothing_leaks_out_of_a_closed_box(
    tracer: str, workers: Workers, offset: tuple[float, float, float]
) -> None:
    stand = Stand(scene_of(thing("room", walls(5.0, 2.5, 4.0), offset)), 1500)
    towards = np.add(offset, (0, 1.25, 0)) - stand.mesh.origin - stand.mesh.positions
    inside = (stand.mesh.normals * towards).sum(axis=1) > 0
    assert 0.4 < inside.mean() < 0.6
    transport = Transport(workers, PATTERN)
    update(transport, stand, inside)
    assert (transport.table.vertex < NOTHING - 1).all()
    ones = np.ones((len(stand.mesh), 3), np.float32)
    assert (gathered(transport, ones) == 1).all()
    assert (transport.share_back == 0).all()
    assert inside[transport.table.vertex].all()


@pytest.mark.parametrize("rows", [10, 24])
def test_nothing_leaks_out_of_a_ball(workers: Workers, rows: int) -> None:
    """Two shells: of the inner one the inside is seen."""
    shells = scene_of(
        thing("room", joined(ball(2.0, rows), ball(1.9, rows, inwards=True)), (0.3, 1.0, 0.2)),
    )
    stand = Stand(shells, 3000)
    towards = np.array((0.3, 1.0, 0.2)) - stand.mesh.origin - stand.mesh.positions
    inside = (stand.mesh.normals * towards).sum(axis=1) > 0
    assert inside.any()
    assert not inside.all()
    transport = Transport(workers, PATTERN)
    update(transport, stand, inside)
    assert (transport.table.vertex < BLACK).all()
    assert inside[transport.table.vertex].all()


def test_what_stops_no_light_is_passed(workers: Workers) -> None:
    room = thing("room", walls(4.0, 2.5, 4.0))
    pane = thing("pane", ball(0.5), (0, 1, 0), "glass")
    with_pane, without = Stand(scene_of(room, pane), 1200), Stand(scene_of(room), 1200)
    wanted = with_pane.mesh.object == 0
    seen = Transport(workers, PATTERN)
    update(seen, with_pane, wanted)
    assert (with_pane.mesh.object[seen.table.vertex[seen.table.vertex < BLACK]] == 0).all()
    assert len(without.mesh) != len(with_pane.mesh)


def compare(operator: Rows, other: Rows, mesh: Any) -> tuple[float, float]:
    """Share of hits that differ, and relative RMSE of a matte radiance gathered through both.

    Where faces of two objects lie in one plane, a tracer may give either: hits of two objects at the
    same distance, seen by those inside or under what stands there, are left out.
    """
    a, b = by_vertex(operator), by_vertex(other)
    tied = (a[2] == b[2]) & (a[0] != b[0]) & np.isfinite(a[2])
    tied &= _objects(mesh, a) != _objects(mesh, b)
    assert tied.mean() < 0.005
    rng = np.random.default_rng(8)
    radiance = (0.2 + rng.random((len(mesh), 3))).astype(np.float32)
    clear = ~tied.any(axis=1)
    one, two = gathered(operator, radiance)[clear], gathered(other, radiance)[clear]
    rmse = np.sqrt(np.mean((one - two) ** 2)) / max(two.mean(), 1e-9)
    return float(np.mean(((a[0] != b[0]) | (a[1] != b[1])) & ~tied)), float(rmse)


def _objects(mesh: Any, hits: tuple[np.ndarray, ...]) -> np.ndarray:
    lit = hits[0] < BLACK
    return np.where(lit, mesh.object[np.where(lit, hits[0], 0)], np.where(hits[0] == BLACK, hits[1], -1))


@pytest.mark.parametrize("offset", [(0, 0, 0), FAR])
def test_moves_end_as_if_traced_afresh(workers: Workers, offset: tuple[float, float, float]) -> None:
    """Objects one at a time and together, turned, scaled, in contact, through walls, and back again."""
    rng = np.random.default_rng(11)
    stand = Stand(furnished(offset), 1200)
    transport = Transport(workers, PATTERN)
    update(transport, stand)
    names = ["chest", "stool", "hoop", "ball"]
    sizes = {name: stand.scene[name].transform.scale for name in names}
    differ, errors, retraced = [], [], []
    for number in range(100):
        moving = rng.choice(names, 1 + (number % 4 == 3), replace=False)
        stand.place(**{n: somewhere(rng, offset, sizes[n] * rng.uniform(0.8, 1.25)) for n in moving})
        before = by_vertex(transport)
        counts = update(transport, stand)
        after = by_vertex(transport)
        same = ((before[0] == after[0]) & (before[1] == after[1])).all(axis=1)
        assert (transport.touched[np.argsort(transport.rows)] == ~same).all()
        assert counts.rays + counts.kept == len(stand.mesh) * 16
        retraced.append(counts.rays / (len(stand.mesh) * 16))
        if number % 4 == 3:
            fresh = Transport(workers, PATTERN)
            update(fresh, stand)
            differing, error = compare(transport, fresh, stand.mesh)
            differ.append(differing)
            errors.append(error)
    assert np.mean(retraced) < 0.6
    assert np.mean(differ) <= 2e-5
    assert max(differ) <= 1e-4
    assert np.mean(errors) < 1e-3


class Impatient(Job):
    """Cancelled at its nth checkpoint."""

    def __init__(self, patience: int) -> None:
        super().__init__("impatient")
        self._patience = patience

    def checkpoint(self, done: int = 0, total: int = 0) -> None:
        if self.checkpoints == self._patience:
            self.cancel()
        super().checkpoint(done, total)


def test_a_cancelled_update_is_gone_on_with(workers: Workers) -> None:
    """Cancelled again and again, at first and in the middle of moves: in the end all is as traced afresh."""
    rng = np.random.default_rng(5)
    stand = Stand(furnished(), 2500)
    transport = Transport(workers, PATTERN)
    cancelled = 0
    for number in range(24):
        if number:
            stand.place(**{str(rng.choice(["chest", "hoop", "ball"])): somewhere(rng, scale=0.5)})
        try:
            update(transport, stand, job=Impatient(int(rng.integers(0, 6))))
        except Cancelled:
            cancelled += 1
    assert cancelled > 10
    before = by_vertex(transport)
    update(transport, stand)
    assert transport.current.all()
    fresh = Transport(workers, PATTERN)
    update(fresh, stand)
    differing, _ = compare(transport, fresh, stand.mesh)
    assert differing < 1e-4
    assert len(before[0]) == len(fresh)


def test_touched_counts_from_the_last_update_that_ended() -> None:
    stand = Stand(furnished(), 2500)
    transport = Transport(Workers(1), PATTERN)
    update(transport, stand)
    update(transport, stand)
    assert not transport.touched.any()
    before = by_vertex(transport)
    stand.place(hoop=Transform((0.2, 0.4, 0.2), scale=0.5))
    for patience in (1, 2, 3):
        with pytest.raises(Cancelled):
            update(transport, stand, job=Impatient(patience))
    update(transport, stand)
    after = by_vertex(transport)
    same = ((before[0] == after[0]) & (before[1] == after[1])).all(axis=1)
    assert 0 < same.sum() < len(same)
    assert (transport.touched[np.argsort(transport.rows)] == ~same).all()


def test_rows_stay_when_others_are_wanted_and_wait_when_they_are_not(workers: Workers) -> None:
    stand = Stand(furnished(), 1200)
    transport = Transport(workers, PATTERN)
    left = stand.mesh.positions[:, 0] < 0
    first = update(transport, stand, left)
    assert first.rays == 16 * left.sum()
    assert update(transport, stand, left).rays == 0
    both = update(transport, stand)
    assert both.rays == 16 * (~left).sum()
    assert both.kept == 16 * left.sum()
    there, away = stand.scene["hoop"].transform, Transform((0.0, 1.0, 0.0), scale=0.4)
    stand.place(hoop=away)
    assert update(transport, stand, left).rows == left.sum()
    assert not transport.current.all()
    stand.place(hoop=there)  # whoever waited knows it still
    assert update(transport, stand, ~left) == type(both)(0, 16 * int((~left).sum()), 0, 0)
    update(transport, stand)
    fresh = Transport(workers, PATTERN)
    update(fresh, stand)
    assert compare(transport, fresh, stand.mesh)[0] < 1e-4


def test_rows_that_nobody_wants_go_where_room_is_short(workers: Workers) -> None:
    stand = Stand(furnished(), 1200)
    count = len(stand.mesh)
    transport = Transport(workers, PATTERN, limit=count * 16 * 8)
    left = stand.mesh.positions[:, 0] < 0
    update(transport, stand, left)
    update(transport, stand, ~left)
    assert len(transport) == (~left).sum()
    assert (transport.row_of[left] == -1).all()
    assert (transport.rows[transport.row_of[~left]] == np.flatnonzero(~left)).all()
    fresh = Transport(workers, PATTERN)
    update(fresh, stand, ~left)
    assert (by_vertex(transport)[0] == by_vertex(fresh)[0]).all()
    assert transport.nbytes < 1.2 * count * 16 * 8


def retraced(workers: Workers, known: Transport, stand: Stand) -> Transport:
    """The rays that `known` has, all traced afresh: vertices had other numbers when they were chosen."""
    made = Transport(workers, known.pattern)
    update(made, stand, ~stand.all())
    made._append(known.rows, known.variant)
    made._stream = known._stream.copy()
    update(made, stand)
    return made


def test_objects_that_come_and_go_leave_the_rest(workers: Workers) -> None:
    """Added, removed, made anew, turned to glass, with moves and cancelled updates between."""
    rng = np.random.default_rng(21)
    first = furnished()
    others = [
        thing("lamp", ball(0.2, 8), (0.0, 1.2, 0.0)),
        thing("cube", box((0.5, 0.5, 0.5)), (-0.4, 0.0, 0.8)),
        thing("pane", box((1.0, 1.0, 0.02)), (0.2, 0.1, 0.0), "glass"),
    ]
    every = [*first.of(MeshObject), *others]
    stand = Stand(first, 1500)
    transport = Transport(workers, PATTERN)
    update(transport, stand)
    shares = []
    for number in range(30):
        shown = [node for node in every if node.id == "room" or rng.random() < 0.7]
        if number % 3 == 1:
            shown = list(stand.scene.of(MeshObject))
            change = int(rng.integers(1, len(shown)))
            material = "glass" if shown[change].materials == ("matt",) else "matt"
            shown[change] = dataclasses.replace(shown[change], materials=(material,))
        before = {(o.node, id(o.mesh)) for o in stand.mesh.objects}
        stand.follow(scene_of(*shown))
        if number % 2:
            name = str(rng.choice([node.id for node in shown[1:]] or ["room"]))
            stand.place(**{name: Transform((0, 0.017, 0)) @ somewhere(rng, scale=0.6)})
        if number % 5 == 4:
            with contextlib.suppress(Cancelled):
                update(transport, stand, job=Impatient(2))
        counts = update(transport, stand)
        assert len(transport) == len(stand.mesh)
        assert transport.current.all()
        if before & {(o.node, id(o.mesh)) for o in stand.mesh.objects}:
            shares.append(counts.rays / (16 * len(stand.mesh)))
        fresh = retraced(workers, transport, stand)
        differing, _ = compare(transport, fresh, stand.mesh)
        assert differing < 2e-4
        black, seen = transport.black.copy(), transport._seen.copy()
        transport._look(stand.mesh)  # as told by the hits that there are
        assert (black == transport.black).all()
        assert (seen == transport._seen).all()
    assert np.mean(shares) < 0.7


def test_what_comes_and_goes_is_all_that_is_traced(workers: Workers) -> None:
    bulb = thing("bulb", ball(0.15, 4), (0.2, 1.0, 0.0))
    stand = Stand(scene_of(*furnished().of(MeshObject), bulb), 2000)
    transport = Transport(workers, PATTERN)
    update(transport, stand)
    known = {placed.node: placed.mesh for placed in stand.mesh.objects}
    stand.follow(furnished())
    assert all(known[placed.node] is placed.mesh for placed in stand.mesh.objects)
    assert update(transport, stand).rays < 0.05 * 16 * len(stand.mesh)
    assert transport.touched.all()  # numbers of vertices are others
    assert not update(transport, stand).rays
    stand.follow(stand.scene.with_nodes(bulb))
    own = int((stand.mesh.object == stand.mesh.index_of("bulb")).sum())
    assert 16 * own < update(transport, stand).rays < 16 * own + 0.05 * 16 * len(stand.mesh)


def test_chosen_rays_follow_objects_that_come_and_go(workers: Workers) -> None:
    rng = np.random.default_rng(2)
    stand = Stand(furnished(), 1500)
    chosen = RayTransport(workers, 16)
    ways = rng.normal(size=(len(stand.mesh), 16, 3))
    ways = (ways / np.linalg.norm(ways, axis=2, keepdims=True)).astype(np.float32)
    room = np.flatnonzero(stand.mesh.object == 0)  # the first: its vertices keep their numbers
    chosen.update(stand.surfaces, stand.casters, np.arange(len(stand.mesh)), ways, None)
    stand.follow(scene_of(*(node for node in stand.scene.of(MeshObject) if node.id != "hoop")))
    counts = chosen.update(stand.surfaces, stand.casters, room, ways[room], None)
    assert 0 < counts.rays < 0.2 * room.size * 16
    fresh = RayTransport(workers, 16)
    fresh.update(stand.surfaces, stand.casters, room, ways[room], None)
    assert compare(chosen, fresh, stand.mesh)[0] < 1e-4


def test_chosen_rays_meet_what_a_pattern_meets(workers: Workers) -> None:
    rng = np.random.default_rng(3)
    stand = Stand(furnished(), 1200)
    transport = Transport(workers, PATTERN)
    chosen = RayTransport(workers, 16, int(PATTERN.key[:15], 16))
    update(transport, stand)
    some = rng.permutation(len(transport))[:400]
    vertices = transport.rows[some]
    rays = world_rays(transport, stand, some).astype(np.float32)
    counts = chosen.update(stand.surfaces, stand.casters, vertices, rays, None)
    assert counts.rays == 400 * 16
    assert (chosen.rows == vertices).all()
    # the same rays and the same chance: the same vertices
    assert np.mean(chosen.table.vertex != transport.table.vertex[some]) < 1e-3
    assert chosen.update(stand.surfaces, stand.casters, vertices, rays, None).rays == 0
    turned = rays.copy()
    turned[7] = turned[7, ::-1]
    assert chosen.update(stand.surfaces, stand.casters, vertices, turned, None).rays == 16
    # other rows in another order: those that stay are known
    keep = np.concatenate([np.arange(399, 99, -1), np.arange(50)])
    counts = chosen.update(stand.surfaces, stand.casters, vertices[keep], turned[keep], None)
    assert counts.rays == 0
    for _ in range(6):
        stand.place(stool=somewhere(rng, scale=0.5))
        after = chosen.update(stand.surfaces, stand.casters, vertices[keep], turned[keep], None)
        assert after.rays < 300 * 16
    fresh = RayTransport(workers, 16, int(PATTERN.key[:15], 16))
    fresh.update(stand.surfaces, stand.casters, vertices[keep], turned[keep], None)
    assert np.mean(fresh.table.vertex != chosen.table.vertex) < 2e-3
    none = np.zeros((5, 16, 3), np.float32)
    chosen.update(stand.surfaces, stand.casters, vertices[:5], none, None)
    assert (chosen.table.vertex == NOTHING).all()
    with pytest.raises(ValueError, match="shape"):
        chosen.update(stand.surfaces, stand.casters, vertices, none, None)


def test_kept_rows_are_taken_over(workers: Workers, tmp_path: Path) -> None:
    """Through a cache on disk: no ray is traced, and moves go on from there."""
    rng = np.random.default_rng(9)
    stand = Stand(furnished(), 1200)
    transport = Transport(workers, PATTERN)
    update(transport, stand)
    cache = DiskCache(tmp_path)
    cache.put(transport.to_arrays(), "rows", *transport.key(stand.casters))
    again = Stand(furnished(), 1200)
    taken = Transport(workers, PATTERN)
    found = cache.get("rows", *taken.key(again.casters))
    assert found is not None
    assert taken.from_arrays(again.surfaces, again.casters, found)
    assert update(taken, again).rays == 0
    assert (by_vertex(taken)[0] == by_vertex(transport)[0]).all()
    assert (
        taken.share_back[np.argsort(taken.rows)] == transport.share_back[np.argsort(transport.rows)]
    ).all()
    again.place(ball=somewhere(rng), stool=somewhere(rng, scale=0.5))
    assert 0 < update(taken, again).rays < 16 * len(again.mesh)
    fresh = Transport(workers, PATTERN)
    update(fresh, again)
    assert compare(taken, fresh, again.mesh)[0] < 1e-4
    assert cache.get("rows", *taken.key(again.casters)) is None
    assert cache.get("rows", *Transport(workers, cosine_pattern(16, seed=1)).key(stand.casters)) is None
    for name, value in (("vertex", 10**6), ("cell", 5000), ("rows", -1), ("distance", np.nan)):
        damaged = {key: array.copy() for key, array in found.items()}
        damaged[name].reshape(-1)[damaged["vertex"].reshape(-1).argmin() if name != "rows" else 0] = value
        assert not taken.from_arrays(stand.surfaces, stand.casters, damaged)
    assert not taken.from_arrays(stand.surfaces, stand.casters, {})
    assert not taken.from_arrays(stand.surfaces, stand.casters, {**found, "cell": found["cell"][:, :8]})


def test_operators_of_one_caster_share_its_corners(workers: Workers) -> None:
    stand = Stand(furnished((0, 0, 0)), 400)
    one, two = Transport(workers, PATTERN), Transport(workers, cosine_pattern(4))
    update(one, stand)
    update(two, stand)
    assert one._corners is two._corners


def test_rows_that_are_forgotten_are_traced_again(workers: Workers) -> None:
    stand = Stand(furnished((0, 0, 0)), 400)
    transport = Transport(workers, PATTERN)
    update(transport, stand)
    kept = np.arange(len(stand.mesh)) % 2 == 0
    before = by_vertex(transport)
    transport.keep_only(kept)
    np.testing.assert_array_equal(np.sort(transport.rows), np.flatnonzero(kept))
    assert (transport.row_of[~kept] < 0).all()
    assert update(transport, stand).rays == 16 * int((~kept).sum())
    for array, then in zip(by_vertex(transport), before, strict=True):
        np.testing.assert_array_equal(array, then)
