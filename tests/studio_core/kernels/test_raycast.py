"""Both tracers against every-ray-every-triangle, on scenes with instances, odd geometry and odd rays."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from oracles.raycast import nearest

from studio_core.errors import InputError
from studio_core.kernels.packets import EVERYTHING, OPAQUE
from studio_core.kernels.ray_batches import occluded_chunk
from studio_core.kernels.raycast import CasterObject, RayCaster
from studio_core.parallel import Workers

BACKENDS = ["embree", "bvh"]
CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
CUBE_FACES = np.array(
    [
        [0, 1, 3],
        [0, 3, 2],
        [4, 6, 7],
        [4, 7, 5],
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
        [1, 5, 7],
        [1, 7, 3],
    ],
    np.uint32,
)


@pytest.fixture(scope="module", params=BACKENDS)
def backend(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def workers() -> Iterator[Workers]:
    with Workers(2) as made:
        yield made


def place(shift: npt.ArrayLike = (0, 0, 0), linear: npt.ArrayLike | None = None) -> npt.NDArray[np.float64]:
    transform = np.eye(4)
    transform[:3, :3] = np.eye(3) if linear is None else linear
    transform[:3, 3] = shift
    return transform


def turned(rng: np.random.Generator, scale: float = 1.0) -> npt.NDArray[np.float64]:
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return np.asarray(q * scale)


def soup(rng: np.random.Generator, count: int) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.uint32]]:
    centres = rng.uniform(-1, 1, (count, 1, 3))
    corners = centres + rng.normal(scale=0.4, size=(count, 3, 3))
    return corners.reshape(-1, 3).astype(np.float32), np.arange(3 * count, dtype=np.uint32).reshape(-1, 3)


def random_scene(
    rng: np.random.Generator, offset: npt.ArrayLike = 0.0, size: float = 1.0
) -> list[CasterObject]:
    """Two meshes in six placements, turned, stretched and mirrored."""
    meshes = [soup(rng, 20), (CUBE, CUBE_FACES)]
    objects = []
    for number in range(6):
        positions, faces = meshes[number % 2]
        linear = turned(rng) @ np.diag(rng.uniform(0.3, 1.2, 3)) * size
        shift = rng.uniform(-3, 3, 3) * size + np.asarray(offset)
        objects.append(CasterObject(positions, faces, f"mesh{number % 2}", place(shift, linear)))
    return objects


def random_rays(
    rng: np.random.Generator, count: int, offset: npt.ArrayLike = 0.0, size: float = 1.0
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    origins = rng.uniform(-4, 4, (count, 3)) * size + np.asarray(offset)
    aims = rng.uniform(-3, 3, (count, 3)) * size + np.asarray(offset)
    return origins, (aims - origins) / size


Placed = tuple[npt.NDArray[np.float64], npt.NDArray[np.uint32], npt.NDArray[np.float64]]


def plain(objects: list[CasterObject]) -> list[Placed]:
    return [(item.positions.astype(np.float64), item.faces, item.transform) for item in objects]


@pytest.mark.parametrize("seed", range(3))
def test_first_hits_agree_with_brute_force(backend: str, workers: Workers, seed: int) -> None:
    rng = np.random.default_rng(seed)
    objects = random_scene(rng)
    origins, directions = random_rays(rng, 1500)
    expected = nearest(plain(objects), origins, directions)
    clear = expected.margin > 1e-4
    with RayCaster(objects, backend) as caster:
        hits = caster.closest(origins, directions, 0.0, np.inf, workers)
        blocked = caster.occluded(origins, directions, np.inf, workers)
        assert caster.rays == 3000
    assert clear.sum() > 500
    assert 0.2 < (expected.face >= 0).mean() < 0.95
    np.testing.assert_array_equal(hits.object[clear], expected.object[clear])
    np.testing.assert_array_equal(hits.face[clear], expected.face[clear])
    np.testing.assert_array_equal(blocked, hits.face >= 0)
    hit = clear & (expected.face >= 0)
    assert np.isinf(hits.t[~hit & clear]).all()
    np.testing.assert_allclose(hits.t[hit], expected.t[hit], rtol=2e-4, atol=2e-4)
    np.testing.assert_allclose(hits.u[hit], expected.u[hit], atol=5e-3)
    np.testing.assert_allclose(hits.v[hit], expected.v[hit], atol=5e-3)
    np.testing.assert_allclose(hits.normal[hit], expected.normal[hit], atol=1e-4)
    facing = np.einsum("ij,ij->i", expected.normal, directions)
    np.testing.assert_array_equal(hits.front[hit], facing[hit] < 0)
    assert not hits.front[~hit & clear].any()


def test_distances_bound_the_ray(backend: str, workers: Workers) -> None:
    wall = CasterObject(CUBE, CUBE_FACES, "cube", place((5, 0, 0)))
    origin, direction = np.tile([0.0, 0.1, 0.2], (3, 1)), np.tile([2.0, 0, 0], (3, 1))
    with RayCaster([wall], backend) as caster:
        far = np.array([1.99, 2.01, -1.0])
        np.testing.assert_array_equal(caster.occluded(origin, direction, far, workers), [False, True, False])
        first = caster.closest(origin, direction, 0.0, np.inf, workers)
        np.testing.assert_allclose(first.t, 2.0, rtol=1e-6)
        behind = caster.closest(origin, direction, 2.5, np.inf, workers)
        np.testing.assert_allclose(behind.t, 3.0, rtol=1e-6)
        assert first.front.all()
        assert not behind.front.any()


def test_moving_equals_building_anew(backend: str, workers: Workers) -> None:
    rng = np.random.default_rng(5)
    objects = random_scene(rng)
    origins, directions = random_rays(rng, 800)
    elsewhere = place((0.5, 0.2, 0), turned(rng))
    moved = [*objects]
    moved[2] = CasterObject(objects[2].positions, objects[2].faces, "mesh0", elsewhere)
    with RayCaster(objects, backend) as caster, RayCaster(moved, backend) as fresh:
        before = caster.closest(origins, directions, 0.0, np.inf, workers)
        scene = caster.handles().scene
        caster.move(2, moved[2].transform)
        assert caster.handles().scene == scene
        after = caster.closest(origins, directions, 0.0, np.inf, workers)
        anew = fresh.closest(origins, directions, 0.0, np.inf, workers)
        assert (before.object != after.object).any()
        assert (after.face != anew.face).mean() < 0.005  # centres differ: rays at edges may
        same = after.face == anew.face
        np.testing.assert_allclose(after.normal[same], anew.normal[same], atol=1e-5)
        caster.move(2, objects[2].transform)
        np.testing.assert_array_equal(caster.closest(origins, directions, 0.0, np.inf, workers).t, before.t)


def test_faces_that_let_light_through(backend: str, workers: Workers) -> None:
    opaque = np.arange(12) >= 6
    box = CasterObject(CUBE, CUBE_FACES, "cube", place(), opaque)
    rng = np.random.default_rng(2)
    origins, directions = np.zeros((600, 3)), rng.normal(size=(600, 3))
    expected = nearest(plain([box]), origins, directions)
    clear = expected.margin > 1e-3
    with RayCaster([box], backend) as caster:
        seen = caster.closest(origins, directions, 0.0, np.inf, workers)
        solid = caster.closest(origins, directions, 0.0, np.inf, workers, mask=OPAQUE)
        blocked = caster.occluded(origins, directions, np.inf, workers)
        any_face = caster.occluded(origins, directions, np.inf, workers, mask=EVERYTHING)
    np.testing.assert_array_equal(seen.face[clear], expected.face[clear])
    np.testing.assert_array_equal(blocked[clear], opaque[expected.face][clear])
    np.testing.assert_array_equal(
        solid.face[clear], np.where(opaque[expected.face], expected.face, -1)[clear]
    )
    assert any_face.all()


def test_one_and_two_threads_give_the_same_bits(backend: str) -> None:
    rng = np.random.default_rng(3)
    objects = random_scene(rng)
    origins, directions = random_rays(rng, 10_001)
    with RayCaster(objects, backend) as caster, Workers(1) as one, Workers(2) as two:
        a = caster.closest(origins, directions, 0.0, np.inf, one)
        b = caster.closest(origins, directions, 0.0, np.inf, two)
        for name in ("t", "object", "face", "u", "v", "normal", "front"):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
        np.testing.assert_array_equal(
            caster.occluded(origins, directions, 3.0, one), caster.occluded(origins, directions, 3.0, two)
        )


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e2])
@pytest.mark.parametrize("offset", [0.0, 1e4])
def test_large_and_small_coordinates(backend: str, workers: Workers, size: float, offset: float) -> None:
    rng = np.random.default_rng(7)
    shift = np.array([offset, -offset / 2, offset / 3])
    objects = random_scene(rng, shift, size)
    origins, directions = random_rays(rng, 800, shift, size)
    expected = nearest(plain(objects), origins, directions)
    clear = expected.margin > 1e-3
    with RayCaster(objects, backend) as caster:
        hits = caster.closest(origins, directions, 0.0, np.inf, workers)
        assert caster.epsilon < 1e-4 * size
    np.testing.assert_array_equal(hits.face[clear], expected.face[clear])
    hit = clear & (expected.face >= 0)
    np.testing.assert_allclose(hits.t[hit] / size, expected.t[hit] / size, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize("extent", [1e-3, 1.0, 1e4])
def test_lifted_origins_do_not_meet_their_own_surface(backend: str, workers: Workers, extent: float) -> None:
    """Points on a turned floor, lifted by epsilon: no direction above the floor is blocked."""
    rng = np.random.default_rng(11)
    corners = np.array([[-1, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]], np.float32) * extent
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    floor = CasterObject(corners, faces, "floor", place(np.array([0.3, 0.1, 0.7]) * extent, turned(rng)))
    weights = rng.dirichlet([1, 1, 1], 4000)
    placed = corners.astype(np.float64) @ floor.transform[:3, :3].T + floor.transform[:3, 3]
    points = np.einsum("ij,jk->ik", weights, placed[faces[0]])
    normal = np.cross(placed[1] - placed[0], placed[2] - placed[0])
    normal /= np.linalg.norm(normal)
    directions = rng.normal(size=(4000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions *= np.sign(directions @ normal)[:, None]
    with RayCaster([floor], backend) as caster:
        lifted = points + caster.epsilon * normal
        assert not caster.occluded(lifted, directions, np.inf, workers).any()
        assert (
            caster.occluded(lifted, -directions, np.inf, workers)[np.abs(directions @ normal) > 0.05].mean()
            > 0.9
        )


def test_a_closed_box_does_not_leak(backend: str, workers: Workers) -> None:
    """Rays from vertices and edges, moved towards the adjacent faces' middles, all meet the box."""
    rng = np.random.default_rng(4)
    transform = place((2.0, -1.0, 0.5), turned(rng, 3.0))
    box = CasterObject(CUBE, CUBE_FACES, "box", transform)
    placed = CUBE @ transform[:3, :3].T + transform[:3, 3]
    points, inwards = [], []
    for corners in CUBE_FACES:
        a, b, c = placed[corners]
        middle = (a + b + c) / 3
        inward = transform[:3, 3] - middle
        normal = np.cross(b - a, c - a)
        normal *= np.sign(normal @ inward) / np.linalg.norm(normal)
        for start in (a, b, c, (a + b) / 2, (b + c) / 2, (c + a) / 2):
            points.append(start + 1e-4 * (middle - start))
            inwards.append(normal)
    with RayCaster([box], backend) as caster:
        lifted = np.repeat(np.array(points) + caster.epsilon * np.array(inwards), 200, axis=0)
        directions = rng.normal(size=lifted.shape)
        directions *= np.sign(np.einsum("ij,ij->i", directions, np.repeat(inwards, 200, axis=0)))[:, None]
        assert caster.occluded(lifted, directions, np.inf, workers).all()
        edges = np.repeat(placed[[0, 1, 3, 2, 6, 7]] + placed[[1, 3, 2, 6, 7, 5]], 400, axis=0) / 2
        aimed = np.repeat(edges[::400], 400, axis=0) - transform[:3, 3]
        from_middle = np.broadcast_to(transform[:3, 3], aimed.shape)
        assert caster.occluded(from_middle, aimed, np.inf, workers).all()


