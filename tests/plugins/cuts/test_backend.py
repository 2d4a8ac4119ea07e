"""The cuts as a whole: against brute force, after every kind of edit, and how little each costs."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from counting_stages import StoppingJob
from scenes import cube, little_scene, sky

from studio_core import edits
from studio_core.arrays import frozen_map
from studio_core.contract import Services
from studio_core.errors import Cancelled, EditError
from studio_core.parallel import Workers
from studio_core.scene.diff import Aspect, Changes, diff, view_changed
from studio_core.scene.geometry import Geometry, Image
from studio_core.scene.nodes import AreaLamp, Group, Material, MeshObject, PointLamp, Scene
from studio_core.scene.transform import Transform, axis_angle, looking
from studio_core.shading.artifacts import Radiance, Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.materials import coefficients, resolve
from studio_core.shading.offline import backend_params, scene_view, shade
from studio_core.shading.pipeline import Pipeline
from studio_plugins.cuts import light_cache, light_stage, visibility_stage
from studio_plugins.cuts.visibility_stage import Seen

FAST = {"directions": "1024", "vertices": 700, "refine": False, "lamp_samples": 8}


@pytest.fixture(scope="module")
def services(host, workers):
    return Services(workers, host)


def params_of(host, **values):
    return backend_params(host.get("backend", "cuts"), values)


class Given:
    """Hands on surfaces that another pipeline has made."""

    needs: tuple[type, ...] = ()
    gives = Surfaces
    dirtied_by = Aspect.NONE

    def __init__(self, surfaces: Surfaces) -> None:
        self._surfaces = surfaces

    def run(self, frame: Frame, inputs: Any, job: Job) -> Surfaces:
        return self._surfaces


class Bench:
    """A pipeline over a scene that is edited."""

    def __init__(self, scene, host, services, everywhere=False, **values):
        self.scene, self.services = scene, services
        self.view = scene_view(scene, None, 48, 36)
        self.backend = host.get("backend", "cuts")
        self.params = params_of(host, **{**FAST, "everywhere": everywhere, **values})
        self.pipeline = Pipeline(self.backend.stages(services))
        self.revision = 0
        self.made = self.update(Changes())

    def update(self, changes: Changes, job: Job | None = None, moving: bool = False) -> Radiance:
        self.revision += 1
        frame = Frame(self.scene, self.view, self.params, self.revision, moving)
        self.made = self.pipeline.update(frame, changes, job or Job("test"))
        return self.made

    def do(self, edit, job=None, moving=False) -> Radiance:
        before, self.scene = self.scene, edit(self.scene)
        return self.update(diff(before, self.scene), job, moving)

    def go(self, before, after) -> Radiance:
        """From one scene to another, as undo does."""
        self.scene = after
        return self.update(diff(before, after))

    def look(self, transform, moving=False) -> Radiance:
        self.view = dataclasses.replace(self.view, transform=transform)
        return self.update(view_changed(), moving=moving)

    def rest(self) -> Radiance:
        return self.update(view_changed())

    def fresh(self) -> tuple[Radiance, Pipeline]:
        """What a pipeline without a past makes of the same meshes."""
        surfaces = self.pipeline.artifact(Surfaces)
        pipeline = Pipeline([Given(surfaces), *self.backend.stages(self.services)[1:]])
        frame = Frame(self.scene, self.view, self.params, 1)
        return pipeline.update(frame, Changes(), Job("fresh")), pipeline

    def visible(self, pipeline=None):
        """Exact records of the vertices that are seen, by what blocks: slots differ between stores."""
        seen = (pipeline or self.pipeline).artifact(Seen)
        return seen, {p: blocked(seen.store, p) for p in seen.points[::5]}

    def assert_fresh(self, exact=True, close=1e-5):
        made, pipeline = self.fresh()
        mine, own = self.visible()
        theirs, other = self.visible(pipeline)
        np.testing.assert_array_equal(mine.mask, theirs.mask)
        assert mine.exact
        assert theirs.exact
        assert self.made.final
        assert own == other
        assert self.made.layers.keys() == made.layers.keys()
        seen = mine.mask
        for node, layer in made.layers.items():
            found = self.made.layers[node]
            scale = max(float(layer.irradiance[seen].mean()), 1e-6)
            np.testing.assert_allclose(found.irradiance[seen], layer.irradiance[seen], atol=1e-5 * scale)
            wrong = found.terms[seen] - layer.terms[seen]
            if exact:
                assert np.abs(wrong).max() <= close * max(np.abs(layer.terms[seen]).max(), 1e-6)
            else:  # nodes were split for another lobe, or finer while it moved: within the tolerance
                size = np.sqrt((layer.terms[seen] ** 2).mean())
                assert np.sqrt((wrong**2).mean()) < 5e-3 * size


def blocked(store, p):
    """What is hidden at a vertex, as bytes."""
    sources = store.sources()
    hidden = np.zeros(1 << store.k, np.bool_)
    record = sources.pool[sources.start[p] : sources.start[p] + sources.length[p]].tolist()
    skip, at = sources.skip[sources.row[p], sources.owner[p]], 0
    while at < len(record):
        slot, count = record[at], record[at + 1]
        for pair in range(at + 2, at + 2 + 2 * count, 2):
            if not skip[slot]:
                hidden[record[pair] : record[pair + 1] + 1] = True
        at += 2 + 2 * count
    return hidden.tobytes()


def thing(name: str, geometry: Geometry, material: str, transform: Transform) -> MeshObject:
    return MeshObject(id=name, name=name, geometry=geometry, materials=(material,), transform=transform)


def lit_scene(**options: Any) -> Scene:
    """A cube, a small box and a sheet on a floor; sky, a point lamp and an area lamp."""
    scene = little_scene(cube_model="ggx", cube_values={"roughness": 0.5}, **options)
    corners = np.array([(-0.4, 0, 0), (0.4, 0, 0), (0.4, 0.8, 0.2), (-0.4, 0.8, 0.2)], np.float32)
    sheet = Geometry(corners, np.array([(0, 1, 2), (0, 2, 3)], np.uint32))
    glaze = Material(id="glaze", name="Glaze", model="phong", values=frozen_map({"exponent": 40.0}))
    return scene.with_materials(glaze).with_nodes(
        thing("box", cube(0.5), "glaze", Transform((1.0, 0.25, 0.75))),
        MeshObject(
            id="sheet",
            name="Sheet",
            geometry=sheet,
            materials=("matt",),
            transform=Transform((-1.0, 0.0, 0.5)),
        ),
        PointLamp(id="bulb", name="Bulb", transform=Transform((0.5, 1.75, 1.25))),
        AreaLamp(
            id="panel",
            name="Panel",
            transform=Transform((-0.5, 2.5, 0.0), axis_angle((1, 0, 0), -90)),
            width=1.0,
            height=0.5,
        ),
    )


@pytest.fixture
def bench(host, services):
    return Bench(lit_scene(), host, services)


# -- against brute force ------------------------------------------------------------------------------


def error(found, true):
    return float(np.sqrt(((found - true) ** 2).mean()) / max(true.mean(), 1e-12))


def colours(scene, made, services):
    """(V, 3) radiance per vertex with the materials' coefficients."""
    total = np.zeros((len(made.valid), 3))
    lights = {node.id: node for node in scene.nodes.values() if node.id in made.layers}
    terms = made.combined(lights)
    for m, name in enumerate(made.surfaces.materials):
        own = made.surfaces.mesh.material == m
        table = coefficients(resolve(scene.material(name), services.registry))
        total[own] = np.einsum("vtc,tc->vc", terms[own], table)
    return total


