"""Meshes refined where light needs it: over rounds, edits, views and cancelled work."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from counting_stages import StoppingJob
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import cube, sky

from studio_core import edits
from studio_core.contract import Services
from studio_core.document import Document
from studio_core.errors import Cancelled
from studio_core.kernels.raycast import CasterObject, RayCaster
from studio_core.parallel import Workers
from studio_core.raster import PictureStage
from studio_core.scene.diff import Aspect, Changes, view_changed
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import MeshObject, PointLamp
from studio_core.scene.transform import Transform, axis_angle, looking
from studio_core.scene.world_mesh import assemble
from studio_core.shading.artifacts import Casters, Hits, Picture, Radiance, Surfaces
from studio_core.shading.brute_force import VisibilityBits
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params, scene_view
from studio_core.shading.pipeline import Inputs, Pipeline
from studio_core.shading.primary import PrimaryStage
from studio_core.shading.refinement import Adaptive, AdaptiveSurfaceStage, LocatedPrimaryStage
from studio_core.shading.stages import common_stages

LAMP = PointLamp(id="lamp", name="Lamp", intensity=4.0, transform=Transform((1.5, 2.0, 1.5)))
GOAL = Adaptive(target=0.005, extra=3000, rounds=4)


@pytest.fixture(scope="module")
def services(host, workers):
    return Services(workers, host)


def window(size: int = 32) -> Image:
    """A dark sky with one bright window."""
    pixels = np.full((size // 2, size, 3), 0.05, np.float32)
    pixels[size // 8 : size // 4, size // 4 : size // 3] = 20.0
    return Image(pixels)


class Refined:
    """A document seen through the brute-force backend with refinement."""

    def __init__(self, scene, services, goal=GOAL, vertices=600, size=(64, 48)):
        self.document = Document(scene)
        self.services, self.goal = services, goal
        self.view = dataclasses.replace(scene_view(scene, None, *size), antialias=1)
        self.backend = services.registry.get("backend", "reference")
        values = {"directions": "1024", "vertices": vertices, "lamp_samples": 4}
        self.params = backend_params(self.backend, values)
        self.pipeline = self.fresh()
        self.pending = Changes()
        self.heard = []
        self.document.changed.connect(self._changed)

    def fresh(self):
        plain = self.backend.stages(self.services)
        own = plain[len(common_stages(self.services)) :]
        shared = common_stages(self.services, lambda params: self.goal)
        return Pipeline([*shared, *own, PictureStage(self.services)])

    def _changed(self, before, after, changes):
        self.pending |= changes

    @property
    def stage(self) -> AdaptiveSurfaceStage:
        return self.pipeline.stages[0]

    @property
    def surfaces(self) -> Surfaces:
        return self.pipeline.artifact(Surfaces)

    @property
    def extra(self) -> int:
        return len(self.surfaces.mesh) - len(self.surfaces.unrefined.mesh)

    def look(self, edit=None, moving=False, job=None) -> Picture:
        if edit is not None:
            self.document.apply(edit)
        changes, self.pending = self.pending, Changes()
        frame = Frame(self.document.scene, self.view, self.params, moving=moving)
        self.heard = []
        return self.pipeline.update(frame, changes, job or Job("test", on_publish=self.heard.append))

    def turn(self, to) -> None:
        self.view = dataclasses.replace(self.view, transform=looking(to, (0.0, 0.3, 0.0)))
        self.pending |= view_changed()

    def check(self) -> None:
        """What is shown is the light of the vertices there are, and these are the base and its parts."""
        surfaces, made = self.surfaces, self.pipeline.artifact(Radiance)
        assert made.surfaces is surfaces
        mesh, base = surfaces.mesh, surfaces.unrefined.mesh
        whole = assemble(mesh.objects, mesh.origin)
        for name in ("positions", "normals", "area", "faces", "material", "face_material", "vertex_offsets"):
            np.testing.assert_array_equal(getattr(mesh, name), getattr(whole, name))
        for index, (placed, unrefined) in enumerate(zip(mesh.objects, base.objects, strict=True)):
            assert dataclasses.replace(placed, mesh=unrefined.mesh) == unrefined
            old = base.vertices_of(index)
            new = mesh.vertices_of(index)
            for name in ("positions", "normals", "inset"):
                now = getattr(mesh, name)[new][: old.stop - old.start]
                np.testing.assert_array_equal(now, getattr(base, name)[old])
        assert self.extra <= self.goal.extra
        kinds = (stage.gives for stage in self.pipeline.stages)
        artifacts = {kind: self.pipeline.artifact(kind) for kind in kinds}
        artifacts[VisibilityBits] = VisibilityBits(mesh, artifacts[Casters].shadow, self.services.workers)
        frame = Frame(self.document.scene, self.view, self.params)
        again = self.pipeline.stages[-2].run(frame, Inputs(artifacts, Changes()), Job("again"))
        np.testing.assert_array_equal(again.valid, made.valid)
        for layer, there in again.layers.items():
            np.testing.assert_allclose(there.terms, made.layers[layer].terms, rtol=1e-5, atol=1e-6)


@pytest.fixture
def refined(services, little_scene):
    return Refined(little_scene(environment=window()).with_nodes(LAMP), services)


def truth(scene, services, size=(64, 48)) -> np.ndarray:
    """On a mesh so fine that its own error is small."""
    return Refined(scene, services, None, 60_000, size).look().linear


def error(picture: Picture, true: np.ndarray) -> float:
    inner = picture.coverage == 1
    return float(np.sqrt(((picture.linear - true)[inner] ** 2).mean()) / true[inner].mean())


def test_rounds_bring_the_picture_nearer_to_the_truth(refined, services) -> None:
    true = truth(refined.document.scene, services)
    last = refined.look()
    errors = [error(picture, true) for picture in (*refined.heard, last)]
    assert len(errors) >= 3
    assert errors[-1] < 0.5 * errors[0]
    assert refined.pipeline.rounds == len(errors) - 1
    estimates = [report.estimate for report in refined.stage.reports]
    assert len(estimates) == len(errors)
    for estimate, real in zip(estimates, errors, strict=True):
        assert 0.4 * real < estimate < 2.5 * real
    refined.check()
    judged = refined.stage.reports
    assert refined.look() is last
    assert refined.stage.reports is judged  # not even looked at again


def test_few_vertices_in_the_right_places_beat_many_everywhere(refined, services) -> None:
    scene = refined.document.scene
    true = truth(scene, services)
    made = refined.look()
    uniform = Refined(scene, services, None, 2 * len(refined.surfaces.mesh))
    assert error(made, true) < 0.5 * error(uniform.look(), true)
    assert len(uniform.surfaces.mesh) > len(refined.surfaces.mesh)


def test_a_vertex_in_the_dark_of_a_contact_no_longer_bleeds(services, little_scene) -> None:
    scene = little_scene(cube_size=0.12).with_nodes(LAMP)  # a leg on a coarse floor
    bare = Refined(scene, services, None, 600, (120, 90))
    bare.look()
    floor_mesh = bare.surfaces.mesh.objects[bare.surfaces.mesh.index_of("floor")].mesh
    spot = floor_mesh.positions[np.linalg.norm(floor_mesh.positions, axis=1).argmin()]
    leg = dataclasses.replace(scene["cube"], transform=Transform((float(spot[0]), 0.06, float(spot[2]))))
    scene = scene.with_nodes(leg)  # just over one of its vertices
    coarse, fine = (Refined(scene, services, goal, 600, (120, 90)) for goal in (None, GOAL))
    true = truth(scene, services, (120, 90))
    before, after = coarse.look(), fine.look()
    assert error(after, true) < 0.4 * error(before, true)
    floor = after.nodes.index("floor")
    at = fine.surfaces.mesh.positions[fine.surfaces.mesh.vertices_of(floor)] + fine.surfaces.mesh.origin
    near = np.linalg.norm((at - spot)[:, [0, 2]], axis=1) < 0.3
    assert near.sum() > 0.4 * fine.extra


def test_without_a_goal_nothing_is_refined(services, little_scene) -> None:
    plain = Refined(little_scene(), services, None)
    plain.look()
    assert plain.surfaces.base is None
    assert plain.surfaces.unrefined is plain.surfaces
    assert plain.pipeline.rounds == 0


def test_refinement_traces_no_primary_ray_and_rebuilds_no_caster(refined) -> None:
    refined.look(moving=True)
    casters = refined.pipeline.artifact(Casters)
    rays, bits = casters.primary.rays, refined.pipeline.artifact(VisibilityBits)
    refined.pending |= view_changed()
    refined.look()
    assert refined.pipeline.rounds > 1
    assert refined.extra > 100
    assert refined.pipeline.artifact(Casters) is casters
    assert casters.primary.rays <= rays + refined.view.width * refined.view.height
    assert refined.pipeline.artifact(VisibilityBits) is not bits


def test_hits_carried_down_are_hits_traced(refined) -> None:
    refined.document.apply(edits.SetMaterial("paint", opacity=0.4))
    refined.document.apply(edits.Move({"cube": Transform((0.0, 0.6, 0.0))}))  # in contact either may be first
    refined.look()
    surfaces, hits = refined.surfaces, refined.pipeline.artifact(Hits)
    objects = [
        CasterObject(p.mesh.positions, p.mesh.faces, p.node, p.transform.matrix(), None)
        for p in surfaces.mesh.objects
    ]
    alone = dataclasses.replace(surfaces, base=None, tree=None)
    casters = Casters(RayCaster([]), RayCaster(objects), (), ())
    frame = Frame(refined.document.scene, refined.view, refined.params)
    inputs = Inputs({Surfaces: alone, Casters: casters}, Changes())
    traced = PrimaryStage(refined.services).run(frame, inputs, Job("trace"))
    mesh = surfaces.mesh

    def compare(made: Hits, again: Hits) -> None:
        np.testing.assert_array_equal(made.face >= 0, again.face >= 0)
        hit = made.face >= 0
        assert (made.face[hit] == again.face[hit]).mean() > 0.99
        places = []
        for found in (made, again):
            corners = mesh.positions[mesh.faces[found.face[hit]]].astype(np.float64)
            weights = np.stack([1 - found.u - found.v, found.u, found.v], axis=1)[hit]
            places.append((weights[:, :, None] * corners).sum(axis=1))
        np.testing.assert_allclose(*places, atol=1e-5)
        assert len(made.behind) == len(again.behind)
        for (a, rest), (b, other) in zip(made.behind, again.behind, strict=True):
            np.testing.assert_array_equal(a, b)
            compare(rest, other)

    assert hits.behind
    compare(hits, traced)


def test_hits_of_pixels_in_which_something_ends_are_carried_down_too(refined) -> None:
    refined.document.apply(edits.SetMaterial("paint", opacity=0.4))
    refined.view = dataclasses.replace(refined.view, fine_edges=True)
    refined.look()
    surfaces, carried = refined.surfaces, refined.pipeline.artifact(Hits)
    frame = Frame(refined.document.scene, refined.view, refined.params)
    made = {Surfaces: surfaces.unrefined, Casters: refined.pipeline.artifact(Casters)}
    traced = PrimaryStage(refined.services).run(frame, Inputs(made, Changes()), Job("trace"))
    np.testing.assert_array_equal(carried.edges.pixels, traced.edges.pixels)

    def points(mesh, hits: Hits):
        hit = hits.face >= 0
        weights = np.stack([1 - hits.u - hits.v, hits.u, hits.v], axis=1)[hit]
        return np.einsum("nk,nkc->nc", weights, mesh.positions[mesh.faces[hits.face[hit]]])

    pairs = [(carried.edges.hits, traced.edges.hits)]
    for below, above in pairs:
        np.testing.assert_array_equal(below.face >= 0, above.face >= 0)
        ours, theirs = points(surfaces.mesh, below), points(surfaces.unrefined.mesh, above)
        np.testing.assert_allclose(ours, theirs, atol=1e-5)
        for (a, rest), (b, other) in zip(below.behind, above.behind, strict=True):
            np.testing.assert_array_equal(a, b)
            pairs.append((rest, other))
    assert len(pairs) > 1
    assert (carried.edges.hits.face != traced.edges.hits.face).any()


def test_one_thread_refines_like_two(services, little_scene) -> None:
    scene = little_scene(environment=window())
    with Workers(1) as one:
        single = Refined(scene, Services(one, services.registry))
        double = Refined(scene, services)
        single.view = double.view = dataclasses.replace(double.view, fine_edges=True)
        np.testing.assert_array_equal(single.look().linear, double.look().linear)
        np.testing.assert_array_equal(single.surfaces.mesh.faces, double.surfaces.mesh.faces)


def test_instances_are_refined_each_for_itself(services, little_scene) -> None:
    scene = little_scene(environment=window())
    second = dataclasses.replace(scene["cube"], id="second", transform=Transform((-1.2, 0.5, -0.5)))
    made = Refined(scene.with_nodes(second), services)
    made.look()
    placed = {p.node: p.mesh for p in made.surfaces.mesh.objects}
    assert len(placed["cube"]) != len(placed["second"])
    base = {p.node: p.mesh for p in made.surfaces.unrefined.mesh.objects}
    assert base["cube"] is base["second"]
    made.check()


def test_refinement_outlives_edits_that_leave_the_mesh(refined) -> None:
    refined.look()
    kept = {p.node: p.mesh for p in refined.surfaces.mesh.objects}
    refined.goal = dataclasses.replace(GOAL, rounds=0)

    def same() -> bool:
        return all(p.mesh is kept[p.node] for p in refined.surfaces.mesh.objects)

    for edit in (
        edits.Move({"cube": Transform((0.3, 0.5, 0.1), axis_angle((0, 1, 0), 30))}),
        edits.SetMaterial("paint", {"base_color": (0.1, 0.2, 0.3)}),
        edits.SetMaterial("paint", opacity=0.5),
        edits.Assign("cube", "matt"),
        edits.SetFields("lamp", {"intensity": 1.0}),
        edits.Remove(("lamp",)),
    ):
        refined.look(edit, moving=True)
        refined.check()
        assert same(), edit
    for index in range(6, -1, -1):
        refined.document.go_to(index)
        refined.look()
        refined.check()
        assert same()


def test_removed_objects_take_theirs_along_and_bring_it_back(refined) -> None:
    refined.look()
    kept = {p.node: p.mesh for p in refined.surfaces.mesh.objects}
    refined.goal = dataclasses.replace(GOAL, rounds=0)
    edge = refined.surfaces.mesh.objects[0].mesh.edge
    refined.look(edits.Remove(("cube",)))
    refined.check()
    assert len(refined.surfaces.mesh.objects) == 1
    refined.document.undo()
    refined.look()
    refined.check()
    assert refined.surfaces.mesh.objects[0].mesh.edge == edge
    assert all(p.mesh is kept[p.node] for p in refined.surfaces.mesh.objects)
    refined.look(edits.SetGeometry("cube", cube(0.6)))
    refined.check()
    assert next(p for p in refined.surfaces.mesh.objects if p.node == "cube").mesh is not kept["cube"]


def test_another_budget_and_no_goal_start_over(refined) -> None:
    refined.look()
    refined.params = dataclasses.replace(refined.params, vertices=900)
    refined.pending |= Changes(aspects=Aspect.QUALITY)
    refined.goal = dataclasses.replace(GOAL, rounds=0)
    refined.look()
    assert refined.extra == 0
    refined.goal = None
    refined.pending |= Changes(aspects=Aspect.QUALITY)
    refined.look()
    assert refined.surfaces.base is None


@given(seed=st.integers(0, 2**32))
@settings(max_examples=5)
def test_any_history_stays_within_bounds_and_right(services, seed: int) -> None:
    from scenes import little_scene

    rng = np.random.default_rng(seed)
    small = dataclasses.replace(GOAL, extra=700, rounds=3)
    refined = Refined(little_scene(environment=window()), services, small, size=(40, 30))
    one = MeshObject(id="one", name="One", geometry=cube(0.4), materials=("paint",))
    for step in range(7):
        moving = bool(rng.random() < 0.4)
        kind = rng.integers(0, 5)
        edit = None
        if kind == 0:
            refined.turn((rng.uniform(-3, 3), rng.uniform(0.5, 3), rng.uniform(2, 4)))
        elif kind == 1:
            place = Transform((rng.uniform(-1, 1), 0.5, rng.uniform(-1, 1)))
            edit = edits.Move({"cube": place})
        elif kind == 2:
            where = Transform((rng.uniform(-1, 1), 0.2, 1.2))
            edit = edits.Add((dataclasses.replace(one, id=f"one-{step}", transform=where),))
        elif kind == 3:
            edit = edits.SetFields("sky", {"azimuth": rng.uniform(0, 6)})
        elif refined.document.can_undo:
            refined.document.undo()
        try:
            stop = 0 if rng.random() < 0.6 else int(rng.integers(1, 200))
            refined.look(edit, moving, StoppingJob(stop) if stop else None)
        except Cancelled:
            continue
        refined.check()
        assert refined.pipeline.rounds <= small.rounds + 1


def test_a_round_that_was_stopped_is_forgotten(refined) -> None:
    """What moves next is drawn with vertices that are known already."""
    refined.look(moving=True)
    lit = refined.pipeline.stages[-2]
    plain = refined.pipeline.artifact(Radiance)
    run: Callable[..., object] = lit.run

    def stop(frame: Frame, inputs: Inputs, job: Job) -> object:
        if inputs[Surfaces].base is not None:
            raise Cancelled
        return run(frame, inputs, job)

    lit.run = stop
    refined.pending |= view_changed()
    with pytest.raises(Cancelled):
        refined.look()
    assert len(refined.heard) == 1  # the picture before the round
    lit.run = run
    refined.look(moving=True)
    assert refined.surfaces.base is None
    assert refined.surfaces is plain.surfaces
    refined.pending |= view_changed()
    refined.look()
    assert refined.extra > 100
    refined.check()


def test_where_there_is_no_room_what_hardly_helps_goes(services, little_scene) -> None:
    scene = little_scene(environment=window())
    far = dataclasses.replace(
        scene["floor"], id="far", transform=Transform((0.0, 0.0, 60.0)), name="Far", materials=("paint",)
    )
    stand = dataclasses.replace(scene["cube"], id="stand", transform=Transform((0.0, 0.5, 60.0)))
    tight = dataclasses.replace(GOAL, extra=500, target=0.005)
    refined = Refined(scene.with_nodes(far, stand), services, tight)
    refined.look()
    before = {p.node: len(p.mesh) for p in refined.surfaces.mesh.objects}
    base = {p.node: len(p.mesh) for p in refined.surfaces.unrefined.mesh.objects}
    assert before["floor"] > base["floor"]
    assert before["far"] == base["far"]
    place = refined.view.transform.translation
    there = Transform((0.0, 0.0, 60.0)) @ refined.view.transform
    assert there.translation[2] == pytest.approx(place[2] + 60)
    refined.view = dataclasses.replace(refined.view, transform=there)
    refined.pending |= view_changed()
    refined.look()
    after = {p.node: len(p.mesh) for p in refined.surfaces.mesh.objects}
    assert after["far"] > base["far"]
    assert after["floor"] == base["floor"]
    refined.check()


def test_hits_of_an_unchanged_view_are_the_same_object(services, little_scene) -> None:
    scene = little_scene(environment=sky())
    seen = Refined(scene, services, None)
    seen.look()
    hits = seen.pipeline.artifact(Hits)
    seen.look(edits.SetMaterial("paint", {"base_color": (0.1, 0.2, 0.3)}))
    assert seen.pipeline.artifact(Hits) is hits
    assert isinstance(seen.pipeline.stages[4], LocatedPrimaryStage)