def test_rays_that_are_not_finite_are_free(backend: str, workers: Workers) -> None:
    box = CasterObject(CUBE, CUBE_FACES, "box", place())
    origins = np.zeros((9, 3))
    directions = np.tile([0.3, 0.4, 1.0], (9, 1))
    far = np.full(9, np.inf)
    origins[0, 0], origins[1, 2] = np.nan, np.inf
    directions[2, 1], directions[3, 0] = np.nan, -np.inf
    directions[4] = 0.0
    far[5] = np.nan
    origins[6] = 1e300
    with RayCaster([box], backend) as caster:
        np.testing.assert_array_equal(
            caster.occluded(origins, directions, far, workers), [False] * 7 + [True] * 2
        )
        hits = caster.closest(origins, directions, 0.0, far, workers)
        np.testing.assert_array_equal(hits.face >= 0, [False] * 7 + [True] * 2)
        assert np.isfinite(hits.normal).all()
        with pytest.raises(ValueError, match="origins and directions"):
            caster.occluded(np.zeros((2, 3)), np.zeros((3, 3)), 1.0, workers)


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        ({"positions": np.where(np.arange(24).reshape(8, 3) == 5, np.nan, CUBE)}, "not finite"),
        ({"positions": CUBE * np.float32(1e30)}, "not finite or farther"),
        ({"positions": CUBE[:, :2]}, "positions"),
        ({"positions": CUBE[:5]}, "corner"),
        ({"faces": CUBE_FACES.astype(np.int64) - 1}, "corner"),
        ({"faces": CUBE_FACES[:, :2]}, "triangles"),
        ({"faces": CUBE_FACES.astype(np.float32)}, "triangles"),
        ({"occludes": np.ones(3, bool)}, "12 faces"),
        ({"transform": place((np.nan, 0, 0))}, "finite 4×4"),
        ({"transform": np.eye(3)}, "finite 4×4"),
        ({"transform": np.eye(4)[::-1]}, "affine"),
    ],
)
def test_arrays_that_cannot_be_a_mesh_are_refused(
    backend: str, change: dict[str, object], cause: str
) -> None:
    arguments = {"positions": CUBE, "faces": CUBE_FACES, "key": "chair", "transform": np.eye(4)} | change
    with pytest.raises(InputError, match=f"'chair'.*{cause}"):
        RayCaster([CasterObject(**arguments)], backend)  # type: ignore[arg-type]