def compared(scene, host, services, vertices=700, quality=0.5):
    view = scene_view(scene, None, 48, 36)
    values = {**FAST, "vertices": vertices, "everywhere": True}
    cuts, reference = host.get("backend", "cuts"), host.get("backend", "reference")
    own = shade(scene, view, cuts, params_of(host, **values, quality=quality), services)
    plain = {n: v for n, v in values.items() if n != "refine"} | {"quarters": False}
    truth = shade(scene, view, reference, backend_params(reference, plain), services)
    np.testing.assert_array_equal(own.surfaces.mesh.positions, truth.surfaces.mesh.positions)
    return own, truth


def random_scene(seed: int) -> Scene:
    """Boxes through each other on a floor, and a thin open mesh."""
    rng = np.random.default_rng(seed)
    scene = little_scene(cube_model=("lambert", "ggx", "phong")[seed % 3])
    for number in range(4):
        turn = axis_angle(rng.normal(size=3), rng.uniform(-90, 90))
        place = Transform(tuple(rng.uniform((-1.2, 0.2, -1.2), (1.2, 0.9, 1.2))), turn, rng.uniform(0.5, 1.5))
        scene = scene.with_nodes(thing(f"b{number}", cube(0.4), ("paint", "matt")[number % 2], place))
    corners = np.round(rng.uniform(-0.4, 0.4, (12, 3)), 3).astype(np.float32)
    shards = Geometry(corners, np.arange(12, dtype=np.uint32).reshape(-1, 3))
    return scene.with_nodes(
        MeshObject(
            id="shards", name="S", geometry=shards, materials=("matt",), transform=Transform((0, 1.4, 0))
        )
    )


