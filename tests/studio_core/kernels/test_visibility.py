"""Visibility bits and lamp rays against brute force, for both tracers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import pytest
from oracles.raycast import nearest

from studio_core.errors import Cancelled
from studio_core.kernels.directions import direction_set
from studio_core.kernels.raycast import CasterObject, RayCaster
from studio_core.kernels.visibility import occlusion_rays, trace_visibility
from studio_core.parallel import Workers

F64 = npt.NDArray[np.float64]
FLOOR = np.array([[-5, 0, -5], [-5, 0, 5], [5, 0, 5], [5, 0, -5]], np.float32)
FLOOR_FACES = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
PYRAMID = np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1], [0, 1.5, 0]], np.float32)
PYRAMID_FACES = np.array([[0, 4, 1], [1, 4, 2], [2, 4, 3], [3, 4, 0], [0, 1, 2], [0, 2, 3]], np.uint32)


@pytest.fixture(scope="module", params=["embree", "bvh"])
def caster(request: pytest.FixtureRequest) -> Iterator[RayCaster]:
    with RayCaster(scene(), request.param) as made:
        yield made


@pytest.fixture(scope="module")
def workers() -> Iterator[Workers]:
    with Workers(2) as made:
        yield made


def scene() -> list[CasterObject]:
    """A floor and three turned pyramids that share a mesh, one of them mirrored."""
    objects = [CasterObject(FLOOR, FLOOR_FACES, "floor", np.eye(4))]
    rng = np.random.default_rng(0)
    for shift in ([1.5, 0.3, 0], [-1.5, 0.6, 1], [0, 2.0, -1.5]):
        q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        transform = np.eye(4)
        transform[:3, :3], transform[:3, 3] = q * 0.7, shift
        objects.append(CasterObject(PYRAMID, PYRAMID_FACES, "pyramid", transform))
    return objects


def on_the_surfaces(count: int) -> tuple[F64, F64]:
    rng = np.random.default_rng(1)
    points, normals = [], []
    for item in scene():
        placed = item.positions @ item.transform[:3, :3].T + item.transform[:3, 3]
        for corners in placed[item.faces[rng.integers(0, len(item.faces), count)]]:
            normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
            points.append(rng.dirichlet([2, 2, 2]) @ corners)
            normals.append(
                normal / np.linalg.norm(normal) * (1 if item.key == "floor" else rng.choice([-1, 1]))
            )
    return np.array(points), np.array(normals)


def bits(words: npt.NDArray[np.uint64]) -> npt.NDArray[np.bool_]:
    return np.unpackbits(words.view(np.uint8), axis=1, bitorder="little").astype(bool)


def plain() -> list[tuple[F64, npt.NDArray[np.uint32], F64]]:
    return [(item.positions.astype(np.float64), item.faces, item.transform) for item in scene()]


def test_bits_agree_with_brute_force(caster: RayCaster, workers: Workers) -> None:
    points, normals = on_the_surfaces(5)
    rng = np.random.default_rng(2)
    shading = normals + rng.normal(scale=0.2, size=normals.shape)
    shading /= np.linalg.norm(shading, axis=1, keepdims=True)
    directions = direction_set(10)
    before = caster.rays
    found = trace_visibility(caster, points, shading, directions, workers, geometric_normals=normals)
    along = directions.directions.astype(np.float64)
    above = shading.astype(np.float32).astype(np.float64) @ along.T > 1e-6
    seen = bits(found.words)
    assert not (seen & ~(shading @ along.T > -1e-6)).any()
    checked = 0
    for point in range(len(points)):
        start = points[point] + 1e-5 * normals[point]
        truth = nearest(plain(), np.broadcast_to(start, along.shape), along)
        clear = truth.margin > 2e-3
        np.testing.assert_array_equal(seen[point][clear], (above[point] & (truth.face < 0))[clear])
        checked += int(clear.sum())
    assert checked > 0.5 * seen.size
    assert found.rays == pytest.approx(above.sum(), abs=3)
    assert caster.rays - before == found.rays
    dark = (~above).reshape(-1, 8).all(axis=1).sum()
    assert 0.6 * dark < found.skipped <= dark


def test_the_floor_skips_the_lower_half_of_the_tree(workers: Workers) -> None:
    with RayCaster(scene()[:1]) as caster:
        found = trace_visibility(caster, [[0.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]], direction_set(12), workers)
    assert found.rays == 2048
    assert 0.7 * 256 <= found.skipped <= 256
    np.testing.assert_array_equal(bits(found.words)[0], np.arange(4096) < 2048)


def test_one_and_two_threads_and_a_given_array_give_the_same_bits(
    caster: RayCaster, workers: Workers
) -> None:
    points, normals = on_the_surfaces(40)
    directions = direction_set(13)
    out = np.full((len(points), 128), 7, np.uint64)
    found = trace_visibility(caster, points, normals, directions, workers, out=out)
    assert found.words is out
    with Workers(1) as one:
        alone = trace_visibility(caster, points, normals, directions, one)
    np.testing.assert_array_equal(alone.words, out)
    assert (alone.rays, alone.skipped) == (found.rays, found.skipped)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
def test_the_inside_of_a_closed_mesh_sees_nothing(workers: Workers, scale: float) -> None:
    """Vertices of a pyramid from inside, inset towards their faces' middles; no direction leaks."""
    transform = np.eye(4)
    transform[:3, :3] *= scale
    transform[:3, 3] = np.array([3.0, -2.0, 1.0]) * scale
    points, normals, insets = [], [], []
    placed = PYRAMID.astype(np.float64) @ transform[:3, :3].T + transform[:3, 3]
    inside = placed.mean(axis=0)
    for corners in placed[PYRAMID_FACES]:
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        normal *= np.sign(normal @ (inside - corners[0])) / np.linalg.norm(normal)
        for corner in corners:
            points.append(corner)
            normals.append(normal)
            insets.append(1e-3 * (corners.mean(axis=0) - corner))
    for backend in ("embree", "bvh"):
        with RayCaster([CasterObject(PYRAMID, PYRAMID_FACES, "p", transform)], backend) as caster:
            found = trace_visibility(
                caster, points, normals, direction_set(12), workers, inset=np.array(insets)
            )
            assert found.rays > 1000 * len(points)
            assert not found.words.any()
            outside = trace_visibility(caster, points, -np.array(normals), direction_set(12), workers)
            assert bits(outside.words).mean() > 0.4