def test_equal_names_for_different_meshes_are_refused(backend: str) -> None:
    with pytest.raises(InputError, match="two different meshes are both called 'x'"):
        RayCaster(
            [
                CasterObject(CUBE, CUBE_FACES, "x", np.eye(4)),
                CasterObject(CUBE, CUBE_FACES[:3], "x", np.eye(4)),
            ],
            backend,
        )


coordinate = st.sampled_from(
    [0.0, 1.0, -1.0, 0.5, 1e-20, -1e-30, 1e-3, 100.0, 1e8, float("nan"), float("inf")]
)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    data=st.data(),
    points=st.lists(st.tuples(coordinate, coordinate, coordinate), min_size=1, max_size=6),
    scale=st.sampled_from([1.0, 0.0, 1e-12, 1e6, -2.0]),
)
def test_odd_geometry_is_dropped_or_refused(
    backend: str,
    workers: Workers,
    data: st.DataObject,
    points: list[tuple[float, float, float]],
    scale: float,
) -> None:
    corner = st.integers(0, len(points) - 1)
    faces = data.draw(st.lists(st.tuples(corner, corner, corner), max_size=6))
    positions = np.array(points, np.float32)
    item = CasterObject(
        positions, np.array(faces, np.uint32).reshape(-1, 3), "odd", place((1, 2, 3), np.eye(3) * scale)
    )
    if not np.isfinite(positions).all():
        with pytest.raises(InputError):
            RayCaster([item], backend)
        return
    rng = np.random.default_rng(0)
    with RayCaster([item, CasterObject(CUBE, CUBE_FACES, "cube", place())], backend) as caster:
        origins = np.concatenate(
            [
                positions[np.array(faces, int).reshape(-1, 3)].mean(axis=1) * scale + [1, 2, 3]
                if faces
                else np.zeros((1, 3)),
                rng.normal(size=(8, 3)),
            ]
        )
        directions = rng.normal(size=origins.shape)
        hits = caster.closest(origins, directions, 0.0, np.inf, workers)
        caster.occluded(origins, directions, np.inf, workers)
        for values in (hits.u, hits.v, hits.normal, caster.centre, caster.epsilon):
            assert np.isfinite(values).all()
        assert not np.isnan(hits.t).any()
        odd = hits.object == 0
        assert (hits.face[odd] < len(faces)).all()
        for index in hits.face[odd]:
            assert len(set(faces[index])) == 3