@pytest.mark.parametrize("seed", range(3))
def test_random_scenes_are_lit_as_by_brute_force(host, services, seed):
    scene = random_scene(seed)
    own, truth = compared(scene, host, services)
    a, b = own.layers["sky"].irradiance, truth.layers["sky"].irradiance
    assert error(a, b) < 1e-3
    assert error(colours(scene, own, services), colours(scene, truth, services)) < 2e-2


def test_matt_surfaces_are_exact(host, services):
    scene = little_scene()
    own, truth = compared(scene, host, services)
    assert error(own.layers["sky"].irradiance, truth.layers["sky"].irradiance) < 1e-3
    assert error(colours(scene, own, services), colours(scene, truth, services)) < 1e-3


def test_glossy_surfaces_are_within_two_per_cent(host, services):
    scene = little_scene(cube_model="ggx", cube_values={"roughness": 0.5, "metallic": 1.0})
    own, truth = compared(scene, host, services)
    assert error(colours(scene, own, services), colours(scene, truth, services)) < 2e-2
    finest, _ = compared(scene, host, services, quality=1.0)
    finer = error(colours(scene, finest, services), colours(scene, truth, services))
    assert finer < error(colours(scene, own, services), colours(scene, truth, services)) + 1e-4


def test_every_layer_is_that_of_brute_force(host, services):
    own, truth = compared(lit_scene(), host, services)
    assert own.layers.keys() == truth.layers.keys() == {"sky", "bulb", "panel"}
    for layer in ("bulb", "panel"):
        assert error(own.layers[layer].irradiance, truth.layers[layer].irradiance) < 1e-5
        assert error(own.layers[layer].terms, truth.layers[layer].terms) < 1e-4


@pytest.mark.parametrize(("scale", "place"), [(1e-3, (0.0, 0.0, 0.0)), (1.0, (1e4, 0.0, -1e4))])
def test_tiny_scenes_and_far_ones(host, services, scale, place):
    base = Transform(place, scale=scale)
    scene = little_scene()
    nodes = [dataclasses.replace(node, transform=base @ node.transform) for node in scene.of(MeshObject)]
    camera = dataclasses.replace(scene["camera"], transform=base @ scene["camera"].transform)
    camera = dataclasses.replace(camera, transform=dataclasses.replace(camera.transform, scale=1.0))
    scene = scene.with_nodes(*nodes, camera)
    own, truth = compared(scene, host, services)
    a, b = own.layers["sky"].irradiance, truth.layers["sky"].irradiance
    assert truth.layers["sky"].irradiance.max() > 1
    assert error(a, b) < 2e-3


