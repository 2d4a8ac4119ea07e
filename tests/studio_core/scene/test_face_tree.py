"""Hits carried down to the parts of split faces, against looking at every part."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.meshes import box, floor, ring, t_junctions

from studio_core.kernels.refinement import locate
from studio_core.scene.face_tree import NO_PART, FaceTree, joined
from studio_core.scene.shading_mesh import ShadingMesh, refined, shade_mesh

SHAPES = {"floor": floor(), "box": box((1, 2, 0.5)), "ring": ring()}
Floats = npt.NDArray[np.float32]


def grow(mesh: ShadingMesh, rng: np.random.Generator, rounds: int) -> tuple[ShadingMesh, FaceTree]:
    """A mesh refined at random, its last rounds in one corner."""
    tree = FaceTree.unsplit(len(mesh.faces))
    for number in range(rounds):
        marked = rng.random(len(mesh.faces)) < rng.uniform(0, 0.4)
        if number > 1:
            away = np.linalg.norm(mesh.positions[mesh.faces].mean(axis=1) - mesh.positions[0], axis=1)
            marked = away <= np.partition(away, 2)[2]
        finer, parent = refined(mesh, faces=marked)
        tree = tree.grown(mesh, finer, parent)
        mesh = finer
    return mesh, tree


def places(mesh: ShadingMesh, face: npt.ArrayLike, u: Floats, v: Floats) -> npt.NDArray[np.float64]:
    corner = mesh.positions[mesh.faces[np.asarray(face)]].astype(np.float64)
    weight = np.stack([1.0 - u - v, u, v], axis=1)
    return np.asarray((weight[:, :, None] * corner).sum(axis=1))


def carried(
    tree: FaceTree, face: npt.NDArray[np.int32], u: Floats, v: Floats
) -> tuple[npt.NDArray[np.int32], Floats, Floats]:
    found, made = np.full(len(face), -7, np.int32), np.full((2, len(face)), np.nan, np.float32)
    locate(0, len(face), face, u, v, tree.root, tree.part, tree.within, found, *made)
    return found, *made


@given(st.sampled_from(sorted(SHAPES)), st.integers(0, 2**32 - 1), st.integers(0, 4))
@settings(max_examples=20)
def test_every_part_knows_the_face_it_comes_from(name: str, seed: int, rounds: int) -> None:
    rng = np.random.default_rng(seed)
    base = shade_mesh(SHAPES[name], 1.5)
    finer, tree = grow(base, rng, rounds)
    finer_again, other = grow(base, rng, rounds)
    origins = joined([tree, other]).origins()
    assert len(origins) == len(finer.faces) + len(finer_again.faces)
    for made, first, begin in ((finer, 0, 0), (finer_again, len(finer.faces), len(base.faces))):
        own = origins[first : first + len(made.faces)] - begin
        face, u, v = somewhere(rng, len(base.faces), 200)
        part = carried(tree if made is finer else other, face, u, v)[0]
        np.testing.assert_array_equal(own[part], face)
        areas = np.bincount(own, _areas(made), minlength=len(base.faces))
        np.testing.assert_allclose(areas, _areas(base), rtol=1e-4)


def _areas(mesh: ShadingMesh) -> npt.NDArray[np.float64]:
    a, b, c = (mesh.positions[mesh.faces[:, k]].astype(np.float64) for k in range(3))
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)


def somewhere(
    rng: np.random.Generator, faces: int, count: int
) -> tuple[npt.NDArray[np.int32], Floats, Floats]:
    u, v = rng.random((2, count)).astype(np.float32)
    over = u + v > 1
    return rng.integers(0, faces, count).astype(np.int32), np.where(over, 1 - u, u), np.where(over, 1 - v, v)


@given(st.sampled_from(sorted(SHAPES)), st.floats(0.3, 3.0), st.integers(0, 2**32 - 1), st.integers(0, 7))
@settings(max_examples=40)
def test_points_stay_where_they_are(name: str, edge: float, seed: int, rounds: int) -> None:
    rng = np.random.default_rng(seed)
    base = shade_mesh(SHAPES[name], edge)
    mesh, tree = grow(base, rng, rounds)
    face, u, v = somewhere(rng, len(base.faces), 300)
    face[:3] = -1
    found, a, b = carried(tree, face, u, v)
    assert (found[:3] == -1).all()
    assert (a[:3] == u[:3]).all()
    assert ((found[3:] >= 0) & (found[3:] < len(mesh.faces))).all()
    assert min(a[3:].min(), b[3:].min(), (1 - a[3:] - b[3:]).min()) > -1e-4
    there = places(mesh, found[3:], a[3:], b[3:])
    np.testing.assert_allclose(there, places(base, face[3:], u[3:], v[3:]), atol=2e-6)
    same = mesh.source_face[found[3:]] == base.source_face[face[3:]]
    assert same.all()
    # Every part is reached, from the face that it is a part of.
    references = np.concatenate([tree.root, tree.part[tree.part != NO_PART]])
    leaves = np.sort(~references[references < 0])
    assert np.array_equal(leaves, np.arange(len(mesh.faces)))
    assert len(tree.part) == len(np.unique(references[references >= 0]))


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=15)
def test_trees_of_objects_join(seed: int) -> None:
    rng = np.random.default_rng(seed)
    bases = [shade_mesh(floor(), 1.0), shade_mesh(box(), 0.7), shade_mesh(floor(), 2.0)]
    grown = [grow(mesh, rng, rounds) for mesh, rounds in zip(bases, (3, 0, 2), strict=True)]
    whole = joined([tree for _, tree in grown])
    before = after = 0
    for base, (mesh, tree) in zip(bases, grown, strict=True):
        face, u, v = somewhere(rng, len(base.faces), 100)
        alone = carried(tree, face, u, v)
        together = carried(whole, face + np.int32(before), u, v)
        assert np.array_equal(together[0], alone[0] + after)
        assert np.array_equal(together[1:], alone[1:])
        before, after = before + len(base.faces), after + len(mesh.faces)
    assert len(joined([]).root) == 0


def test_refinement_of_one_side_leaves_no_t_junction() -> None:
    mesh, _ = grow(shade_mesh(floor(), 1.0), np.random.default_rng(3), 6)
    points = np.zeros((int(mesh.welded.max()) + 1, 3))
    points[mesh.welded] = mesh.positions
    assert not t_junctions(points, mesh.welded[mesh.faces], 1e-6)


def test_what_is_no_number_ends_somewhere() -> None:
    mesh, tree = grow(shade_mesh(floor(), 1.0), np.random.default_rng(3), 3)
    nothing = np.array([np.nan, 0.2], np.float32)
    found, a, _ = carried(tree, np.zeros(2, np.int32), nothing, nothing)
    assert 0 <= found[0] < len(mesh.faces)
    assert np.isnan(a[0])
    assert np.isfinite(a[1])


def test_no_round_is_no_change() -> None:
    mesh = shade_mesh(box(), 0.5)
    finer, parent = refined(mesh, faces=np.zeros(0, int))
    assert finer is mesh
    tree = FaceTree.unsplit(len(mesh.faces)).grown(mesh, finer, parent)
    assert np.array_equal(tree.root, ~np.arange(len(mesh.faces)))
    with pytest.raises(ValueError, match="read-only"):
        tree.root[0] = 1