def test_empty_and_flat_scenes_block_nothing(backend: str, workers: Workers) -> None:
    line = np.array([[0, 0, 0], [1, 1, 1], [2, 2, 2]], np.float32)
    flat = CasterObject(line, np.array([[0, 1, 2]], np.uint32), "line", place())
    none = CasterObject(CUBE[:0], CUBE_FACES[:0], "none", place())
    crushed = CasterObject(CUBE, CUBE_FACES, "cube", place(linear=np.diag([1.0, 1.0, 0.0])))
    for objects in ([], [flat], [none], [flat, none, crushed]):
        with RayCaster(objects, backend) as caster:
            assert not caster.occluded(np.zeros((3, 3)), np.ones((3, 3)), np.inf, workers).any()
            assert len(caster) == len(objects)
    with RayCaster([crushed], backend) as caster:
        caster.move(0, place())
        assert caster.occluded(np.zeros((3, 3)), np.ones((3, 3)), np.inf, workers).all()
        caster.move(0, crushed.transform)
        assert not caster.occluded(np.zeros((3, 3)), np.ones((3, 3)), np.inf, workers).any()


def test_meshes_are_shared_and_lent(backend: str, workers: Workers, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(9)
    objects = random_scene(rng)
    first = RayCaster(objects, backend)
    assert len(first._meshes) == 2
    built: list[int] = []
    monkeypatch.setattr(first._device, "mesh", lambda *a: built.append(1))
    with RayCaster(objects[:3], previous=first) as second:
        assert not built
        first.close()
        first.close()
        for use in (
            first.handles,
            lambda: first.occluded(np.zeros((1, 3)), np.ones((1, 3)), 1.0, workers),
            lambda: first.closest(np.zeros((1, 3)), np.ones((1, 3)), 0.0, 1.0, workers),
            lambda: first.move(0, np.eye(4)),
        ):
            with pytest.raises(RuntimeError, match="closed"):
                use()
        origins, directions = random_rays(rng, 300)
        expected = nearest(plain(objects[:3]), origins, directions)
        clear = expected.margin > 1e-4
        hits = second.closest(origins, directions, 0.0, np.inf, workers)
        np.testing.assert_array_equal(hits.face[clear], expected.face[clear])


def test_thousands_of_triangles_and_many_instances(workers: Workers) -> None:
    """Both tracers on deep trees: same answers but for rays that graze an edge."""
    rng = np.random.default_rng(12)
    positions, faces = soup(rng, 3000)
    positions = (positions * 0.3 + np.repeat(rng.uniform(-1, 1, (3000, 3)), 3, axis=0)).astype(np.float32)
    objects = [
        CasterObject(positions, faces, "soup", place(rng.uniform(-6, 6, 3), turned(rng, 0.8)))
        for _ in range(60)
    ]
    origins, directions = random_rays(rng, 4000, 0.0, 2.0)
    answers = []
    for backend in BACKENDS:
        with RayCaster(objects, backend) as caster:
            answers.append(caster.closest(origins, directions, 0.0, np.inf, workers))
    same = answers[0].face == answers[1].face
    assert same.mean() > 0.998
    np.testing.assert_array_equal(answers[0].object[same], answers[1].object[same])
    hit = same & (answers[0].face >= 0)
    np.testing.assert_allclose(answers[0].t[hit], answers[1].t[hit], rtol=1e-3, atol=1e-5)
    assert 0.1 < hit.mean() < 0.9


def test_piled_up_triangles_do_not_exhaust_the_stack(backend: str, workers: Workers) -> None:
    """Coordinates halving towards a point, and thousands of equal triangles: the worst for a splitter."""
    steps = 2.0 ** -np.arange(0, 100, 0.05)
    shrinking = (CUBE[None, :3] * steps[:, None, None]).reshape(-1, 3).astype(np.float32)
    equal = np.tile(CUBE[:3], (5000, 1))
    positions = np.concatenate([shrinking, equal])
    faces = np.arange(len(positions), dtype=np.uint32).reshape(-1, 3)
    with RayCaster([CasterObject(positions, faces, "pile", place())], backend) as caster:
        hits = caster.closest([[0.0, -0.5, -0.5]], [[-1.0, 0.0, 0.0]], 0.0, np.inf, workers)
        assert hits.t[0] <= 1.0


def test_the_fallback_is_chosen_with_a_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    from studio_core.kernels import caster_mesh, embree

    def missing() -> None:
        raise embree.EmbreeUnavailableError("the embreex package is not installed")

    monkeypatch.delenv("LUCARNE_RAYCASTER", raising=False)
    with RayCaster([]) as caster:
        assert caster.backend == "embree"
    monkeypatch.setattr(caster_mesh, "EmbreeDevice", missing)
    with RayCaster([]) as caster:
        assert (caster.backend, caster.reason) == ("bvh", "the embreex package is not installed")
    with pytest.raises(embree.EmbreeUnavailableError):
        RayCaster([], "embree")
    monkeypatch.setenv("LUCARNE_RAYCASTER", "bvh")
    with RayCaster([]) as caster:
        assert caster.backend == "bvh"
    monkeypatch.setenv("LUCARNE_RAYCASTER", "magic")
    with pytest.raises(InputError, match="magic"):
        RayCaster([])


def test_a_library_that_is_none_is_refused(tmp_path: object) -> None:
    from pathlib import Path

    from studio_core.kernels import embree

    junk = Path(str(tmp_path)) / "libembree4.so"
    junk.write_bytes(b"junk")
    with pytest.raises(embree.EmbreeUnavailableError, match="could not be loaded"):
        embree.EmbreeDevice(junk)


def test_a_part_alone_is_met_as_in_the_scene(backend: str, workers: Workers) -> None:
    rng = np.random.default_rng(3)
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]], np.uint32)
    corners = rng.normal(size=(4, 3)).astype(np.float32) + 5
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = 0.3 * turn * np.sign(np.linalg.det(turn)), (2, -1, 7)
    with RayCaster([CasterObject(corners, faces, "one", matrix)], backend) as caster:
        part = caster.part(0)
        assert part.scale == pytest.approx(1 / 0.3)
        world = corners.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
        far = np.linalg.norm(world - part.centre, axis=1).max()
        assert far == pytest.approx(part.radius, rel=1e-5)
        origins = part.centre + rng.normal(size=(4000, 3))
        along = part.centre + 0.2 * rng.normal(size=(4000, 3)) - origins
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        expected = caster.occluded(origins, along, np.inf, workers)
        own = (origins @ part.from_world[:, :3].T + part.from_world[:, 3]).astype(np.float32)
        own_along = (along @ part.from_world[:, :3].T / part.scale).astype(np.float32)
        found = np.zeros(4000, bool)
        far_away = np.full(4000, np.inf, np.float32)
        handles = caster.handles()
        occluded_chunk(
            handles.occluded8, part.scene, own, own_along, far_away, np.uint32(OPAQUE), found, 0, 4000
        )
        assert 0.1 < expected.mean() < 0.9
        assert (found != expected).sum() <= 2  # rays that graze an edge