def test_no_light_leaks_where_a_box_stands_on_the_floor(host, services):
    """Floor and box touch in one plane, and all light comes from below: neither gets any."""
    image = np.zeros((32, 64, 3), np.float32)
    image[18:] = 1.0
    scene = little_scene(environment=Image(image), floor_size=200.0)
    made = Bench(scene, host, services, everywhere=True, vertices=6000).made
    mesh = made.surfaces.mesh
    places = mesh.positions + mesh.origin
    light = made.layers["sky"].irradiance.max(axis=1)
    near = (np.abs(places[:, [0, 2]]) < 1.0).all(axis=1) & (mesh.normals[:, 1] > -0.5)
    assert (near & (places[:, 1] < 1e-6)).sum() > 5
    assert light[near].max() < 1e-6
    assert light[mesh.normals[:, 1] < -0.5].max() > 1

    above = Bench(little_scene(), host, services, everywhere=True, vertices=3000).made
    mesh = above.surfaces.mesh
    places = mesh.positions + mesh.origin
    light = above.layers["sky"].irradiance.max(axis=1)
    inside = (np.abs(places[:, [0, 2]]) < 0.45).all(axis=1) & (mesh.normals[:, 1] > 0.9)
    under = inside & (mesh.object == above.surfaces.nodes.index("floor"))
    assert under.sum() > 5
    assert light[under].max() < 1e-6


def test_objects_of_one_triangle_and_of_ten_thousand(host, services):
    triangle = Geometry(
        np.array([(0, 0, 0), (0.8, 0, 0), (0, 0.8, 0.1)], np.float32), np.array([(0, 1, 2)], np.uint32)
    )
    steps = np.linspace(-0.4, 0.4, 72)
    x, z = np.meshgrid(steps, steps, indexing="ij")
    waves = np.stack([x, 0.1 * np.sin(9 * x) * np.cos(7 * z), z], axis=-1).reshape(-1, 3)
    index = np.arange(72 * 72).reshape(72, 72)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    faces = np.concatenate([np.stack([a, c, b], 1), np.stack([a, d, c], 1)])
    cloth = Geometry(waves.astype(np.float32), faces.astype(np.uint32))
    assert len(faces) > 10_000
    scene = little_scene().with_nodes(
        MeshObject(
            id="t", name="T", geometry=triangle, materials=("paint",), transform=Transform((-1, 0.5, 1))
        ),
        MeshObject(
            id="c", name="C", geometry=cloth, materials=("paint",), transform=Transform((1, 1.2, 0.5))
        ),
    )
    own, truth = compared(scene, host, services, vertices=500)
    a, b = own.layers["sky"].irradiance, truth.layers["sky"].irradiance
    assert error(a, b) < 1e-3
    assert {"t", "c"} <= set(own.surfaces.nodes)


# -- by increments as afresh ---------------------------------------------------------------------------

