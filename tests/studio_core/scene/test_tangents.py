"""Tangents of vertices against what a surface's parametrisation says."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from hypothesis import given
from hypothesis import strategies as st

from studio_core.kernels.radiance import frame, surface_frame
from studio_core.scene.geometry import Geometry
from studio_core.scene.shading_mesh import ShadingMesh, refine, shade_mesh
from studio_core.scene.tangents import arbitrary_tangents, perpendicular
from studio_core.scene.transform import Transform, axis_angle, rotation_matrix
from studio_core.scene.world_mesh import Placed, assemble

F64 = npt.NDArray[np.float64]
seeds = st.integers(0, 2**32 - 1)


def unit(v: F64) -> F64:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def sheet(columns: int, rows: int, at, uv) -> Geometry:
    """A grid of u, v in 0…1: positions `at`, texture coordinates `uv` of them."""
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1)))
    corner = np.arange((columns + 1) * rows).reshape(rows, -1)[:, :-1].ravel()
    right, up, both = corner + 1, corner + columns + 1, corner + columns + 2
    faces = np.concatenate([np.stack([corner, right, both], 1), np.stack([corner, both, up], 1)])
    given = (np.asarray(f(u, v), np.float32) for f in (at, uv))
    positions, uvs = given
    return Geometry(positions, faces.astype(np.uint32), None, uvs)


def column(u: F64, v: F64) -> F64:
    """A quarter of a round column, u around it."""
    turn = np.pi / 2 * u
    return np.stack([np.sin(turn), v, np.cos(turn)], 1)


def test_no_direction_of_the_plane_is_none() -> None:
    normals = np.array([[0.0, 0.6, 0.8], [0, 0, 1], [0, 0, 1]])
    made = perpendicular(np.array([[0.0, 3, 4], [0, 0, 0], [2, 0, 5]]), normals)
    np.testing.assert_array_equal(made, [[0, 0, 0], [0, 0, 0], [1, 0, 0]])


def axes_of(mesh: ShadingMesh) -> F64:
    made = np.zeros((len(mesh), 3, 3))
    for p in range(len(mesh)):
        surface_frame(mesh.normals[p], mesh.tangents[p], made[p])
    return made


@given(seeds)
def test_frames_are_orthonormal_and_as_handed_as_the_tangent_says(seed: int) -> None:
    rng = np.random.default_rng(seed)
    normal = unit(rng.normal(size=3)).astype(np.float32)
    along = perpendicular(rng.normal(size=(1, 3)), normal[None].astype(np.float64))[0]
    tangent = np.append(along, rng.choice([-1, 1])).astype(np.float32)
    axes = np.zeros((3, 3))
    surface_frame(normal, tangent, axes)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=3e-7)
    np.testing.assert_allclose(np.linalg.det(axes), tangent[3], atol=1e-6)
    np.testing.assert_array_equal(axes[0], tangent[:3])


@given(seeds)
def test_arbitrary_tangents_give_the_frame_of_the_normal_alone(seed: int) -> None:
    rng = np.random.default_rng(seed)
    normals = unit(rng.normal(size=(9, 3)))
    normals[:3] = [[0, 0, 1], [0, 0, -1], [1, 0, 0]]
    normals = normals.astype(np.float32)
    for normal, tangent in zip(normals, arbitrary_tangents(normals), strict=True):
        one, other = np.zeros((3, 3)), np.zeros((3, 3))
        surface_frame(normal, tangent, one)
        frame(*normal.astype(np.float64), other)
        np.testing.assert_allclose(one, other, atol=5e-7)


@given(st.floats(-3, 3), st.floats(0.1, 3), st.floats(0.2, 4), st.booleans())
def test_tangents_follow_the_picture_around_a_column(turn, wide, high, flipped) -> None:
    """A picture turned, stretched and mirrored on the surface: x runs along ∂P/∂u, y with ∂P/∂v."""
    sense = -1 if flipped else 1

    def laid(u: F64, v: F64) -> F64:
        c, s = np.cos(turn), np.sin(turn)
        around, up = wide * np.pi / 2 * u, high * v
        return np.stack([c * around - s * up, sense * (s * around + c * up)], 1)

    mesh = shade_mesh(sheet(24, 5, column, laid), 0.2)
    front = mesh.side > 0
    angle = np.arctan2(mesh.positions[:, 0], mesh.positions[:, 2]).astype(np.float64)
    around = np.stack([np.cos(angle), 0 * angle, -np.sin(angle)], 1)
    du = unit(np.cos(turn) / wide * around - np.sin(turn) / high * np.array([0.0, 1, 0]))
    np.testing.assert_allclose((mesh.tangents[:, :3] * du).sum(axis=1), 1, atol=3e-3)
    assert (mesh.tangents[front, 3] == sense).all()
    assert (mesh.tangents[~front, 3] == -sense).all()
    dv = sense * (np.sin(turn) / wide * around + np.cos(turn) / high * np.array([0.0, 1, 0]))
    assert ((axes_of(mesh)[:, 1] * dv).sum(axis=1) > 0).all()


def test_where_the_picture_turns_back_each_half_keeps_its_own() -> None:
    def book(u: F64, v: F64) -> F64:
        return np.stack([u, v, 0 * u], 1)

    def folded(u: F64, v: F64) -> F64:
        return np.stack([np.abs(u - 0.5), v], 1)

    mesh = shade_mesh(sheet(4, 2, book, folded), 0.3)
    plain = shade_mesh(sheet(4, 2, book, lambda u, v: np.stack([u, v], 1)), 0.3)
    centre = mesh.positions[mesh.faces].mean(axis=1)[:, 0] - 0.5
    along = mesh.tangents[mesh.faces]
    np.testing.assert_allclose(along[..., 0], np.broadcast_to(np.sign(centre)[:, None], (len(centre), 3)))
    np.testing.assert_array_equal(along[..., 3], np.broadcast_to(np.sign(centre)[:, None], (len(centre), 3)))
    fold = np.isclose(mesh.positions[:, 0], 0.5)
    assert fold.sum() == 2 * np.isclose(plain.positions[:, 0], 0.5).sum()
    assert len(mesh) - fold.sum() / 2 == len(plain)
    np.testing.assert_allclose(np.abs(mesh.normals[:, 2]), 1, atol=1e-6)


def test_without_coordinates_a_tangent_is_the_normals_own() -> None:
    bare = sheet(3, 3, column, lambda u, v: np.stack([u, v], 1))
    for uvs in (None, np.full((len(bare.positions), 2), 0.3, np.float32)):
        mesh = shade_mesh(Geometry(bare.positions, bare.faces, None, uvs), 0.2)
        np.testing.assert_allclose(mesh.tangents, arbitrary_tangents(mesh.normals), atol=1e-6)


def test_refined_vertices_go_on_with_their_neighbours_tangents() -> None:
    mesh = shade_mesh(sheet(24, 5, column, lambda u, v: np.stack([u, v], 1)), 0.2)
    finer = refine(mesh, faces=np.arange(len(mesh.faces)))
    np.testing.assert_array_equal(finer.tangents[: len(mesh)], mesh.tangents)
    parents = mesh.tangents[finer.parents[len(mesh) :]].mean(axis=1)
    assert ((finer.tangents[len(mesh) :] * parents).sum(axis=1) > 1.99).all()


@given(seeds)
def test_tangents_turn_with_their_object(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mesh = shade_mesh(sheet(4, 2, column, lambda u, v: np.stack([-u, v], 1)), 0.4)
    turn = axis_angle(rng.normal(size=3), rng.uniform(-180, 180))
    placed = Transform(tuple(rng.uniform(-5, 5, 3)), turn, rng.uniform(0.2, 3))
    still = assemble([Placed("a", mesh, Transform(), (0,))])
    moved = still.moved(0, placed)
    expected = mesh.tangents[:, :3] @ rotation_matrix(turn).T
    np.testing.assert_allclose(moved.tangents[:, :3], expected, atol=1e-6)
    np.testing.assert_array_equal(moved.tangents[:, 3], mesh.tangents[:, 3])
