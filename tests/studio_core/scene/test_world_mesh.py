"""The world's mesh: placing, offsets, materials, sharing, moving one object."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.meshes import box, floor, joined, ring

from studio_core.scene.geometry import Geometry
from studio_core.scene.shading_mesh import NO_BACK, choose_edge, refine
from studio_core.scene.transform import IDENTITY, Transform, axis_angle
from studio_core.scene.world_mesh import MeshCache, WorldMesh, assemble, world_mesh

SLOTTED = Geometry(box().positions, box().faces, slots=np.arange(12) // 6)
TURN = Transform((3.0, 0.5, -2.0), axis_angle((1, 2, 3), 70), 0.4)


def scene(edge: float = 0.5, cache: MeshCache | None = None) -> WorldMesh:
    items = [
        ("floor", floor(), IDENTITY, (4,)),
        ("chest", SLOTTED, TURN, (2, 7)),
        ("chest-2", SLOTTED, Transform((-2.0, 0.0, 0.0), scale=0.4), (9,)),
        ("bare", ring(), IDENTITY, ()),
    ]
    return world_mesh(items, edge, cache=cache)


def same(a: WorldMesh, b: WorldMesh) -> None:
    for field in dataclasses.fields(a):
        one, other = getattr(a, field.name), getattr(b, field.name)
        if isinstance(one, np.ndarray):
            assert np.array_equal(one, other), field.name
            assert not one.flags.writeable


def test_objects_are_placed_one_after_the_other() -> None:
    world = scene()
    assert world.vertex_offsets[-1] == len(world)
    for index, placed in enumerate(world.objects):
        mesh, where, faces = placed.mesh, world.vertices_of(index), world.faces_of(index)
        matrix = placed.transform.matrix()
        at = mesh.positions @ matrix[:3, :3].T + matrix[:3, 3]
        assert np.allclose(world.positions[where], at, atol=1e-5)
        scale = placed.transform.scale
        for name in ("normals", "geometric"):
            expected = getattr(mesh, name) @ matrix[:3, :3].T / scale
            assert np.allclose(getattr(world, name)[where], expected, atol=1e-6)
        assert np.allclose(world.inset[where], mesh.inset @ matrix[:3, :3].T, atol=1e-9)
        assert world.area[where].sum() == pytest.approx(mesh.area.sum() * scale**2, rel=1e-5)
        assert np.array_equal(world.faces[faces] - where.start, mesh.faces)
        back = world.back_faces[faces]
        assert np.array_equal(back == NO_BACK, mesh.back_faces == NO_BACK)
        assert np.array_equal((back - where.start)[back != NO_BACK], mesh.back_faces[back != NO_BACK])
        assert (world.object[where] == index).all()
        sides = world.positions[world.faces[faces]] - world.positions[np.roll(world.faces[faces], 1, axis=1)]
        assert np.linalg.norm(sides, axis=2).max() <= 0.5 * 1.001
        assert world.index_of(placed.node) == index
    assert set(world.side.tolist()) == {1, -1}
    with pytest.raises(KeyError):
        world.index_of("lamp")


def test_materials_come_from_slots() -> None:
    world = scene()
    assert set(world.material[world.vertices_of(0)].tolist()) == {4}
    assert set(world.material[world.vertices_of(1)].tolist()) == {2, 7}
    assert set(world.material[world.vertices_of(2)].tolist()) == {9}
    assert set(world.material[world.vertices_of(3)].tolist()) == {-1}
    assert (world.material[world.faces] == world.face_material[:, None]).all()


def test_instances_and_versions_share_meshes() -> None:
    cache = MeshCache()
    world, again = scene(cache=cache), scene(cache=cache)
    assert world.objects[1].mesh is world.objects[2].mesh
    assert all(a.mesh is b.mesh for a, b in zip(world.objects, again.objects, strict=True))
    same(world, again)
    assert cache.mesh(floor(), 70.0) is cache.mesh(floor(), 90.0)  # nothing is split at either
    small = MeshCache(capacity=1)
    assert small.mesh(floor(), 0.5) is not small.mesh(box(), 0.5)
    same(world, scene(cache=small))


@given(
    st.integers(0, 3),
    st.tuples(*[st.floats(-50, 50)] * 3),
    st.floats(-360, 360),
    st.floats(0.1, 3),
)
@settings(max_examples=25)
def test_moving_one_object_is_the_same_as_placing_it_there(
    index: int, to: tuple[float, float, float], degrees: float, scale: float
) -> None:
    world = scene()
    there = Transform(to, axis_angle((0, 1, 0), degrees), scale)
    moved = world.moved(index, there)
    fresh = assemble(
        [dataclasses.replace(p, transform=there) if k == index else p for k, p in enumerate(world.objects)]
    )
    same(moved, fresh)
    others = np.ones(len(world), bool)
    others[world.vertices_of(index)] = False
    assert np.array_equal(moved.positions[others], world.positions[others])
    assert moved.faces is world.faces
    assert moved.material is world.material
    same(moved.moved(index, world.objects[index].transform), world)


def test_moving_many_is_moving_one_after_the_other() -> None:
    world = scene()
    there = {k: Transform((k, 1.0, -2.0), scale=1.0 + k) for k in (3, 0, 2)}
    one_by_one = world
    for index, transform in there.items():
        one_by_one = one_by_one.moved(index, transform)
    made = world.moved_many({**there, 1: world.objects[1].transform})
    same(made, one_by_one)
    assert made.objects == one_by_one.objects
    assert world.moved_many({k: placed.transform for k, placed in enumerate(world.objects)}) is world


def test_far_scenes_keep_their_precision_about_an_origin() -> None:
    far = Transform((1e6, 0.0, -2e6))
    world = world_mesh([("floor", floor(), far, (0,))], 0.1, origin=far.translation)
    near = world_mesh([("floor", floor(), IDENTITY, (0,))], 0.1)
    assert np.array_equal(world.positions, near.positions)


def test_a_refined_mesh_takes_its_place() -> None:
    world = scene()
    finer = refine(world.objects[1].mesh, faces=[0, 3])
    made = world.with_mesh(1, finer)
    assert len(made) == len(world) + len(finer) - len(world.objects[1].mesh)
    assert made.objects[2].mesh is world.objects[2].mesh
    assert np.array_equal(made.positions[made.vertices_of(3)], world.positions[world.vertices_of(3)])


def test_refined_meshes_of_several_objects_take_their_places_at_once() -> None:
    world = scene().moved(2, TURN)
    finer = {index: refine(world.objects[index].mesh, faces=[0, 2]) for index in (2, 0)}
    made = world.with_meshes(finer)
    same(made, world.with_mesh(0, finer[0]).with_mesh(2, finer[2]))
    same(made, assemble(made.objects, world.origin))
    for index, mesh in finer.items():  # old vertices come first, unchanged
        old, new = world.vertices_of(index), made.vertices_of(index)
        for name in ("positions", "normals", "geometric", "inset", "uvs", "side", "material"):
            kept = getattr(made, name)[new][: old.stop - old.start]
            assert np.array_equal(kept, getattr(world, name)[old])
        assert len(mesh) == new.stop - new.start
    same(made.with_meshes({index: world.objects[index].mesh for index in finer}), world)


def test_an_empty_world() -> None:
    world = world_mesh([], 1.0)
    assert len(world) == len(world.faces) == len(world.objects) == 0
    assert world.faces.shape == (0, 3)


def test_the_cache_prepares_for_choosing_an_edge() -> None:
    cache = MeshCache()
    items = [(joined(box(), ring()), 1.0), (floor(), 2.0)]
    assert choose_edge(items, 5000, prepared=cache.prepared) == choose_edge(items, 5000)
    assert cache.prepared(items[0][0]) is cache.prepared(items[0][0])
