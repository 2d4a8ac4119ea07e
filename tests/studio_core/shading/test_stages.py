"""The stages that all backends share, over edits: nothing stale, nothing traced twice."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scenes import cube, sky

from studio_core import edits
from studio_core.contract import Services
from studio_core.document import Document
from studio_core.errors import EditError
from studio_core.raster import PictureStage
from studio_core.scene.diff import Changes
from studio_core.scene.geometry import Geometry, Image
from studio_core.scene.nodes import (
    Camera,
    DirectionalLamp,
    Environment,
    Group,
    Material,
    MeshObject,
    PointLamp,
    Scene,
)
from studio_core.scene.transform import Transform
from studio_core.session import View
from studio_core.shading.artifacts import Picture, Radiance
from studio_core.shading.brute_force import VisibilityBits
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params, scene_view
from studio_core.shading.pipeline import Pipeline


@pytest.fixture(scope="module")
def services(host, workers):
    return Services(workers, host)


def seen(picture):
    """Ids of what is seen at the pixels."""
    return [[*picture.nodes, None][index] for index in picture.node.ravel()]


class Watched:
    """A document whose changes go through one pipeline, as in the window."""

    def __init__(self, scene, services, host):
        self.document = Document(scene)
        self.services, self.host = services, host
        self.pipeline = self.fresh()
        self.view = dataclasses.replace(scene_view(scene, None, 32, 24), antialias=1)
        values = {"directions": "1024", "vertices": 800, "lamp_samples": 4, "everywhere": True}
        self.params = backend_params(host.get("backend", "reference"), values)
        self.pending = Changes()
        self.document.changed.connect(self._changed)
        self.shown = self.update(self.pipeline)

    def fresh(self):
        backend = self.host.get("backend", "reference")
        return Pipeline([*backend.stages(self.services), PictureStage(self.services)])

    def _changed(self, before, after, changes):
        self.pending |= changes

    def update(self, pipeline) -> Picture:
        return pipeline.update(Frame(self.document.scene, self.view, self.params), self.pending, Job("x"))

    def apply(self, edit):
        """The picture after an edit, which must be that of a pipeline without a past."""
        self.document.apply(edit)
        made = self.update(self.pipeline)
        self.pending = Changes()
        whole = self.update(self.fresh())
        np.testing.assert_allclose(made.linear, whole.linear, rtol=1e-5, atol=1e-6)
        assert seen(made) == seen(whole)
        return made

    @property
    def traced(self):
        """The store of visibility and how many rays it took."""
        store = self.pipeline.artifact(VisibilityBits)
        return store, store.rays


@pytest.fixture
def watched(services, host, little_scene):
    return Watched(little_scene(), services, host)


def test_light_may_come_to_a_scene_that_had_none(services, host, little_scene):
    bare = edits.Remove(("sky",))(little_scene())
    watched = Watched(bare, services, host)
    assert not watched.shown.linear.any()
    assert watched.apply(edits.Add((Environment(id="new", name="New", image=sky()),))).linear.all()


@pytest.mark.parametrize("opacity", [0.7, 0.3, 0.0])
def test_opacity_is_never_stale(watched, opacity):
    before = watched.shown.linear
    assert not np.array_equal(watched.apply(edits.SetMaterial("paint", opacity=opacity)).linear, before)
    watched.apply(edits.SetMaterial("paint", opacity=opacity / 2))
    watched.apply(edits.SetMaterial("paint", opacity=1.0))


def test_what_moves_no_surface_traces_no_environment_ray(watched):
    traced = watched.traced
    lamp = PointLamp(id="lamp", name="Lamp", transform=Transform((0.0, 2.0, 1.0)))
    watched.apply(edits.Add((lamp,)))
    watched.apply(edits.Move({"lamp": Transform((1.0, 2.0, 1.0))}))
    watched.apply(edits.SetFields("lamp", {"hidden": True}))
    watched.apply(edits.Add((Camera(id="second", name="Second"), Group(id="group", name="Group"))))
    watched.apply(edits.Move({"second": Transform((1.0, 0.0, 0.0))}))
    watched.apply(edits.SetMaterial("paint", opacity=0.8))
    watched.apply(edits.SetMaterial("paint", {"base_color": (0.1, 0.2, 0.3)}))
    watched.apply(edits.Reparent(("cube",), "group"))
    assert watched.traced == traced
    watched.apply(edits.Move({"cube": Transform((0.2, 0.5, 0.0))}))
    assert watched.traced[0] is not traced[0]


def test_whether_the_environment_is_seen_costs_no_light_sum(watched):
    radiance = watched.pipeline.artifact(Radiance)
    watched.apply(edits.SetFields("sky", {"background": False}))
    watched.apply(edits.SetFields("sky", {"intensity": 2.0}))
    assert watched.pipeline.artifact(Radiance) is radiance


def test_groups_move_hide_and_hang_elsewhere(watched):
    one = MeshObject(
        id="one", name="One", geometry=cube(0.3), materials=("paint",), transform=Transform((1.0, 0.2, 1.0))
    )
    watched.apply(edits.Add((Group(id="group", name="Group"), dataclasses.replace(one, parent="group"))))
    watched.apply(edits.Reparent(("cube",), "group"))
    watched.apply(edits.Move({"group": Transform((0.3, 0.1, -0.2))}))
    watched.apply(edits.Order(("cube",), "floor"))
    watched.apply(edits.Move({"group": Transform((0.1, 0.0, 0.0))}))
    watched.apply(edits.Assign("one", "matt"))
    watched.apply(edits.SetFields("group", {"hidden": True}))
    watched.apply(edits.Remove(("cube",)))
    watched.document.go_to(3)
    watched.apply(edits.SetGeometry("cube", cube(0.7)))


def test_the_first_shown_environment_lights_and_is_seen(watched):
    red = Image(np.tile(np.array([4, 0, 0], np.float32), (8, 16, 1)))
    watched.apply(edits.Add((Environment(id="red", name="Red", image=red),)))
    corner = watched.apply(edits.Order(("red",), "sky")).linear[0, 0]
    np.testing.assert_allclose(corner, (4, 0, 0), rtol=1e-5)
    unseen = watched.apply(edits.SetFields("red", {"background": False}))
    assert not unseen.linear[0, 0].any()  # what gives no light is not shown either
    watched.apply(edits.SetFields("red", {"hidden": True}))


@pytest.mark.parametrize(
    "image",
    [
        Image(np.full((8, 16, 1), 0.5, np.float32)),
        Image(np.full((8, 16, 4), 0.5, np.float32)),
        Image(np.full((8, 16, 3), 188, np.uint8), "srgb"),
        Image(np.full((8, 16, 1), 188, np.uint8), "srgb"),
    ],
    ids=["grey", "alpha", "bytes", "grey bytes"],
)
def test_any_picture_may_be_an_environment(watched, image):
    grey = Image(np.full((8, 16, 3), 0.5, np.float32))
    same, made = (watched.apply(edits.SetFields("sky", {"image": i})).linear for i in (grey, image))
    np.testing.assert_allclose(made, same, rtol=0.01)


def test_a_mesh_without_material_is_refused_in_a_sentence(services, host, little_scene):
    scene = little_scene()
    bare = dataclasses.replace(scene["cube"], materials=())
    with pytest.raises(EditError, match="'Cube' cannot be shaded"):
        Watched(scene.with_nodes(bare), services, host)


def test_an_empty_mesh_of_glass_is_no_obstacle(services, host):
    empty = Geometry(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
    scene = Scene().with_materials(Material(id="glass", name="Glass", opacity=0.2))
    nothing = MeshObject(id="n", name="Nothing", geometry=empty, materials=("glass",))
    scene = scene.with_nodes(nothing, Environment(id="sky", name="Sky", image=sky()))
    assert Watched(scene, services, host).shown.linear.all()


@pytest.mark.parametrize("away", [1e4, -1e5])
def test_a_scene_far_away_looks_the_same(services, host, little_scene, away):
    near = little_scene()
    shift = Transform((away, 0.0, away / 2))
    top = [node for node in near.nodes.values() if node.parent is None]
    far = edits.Move({node.id: shift @ node.transform for node in top})(near)
    lamp = DirectionalLamp(id="sun", name="Sun", transform=Transform(rotation=(0.8, -0.6, 0.0, 0.0)))
    here, there = (Watched(s.with_nodes(lamp), services, host).shown for s in (near, far))
    solid = (here.node == there.node) & (here.coverage == 1)
    assert solid.sum() > 0.99 * (here.coverage == 1).sum()
    difference = np.abs(here.linear - there.linear)[solid]
    assert np.percentile(difference, 95) < 0.02 * here.linear[solid].mean()


@pytest.mark.parametrize(
    "wrong", [{"width": 0}, {"height": 0}, {"antialias": 0}, {"fov": 0.0}, {"fov": 180.0}]
)
def test_a_view_of_nothing_is_refused(wrong):
    with pytest.raises(ValueError, match="view"):
        View(**wrong)