MOVE = edits.Move({"box": Transform((0.75, 0.25, 0.5))})
BACK = edits.Move({"box": Transform((1.0, 0.25, 0.75))})
TURN = edits.Move({"box": Transform((1.0, 0.25, 0.75), axis_angle((0, 1, 0), 25))})
SMALL = edits.Move({"box": Transform((1.0, 0.25, 0.75), scale=0.5)})
LAMP = edits.Move({"bulb": Transform((0.0, 1.5, 1.5))})
OTHER = thing("new", cube(0.25), "glaze", Transform((-0.75, 0.125, 1.25)))
EDITS: Mapping[str, Any] = {
    "move": MOVE,
    "turn": TURN,
    "scale": SMALL,
    "move the sheet": edits.Move({"sheet": Transform((-1.0, 0.25, 0.75))}),
    "move the floor": edits.Move({"floor": Transform((0.0, -0.25, 0.0))}),
    "add": edits.Add((OTHER,)),
    "remove": edits.Remove(("box",)),
    "hide": edits.SetFields("box", {"hidden": True}),
    "hide a lamp": edits.SetFields("bulb", {"hidden": True}),
    "colour": edits.SetMaterial("glaze", {"diffuse": (0.1, 0.6, 0.2)}),
    "exponent": edits.SetMaterial("glaze", {"exponent": 15.0}),
    "model": edits.SetMaterial("matt", model="ggx"),
    "to matt": edits.SetMaterial("paint", model="lambert"),
    "see through": edits.SetMaterial("glaze", opacity=0.3),
    "assign": edits.Assign("box", "paint"),
    "turn the light": edits.SetFields("sky", {"azimuth": 70.0}),
    "another light": edits.SetFields("sky", {"image": sky(16, 2.0)}),
    "gain": edits.SetFields("sky", {"intensity": 3.0}),
    "move a lamp": LAMP,
    "size a lamp": edits.SetFields("panel", {"width": 0.25}),
    "remove a lamp": edits.Remove(("panel",)),
    "mesh": edits.SetGeometry("box", cube(0.4)),
}
RETURNS = {"to matt", "move", "turn", "hide", "see through", "add", "remove", "move a lamp", "scale"}
LOOKS = {"colour", "exponent", "model", "to matt", "assign"}  # nodes may stay split for another lobe


@pytest.mark.parametrize("name", EDITS)
def test_an_edit_by_increments_is_as_afresh(bench, name):
    bench.do(EDITS[name])
    bench.assert_fresh(exact=name not in LOOKS)


@pytest.mark.parametrize("name", sorted(RETURNS))
def test_and_back(bench, name):
    scene = bench.scene
    before = dict(bench.made.layers)
    bench.do(EDITS[name])
    now, bench.scene = bench.scene, scene
    bench.update(diff(now, scene))
    bench.assert_fresh()
    for node, layer in before.items():
        found = bench.made.layers[node]
        if found.terms.shape == layer.terms.shape:
            seen = bench.made.valid
            np.testing.assert_allclose(found.irradiance[seen], layer.irradiance[seen], atol=1e-6)


@pytest.mark.parametrize("name", ["move", "turn", "scale", "move a lamp", "turn the light", "add", "hide"])
def test_moving_frames_leave_nothing_behind(bench, name):
    bench.do(EDITS[name], moving=True)
    bench.do(LAMP, moving=True)
    bench.do(MOVE if name != "hide" else EDITS["gain"], moving=True)
    bench.rest()
    bench.assert_fresh(exact=False)


@pytest.mark.parametrize(
    ("name", "at"),
    [("move", at) for at in (1, 4, 7, 10, 13, 16, 20, 25)]
    + [("hide", at) for at in (5, 12, 15, 24)]
    + [("turn the light", at) for at in (6, 11, 14, 21)],
)
def test_cancelled_frames_leave_nothing_behind(bench, name, at):
    both = edits.Compound("both", (EDITS[name], LAMP))
    with contextlib.suppress(Cancelled):
        bench.do(both, StoppingJob(at), moving=at % 2 == 0)
    bench.do(EDITS["move the sheet"], moving=at % 3 == 0)
    bench.rest()
    bench.assert_fresh(exact=False)


@pytest.mark.parametrize("seed", range(6))
def test_random_sessions(host, services, seed):
    """Edits, undo and looks around, some while a hand moves, some cancelled anywhere."""
    rng = np.random.default_rng(seed)
    scene = lit_scene()
    if seed % 3 == 0:
        scene = edits.Reparent(("box", "sheet"), "g")(scene.with_nodes(Group(id="g", name="G")))
    bench = Bench(scene, host, services)
    views = [
        bench.view.transform,
        looking((-2.5, 1.2, -3.0), (0, 0.4, 0)),
        looking((0.2, 3.5, 0.1), (0, 0, 0)),
    ]
    history, names = [bench.scene], list(EDITS)
    for _ in range(7):
        kind, moving = rng.integers(0, 10), bool(rng.random() < 0.35)
        job = StoppingJob(int(rng.integers(1, 40))) if rng.random() < 0.3 else None
        with contextlib.suppress(Cancelled, EditError):  # some things are gone already
            if kind < 6:
                bench.do(EDITS[names[rng.integers(len(names))]], job, moving)
            elif kind < 8:
                now, bench.scene = bench.scene, history[rng.integers(len(history))]
                bench.update(diff(now, bench.scene), job, moving)
            else:
                bench.look(views[rng.integers(3)], moving)
        history.append(bench.scene)
    bench.rest()
    bench.assert_fresh(exact=False)


