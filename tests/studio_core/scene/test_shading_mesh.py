"""The shading mesh against its source: area, place, edges, normals, uvs, sides; and what refines it."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from oracles import meshes
from oracles.meshes import barycentric, box, edge_faces, euler, floor, joined, ring

from studio_core.scene.geometry import Geometry
from studio_core.scene.shading_mesh import (
    NO_BACK,
    ShadingMesh,
    choose_edge,
    places_between,
    prepare,
    refine,
    rung,
    shade_mesh,
)
from studio_core.scene.surface import surface
from studio_core.scene.topology import tolerance


def welded_faces(mesh: ShadingMesh) -> npt.NDArray[np.uint32]:
    return mesh.welded[mesh.faces]


def points(mesh: ShadingMesh) -> npt.NDArray[np.float64]:
    made = np.zeros((int(mesh.welded.max()) + 1, 3))
    made[mesh.welded] = mesh.positions
    return made


def face_normals(mesh: ShadingMesh) -> npt.NDArray[np.float64]:
    a, b, c = (mesh.positions[mesh.faces[:, k]].astype(np.float64) for k in range(3))
    n = np.cross(b - a, c - a)
    return n / np.linalg.norm(n, axis=1, keepdims=True)


def check(mesh: ShadingMesh, geometry: Geometry) -> None:
    """Everything that is true of every shading mesh of a geometry."""
    near = 10 * tolerance(geometry.positions) + 1e-12
    used = geometry.faces[mesh.source_face]
    corners = [geometry.positions[used[:, k]].astype(np.float64) for k in range(3)]
    for k in range(3):
        at = mesh.positions[mesh.faces[:, k]].astype(np.float64)
        assert meshes.distances(at, *corners).max(initial=0) <= near
    sides = mesh.positions[mesh.faces] - mesh.positions[np.roll(mesh.faces, 1, axis=1)]
    assert np.linalg.norm(sides.astype(np.float64), axis=2).max(initial=0) <= mesh.edge + near
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-5)
    assert np.allclose(np.linalg.norm(mesh.geometric, axis=1), 1, atol=1e-5)
    total = meshes.areas(mesh.positions, mesh.faces).sum()
    assert mesh.area[mesh.side > 0].sum(dtype=np.float64) == pytest.approx(total, rel=1e-5)
    assert (mesh.slot[mesh.faces] == mesh.slots[:, None]).all()
    assert (mesh.side[mesh.faces] == 1).all()
    seen = mesh.back_faces[:, 0] != NO_BACK
    assert (mesh.back_faces[~seen] == NO_BACK).all()
    assert (mesh.side[mesh.back_faces[seen]] == -1).all()
    assert (mesh.welded[mesh.back_faces[seen]] == mesh.welded[mesh.faces[seen]]).all()
    assert np.array_equal(mesh.positions[mesh.faces], points(mesh)[welded_faces(mesh)].astype(np.float32))
    every = np.concatenate([mesh.faces.ravel(), mesh.back_faces[seen].ravel()])
    assert np.array_equal(np.unique(every), np.arange(len(mesh)))


def check_facing(mesh: ShadingMesh) -> None:
    """Shading normals look to the side that they shade."""
    flat = face_normals(mesh)
    along = np.einsum("fkc,fc->fk", mesh.normals[mesh.faces].astype(np.float64), flat)
    assert along.min() > 0
    seen = mesh.back_faces[:, 0] != NO_BACK
    behind = np.einsum("fkc,fc->fk", mesh.normals[mesh.back_faces[seen]].astype(np.float64), flat[seen])
    assert behind.max(initial=-1) < 0


SHAPES = {"floor": floor(), "box": box((1, 2, 0.5)), "ring": ring(), "two": joined(box(), ring())}


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("edge", [10.0, 0.7, 0.31, 0.093])
def test_a_clean_mesh_keeps_area_place_and_topology(name: str, edge: float) -> None:
    geometry = SHAPES[name]
    mesh = shade_mesh(geometry, edge)
    check(mesh, geometry)
    check_facing(mesh)
    area = meshes.areas(geometry.positions, geometry.faces).sum()
    assert meshes.areas(mesh.positions, mesh.faces).sum() == pytest.approx(area, rel=1e-5)
    assert euler(welded_faces(mesh)) == {"floor": 1, "box": 2, "ring": 0, "two": 2}[name]
    counts = set(edge_faces(welded_faces(mesh)).values())
    assert counts == ({1, 2} if name == "floor" else {2})
    assert (mesh.back_faces[:, 0] == NO_BACK).all() == (name != "floor")
    if edge > 0.2:
        assert not meshes.t_junctions(points(mesh), welded_faces(mesh), 1e-6)


soups = st.builds(
    lambda positions, picks: Geometry(positions, picks % len(positions)),
    hnp.arrays(np.float32, st.tuples(st.integers(3, 9), st.just(3)), elements=st.integers(-2, 2).map(float)),
    hnp.arrays(np.uint32, st.tuples(st.integers(0, 12), st.just(3)), elements=st.integers(0, 8)),
)


@given(soups, st.floats(0.2, 6.0))
@settings(max_examples=100)
def test_any_soup_of_triangles_is_shaded_conformingly(geometry: Geometry, edge: float) -> None:
    source = surface(geometry)
    mesh = shade_mesh(geometry, edge)
    if not len(source.faces):
        assert len(mesh) == len(mesh.faces) == 0
        return
    check(mesh, geometry)
    area = meshes.areas(source.points, source.faces).sum()
    assert meshes.areas(mesh.positions, mesh.faces).sum() == pytest.approx(area, rel=1e-5)
    assert euler(welded_faces(mesh)) == euler(source.faces)
    # An edge inside a source face has two faces, one on a source edge as many as the source edge.
    before, after = edge_faces(source.faces), edge_faces(welded_faces(mesh))
    at = points(mesh)
    lengths = dict.fromkeys(range(1, 40), 0.0)
    for (a, b), count in before.items():
        lengths[count] += float(np.linalg.norm(source.points[a] - source.points[b]))
    for (a, b), count in after.items():
        lengths[count] -= float(np.linalg.norm(at[a] - at[b]))
    assert all(abs(rest) < 1e-3 for count, rest in lengths.items() if count != 2)
    again = shade_mesh(geometry, edge)
    for name in ("positions", "normals", "inset", "faces", "back_faces", "slot"):
        assert np.array_equal(getattr(mesh, name), getattr(again, name))


@given(st.integers(0, 10**6), st.floats(0.05, 1.0))
@settings(max_examples=30)
def test_uvs_and_file_normals_are_interpolated(seed: int, edge: float) -> None:
    rng = np.random.default_rng(seed)
    corner = np.array([[0, 0, 0], [0, 0, 2.0], [2, 0, 2], [2, 0, 0]]) + rng.uniform(-0.3, 0.3, (4, 3))
    normal = np.array([0, 1.0, 0]) + rng.uniform(-0.3, 0.3, (4, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    geometry = Geometry(corner, faces, normal, rng.uniform(-3, 3, (4, 2)))
    mesh = shade_mesh(geometry, edge)
    assert mesh.uvs is not None
    assert geometry.uvs is not None
    used = geometry.faces[mesh.source_face]
    for chosen in (mesh.faces, mesh.back_faces):
        for k in range(3):
            at = mesh.positions[chosen[:, k]].astype(np.float64)
            weights, _ = barycentric(
                at, *(geometry.positions[used[:, c]].astype(np.float64) for c in range(3))
            )
            uvs = np.einsum("fc,fcd->fd", weights, geometry.uvs[used])
            assert np.allclose(mesh.uvs[chosen[:, k]], uvs, atol=2e-5)
    check_facing(mesh)
    low = normal[:, 1].min()
    assert (mesh.normals[mesh.side > 0, 1] >= low - 1e-5).all()
    original = mesh.normals[[np.abs(mesh.positions - p).sum(axis=1).argmin() for p in geometry.positions]]
    assert np.allclose(np.abs((original * normal).sum(axis=1)), 1, atol=1e-5)


def test_backward_file_normals_are_turned_to_the_faces_side() -> None:
    base = floor(2)
    mesh = shade_mesh(Geometry(base.positions, base.faces, np.tile([0, -1, 0], (4, 1))), 0.5)
    assert np.allclose(mesh.normals[:, 1], mesh.side)


def test_file_normals_split_only_where_they_differ() -> None:
    wedge = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1], [1, 1, 0]], np.float32)  # a fold along the x axis
    faces = np.array([[0, 2, 1], [0, 1, 3]])
    soft = Geometry(wedge, faces, np.tile([0, 1, 1], (4, 1)) / np.sqrt(2))
    assert (shade_mesh(soft, 9.0).side > 0).sum() == 4
    hard = Geometry(
        wedge[[0, 2, 1, 0, 1, 3]], np.arange(6).reshape(2, 3), np.repeat([[0, 1, 0], [0, 0, 1]], 3, axis=0)
    )
    assert (shade_mesh(hard, 9.0).side > 0).sum() == 6


def test_creases_split_and_soft_edges_do_not() -> None:
    assert len(shade_mesh(box(), 9.0)) == 24
    assert len(shade_mesh(ring(24, 16), 9.0)) == 24 * 16
    assert len(shade_mesh(box(), 9.0, crease_degrees=100)) == 8


def test_slots_and_uv_seams_split_vertices() -> None:
    base = floor()
    two = Geometry(base.positions, base.faces, uvs=base.uvs, slots=np.array([0, 1]))
    mesh = shade_mesh(two, 0.5)
    check(mesh, two)
    assert set(mesh.slot.tolist()) == {0, 1}
    uvs = np.concatenate([np.zeros((3, 2)), np.ones((3, 2))])
    seam = Geometry(base.positions[base.faces.ravel()], np.arange(6).reshape(2, 3), uvs=uvs)
    made = shade_mesh(seam, 9.0)
    assert (made.side > 0).sum() == 6
    assert len(np.unique(made.welded)) == 4


@pytest.mark.parametrize("side", [93, 186])
def test_a_floor_of_two_triangles_gets_the_vertices_asked_for(side: int) -> None:
    geometry = floor(6)
    edge = choose_edge([(geometry, 1.0)], 2 * side**2)
    mesh = shade_mesh(geometry, edge)
    assert (mesh.side > 0).sum() == pytest.approx(side**2, rel=0.15)
    assert (mesh.side > 0).sum() * 2 == len(mesh)
    area = mesh.area[mesh.side > 0]
    assert 0.15 < np.percentile(area, 5) / np.median(area) < np.percentile(area, 95) / np.median(area) < 3
    smallest = np.sort(face_angles(mesh), axis=1)[:, 0]
    assert np.median(smallest) > 35
    assert smallest.min() > 5


def face_angles(mesh: ShadingMesh) -> npt.NDArray[np.float64]:
    p = mesh.positions[mesh.faces].astype(np.float64)
    ahead, behind = np.roll(p, -1, axis=1) - p, np.roll(p, 1, axis=1) - p
    cross = np.linalg.norm(np.cross(ahead, behind), axis=2)
    return np.degrees(np.arctan2(cross, (ahead * behind).sum(axis=2)))


def test_long_strips_become_compact_triangles() -> None:
    mesh = shade_mesh(floor(20, 0.5), 0.2)
    assert np.median(face_angles(mesh).min(axis=1)) > 30


def test_inset_stays_in_the_surface_and_off_the_vertex_only_at_rims() -> None:
    mesh = shade_mesh(box(), 0.3)
    along = (mesh.inset * mesh.geometric).sum(axis=1)
    assert np.abs(along).max() < 1e-8
    length = np.linalg.norm(mesh.inset, axis=1)
    inner = ((mesh.positions > 0.01) & (mesh.positions < 0.99)).sum(axis=1) == 2
    assert length.max() < 1e-3 * 0.3
    assert length[~inner].min() > 1e-3 * 0.02  # at creases it always leads away
    outside = np.abs(mesh.positions + mesh.inset - 0.5).max(axis=1)
    rim = np.abs(mesh.positions - 0.5)
    assert (
        np.sort(rim, axis=1)[~inner, 1]
        >= np.sort(np.abs(mesh.positions + mesh.inset - 0.5), axis=1)[~inner, 1]
    ).all()
    assert outside.max() <= 0.5 + 1e-6


def test_inset_of_curved_surfaces_is_never_below_the_tangent_plane() -> None:
    for geometry in (ring(), floor()):
        mesh = shade_mesh(geometry, 0.3)
        assert (mesh.inset * mesh.geometric).sum(axis=1).min() > -1e-9


def test_needles_do_not_explode() -> None:
    needle = Geometry(np.array([[0, 0, 0], [1, 0, 0], [0.5, 1e-4, 0]]), np.array([[0, 1, 2]]))
    mesh = shade_mesh(needle, 0.01)
    assert 200 <= (mesh.side > 0).sum() < 210  # twice round it, and nothing inside
    check(mesh, needle)
    thin = Geometry(np.array([[0, 0, 0], [1, 0, 0], [0.5, 1e-6, 0]]), np.array([[0, 1, 2]]))
    assert len(shade_mesh(thin, 0.01).faces) == 0  # flatter than the welding tolerance


def test_the_limit_makes_the_edge_longer_and_says_so() -> None:
    mesh = shade_mesh(floor(), 1e-5, limit=5000)
    assert 2500 < len(mesh) < 7000
    assert mesh.edge > 1e-3
    check(mesh, floor())
    assert shade_mesh(floor(), 1e-30, limit=100).edge > 0.1
    assert len(shade_mesh(box(), 0.01, limit=1)) >= 24


@pytest.mark.parametrize("edge", [0.0, -1.0, float("nan")])
def test_an_edge_that_is_no_length_is_refused(edge: float) -> None:
    with pytest.raises(ValueError, match="positive"):
        shade_mesh(floor(), edge)


def test_nothing_makes_an_empty_mesh() -> None:
    for geometry in (
        Geometry(np.zeros((0, 3)), np.zeros((0, 3))),
        Geometry(np.zeros((3, 3)), np.array([[0, 1, 2]])),
        Geometry(np.eye(3), np.zeros((0, 3))),
    ):
        mesh = shade_mesh(geometry, 0.1)
        assert len(mesh) == len(mesh.faces) == len(mesh.back_faces) == 0
        assert refine(mesh, faces=np.zeros(0, int)) is mesh
        assert choose_edge([(geometry, 1.0)]) > 0


def test_arrays_are_read_only() -> None:
    mesh = shade_mesh(floor(), 1.0)
    with pytest.raises(ValueError, match="read-only"):
        mesh.positions[0] = 1


@given(st.sampled_from(sorted(SHAPES)), st.floats(0.3, 3.0), st.integers(0, 2**32 - 1), st.integers(1, 4))
@settings(max_examples=40, suppress_health_check=[HealthCheck.too_slow])
def test_refinement_is_conforming_and_keeps_what_was_there(
    name: str, edge: float, seed: int, rounds: int
) -> None:
    geometry = SHAPES[name]
    mesh = shade_mesh(geometry, edge)
    rng = np.random.default_rng(seed)
    for _ in range(rounds):
        marked = rng.random(len(mesh.faces)) < rng.uniform(0, 0.3)
        longest = mesh.positions[mesh.faces] - mesh.positions[np.roll(mesh.faces, 1, axis=1)]
        before = np.linalg.norm(longest, axis=2).max(axis=1)[marked].max(initial=0)
        finer = refine(mesh, faces=marked)
        old = len(mesh)
        for kept in ("positions", "normals", "geometric", "inset", "slot", "side", "welded", "parents"):
            assert np.array_equal(getattr(finer, kept)[:old], getattr(mesh, kept))
        ends = finer.parents[old:]
        assert (ends < old).all()
        middle = finer.positions[ends].astype(np.float64).mean(axis=1)
        assert np.abs(finer.positions[old:] - middle).max(initial=0) < 1e-6
        assert len(finer.faces) >= len(mesh.faces) + marked.sum()
        check(finer, geometry)
        assert euler(welded_faces(finer)) == euler(welded_faces(mesh))
        assert set(edge_faces(welded_faces(finer)).values()) <= {1, 2}
        total = finer.area[finer.side > 0].sum(dtype=np.float64)
        assert total == pytest.approx(mesh.area[mesh.side > 0].sum(dtype=np.float64), rel=1e-5)
        assert before == 0 or len(finer) > len(mesh)
        mesh = finer


def test_refinement_towards_a_corner_makes_no_needles() -> None:
    mesh = shade_mesh(floor(), 3.0)
    least = face_angles(mesh).min()
    for _ in range(12):
        away = np.linalg.norm(mesh.positions[mesh.faces].mean(axis=1), axis=1)
        mesh = refine(mesh, faces=[int(away.argmin())])
    assert face_angles(mesh).min() >= least / 2 - 1e-3
    assert len(mesh) < 500


def test_marked_edges_are_cut_and_others_refused() -> None:
    mesh = shade_mesh(box(), 9.0)
    face = mesh.faces[0]
    finer = refine(mesh, marked=[[face[0], face[1]]])
    middle = (mesh.positions[face[0]] + mesh.positions[face[1]]) / 2
    assert (np.abs(finer.positions - middle).sum(axis=1) < 1e-6).any()
    far = np.linalg.norm(mesh.positions - mesh.positions[face[0]], axis=1).argmax()
    with pytest.raises(ValueError, match="no edge"):
        refine(mesh, marked=[[face[0], far]])


@pytest.mark.parametrize("budget", [3000, 30_000])
def test_the_budget_is_met_where_splitting_dominates(budget: int) -> None:
    items = [(floor(6), 1.0), (box((200, 10, 300)), 0.01), (box(), 0.5), (ring(), 0.8), (ring(), 0.4)]
    edge = choose_edge(items, budget)
    made = sum(len(shade_mesh(geometry, edge / scale)) for geometry, scale in items)
    assert made == pytest.approx(budget, rel=0.15)


def test_heavy_sources_still_leave_a_quarter_of_the_budget() -> None:
    heavy = ring(60, 50)
    items = [(heavy, 1.0), (floor(6), 1.0)]
    edge = choose_edge(items, 2000)
    made = sum(len(shade_mesh(geometry, edge)) for geometry, _ in items)
    assert made == pytest.approx(3000 + 8 + 500, rel=0.15)
    assert len(prepare(heavy).weld) == 3000


@given(st.floats(0.01, 100.0))
@settings(max_examples=20)
def test_the_edge_follows_the_size_of_the_scene(scale: float) -> None:
    assume(scale > 0)
    base = choose_edge([(ring(), 1.0), (box(), 2.0)], 3000)
    assert choose_edge([(ring(), scale), (box(), 2 * scale)], 3000) == pytest.approx(base * scale, rel=0.05)


@given(st.sampled_from(sorted(SHAPES)), st.floats(1e-3, 1e3), st.floats(0.97, 1.03))
def test_edges_settle_on_a_ladder_of_the_geometry(name: str, edge: float, by: float) -> None:
    geometry = SHAPES[name]
    found = rung(geometry, edge)
    assert 2**-0.2501 < found / edge < 2**0.2501
    assert rung(geometry, found) == pytest.approx(found)
    assert rung(geometry, found * by) == rung(geometry, found)
    assert rung(geometry, 2 * edge) == pytest.approx(2 * found)
    assert rung(geometry, found * 2**0.5) == pytest.approx(found * 2**0.5)


def test_every_geometry_has_its_ladder_somewhere_else() -> None:
    places = [math.log2(rung(geometry, 1.0)) for geometry in SHAPES.values()]
    assert len({round(place, 6) for place in places}) == len(SHAPES)


def test_what_is_not_split_is_one_mesh_whatever_edge_is_asked_for() -> None:
    longest = math.sqrt(2)
    made = [shade_mesh(box(), edge) for edge in (1.001 * longest, 2 * longest, 50.0)]
    assert len({mesh.edge for mesh in made}) == 1
    assert made[0].edge >= longest
    assert np.array_equal(made[0].positions, made[2].positions)
    assert len(shade_mesh(box(), 0.99 * longest)) > len(made[0])


def test_a_scene_without_objects_and_a_budget_of_nothing() -> None:
    assert choose_edge([]) == 1.0
    with pytest.raises(ValueError, match="budget"):
        choose_edge([(floor(), 1.0)], 0)


def test_places_between_are_those_of_a_refined_mesh() -> None:
    mesh = shade_mesh(box(), 0.3)
    for _ in range(3):
        pairs = mesh.faces[:: max(len(mesh.faces) // 7, 1), :2]
        finer, places = refine(mesh, marked=pairs), places_between(mesh, pairs)
        for name in ("positions", "normals", "area", "slot", "welded", "parents", "faces", "back_faces"):
            np.testing.assert_array_equal(getattr(places, name), getattr(finer, name), name)
        mesh = finer
    assert places_between(mesh, np.zeros((0, 2), int)) is mesh
