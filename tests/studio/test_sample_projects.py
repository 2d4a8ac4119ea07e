"""The sample projects: believable sizes, sound meshes, sane light, stored files as scripts make them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from oracles.solids import uses_of_edges, volume

import sample_projects
from sample_projects import make
from sample_projects.captured_room import build as captured
from sample_projects.captured_room import swatches
from sample_projects.living_room import build as living
from sample_projects.living_room import seating, window_room
from sample_projects.modelling import equirect, mesh
from sample_projects.modelling.parts import Stage
from sample_projects.red_cabinet import build as red
from sample_projects.terrace import build as terrace
from sample_projects.terrace import open_sky
from studio_core.params import build as checked
from studio_core.project.store import load
from studio_core.registry import PluginHost
from studio_core.scene.geometry import Geometry
from studio_core.scene.nodes import Camera, Environment, MeshObject, Scene
from studio_core.scene.shading_mesh import choose_edge, shade_mesh
from studio_plugins.brdfs import plugin as brdfs
from studio_plugins.residual.model import RESIDUAL

FOLDER = Path(sample_projects.__file__).parent
OPEN = {"Floor", "Paving", "Rug", "Leaves", "Print", "Grasses", "Earth"}


@pytest.fixture(scope="module")
def scenes() -> dict[str, Scene]:
    return {name: build() for name, build in make.SAMPLES.items()}


@pytest.fixture(scope="module", params=list(make.SAMPLES))
def scene(request: pytest.FixtureRequest, scenes: dict[str, Scene]) -> Scene:
    return scenes[request.param]


def as_mesh(geometry: Geometry) -> mesh.Mesh:
    normals = geometry.normals
    assert normals is not None
    return mesh.Mesh(
        geometry.positions.astype(np.float64),
        normals.astype(np.float64),
        geometry.faces.astype(np.int64),
        np.zeros((len(geometry.positions), 2)),
        geometry.slots.astype(np.int64),
    )


def environment(scene: Scene) -> Environment:
    (found,) = scene.of(Environment)
    return found


def world_points(scene: Scene, node: str) -> np.ndarray:
    made = []
    for ident in scene.subtree(node):
        thing = scene[ident]
        if isinstance(thing, MeshObject):
            matrix = scene.world(ident).matrix()
            made.append(thing.geometry.positions @ matrix[:3, :3].T + matrix[:3, 3])
    return np.concatenate(made)


def test_every_reference_resolves_and_every_material_fits_its_model(scene: Scene) -> None:
    host = PluginHost([brdfs])
    assert len({node.name for node in scene.of(Camera)}) >= 2
    for node in scene.nodes.values():
        assert node.parent is None or node.parent in scene.nodes
    for thing in scene.of(MeshObject):
        assert len(thing.materials) == int(thing.geometry.slots.max()) + 1
        for ident in thing.materials:
            material = scene.material(ident)
            model = host.brdf(material.model)
            checked(model.Params, material.values)
            assert set(material.textures) <= set(model.textures)
            assert not material.textures or thing.geometry.uvs is not None


def test_parts_are_closed_where_they_should_be_and_face_outwards(scene: Scene) -> None:
    for thing in scene.of(MeshObject):
        made = as_mesh(thing.geometry)
        flat = mesh.face_normals(made.positions, made.faces)
        area = np.linalg.norm(flat, axis=1) / 2
        assert area.min() > 1e-9, thing.id
        assert np.linalg.norm(made.normals, axis=1) == pytest.approx(1.0, abs=1e-5)
        cosine = np.einsum("ij,ij->i", mesh.unit(flat), mesh.unit(made.normals[made.faces].sum(axis=1)))
        assert cosine.min() > 0.35, thing.id
        assert np.average(cosine, weights=area) > 0.95, thing.id
        if thing.name not in OPEN:
            assert uses_of_edges(made.positions, made.faces) == {2}, thing.id
            assert volume(made.positions, made.faces) > 0, thing.id


def test_vertex_counts_are_those_of_a_furnished_room(scenes: dict[str, Scene]) -> None:
    things = list(scenes["living-room"].of(MeshObject))
    assert 17_000 < sum(len(thing.geometry.positions) for thing in things) < 22_000
    edge = choose_edge([(thing.geometry, 1.0) for thing in things])
    assert 24_000 < sum(len(shade_mesh(thing.geometry, edge)) for thing in things) < 31_000


@pytest.mark.parametrize(
    ("node", "low", "high"),
    [
        ("group-sofa", (2.0, 0.8, 0.85), (2.4, 0.95, 1.05)),
        ("group-coffee-table", (1.0, 0.6, 0.55), (1.3, 1.1, 0.75)),
        ("mesh-chair-at-the-back", (0.4, 0.75, 0.45), (0.6, 0.9, 0.65)),
        ("group-armchair", (0.75, 0.8, 0.75), (1.2, 1.0, 1.25)),
        ("group-floor-lamp", (0.4, 1.5, 0.4), (0.6, 1.8, 0.6)),
        ("mesh-dining-corner-table-top", (0.95, 0.01, 0.95), (1.05, 0.04, 1.05)),
    ],
)
def test_furniture_has_the_size_of_furniture(
    scenes: dict[str, Scene], node: str, low: tuple[float, ...], high: tuple[float, ...]
) -> None:
    points = world_points(scenes["living-room"], node)
    size = points.max(axis=0) - points.min(axis=0)
    assert (size > low).all(), size
    assert (size < high).all(), size


def test_everything_stands_on_the_floor_within_the_room(scene: Scene) -> None:
    floor = next(thing for thing in scene.of(MeshObject) if thing.name in ("Floor", "Paving"))
    low, high = floor.geometry.bounds
    for node in scene.children(None):
        if not any(isinstance(scene[ident], MeshObject) for ident in scene.subtree(node.id)):
            continue
        points = world_points(scene, node.id)
        assert points[:, 1].min() >= -1e-4, node.name
        for point in points[points[:, 1] < 0.4]:  # higher up leaves and parasols may hang over
            assert (point[[0, 2]] >= low[[0, 2]] - 0.02).all(), node.name
            assert (point[[0, 2]] <= high[[0, 2]] + 0.02).all(), node.name
    for name in ("Sofa", "Armchair", "Floor lamp", "Rubber fig", "Parasol", "Planter"):
        found = [node for node in scene.nodes.values() if node.name == name]
        for node in found:
            assert world_points(scene, node.id)[:, 1].min() < 0.02, name


def test_the_two_chairs_are_instances(scene: Scene) -> None:
    one, two = (thing for thing in scene.of(MeshObject) if thing.name.startswith("Chair at"))
    assert one.geometry is two.geometry
    assert one.transform != two.transform


def test_the_first_camera_frames_the_furniture(scene: Scene) -> None:
    camera = next(scene.of(Camera))
    assert 30 <= camera.fov <= 45
    to_camera = np.linalg.inv(scene.world(camera.id).matrix())
    slope = math.tan(math.radians(camera.fov) / 2)
    for name in ("Sofa", "Armchair", "Coffee table", "Table for two", "Dining corner", "Floor lamp"):
        for node in (node for node in scene.nodes.values() if node.name == name):
            assert not isinstance(node, Camera), "names tell nodes apart"
            local = world_points(scene, node.id) @ to_camera[:3, :3].T + to_camera[:3, 3]
            assert (local[:, 2] < 0).all()
            frame = local[:, :2] / -local[:, 2:] / slope / np.array([16 / 9, 1.0])
            inside = (np.abs(frame) < 1).all(axis=1).mean()
            assert inside > 0.95, (name, inside)


def leaf_energy(picture: np.ndarray) -> np.ndarray:
    """Energy in 2^15 cells of equal solid angle (about 1.2° wide), as shares of all."""
    height = len(picture)
    light = picture.astype(np.float64).mean(axis=2) * equirect.solid_angles(height)[:, None]
    y = np.cos(np.pi * (np.arange(height) + 0.5) / height)
    row = np.clip(((1 - y) / 2 * 128).astype(int), 0, 127)
    column = np.arange(2 * height) * 256 // (2 * height)
    cells = np.zeros((128, 256))
    np.add.at(cells, (row[:, None], column[None, :]), light)
    return cells / cells.sum()


def test_no_sun_comes_into_the_room(scenes: dict[str, Scene]) -> None:
    picture = environment(scenes["living-room"]).image.pixels
    assert picture.shape == (512, 1024, 3)
    assert leaf_energy(picture).max() < 0.005
    assert leaf_energy(environment(scenes["terrace"]).image.pixels).max() > 0.3, "the terrace has one"


def test_the_room_is_lit_from_its_windows_and_exposed_for_its_greys(scenes: dict[str, Scene]) -> None:
    picture = environment(scenes["living-room"]).image.pixels.astype(np.float64)
    left, right, front, back, up = (
        equirect.irradiance(picture, np.array(n, dtype=float)).mean()
        for n in ((-1, 0, 0), (1, 0, 0), (0, 0, 1), (0, 0, -1), (0, 1, 0))
    )
    assert left > 2 * right
    assert front > 2 * back
    assert 0.2 < 0.3 * up / math.pi < 0.4, "a grey of 30 % is shown near the middle at 0 EV"
    colour = equirect.irradiance(picture, np.array([0.0, 1.0, 0.0]))
    assert colour.max() / colour.min() < 1.15, "white looks white"
    outside = picture.reshape(-1, 3).mean(axis=1)
    assert 8 < np.quantile(outside, 0.995) / np.median(outside) < 200


def test_half_of_a_pale_room_is_lit_by_its_own_walls(monkeypatch: pytest.MonkeyPatch) -> None:
    pale = window_room.Room(0.9).irradiance
    monkeypatch.setattr(window_room, "PAINT", dict.fromkeys(window_room.PAINT, (0.0, 0.0, 0.0)))
    black = window_room.Room(0.9).irradiance
    assert all((a >= b).all() for a, b in zip(pale, black, strict=True))
    share = 1 - sum(float(b.sum()) for b in black) / sum(float(a.sum()) for a in pale)
    assert 0.3 < share < 0.7


def test_the_terrace_sky_is_calibrated(scenes: dict[str, Scene]) -> None:
    light = environment(scenes["terrace"])
    assert light.luminance_scale is not None
    picture = light.image.pixels.astype(np.float64)
    lux = equirect.irradiance(picture, np.array([0.0, 1.0, 0.0])) @ [0.2126, 0.7152, 0.0722]
    assert 70_000 < lux * light.luminance_scale < 120_000
    row, column = np.unravel_index(picture.sum(axis=2).argmax(), picture.shape[:2])
    brightest = equirect.directions(512, np.array([row + 0.5]), np.array([column + 0.5]))[0]
    assert brightest @ np.array(open_sky.SKY.sun) > math.cos(math.radians(0.5))
    assert picture.max() < 65504


def test_furniture_and_light_come_out_the_same_twice() -> None:
    def keys() -> list[str]:
        found = []
        for module in (living, terrace):
            palette = module.palette()
            stage = Stage(palette)
            module.furnish(stage)
            made = stage.scene()
            found += [f"{thing.id} {thing.geometry.key}" for thing in made.of(MeshObject)]
            found += [t.image.key for m in made.materials.values() for t in m.textures.values()]
        return found

    assert keys() == keys()
    for light in (lambda: window_room.day_room(24, 0.9), lambda: open_sky.sunny_sky(48)):
        (one, scale), (two, again) = light(), light()
        assert np.array_equal(one, two)
        assert scale == again


def test_the_stored_projects_are_what_the_scripts_make(scenes: dict[str, Scene]) -> None:
    for name, made in scenes.items():
        kept = load(FOLDER / f"{name}.lucarne").scene
        assert list(kept.nodes) == list(made.nodes)
        assert list(kept.materials) == list(made.materials)
        for ident, node in made.nodes.items():
            stored = kept[ident]
            assert (stored.name, stored.parent) == (node.name, node.parent)
            assert stored.transform.matrix() == pytest.approx(node.transform.matrix(), abs=1e-9)
            if isinstance(node, MeshObject):
                assert isinstance(stored, MeshObject)
                assert stored.materials == node.materials
                assert np.array_equal(stored.geometry.faces, node.geometry.faces)
                assert stored.geometry.positions == pytest.approx(node.geometry.positions, abs=1e-5)
        for ident, material in made.materials.items():
            assert kept.material(ident).values == material.values
        old, new = environment(kept).image.pixels, environment(made).image.pixels
        assert np.abs(old - new).mean() < 1e-3 * new.mean()


def test_the_stored_projects_are_small() -> None:
    files = list(FOLDER.glob("*.lucarne"))
    assert {path.stem for path in files} == {*make.SAMPLES, *make.FITTED, *make.BOUNCING}
    assert sum(path.stat().st_size for path in files) < 9e6


def test_the_captured_room_is_the_living_room_in_captured_materials(
    scenes: dict[str, Scene], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Made anew from small swatches; the stored one has the same materials in the same places."""
    for name, small in (("CLOTH_TEXELS", 32), ("CLOTH_DIRECTIONS", 9), ("STONE_TEXELS", 24), ("LAMPS", 12)):
        monkeypatch.setattr(swatches, name, small)
    plain, made = scenes["living-room"], captured.build()
    kept = load(FOLDER / "captured-room.lucarne").scene
    assert list(kept.nodes) == list(made.nodes) == list(plain.nodes)
    other = {name for name in plain.materials if made.material(name).model != plain.material(name).model}
    assert other == {captured.SOFA, captured.FLOOR}
    for name in other:
        new, stored = made.material(name), kept.material(name)
        assert new.model == stored.model == "captured"
        assert set(new.textures) == set(stored.textures) == {"albedo", *RESIDUAL}
        colour = [one.textures["albedo"].image.pixels.mean(axis=(0, 1)) for one in (new, stored)]
        np.testing.assert_allclose(*colour, rtol=0.15)
    for thing in kept.of(MeshObject):
        assert thing.geometry.uvs is not None or not other & set(thing.materials)