def test_points_that_are_not_finite_see_nothing(caster: RayCaster, workers: Workers) -> None:
    points = np.array([[np.nan, 0, 0], [0, 9, 0], [0, 9, 0], [np.inf, 0, 0], [0, 9, 0]])
    normals = np.array([[0, 1, 0], [0, np.nan, 0], [0, 0, 0], [0, 1, 0], [0, 1.0, 0]])
    seen = bits(trace_visibility(caster, points, normals, direction_set(10), workers).words)
    np.testing.assert_array_equal(seen.any(axis=1), [False, False, False, False, True])
    targets = np.array([[0, 20, 0, 1], [0, 1, 0, 0]])
    lamps = occlusion_rays(caster, points, normals, targets, workers)
    np.testing.assert_array_equal(lamps.any(axis=1), [False, False, False, False, True])


def test_shapes_that_do_not_fit_are_refused(caster: RayCaster, workers: Workers) -> None:
    up = np.array([[0.0, 1.0, 0.0]])
    with pytest.raises(ValueError, match="points must have the shape"):
        trace_visibility(caster, np.zeros((2, 3)), up, direction_set(10), workers, geometric_normals=up)
    with pytest.raises(ValueError, match="out must be uint64"):
        trace_visibility(caster, up, up, direction_set(10), workers, out=np.zeros((1, 3), np.uint64))
    with pytest.raises(ValueError, match="targets"):
        occlusion_rays(caster, up, up, [[0.0, 0.0, 0.0]], workers)
    none = trace_visibility(caster, np.zeros((0, 3)), np.zeros((0, 3)), direction_set(10), workers)
    assert none.words.shape == (0, 16)


def test_tracing_can_be_cancelled(caster: RayCaster, workers: Workers) -> None:
    class Impatient:
        done = -1

        def checkpoint(self, done: int, total: int, /) -> None:
            self.done = done
            if done:
                raise Cancelled

    points, normals = on_the_surfaces(100)
    job = Impatient()
    with pytest.raises(Cancelled):
        trace_visibility(caster, points, normals, direction_set(15), workers, job)
    assert 0 < job.done < len(points)


def test_lamps_are_seen_as_by_brute_force(caster: RayCaster, workers: Workers) -> None:
    points, normals = on_the_surfaces(30)
    rng = np.random.default_rng(3)
    places = np.column_stack([rng.uniform([-2, 1, -2], [2, 5, 2], (13, 3)), np.ones(13)])
    suns = rng.normal(size=(6, 3))
    suns /= np.linalg.norm(suns, axis=1, keepdims=True)
    targets = np.concatenate([places, np.column_stack([suns, np.zeros(6)])])
    seen = occlusion_rays(caster, points, normals, targets, workers)
    with Workers(1) as one:
        np.testing.assert_array_equal(seen, occlusion_rays(caster, points, normals, targets, one))
    starts = points + 1e-5 * normals
    for index, target in enumerate(targets):
        along = target[:3] - target[3] * starts
        above = np.einsum("ij,ij->i", along, normals)
        truth = nearest(plain(), starts, along, tfar=1.0 if target[3] else np.inf)
        clear = (truth.margin > 2e-3) & (np.abs(above) > 1e-3)
        np.testing.assert_array_equal(seen[clear, index], ((above > 0) & (truth.face < 0))[clear])
        assert clear.mean() > 0.7
    assert 0.1 < seen.mean() < 0.9


def test_a_lamps_own_surface_does_not_hide_it(workers: Workers) -> None:
    panel = np.eye(4)
    panel[:3, :3] *= 0.1
    panel[:3, 3] = [0.0, 3.0, 0.0]
    objects = [*scene()[:1], CasterObject(FLOOR, FLOOR_FACES, "floor", panel)]
    targets = np.array([[x, 3.0, z, 1.0] for x in (-0.4, 0.0, 0.4) for z in (-0.4, 0.1, 0.4)])
    points = np.array([[-1.0, 0.0, 0.3], [2.0, 0.0, 1.0], [0.01, 0.0, 0.02]])
    normals = np.tile([0.0, 1.0, 0.0], (3, 1))
    for backend in ("embree", "bvh"):
        with RayCaster(objects, backend) as caster:
            assert occlusion_rays(caster, points, normals, targets, workers).all()
            assert not occlusion_rays(caster, points, normals, targets, workers, shorten=-0.1).any()