def test_the_camera_shows_what_was_hidden(bench):
    there = looking((-2.5, 1.2, -3.0), (0, 0.4, 0))
    bench.look(there)
    bench.assert_fresh()
    bench.do(MOVE)
    bench.look(scene_view(bench.scene, None, 48, 36).transform)
    bench.assert_fresh()


def test_what_changes_while_it_is_hidden_is_right_when_it_shows(host, services):
    """A wall hides a matt floor's far end; its material changes; the wall goes."""
    wall = thing("wall", cube(1.0), "paint", Transform((1.25, 0.9, 1.6)))
    bench = Bench(lit_scene().with_nodes(wall), host, services)
    away = edits.Move({"wall": Transform((-1.5, 0.5, -1.5))})
    near = edits.Move({"wall": Transform((1.25, 0.9, 1.6))})
    bench.do(away)
    seen = bench.made.valid
    bench.do(near)
    assert (seen & ~bench.made.valid).any()
    bench.do(EDITS["exponent"])
    bench.do(away)
    bench.assert_fresh(exact=False)


def test_objects_in_another_order_keep_their_own_light(bench):
    bench.do(edits.Compound("both", (edits.Order(("box",), "floor"), edits.Assign("sheet", "paint"))))
    assert bench.pipeline.artifact(Surfaces).nodes[0] == "box"
    bench.assert_fresh()


@pytest.mark.parametrize(
    "values",
    [
        {"directions": "4096"},
        {"vertices": 500},
        {"directions": "2048", "vertices": 500},
        {"everywhere": True},
        {"lamp_samples": 4},
        {"quality": 1.0},
    ],
)
def test_other_parameters_and_back(bench, host, values):
    for wanted in ({**FAST, **values}, FAST):
        bench.params = params_of(host, **wanted)
        bench.update(view_changed(Aspect.QUALITY))
        bench.assert_fresh(exact="quality" not in values)  # what was finer stays


@pytest.mark.parametrize("light", ["sky", "bulb", "panel"])
def test_what_moves_while_a_light_is_off(bench, light):
    bench.do(edits.SetFields(light, {"hidden": True}))
    bench.do(MOVE)
    bench.do(EDITS["add"])
    bench.do(edits.SetFields(light, {"hidden": False}))
    bench.assert_fresh()


def test_groups_are_one_thing_until_a_part_moves(host, services):
    scene = lit_scene().with_nodes(Group(id="g", name="G"))
    scene = edits.Reparent(("box", "sheet"), "g")(scene)
    bench = Bench(scene, host, services)
    bench.do(edits.Move({"g": Transform((0.25, 0.0, -0.125))}))
    bench.assert_fresh()
    bench.do(edits.SetMaterial("glaze", opacity=0.3))
    bench.assert_fresh()


def test_one_and_two_threads_agree_bit_for_bit(host):
    made = []
    for threads in (1, 2):
        with Workers(threads) as own:
            bench = Bench(lit_scene(), host, Services(own, host))
            bench.do(MOVE)
            made.append(bench.made)
    for node, layer in made[0].layers.items():
        np.testing.assert_array_equal(layer.terms, made[1].layers[node].terms)
        np.testing.assert_array_equal(layer.irradiance, made[1].layers[node].irradiance)


