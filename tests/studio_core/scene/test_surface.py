"""Repairs: orientation, sides, doubles, degenerate faces, T-junctions."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracles import meshes
from oracles.meshes import areas, box, floor, joined, ring, volume

from studio_core.scene.geometry import Geometry
from studio_core.scene.surface import surface


def turned(geometry: Geometry, which: np.ndarray) -> Geometry:  # type: ignore[type-arg]
    faces = geometry.faces.copy()
    faces[which] = faces[which][:, ::-1]
    return Geometry(geometry.positions, faces, geometry.normals, geometry.uvs, geometry.slots)


@given(st.integers(0, 2**32 - 1), st.sampled_from(["box", "ring", "floor"]))
def test_mixed_winding_is_made_consistent(seed: int, name: str) -> None:
    base = {"box": box(), "ring": ring(), "floor": floor()}[name]
    mixed = turned(base, np.random.default_rng(seed).random(len(base.faces)) < 0.4)
    made = surface(mixed)
    partner = made.partner
    tails = made.faces.reshape(-1)
    inner = np.flatnonzero(partner >= 0)
    assert (tails[inner] != tails[partner[inner]]).all()
    assert len(made.faces) == len(base.faces)
    if name != "floor":
        assert volume(made.points, made.faces) == pytest.approx(volume(base.positions, base.faces), rel=1e-5)


def test_closed_parts_have_a_front_only_and_others_both() -> None:
    both = surface(joined(box(), floor()))
    assert not both.two_sided[:12].any()
    assert both.two_sided[12:].all()
    open_box = box()
    assert surface(Geometry(open_box.positions, open_box.faces[1:])).two_sided.all()


def test_an_inside_out_box_is_turned_and_can_be_seen_from_both_sides() -> None:
    made = surface(turned(box(), np.ones(12, bool)))
    assert volume(made.points, made.faces) == pytest.approx(1)
    assert made.two_sided.all()


def within(outer: Geometry, size: float, at: tuple[float, float, float]) -> Geometry:
    """A solid with an inside-out box of that size about a place."""
    inner = turned(box(), np.ones(12, bool))
    centre = inner.positions.mean(axis=0)
    moved = (inner.positions - centre) * np.float32(size) + np.array(at, np.float32)
    return joined(outer, Geometry(moved, inner.faces))


def test_the_wall_of_a_cavity_looks_into_it_and_has_no_back() -> None:
    solid = box()
    middle = tuple(solid.positions.mean(axis=0))
    hollow = surface(within(solid, 0.5, middle))  # type: ignore[arg-type]
    assert not hollow.two_sided.any()
    assert volume(hollow.points, hollow.faces) == pytest.approx(1 - 0.5**3)


def test_an_inside_out_box_in_the_hole_of_a_ring_is_no_cavity() -> None:
    whole = ring()
    low, high = whole.bounds
    made = surface(within(whole, 0.05 * float((high - low).min()), tuple((low + high) / 2)))
    assert not made.two_sided[: len(whole.faces)].any()
    assert made.two_sided[len(whole.faces) :].all()


def test_a_moebius_strip_keeps_both_sides_and_its_winding() -> None:
    u = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    half = np.stack([np.cos(u / 2) * np.cos(u), np.cos(u / 2) * np.sin(u), np.sin(u / 2)], axis=1)
    centre = np.stack([np.cos(u), np.sin(u), 0 * u], axis=1)
    strip = np.stack([centre - 0.3 * half, centre + 0.3 * half], axis=1).reshape(-1, 3)
    faces = []
    for k in range(24):
        a, b = 2 * k, 2 * k + 1
        c, d = (2 * k + 2, 2 * k + 3) if k < 23 else (1, 0)
        faces += [(a, b, d), (a, d, c)]
    made = surface(Geometry(strip, np.array(faces)))
    assert np.array_equal(made.faces, faces)
    assert made.two_sided.all()


def test_boxes_that_share_an_edge_or_a_face_are_two_solids() -> None:
    for at in ((1.0, 1.0, 0.0), (1.0, 0.0, 0.0)):
        made = surface(joined(box(), box(at=at)))
        assert not made.two_sided.any()
        assert len(made.faces) == 24


def test_doubles_are_one_face_with_two_materials() -> None:
    base = floor()
    faces = np.concatenate([base.faces, base.faces, base.faces[:, [1, 0, 2]]])
    made = surface(Geometry(base.positions, faces, uvs=base.uvs, slots=np.array([3, 3, 5, 5, 8, 8])))
    assert made.source.tolist() == [0, 1]
    assert made.slots.tolist() == [3, 3]
    assert made.back_slots.tolist() == [8, 8]
    assert np.array_equal(made.back_uvs, made.uvs)
    assert made.two_sided.all()


def test_a_closed_box_with_every_face_doubled_is_a_solid() -> None:
    for order in (1, -1):
        base = box()
        parts = [base.faces, base.faces[:, ::-1]][::order]
        made = surface(Geometry(base.positions, np.concatenate(parts)))
        assert len(made.faces) == 12
        assert not made.two_sided.any()
        assert volume(made.points, made.faces) == pytest.approx(1)


def test_degenerate_faces_go_and_leave_no_gap() -> None:
    """A zero-area face that bridges a T-junction: without it, the junction is repaired."""
    positions = np.array([[0, 0, 0], [2, 0, 0], [1, 0, 0], [1, 0, 2], [0, 0, -2], [2, 0, -2]])
    faces = np.array([[0, 1, 3], [0, 2, 1], [2, 0, 4], [2, 4, 5], [2, 5, 1], [0, 0, 1]])
    made = surface(Geometry(positions, faces))
    assert sorted(made.source.tolist()) == [0, 0, 2, 3, 4]
    assert areas(made.points, made.faces).sum() == pytest.approx(6)
    assert sorted(meshes.edge_faces(made.faces).values()).count(2) == 5
    assert not meshes.t_junctions(made.points, made.faces, 1e-6)


@given(st.integers(1, 9), st.integers(1, 9), st.integers(0, 100))
def test_tiles_beside_larger_tiles_are_sewn_together(left: int, right: int, seed: int) -> None:
    """Two rectangles cut into different numbers of strips share one border without T-junctions."""
    rng = np.random.default_rng(seed)
    sides = []
    for count, x0, x1 in ((left, 0.0, 1.0), (right, 1.0, 2.0)):
        cuts = np.sort(np.concatenate([[0, 1], rng.choice(np.arange(1, 60), count - 1, replace=False) / 60]))
        for low, high in itertools.pairwise(cuts):
            corners = np.array([[x0, 0, low], [x0, 0, high], [x1, 0, high], [x1, 0, low]])
            sides.append(Geometry(corners, np.array([[0, 1, 2], [0, 2, 3]]), uvs=corners[:, [0, 2]]))
    whole = joined(*sides)
    made = surface(Geometry(whole.positions, whole.faces, uvs=whole.positions[:, [0, 2]]))
    assert meshes.euler(made.faces) == 1
    assert not meshes.t_junctions(made.points, made.faces, 1e-6)
    assert areas(made.points, made.faces).sum() == pytest.approx(2, rel=1e-5)
    assert np.allclose(made.uvs, made.points[made.faces][:, :, [0, 2]], atol=1e-5)
    assert (np.cross(*np.moveaxis(np.diff(made.points[made.faces], axis=1), 1, 0))[:, 1] > 0).all()
