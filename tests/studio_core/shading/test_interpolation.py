"""What is said of the error between vertices: against loops, and against what is missed in truth."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.interpolation import edge_squares
from oracles.meshes import box, floor, ring

from studio_core.kernels.refinement import descend
from studio_core.scene.geometry import Geometry
from studio_core.scene.shading_mesh import refine
from studio_core.scene.transform import IDENTITY, Transform, looking
from studio_core.scene.world_mesh import WorldMesh, world_mesh
from studio_core.session import View
from studio_core.shading.artifacts import Hits
from studio_core.shading.interpolation import (
    edge_errors,
    parents,
    seen_corners,
    seen_samples,
    squares_saved,
    surpluses,
)

F32 = npt.NDArray[np.float32]
VIEW = View(looking((1.0, 4.0, 3.0), (0.0, 0.0, 0.0)), width=100, height=80, antialias=1)


def world(
    edge: float, rounds: int = 0, seed: int = 0, shapes: tuple[Geometry, ...] = (floor(), box(), ring())
) -> WorldMesh:
    """A few objects, refined at random."""
    rng = np.random.default_rng(seed)
    items = [(str(k), shape, Transform((1.5 * k, 0.1 * k, 0.0)), (0,)) for k, shape in enumerate(shapes)]
    made = world_mesh(items, edge, origin=(0.2, 0.3, 0.4))
    for _ in range(rounds):
        for index, placed in enumerate(made.objects):
            faces = rng.random(len(placed.mesh.faces)) < 0.3
            made = made.with_mesh(index, refine(placed.mesh, faces=faces))
    return made


def hits(faces: npt.ArrayLike, behind: npt.ArrayLike = ()) -> Hits:
    def layer(chosen: npt.ArrayLike, further: tuple[tuple[npt.NDArray[np.int64], Hits], ...]) -> Hits:
        face = np.asarray(chosen, np.int32)
        third = np.full(len(face), 1 / 3, np.float32)
        return Hits(VIEW, 1, face, third, third, np.ones(len(face), np.float32), further)

    through = np.asarray(behind, np.int32)
    return layer(faces, ((np.arange(len(through)), layer(through, ())),) if len(through) else ())


def close(found: object, expected: object) -> None:
    np.testing.assert_allclose(found, expected, rtol=2e-4, atol=1e-12)  # type: ignore[call-overload]


@given(st.floats(0.5, 2.0), st.integers(0, 2), st.integers(0, 2**32 - 1), st.sampled_from([0.0, 0.3, 1.0]))
@settings(max_examples=30)
def test_edges_are_judged_as_by_loops(edge: float, rounds: int, seed: int, smooth: float) -> None:
    rng = np.random.default_rng(seed)
    mesh = world(edge, rounds, seed)
    radiance = rng.random((len(mesh), 3)).astype(np.float32) * np.float32(1 - smooth)
    radiance += mesh.positions @ rng.random((3, 3)).astype(np.float32) * np.float32(0.3)
    picked = rng.integers(-1, len(mesh.faces), 400)
    found = hits(picked, rng.integers(-1, len(mesh.faces), 50))
    valid = rng.random(len(mesh)) < 0.98
    count = np.zeros(len(mesh.faces), int)
    for layer in (found, found.behind[0][1]):
        for face in layer.face:
            count[face] += face >= 0
    close(seen_samples(found, len(mesh.faces)), count)
    faces = np.flatnonzero(count)
    corners = seen_corners(mesh, VIEW, faces)
    used = valid[corners].all(axis=1)
    made = edge_errors(mesh, found, radiance, valid)
    between = [
        (int(p), int(q)) if valid[[k, p, q]].all() else (k, k) for k, (p, q) in enumerate(parents(mesh))
    ]
    expected = edge_squares(
        mesh.positions.astype(np.float64),
        [tuple(map(int, row)) for row in corners[used]],  # type: ignore[misc]
        [int(n) for n in count[faces[used]]],
        radiance.astype(np.float64),
        between,
    )
    assert {(int(i), int(j)) for i, j in made.ends} == set(expected)
    largest = max(expected.values())
    for (i, j), squares in zip(made.ends.tolist(), made.squares, strict=True):
        assert squares == pytest.approx(expected[i, j], rel=2e-3, abs=1e-6 * largest)
    assert made.relative_rmse == pytest.approx(np.sqrt(made.squares.sum() / made.scale))
    mean = (count[faces[used]] * radiance[corners[used]].mean(axis=(1, 2))).sum() / count[faces[used]].sum()
    assert made.scale == pytest.approx(count[faces[used]].sum() * mean**2, rel=1e-4)


def test_what_is_linear_has_no_error_however_steep() -> None:
    mesh = world(0.4, 1, shapes=(floor(),))
    radiance = np.repeat(mesh.positions[:, :1] * 10 + 30, 3, axis=1).astype(np.float32)
    made = edge_errors(mesh, hits(np.arange(len(mesh.faces))), radiance, np.ones(len(mesh), np.bool_))
    assert made.relative_rmse < 2e-3  # far corners of needles are not followed all the way


@pytest.mark.parametrize("edge", [0.5, 0.2, 0.1])
@pytest.mark.parametrize("kind", ["step", "bump"])
def test_the_estimate_is_near_what_is_missed(kind: str, edge: float) -> None:
    """A step, or a smooth highlight, on a floor: against both at many points of every face."""
    rng = np.random.default_rng(1)
    mesh = world_mesh([("floor", floor(), IDENTITY, (0,))], edge)

    def light(at: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        if kind == "step":
            return np.where(at[..., 0] + 0.3 * at[..., 2] > 0.137, 1.0, 0.2)
        return np.asarray(0.3 + np.exp(-((at[..., 0] - 0.1) ** 2 + at[..., 2] ** 2) / 0.18))

    at = mesh.positions.astype(np.float64)
    radiance = np.repeat(light(at)[:, None], 3, axis=1).astype(np.float32)
    area = np.linalg.norm(
        np.cross(at[mesh.faces[:, 1]] - at[mesh.faces[:, 0]], at[mesh.faces[:, 2]] - at[mesh.faces[:, 0]]),
        axis=1,
    )
    face = rng.choice(len(area), 40_000, p=area / area.sum())
    w = rng.dirichlet((1, 1, 1), len(face))
    shown = (w * radiance[mesh.faces[face], 0]).sum(axis=1)
    true = light(np.einsum("nk,nkc->nc", w, at[mesh.faces[face]]))
    real = np.sqrt(np.mean((shown - true) ** 2)) / true.mean()
    made = edge_errors(mesh, hits(face), radiance, np.ones(len(mesh), np.bool_))
    assert 0.5 * real < made.relative_rmse < 3.5 * real


def test_surpluses_and_what_they_saved() -> None:
    mesh = world(1.0, 1, shapes=(floor(),))
    between = parents(mesh)
    new = np.flatnonzero(between[:, 0] != between[:, 1])
    radiance = np.ones((len(mesh), 3), np.float32)
    radiance[new[0]] = (1.5, 1.0, 1.0)
    valid = np.ones(len(mesh), np.bool_)
    told = surpluses(radiance, valid, between)
    assert np.isinf(np.delete(told, new)).all()
    close(told[new], [0.5 / np.sqrt(3), *np.zeros(len(new) - 1)])
    valid[between[new[0], 0]] = False
    assert np.isinf(surpluses(radiance, valid, between)[new[0]])
    valid[:] = True
    saved = squares_saved(mesh, hits(np.arange(len(mesh.faces))), radiance, valid)
    around = (seen_corners(mesh, VIEW, np.arange(len(mesh.faces))) == new[0]).any(axis=1).sum()
    close(saved[new[0]], 0.25 / 3 * around / 6)
    assert np.delete(saved, new[0]).sum() == 0


def test_what_early_vertices_saved_does_not_shrink_with_their_faces() -> None:
    """A ridge that the first round found: further rounds that find nothing new save nothing."""
    mesh = world(3.0, shapes=(floor(),))
    saved = []
    for _ in range(4):
        mesh = mesh.with_mesh(
            0, refine(mesh.objects[0].mesh, faces=np.arange(len(mesh.objects[0].mesh.faces)))
        )
        between = parents(mesh)
        radiance = np.ones((len(mesh), 3), np.float32)
        if not saved:
            top = int(np.flatnonzero((between[:, 0] != between[:, 1]) & (mesh.side > 0))[0])
        radiance[top] = 2.0
        for k in np.flatnonzero(between[:, 0] != between[:, 1]):
            if k != top:
                radiance[k] = radiance[between[k]].mean(axis=0)
        area = np.linalg.norm(
            np.cross(*np.moveaxis(np.diff(mesh.positions[mesh.faces], axis=1), 1, 0)), axis=1
        )
        count = np.rint(area / area.sum() * 4096).astype(int)
        seen = hits(np.repeat(np.arange(len(area)), count))
        saved.append(squares_saved(mesh, seen, radiance, np.ones(len(mesh), np.bool_))[top])
        shown = radiance[mesh.faces, 0].astype(np.float64) - 1
        mean = (shown.sum(axis=1) ** 2 + (shown**2).sum(axis=1)) / 12
        assert saved[-1] == pytest.approx((mean * count).sum(), rel=0.05)
    close(saved, np.full(4, saved[0]))


def test_lengths_in_the_picture() -> None:
    mesh = world_mesh([("floor", floor(1.0), IDENTITY, (0,))], 5.0)
    made = edge_errors(mesh, hits([0, 1]), np.ones((len(mesh), 3), np.float32), np.ones(len(mesh), np.bool_))
    world_from = VIEW.transform.matrix()
    at = np.concatenate([mesh.positions + mesh.origin, np.ones((len(mesh), 1))], axis=1)
    local = at @ np.linalg.inv(world_from).T
    half = np.tan(np.radians(VIEW.fov / 2))
    pixel = local[:, :2] / -local[:, 2:3] / half * VIEW.height / 2
    expected = np.linalg.norm(pixel[made.ends[:, 0]] - pixel[made.ends[:, 1]], axis=1)
    np.testing.assert_allclose(made.pixels, expected, rtol=1e-4)


def test_what_reaches_behind_the_eye_is_long() -> None:
    mesh = world_mesh([("floor", floor(100.0), IDENTITY, (0,))], 500.0)
    made = edge_errors(mesh, hits([0, 1]), np.ones((len(mesh), 3), np.float32), np.ones(len(mesh), np.bool_))
    assert np.isinf(made.pixels).any()


def test_nothing_seen_has_no_error() -> None:
    mesh = world(1.0)
    dark = np.zeros((len(mesh), 3), np.float32)
    for seen, valid in ((hits([-1]), True), (hits([0, 3]), False), (hits([0, 3]), True)):
        made = edge_errors(mesh, seen, dark, np.full(len(mesh), valid))
        assert made.relative_rmse == 0
        assert np.isfinite(made.squares).all()


@given(st.integers(0, 2**32 - 1), st.integers(0, 4))
@settings(max_examples=25)
def test_what_new_vertices_lie_between(seed: int, rounds: int) -> None:
    """Only old vertices are left, and all that lead to the wanted."""
    rng = np.random.default_rng(seed)
    base, mesh = world(1.0), world(1.0, rounds, seed)
    between = parents(mesh)
    old = between[:, 0] == between[:, 1]
    assert old.sum() == len(base)
    wanted = rng.random(len(mesh)) < 0.1
    needed = wanted.copy()
    descend(between, needed)
    assert (old | ~needed).all()
    assert (needed[wanted & old]).all()
    reached = set(np.flatnonzero(wanted).tolist())
    for i in range(len(mesh) - 1, -1, -1):
        if i in reached:
            reached |= set(between[i].tolist())
    assert set(np.flatnonzero(needed).tolist()) == {i for i in reached if old[i]}