# -- what it costs -------------------------------------------------------------------------------------


def work(bench, action):
    """How much more of everything was done."""
    before = dict(bench.made.counts)
    action()
    after = bench.made.counts
    steps = ("rays", "packets", "objects_traced")
    return {n: after[n] - before[n] if n in steps else after[n] for n in after}


def test_a_change_of_colour_does_nothing_at_all(bench):
    made = bench.made
    assert bench.do(EDITS["colour"]) is made


def test_a_change_of_gain_does_nothing_at_all(bench):
    made = bench.made
    assert bench.do(EDITS["gain"]) is made


def test_a_change_of_gloss_shades_the_material_alone(bench):
    done = work(bench, lambda: bench.do(EDITS["exponent"]))
    own = bench.made.surfaces.mesh.material == bench.made.surfaces.materials.index("glaze")
    assert done["rays"] == done["objects_traced"] == 0
    assert done["vertices_summed"] == done["vertices_traced_to_lamps"] == 0
    assert done["vertices_shaded"] == len(bench.made.layers) * int((own & bench.made.valid).sum())


def test_a_camera_that_comes_back_traces_nothing(bench):
    here, there = bench.view.transform, looking((-2.5, 1.2, -3.0), (0, 0.4, 0))
    bench.look(there)
    done = work(bench, lambda: bench.look(here))
    assert done["rays"] == 0
    assert done["vertices_summed"] == 0
    assert done["vertices_traced_to_lamps"] == 0
    assert done["skipped_vertices_unseen"] > 0


def test_another_light_traces_nothing(bench):
    done = work(bench, lambda: bench.do(EDITS["turn the light"]))
    assert done["rays"] == 0
    assert done["vertices_traced_to_lamps"] == 0
    assert done["vertices_summed"] == int(bench.made.valid.sum())


def test_a_lamp_that_moves_leaves_the_sky_alone(bench):
    sky_before = bench.made.layers["sky"]
    done = work(bench, lambda: bench.do(LAMP))
    assert done["rays"] == 0
    assert done["vertices_summed"] == 0
    assert bench.made.layers["sky"] is sky_before
    assert done["vertices_traced_to_lamps"] == int(bench.made.valid.sum())


def test_a_move_traces_less_than_everything(bench):
    first = bench.made.counts["rays"]
    done = work(bench, lambda: bench.do(MOVE))
    assert 0 < done["rays"] < first / 2
    assert done["vertices_summed"] < bench.made.valid.sum()
    done = work(bench, lambda: bench.do(BACK))
    assert 0 < done["rays"] < first / 2


def test_what_comes_is_traced_and_what_goes_or_is_undone_is_not(bench):
    first, scene = bench.made.counts["rays"], bench.scene
    done = work(bench, lambda: bench.do(EDITS["add"]))
    assert 0 < done["rays"] < first / 3
    assert done["vertices_summed"] < bench.made.valid.sum()  # not where it hides nothing
    more = bench.scene
    for there, here in ((scene, more), (more, scene)):
        done = work(bench, lambda there=there, here=here: bench.go(here, there))
        assert done["rays"] == 0
        assert 0 < done["vertices_summed"] < bench.made.valid.sum()
        bench.assert_fresh()
    done = work(bench, lambda: bench.do(EDITS["remove"]))
    now = bench.scene
    bench.go(now, more)
    again = work(bench, lambda: bench.go(more, now))
    assert again["rays"] == 0
    assert done["rays"] < first / 5  # of what it hid from the eye


def test_hidden_vertices_cost_nothing(host, services, bench):
    whole = Bench(lit_scene(), host, services, everywhere=True)
    assert whole.made.counts["skipped_vertices_unseen"] == 0
    assert bench.made.counts["skipped_vertices_unseen"] > 0.2 * len(bench.made.valid)
    assert bench.made.counts["rays"] < 0.8 * whole.made.counts["rays"]