def test_a_chair_carries_two_materials() -> None:
    chair = seating.chair()
    assert set(chair.geometry().slots.tolist()) == {0, 1}
    assert len(chair.materials) == 2


def test_the_room_with_the_red_cabinet_is_stored_as_its_script_makes_it() -> None:
    made, kept = red.build(64), load(FOLDER / "red-cabinet.lucarne").scene
    assert list(kept.nodes) == list(made.nodes)
    for ident, node in made.nodes.items():
        assert kept[ident].transform.matrix() == pytest.approx(node.transform.matrix(), abs=1e-9)
        if isinstance(node, MeshObject):
            stored = kept[ident]
            assert isinstance(stored, MeshObject)
            assert stored.materials == node.materials
            assert stored.geometry.positions == pytest.approx(node.geometry.positions, abs=1e-5)
    for ident, material in made.materials.items():
        assert kept.material(ident).values == material.values
    sky = environment(kept).image.pixels
    assert sky.shape == (192, 384, 3)
    assert leaf_energy(sky).max() > 0.2, "a sun shines in"


def test_the_red_cabinet_is_whole_and_stands_in_its_room_with_what_is_on_it() -> None:
    scene = red.build(64)
    assert len({node.name for node in scene.of(Camera)}) == 2
    for thing in scene.of(MeshObject):
        if thing.parent == "group-red-cabinet" and thing.name not in OPEN:
            shape = as_mesh(thing.geometry)
            assert uses_of_edges(shape.positions, shape.faces) == {2}, thing.id
            assert volume(shape.positions, shape.faces) > 0, thing.id
    points = world_points(scene, "group-red-cabinet")
    assert np.abs(points[:, [0, 2]]).max(axis=0) == pytest.approx([1.4, 1.35], abs=0.15)
    assert points[:, 1].min() == pytest.approx(0.0, abs=1e-4)
    held = {scene[node].name for node in scene.subtree("group-red-cabinet")}
    assert {"Doors", "Vase", "Book rust"} <= held, "what stands on it goes along"
    size = np.ptp(world_points(scene, "mesh-red-cabinet-body"), axis=0)
    assert size == pytest.approx([0.42, 1.16, 1.1], abs=0.01)
