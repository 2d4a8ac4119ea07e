"""What the store of visibility keeps over moves, edits and cancelled work is what tracing afresh gives."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from counting_stages import StoppingJob
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from oracles import cuts as oracle
from scenes import cube

from studio_core.errors import Cancelled
from studio_core.scene.shading_mesh import refine
from studio_core.scene.transform import Transform, axis_angle
from studio_plugins.cuts import records as pools
from studio_plugins.cuts import shelf
from studio_plugins.cuts import store as module
from studio_plugins.cuts.records import Records
from studio_plugins.cuts.store import VisibilityStore

K = 10
FEW = settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture])


LEAVES = 40  # so fine a preview traces leaf by leaf


class Bench:
    """A store that follows a room."""

    def __init__(self, room, workers, job, k=K):
        self.store = VisibilityStore(k, workers)
        self.workers, self.job = workers, job
        self.follow(room)

    def follow(self, room):
        self.room = room
        self.store.follow(room.surfaces, room.occluders)
        return self

    def traced(self, points=None, job=None):
        self.store.trace(self.room.everything if points is None else points, job or self.job)
        return self

    @property
    def rays(self):
        return int(self.store.counts[0])


@pytest.fixture
def bench(kit, workers, job):
    return Bench(kit.room, workers, job).traced()


@pytest.fixture
def fresh(kit, workers, job):
    """Blocked leaves by vertex and slot, traced by a store that knows nothing."""
    return lambda room: kit.seen_by(Bench(room, workers, job).traced().store)


def assert_fresh(bench, fresh, kit):
    np.testing.assert_array_equal(kit.seen_by(bench.store), fresh(bench.room))


MOVES = [
    {"box": Transform((0.75, 0.25, 0.5))},
    {"box": Transform((0.5, 0.25, 0.25), axis_angle((0, 1, 0), 30))},
    {"twin": Transform((-0.75, 0.5, 0.0), axis_angle((0.3, 1.0, -0.2), 37.0), 1.5)},
    {"soup": Transform((-0.5, 0.75, 0.125))},
    {"sheet": Transform((0.25, 0.5, 0.25), axis_angle((0, 1, 0), 20.0), 0.8)},
    {"box": Transform((0.0, 0.25, 0.0)), "soup": Transform((-0.25, 0.75, -1.0))},
    {"floor": Transform((0.0, -0.5, 0.0))},
]


@pytest.mark.parametrize("places", MOVES)
def test_moved_objects_traced_again_are_as_traced_afresh(bench, fresh, kit, places):
    rays = bench.rays
    bench.follow(kit.room.placed(**places)).traced()
    assert_fresh(bench, fresh, kit)
    assert 0 < bench.rays - rays < rays


@FEW
@given(st.lists(st.sampled_from(range(len(MOVES))), min_size=2, max_size=4))
def test_any_sequence_of_moves(kit, workers, job, fresh, moves):
    bench = Bench(kit.room, workers, job).traced()
    for number in moves:
        bench.follow(bench.room.placed(**MOVES[number]))
        rng = np.random.default_rng(number)
        bench.traced(bench.room.everything[rng.random(len(bench.room.mesh)) < 0.6])
    bench.traced()
    assert_fresh(bench, fresh, kit)


def test_moving_back_costs_no_rays_where_nobody_looked(bench, fresh, kit):
    rays, stamps = bench.rays, bench.store.exact.stamp.copy()
    bench.follow(kit.room.placed(**MOVES[0])).follow(kit.room).traced()
    assert bench.rays == rays
    np.testing.assert_array_equal(bench.store.exact.stamp, stamps)
    assert_fresh(bench, fresh, kit)


def test_furniture_moved_together_is_not_traced_against_itself(bench, kit, fresh):
    by = Transform((0.25, 0.0, 0.125))
    pair = {n: by @ kit.room.things[n].transform for n in ("box", "soup")}
    moved = kit.room.placed(**pair)
    objects = int(bench.store.counts[4])
    bench.follow(moved).traced()
    alone = sum(np.diff(moved.mesh.vertex_offsets)[i] for i in (1, 3))
    others = len(moved.mesh) - alone
    assert int(bench.store.counts[4]) - objects == alone * 3 + others * 2
    assert_fresh(bench, fresh, kit)


def test_only_vertices_whose_view_changed_get_a_new_stamp(bench, kit):
    before, stamps = kit.seen_by(bench.store), bench.store.exact.stamp.copy()
    bench.follow(kit.room.placed(**MOVES[0])).traced()
    same = (kit.seen_by(bench.store) == before).all(axis=1)
    assert same.any()
    other = bench.store.exact.stamp != stamps
    assert other[~same].all()
    assert other.mean() < 0.9


def test_a_cancelled_trace_goes_on_where_it_was(kit, workers, job, fresh, monkeypatch):
    monkeypatch.setattr(module, "BATCH", 64)
    whole = Bench(kit.room, workers, job).traced().rays
    bench = Bench(kit.room, workers, job)
    with pytest.raises(Cancelled):
        bench.traced(job=StoppingJob(12))
    known, all_of_them = bench.store.known, len(kit.room.mesh)
    assert 0 < known < all_of_them
    bench.traced()
    assert bench.rays == whole
    assert_fresh(bench, fresh, kit)


@FEW
@given(st.integers(1, 40), st.integers(0, len(MOVES) - 1), st.integers(0, len(MOVES) - 1))
def test_cancelled_anywhere_and_moved_elsewhere(kit, workers, job, fresh, at, first, second):
    bench = Bench(kit.room, workers, job).traced()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "BATCH", 64)
        bench.follow(kit.room.placed(**MOVES[first]))
        try:
            bench.traced(job=StoppingJob(at))
        except Cancelled:
            known, whole = bench.store.known, len(bench.room.mesh)
            assert known < whole
        bench.follow(kit.room.placed(**MOVES[second])).traced()
    assert_fresh(bench, fresh, kit)


def test_objects_come_go_and_come_back(bench, kit, fresh):
    room = kit.room
    numbers = bench.store.generation
    bench.follow(room.without("box"))
    assert bench.store.generation == numbers + 1
    assert not len(bench.store.unknown(bench.room.everything))
    assert_fresh(bench, fresh, kit)
    bench.follow(room).traced()
    assert_fresh(bench, fresh, kit)
    more = room.with_thing("third", kit.Thing(cube(0.3), Transform((0.0, 0.75, 0.5))))
    bench.follow(more).traced()
    assert_fresh(bench, fresh, kit)
    bench.follow(more.without("soup").without("third")).traced()
    assert_fresh(bench, fresh, kit)


def test_what_is_gone_or_back_changes_the_stamps(bench, kit):
    """Light is summed anew by stamps: also where an object comes back, but not where it hides nothing."""
    room = kit.room
    first, seen = bench.store.sources().stamp, kit.seen_by(bench.store)
    bench.follow(room.without("box")).traced()
    gone = bench.store.sources().stamp
    kept = bench.store.gone_to
    was, now = np.flatnonzero(kept >= 0), kept[kept >= 0]
    other = (kit.seen_by(bench.store)[now] != seen[was]).any(axis=1)
    assert 0 < other.mean() < 1
    assert (gone[now] != first[was])[other].all()
    assert (gone[now] == first[was]).sum() > 0
    bench.follow(room).traced()
    back = bench.store.sources().stamp
    assert (back[bench.store.gone_to[now]] != gone[now])[other].all()
    assert (back[bench.store.gone_to[now]] == gone[now]).sum() > 0


def test_an_undo_of_removing_or_adding_costs_no_ray(bench, kit, fresh):
    room = kit.room
    for other in (room.without("box"), room.without("floor"), room.without("soup").without("box")):
        rays = bench.rays
        bench.follow(other).traced()
        bench.follow(room).traced()
        assert bench.rays == rays
        assert_fresh(bench, fresh, kit)
    more = room.with_thing("third", kit.Thing(cube(0.3), Transform((0.0, 0.75, 0.5))))
    bench.follow(more).traced()
    rays = bench.rays
    bench.follow(room).follow(more).traced()
    assert bench.rays == rays
    assert_fresh(bench, fresh, kit)


def test_an_undo_of_finer_meshes_costs_no_ray(bench, kit, fresh):
    rays = bench.rays
    finer = kit.make(dict(kit.room.things), edge=0.3)
    bench.follow(finer).traced()
    assert bench.rays > rays
    rays = bench.rays
    bench.follow(kit.room).traced()
    assert bench.rays == rays
    assert_fresh(bench, fresh, kit)


def test_what_was_traced_meanwhile_does_not_know_what_comes_back(bench, kit, fresh):
    """Some vertices are traced while an object is away and stands elsewhere when it is back, some not."""
    room = kit.room
    away = room.without("box").placed(**MOVES[3])
    bench.follow(away).traced(away.everything[::2])
    bench.follow(room).traced(room.everything[::3])
    bench.follow(room.placed(**MOVES[0])).traced(room.everything[::5])
    bench.follow(room.without("box"))
    bench.follow(room).traced()
    assert_fresh(bench, fresh, kit)


@FEW
@given(st.lists(st.tuples(st.sampled_from(["box", "twin", "soup", "sheet"]), st.integers(0, 5)), max_size=6))
def test_any_sequence_of_coming_and_going(kit, workers, job, fresh, steps):
    bench = Bench(kit.room, workers, job).traced()
    gone = {}
    for name, share in steps:
        if name in gone:
            room = bench.room.with_thing(name, gone.pop(name))
        else:
            gone[name] = bench.room.things[name]
            room = bench.room.without(name)
        if share == 5 and "twin" not in gone:
            room = room.placed(**MOVES[2])
        bench.follow(room)
        bench.traced(room.everything[np.random.default_rng(share).random(len(room.mesh)) < share / 5])
    bench.traced()
    assert_fresh(bench, fresh, kit)


def test_the_shelf_is_as_long_as_it_is(bench, kit, monkeypatch):
    monkeypatch.setattr(shelf, "MOST", 1)
    rays = bench.rays
    bench.follow(kit.room.without("box")).follow(kit.room.without("twin")).follow(kit.room).traced()
    assert bench.rays > rays  # the box' own vertices were put by, but the twin's are later ones


@pytest.mark.parametrize("seed", range(4))
def test_damaged_records_are_refused_or_can_be_read(bench, kit, workers, job, seed):
    """Nothing that comes from a disk leads out of an array."""
    rng = np.random.default_rng(seed)
    everything = kit.room.everything
    pool, length = bench.store.packed(everything)
    other = Bench(kit.room, workers, job)
    assert other.store.unpack(everything, pool, length)
    for place, value in ((0, 5), (0, 65535), (1, 65535), (1, 0), (3, 1 << K), (len(pool) - 1, 65535)):
        bad = pool.copy()
        bad[place] = value
        assert not Bench(kit.room, workers, job).store.unpack(everything, bad, length)
    assert not other.store.unpack(everything, pool, length.astype(np.float64))
    assert not other.store.unpack(everything, pool.reshape(1, -1), length)
    wrong = length.copy()
    wrong[0], wrong[1] = wrong[0] + wrong[1] + 2, -2
    assert not other.store.unpack(everything, pool, wrong)
    for _ in range(20):
        bad = pool.copy()
        bad[rng.integers(0, len(pool), 3)] = rng.integers(0, 1 << 10, 3)
        one = Bench(kit.room, workers, job).store
        if one.unpack(everything, bad, length):
            assert kit.seen_by(one).shape == (len(everything), 1 << K)


def test_gone_and_back_while_others_move(bench, kit, fresh):
    room = kit.room
    bench.follow(room.without("box")).traced()
    bench.follow(room.without("box").placed(**MOVES[3])).traced()
    bench.follow(room.placed(**MOVES[3])).traced()
    assert_fresh(bench, fresh, kit)
    bench.follow(room).traced()
    assert_fresh(bench, fresh, kit)


def test_an_object_replaced_by_another_of_its_name(bench, kit, fresh):
    for thing in (
        kit.Thing(cube(0.25), kit.room.things["box"].transform),
        dataclasses.replace(kit.room.things["box"], opaque=False),
        kit.room.things["box"],
    ):
        bench.follow(kit.room.with_thing("box", thing)).traced()
        assert_fresh(bench, fresh, kit)


def test_objects_in_another_order(bench, kit, fresh):
    rays = bench.rays
    names = list(kit.room.things)
    other = kit.room.with_things({name: kit.room.things[name] for name in reversed(names)})
    bench.follow(other).traced()
    assert bench.rays == rays
    assert_fresh(bench, fresh, kit)


def test_refined_meshes_keep_their_rows(bench, kit, fresh):
    room = kit.room
    coarse = room.mesh.objects[0].mesh
    finer = refine(coarse, faces=np.arange(4))
    assert len(finer) > len(coarse)
    mesh = room.mesh.with_mesh(0, finer)
    refined = dataclasses.replace(room, surfaces=dataclasses.replace(room.surfaces, mesh=mesh))
    bench.follow(refined)
    unknown = bench.store.unknown(refined.everything)
    np.testing.assert_array_equal(unknown, np.arange(len(coarse), len(finer)))
    bench.traced()
    assert_fresh(bench, fresh, kit)
    rays = bench.rays
    bench.follow(room).traced()
    assert bench.rays == rays
    assert_fresh(bench, fresh, kit)


def test_previews_stand_in_until_exact_records_come(bench, kit, fresh, workers, job):
    moved = kit.room.placed(**MOVES[5])
    truth = fresh(moved)
    fine = Bench(kit.room, workers, job, 12).traced()
    fine.follow(moved)
    still = kit.seen_by(fine.store)
    fine.store.preview(moved.everything, 7, job)
    sources = fine.store.sources()
    assert (sources.row > 0).any()
    preview = kit.seen_by(fine.store)
    exact = kit.seen_by(Bench(moved, workers, job, 12).traced().store)
    assert (preview != exact).mean() < 0.2 * (still != exact).mean()
    fine.traced()
    assert not fine.store.sources().row.any()
    np.testing.assert_array_equal(kit.seen_by(fine.store), exact)
    assert truth.shape == (len(exact), 1 << K)


def test_the_finest_preview_sees_what_exact_records_do(kit, workers, job):
    bench = Bench(kit.room, workers, job).traced()
    for move in MOVES:
        moved = kit.room.placed(**move)
        bench.follow(moved).store.preview(moved.everything, LEAVES, job)
        exact = kit.seen_by(Bench(moved, workers, job).traced().store)
        np.testing.assert_array_equal(kit.seen_by(bench.store), exact)


def test_after_an_exact_record_no_coarse_one_is_made(bench, kit, job):
    moved = kit.room.placed(**MOVES[0])
    some = kit.room.everything[::2]
    bench.follow(moved).traced(some)
    exact = kit.seen_by(bench.store)[some]
    bench.store.preview(moved.everything, K, job)
    np.testing.assert_array_equal(kit.seen_by(bench.store)[some], exact)
    assert not bench.store.sources().row[some].any()
    rays = bench.rays
    bench.store.preview(moved.everything, K, job)
    assert bench.rays == rays


def test_coarser_and_finer_previews_of_one_place(kit, workers, job):
    bench = Bench(kit.room, workers, job)
    bench.store.preview(kit.room.everything[::2], 3, job)
    bench.store.preview(kit.room.everything, LEAVES, job)
    exact = Bench(kit.room, workers, job).traced()
    np.testing.assert_array_equal(kit.seen_by(bench.store), kit.seen_by(exact.store))
    assert not bench.store.unseen(kit.room.everything)


def test_hidden_vertices_are_traced_when_they_are_asked_for(kit, workers, job, fresh):
    bench = Bench(kit.room, workers, job)
    some = kit.room.everything[::3]
    assert bench.store.unseen(some)
    bench.traced(some)
    assert bench.store.known == len(some)
    assert not bench.store.unseen(some)
    found = kit.seen_by(bench.store)
    assert not found[np.setdiff1d(kit.room.everything, some)].any()
    bench.follow(kit.room.placed(**MOVES[4])).traced()
    assert_fresh(bench, fresh, kit)


def test_the_pool_is_tidied_and_means_the_same(bench, kit, fresh, monkeypatch):
    monkeypatch.setattr(pools, "LEAST_GARBAGE", 0)
    for number in range(8):
        bench.follow(kit.room.placed(**MOVES[number % len(MOVES)])).traced()
    exact = bench.store.exact
    live = int(exact.length.sum())
    assert exact.used <= 2 * live
    bench.follow(kit.room).traced()
    assert_fresh(bench, fresh, kit)


@given(st.data())
def test_records_are_kept_through_writing_tidying_and_renumbering(data):
    table, known, count = Records(K, 12), {}, 12
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pools, "LEAST_GARBAGE", 0)
        for stamp in range(data.draw(st.integers(1, 6))):
            points = np.array(sorted(data.draw(st.sets(st.integers(0, count - 1)))), np.int64)
            new = [data.draw(st.lists(st.integers(0, 1023), max_size=5)) for _ in points]
            cut = data.draw(st.integers(0, len(new)))
            halves = (new[:cut], new[cut:])
            pieces = [np.array([n for own in half for n in own], np.uint16) for half in halves]
            table.write(points, pieces, np.array([len(own) for own in new], np.int32), stamp)
            known.update(zip(points.tolist(), new, strict=True))
            table.tidy()
            if data.draw(st.booleans()):
                to = np.array(data.draw(st.permutations(range(count))), np.int64)
                to[np.array(sorted(data.draw(st.sets(st.integers(0, count - 1), max_size=3))), np.int64)] = -1
                table.renumber(count, to)
                known = {int(to[p]): own for p, own in known.items() if to[p] >= 0}
    for p in range(count):
        assert table.pool[table.start[p] : table.start[p] + table.length[p]].tolist() == known.get(p, [])
    assert table.nbytes >= 2 * sum(map(len, known.values()))


def test_packed_records_are_taken_over_by_another_store(bench, kit, workers, job, fresh):
    room = kit.room
    bench.follow(room.without("box")).traced()  # the box is a slot that is no more
    here = bench.room
    pool, length = bench.store.packed(here.everything)
    other = Bench(here, workers, job)
    assert other.store.unpack(here.everything, pool, length)
    assert other.store.known == len(here.mesh)
    assert_fresh(other, fresh, kit)
    assert other.rays == 0
    assert not other.store.unpack(here.everything, pool[:-1], length)
    assert not other.store.unpack(here.everything[1:], pool, length)
    bench.follow(room.placed(**MOVES[0]))
    with pytest.raises(ValueError, match="not known"):
        bench.store.packed(room.everything)


def test_every_record_is_well_formed(bench, kit):
    slots = set(range(len(kit.room.things)))
    for record in kit.records(bench.store):
        found = oracle.segments(record)
        assert set(found) <= slots
        for pairs in found.values():
            flat = [leaf for pair in pairs for leaf in pair]
            assert flat == sorted(flat)
            assert all(b - a > 1 for a, b in zip(flat[1::2], flat[2::2], strict=False))


def test_past_what_is_out_of_date_everything_else_is_seen(bench, kit, workers, job):
    moved = kit.room.placed(**MOVES[0])
    bench.follow(moved)
    sources = bench.store.standing()
    without = Bench(kit.room.without("box"), workers, job).traced()
    expected = kit.seen_by(without.store)
    others = np.flatnonzero(moved.mesh.object != 1)
    for p, free in zip(others, expected, strict=True):
        record = sources.pool[sources.start[p] : sources.start[p] + sources.length[p]]
        skip = np.flatnonzero(sources.skip[sources.row[p], sources.owner[p]])
        np.testing.assert_array_equal(oracle.seen(record, 1 << K, skip), free)
    assert not sources.coarse_length.any()