def test_coarse_pictures_of_a_new_scene_come_first(host, services):
    published: list[Radiance] = []
    scene = lit_scene()
    backend = host.get("backend", "cuts")
    params = params_of(host, **{**FAST, "directions": "16384"})
    pipeline = Pipeline(backend.stages(services))
    job = Job("listened to", on_publish=published.append)
    view = scene_view(scene, None, 48, 36)
    final = pipeline.update(Frame(scene, view, params, 1), Changes(), job)
    assert [made.directions for made in published] == [1 << 11, 1 << 13, 1 << 14]
    assert [made.final for made in published] == [False, False, True]
    assert final.final
    assert final.directions == 16384
    for made in published:
        wrong = made.layers["sky"].irradiance - final.layers["sky"].irradiance
        mean = final.layers["sky"].irradiance[final.valid].mean()
        assert np.abs(wrong[final.valid]).mean() < 0.05 * mean


@pytest.fixture
def room(host, services):
    """Directions enough for coarse ones to be coarser."""
    return Bench(lit_scene(), host, services, directions="16384")


def listening():
    published: list[Radiance] = []
    return published, Job("listened to", on_publish=published.append)


def wrong(bench, made, exact):
    """Of the sky's irradiance, in means of it."""
    both = made.valid & exact.valid
    away = made.layers["sky"].irradiance[both] - exact.layers["sky"].irradiance[both]
    return np.sqrt((away**2).mean()) / exact.layers["sky"].irradiance[both].mean()


@pytest.mark.parametrize("name", ["move", "add", "turn", "mesh"])
def test_what_takes_long_is_seen_quickly_before_it_is_exact(room, monkeypatch, name):
    monkeypatch.setattr(visibility_stage, "LONG", 0.0)
    published, job = listening()
    before = room.made
    final = room.do(EDITS[name], job)
    assert [made.final for made in published] == [False, True]
    assert published[0].directions < final.directions
    assert published[1] is final
    assert (published[0].valid == final.valid).all()
    assert 0 < wrong(room, published[0], final) < 0.02
    assert before.final
    room.assert_fresh()


def test_after_a_release_the_first_picture_is_no_worse_than_the_last_moving_one(room, monkeypatch):
    monkeypatch.setattr(visibility_stage, "LONG", 0.0)
    monkeypatch.setattr(visibility_stage, "QUICK", 0.0)  # previews do not become finer meanwhile
    monkeypatch.setattr(visibility_stage, "SLOW", 1e9)
    moving = room.do(MOVE, moving=True)
    rays = moving.counts["rays"]
    published, job = listening()
    final = room.update(view_changed(), job)
    first = published[0]
    assert not first.final
    assert first.counts["rays"] == rays  # what was looked at while it moved is not looked at again
    assert wrong(room, first, final) <= wrong(room, moving, final) * 1.0001
    room.assert_fresh(exact=False)


def test_what_takes_no_time_is_shown_exact_at_once(room, monkeypatch):
    monkeypatch.setattr(visibility_stage, "LONG", 1e9)
    published, job = listening()
    final = room.do(MOVE, job)
    assert [made.final for made in published] == [True]
    assert published[0] is final


def test_fine_shadows_of_what_stands_still_stay_during_a_drag(host, services, monkeypatch):
    """Irradiance past what stands still is summed a few vertices a picture, and brings refinement back."""
    monkeypatch.setattr(light_cache, "AT_ONCE", 40)
    room = Bench(lit_scene(), host, services, refine=True, vertices=700)
    room.update(Changes())
    parts = [room.do(MOVE, moving=True)]
    parts += [room.update(view_changed(), moving=True) for _ in range(8)]
    past, known = room.pipeline.artifact(light_stage.Arriving).standing["sky"]
    assert known.sum() > 80
    published, job = listening()
    room.update(view_changed(), job)
    exact = next(made for made in published if made.final)
    errors = [wrong(room, part, exact) for part in (parts[0], parts[-1])]
    assert errors[1] < errors[0]
    assert (past[known] >= 0).all()
