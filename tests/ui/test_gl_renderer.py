"""What the GPU draws is what the software canvas shows, and only what changed is uploaded."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from captured_fits import made_up
from gl_support import Painter, agreement, edges, require_offscreen, sized
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scenes import cube, floor, little_scene, sky

from studio.samples import sample
from studio_core.arrays import frozen_map
from studio_core.contract import Services
from studio_core.edits import Add, Move, SetFields
from studio_core.kernels.tonemap import KINDS, tonemap
from studio_core.project.store import load
from studio_core.scene.diff import diff
from studio_core.scene.geometry import Geometry, Image, Texture
from studio_core.scene.nodes import ON_THE_GROUND, Camera, Environment, MeshObject, Scene
from studio_core.scene.shading_mesh import BUDGET, NO_BACK, ShadingMesh, refine
from studio_core.scene.transform import Transform, looking
from studio_core.session import View
from studio_core.shading.artifacts import Picture
from studio_plugins.residual.material import scene_material
from studio_ui.canvas.grid import grid_strength
from studio_ui.canvas.raster_viewport import outline
from studio_ui.canvas.viewport import GRID

pytestmark = pytest.mark.gl
VIEW = View(looking((1.6, 1.5, 2.6), (0.0, 0.4, 0.0)), 45.0, 160, 120, 3.0)
RNG = np.random.default_rng(3)
PICTURE = Image(RNG.random((37, 53, 3)).astype(np.float32))
GREY = Image(np.repeat(RNG.random((16, 16, 1)), 3, axis=2).astype(np.float32))


@pytest.fixture(scope="module")
def screen() -> Iterator[Any]:
    require_offscreen()
    from studio_ui.canvas.gl_context import Offscreen

    made = Offscreen()
    yield made
    made.close()


@pytest.fixture
def painter(host: Any, workers: Any) -> Painter:
    return Painter(Services(workers, host))


def drawn(screen: Any, picture: Picture | None, view: View, **look: Any) -> np.ndarray:
    from studio_ui.canvas.gl_renderer import Look

    with screen.target(view.width, view.height):
        screen.renderer.show(picture)
        screen.renderer.draw(Look(view, view.antialias, **look))
        return screen.read()


ROUGH = {"model": "ggx", "values": frozen_map({"base_color": (0.7, 0.5, 0.3), "roughness": 0.4})}


def scene_of(*more: MeshObject, **paint: Any) -> Scene:
    """A floor, a cube and more, of which all but the floor are of a material with such fields."""
    scene = little_scene()
    scene = Move({"cube": Transform((0.0, 0.51, 0.0))})(scene)
    made = dataclasses.replace(scene.material("paint"), **paint)
    return Add(more)(scene.with_materials(made)) if more else scene.with_materials(made)


def photographed(glass: float = 1.0, **sky: Any) -> Scene:
    """A cube on a floor that catches shadows, and what is behind them."""
    scene = scene_of(**ROUGH, opacity=glass)
    scene = scene.with_materials(dataclasses.replace(scene.material("matt"), catches=True))
    return scene.with_nodes(dataclasses.replace(scene["sky"], azimuth=30.0, **sky))


def sheet(name: str, transform: Transform, material: str = "paint") -> MeshObject:
    return MeshObject(id=name, name=name, geometry=floor(1.2), materials=(material,), transform=transform)


def sheets(count: int) -> tuple[MeshObject, ...]:
    """Panes behind and across one another."""
    return tuple(
        sheet(
            f"pane{i}",
            Transform((0.25 * i - 0.5, 0.6, 0.9 - 0.2 * i), (0.5**0.5, 0.0, 0.0, 0.5**0.5))
            if i % 2
            else Transform((0.1, 0.35 + 0.15 * i, 0.4)),
        )
        for i in range(count)
    )


def blade() -> Geometry:
    """One triangle: two sides, no thickness."""
    positions = np.array([(-0.8, 0.0, 0.0), (0.8, 0.1, 0.3), (0.0, 1.4, -0.2)], np.float32)
    return Geometry(positions, np.array([(0, 1, 2)], np.uint32))


BLADE = MeshObject(id="blade", name="Blade", geometry=blade(), materials=("paint",))
LAID = Texture(PICTURE, (3.0, 2.0), (0.2, 0.7), 25.0, 1.4)
COLOURED = {"model": "ggx", "textures": frozen_map({"base_color": LAID})}
FINE = {"textures": frozen_map({"base_color": Texture(PICTURE, (40.0, -25.0), rotation=-70.0)})}
METAL = {
    "model": "ggx",
    "textures": frozen_map({"base_color": Texture(PICTURE), "metallic": Texture(GREY)}),
}
SWATCH = scene_material(made_up("blinn", "albedo-half", size=17)).material
DEEP = {  # with pixels whose sum is below nothing
    "model": SWATCH.model,
    "values": SWATCH.values,
    "tables": SWATCH.tables,
    "textures": frozen_map(
        {
            name: Texture(Image(one.image.pixels * (40 if name.startswith("residual") else 1)), (3.0, 2.0))
            for name, one in SWATCH.textures.items()
        }
    ),
}
BUMPS = Texture(Image(RNG.integers(60, 256, (23, 31, 3), dtype=np.uint8), "data"), (2.0, 3.0), (0.3, 0.1))
SCENES = {
    "normal map": scene_of(**ROUGH, textures=frozen_map({"normal": BUMPS})),
    "normal map of small texels": scene_of(
        model="ggx",
        values=frozen_map({"normal": 1.7}),
        textures=frozen_map({"normal": dataclasses.replace(BUMPS, scale=(40.0, -25.0))}),
    ),
    "picture and normal map": scene_of(
        model="ggx", textures=frozen_map({**COLOURED["textures"], "normal": BUMPS})
    ),
    "two pictures and normal map": scene_of(
        model="ggx", textures=frozen_map({**METAL["textures"], "normal": BUMPS})
    ),
    "glass with a normal map": scene_of(
        *sheets(3), **ROUGH, opacity=0.6, textures=frozen_map({"normal": BUMPS})
    ),
    "captured": scene_of(**DEEP),
    "captured with a normal map": scene_of(
        **{**DEEP, "textures": frozen_map({**DEEP["textures"], "normal": BUMPS})}
    ),
    "plain": scene_of(**ROUGH),
    "picture": scene_of(**COLOURED),
    "picture of small texels": scene_of(**FINE),
    "two pictures": scene_of(**METAL),
    "both sides": scene_of(BLADE, **ROUGH),
    "glass": scene_of(*sheets(4), **ROUGH, opacity=0.35),
    "glass with a picture": scene_of(*sheets(3), **COLOURED, opacity=0.6),
    "turned sky": SetFields("sky", {"azimuth": 77.0, "tint": (1.0, 0.8, 0.5), "intensity": 1.7})(
        little_scene()
    ),
    "no sky": SetFields("sky", {"background": False})(little_scene()),
    "floor of a photograph": photographed(background_azimuth=40.0),
    "floor of a photograph on the ground": photographed(
        projection=ON_THE_GROUND, ground_radius=3.0, transform=Transform((0.3, -0.1, 0.2))
    ),
    "floor of a photograph behind glass": Add(sheets(3))(photographed(glass=0.35, projection=ON_THE_GROUND)),
    "floor without a photograph": photographed(background=False),
    "far from the origin": Move(
        {
            "floor": Transform((5000.0, 30.0, -8000.0)),
            "cube": Transform((5000.0, 30.5, -8000.0), scale=0.7),
        }
    )(little_scene()),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", SCENES)
def test_both_canvases_show_the_same(name: str, kind: str, screen: Any, painter: Painter) -> None:
    scene, view = SCENES[name], VIEW
    if name.startswith("far"):
        view = sized(view, transform=looking((5001.6, 31.5, -7997.4), (5000.0, 30.4, -8000.0)))
    picture = painter.paint(scene, view)
    made = drawn(screen, picture, view, exposure=0.4, tonemap=kind)
    wanted = tonemap(picture.linear, 0.4, kind)
    assert wanted.std() > 10
    assert agreement(made, wanted, edges(picture)) >= 0.99


def in_a_photograph(scene: Scene) -> Scene:
    """A room whose floor is the photograph's."""
    floors = [n for n in scene.of(MeshObject) if n.name == "Floor"]
    assert floors
    catching = [dataclasses.replace(scene.material(m), catches=True) for n in floors for m in n.materials]
    sky = dataclasses.replace(next(scene.of(Environment)), projection=ON_THE_GROUND, background=True)
    return scene.with_materials(*catching).with_nodes(sky)


@pytest.mark.slow
@pytest.mark.parametrize("photographed", [False, True])
def test_both_canvases_show_the_same_sample_room(
    screen: Any, host: Any, workers: Any, photographed: bool
) -> None:
    scene = load(sample()).scene
    scene = in_a_photograph(scene) if photographed else scene
    cameras = list(scene.of(Camera))
    assert len(cameras) >= 3
    painter = Painter(Services(workers, host), vertices=BUDGET)
    for camera in cameras[:3]:
        view = View.of(camera, scene, 480, 270)
        picture = painter.paint(scene, view)
        edge = edges(picture)
        assert edge.mean() < 0.3
        for kind in KINDS:
            made = drawn(screen, picture, view, exposure=-0.3, tonemap=kind)
            assert agreement(made, tonemap(picture.linear, -0.3, kind), edge) >= 0.99


@given(light=arrays(np.float32, (7, 5, 3), elements=st.floats(-1, 4, width=32)), ev=st.floats(-3, 3))
@pytest.mark.parametrize("kind", KINDS)
def test_tones_are_mapped_alike(kind: str, light: np.ndarray, ev: float, screen: Any) -> None:
    light[0, 0], light[1, 1], light[2, 2] = np.nan, np.inf, -np.inf
    made = drawn(screen, still(light), VIEW_SMALL, exposure=ev, tonemap=kind)
    assert np.abs(made.astype(int) - tonemap(light, ev, kind)).max() <= 1


VIEW_SMALL = View(width=5, height=7, antialias=1)


def still(light: np.ndarray) -> Picture:
    """A picture that came without its vertices' colours."""
    shape = light.shape[:2]
    away = np.full(shape, np.inf, np.float32)
    return Picture(None, light, np.zeros(shape, np.float32), np.full(shape, -1, np.int32), away)  # type: ignore[arg-type]


def test_chosen_objects_are_outlined_where_they_are_seen(screen: Any, painter: Painter) -> None:
    picture = painter.paint(SCENES["both sides"], VIEW)
    pink = (1.0, 0.0, 1.0)
    for number, node in enumerate(picture.nodes):
        made = drawn(screen, picture, VIEW, chosen=frozenset([node]), accent=pink, rim=1)
        wanted = outline(picture.node == number)
        assert wanted.any()
        assert np.array_equal((made == (255, 0, 255)).all(axis=2), wanted)


def test_the_ground_has_the_same_lines(screen: Any, painter: Painter) -> None:
    view = sized(VIEW, antialias=1)
    picture = painter.paint(SCENES["plain"], view)
    strength = grid_strength(view, picture.distance)[..., None]
    assert (strength > 0.2).mean() > 0.01
    plain = tonemap(picture.linear)
    wanted = plain + strength * (np.array(GRID) * 255 - plain) + 0.5
    assert agreement(drawn(screen, picture, view, grid=GRID), wanted.astype(np.uint8), edges(picture)) >= 0.99
    behind = picture.node == picture.nodes.index("cube")
    assert (strength[behind] > 0).mean() < 0.05, "the cube hides the ground"


def test_objects_are_drawn_where_they_are_by_now(screen: Any, painter: Painter) -> None:
    """Before there is a picture of it; and they go back when that is undone."""
    view = sized(VIEW, antialias=1)
    scene = SCENES["plain"]
    picture = painter.paint(scene, view)
    there = Transform((-0.6, 0.8, 0.2), scale=0.6)
    moved = painter.paint(Move({"cube": there})(scene), view)
    before = drawn(screen, picture, view)
    uploads = screen.renderer.tally.uploads
    pink = {"chosen": frozenset(["cube"]), "accent": (1.0, 0.0, 1.0), "rim": 1}
    outlined = drawn(screen, picture, view, places={"cube": there}, **pink)
    wanted = outline(moved.node == moved.nodes.index("cube"))
    assert np.array_equal((outlined == (255, 0, 255)).all(axis=2), wanted)
    gone = drawn(screen, picture, view, places={"cube": None})
    assert not np.array_equal(gone, before)
    assert screen.renderer.tally.uploads == uploads, "nothing but a matrix"
    assert np.array_equal(drawn(screen, picture, view), before)


def test_what_lies_under_a_point(screen: Any, painter: Painter) -> None:
    view = sized(VIEW, antialias=1)
    picture = painter.paint(SCENES["glass"], view)
    inside = np.argwhere(~edges(picture))
    with screen.target(8, 8):
        screen.renderer.show(picture)
        for row, column in RNG.permutation(inside)[:40].tolist():
            found = screen.renderer.pick(view, (column + 0.5) / view.width, (row + 0.5) / view.height)
            assert (found.object if found else -1) == picture.node[row, column]
            if found and picture.nodes[found.object] == "floor":
                assert found.distance == pytest.approx(picture.distance[row, column], rel=1e-4)
                assert found.radiance == pytest.approx(picture.linear[row, column], rel=1e-3)


# what is uploaded


def uploaded(screen: Any, picture: Picture) -> Any:
    before = screen.renderer.tally.copy()
    with screen.target(8, 8):
        screen.renderer.show(picture)
    screen.finish()
    return screen.renderer.tally.since(before)


def test_another_light_uploads_the_colours_of_what_is_seen_alone(screen: Any, painter: Painter) -> None:
    painter.stage.everywhere = True
    scene = SCENES["picture"]
    first = painter.paint(scene, VIEW)
    uploaded(screen, first)
    assert vars(uploaded(screen, first)) == dict.fromkeys(vars(screen.renderer.tally), 0)
    painter.stage.phase = 1.0
    second = painter.paint(scene, VIEW)
    moved = uploaded(screen, second)
    mesh = second.radiance.surfaces.mesh
    textured = mesh.vertices_of(second.nodes.index("cube"))
    count = len(mesh)
    assert moved.colours == 12 * (count + textured.stop - textured.start)
    assert (moved.shapes, moved.maps) == (0, 0)


@given(data=st.data())
def test_a_buffer_holds_what_is_known_and_moves_little(data: st.DataObject) -> None:
    """Whatever is told in whatever order: the GPU's floats are the last known ones."""
    from studio_ui.canvas.gl_buffers import GAP, Attribute, Tally

    tally, room = Tally(), 60
    attribute = Attribute(3, tally, "colours")
    attribute.resize(room)
    mirror = Mirror(attribute)
    truth = np.full((room, 3), np.nan, np.float32)
    for _ in range(data.draw(st.integers(1, 5))):
        count = data.draw(st.integers(1, room))
        values = data.draw(arrays(np.float32, (count, 3), elements=st.sampled_from([0.0, 1.0, 2.0])))
        known = data.draw(arrays(np.bool_, count))
        changed = known & (values != truth[:count]).any(axis=1)
        truth[:count][known] = values[known]
        guessed = not attribute._seen and known.any()
        fresh = count if guessed else max(0, count - len(attribute.host))
        before = tally.copy()
        attribute.update(values, known)
        moved = tally.since(before)
        told = np.isfinite(truth).all(axis=1)
        assert np.array_equal(mirror.floats[told], truth[told])
        if before.uploads:
            assert moved.colours <= 12 * (fresh + (1 + GAP) * int(changed.sum()))
        if before.uploads and not changed.any() and not fresh:
            assert moved.uploads == 0


class Mirror:
    """What a buffer on the GPU would hold, by its uploads."""

    def __init__(self, attribute: Any) -> None:
        self.floats = np.full((attribute.room, attribute.width), np.nan, np.float32)
        upload = attribute._upload

        def watched(values: np.ndarray, start: int, stop: int) -> None:
            self.floats[start:stop] = values[start:stop]
            upload(values, start, stop)

        attribute._upload = watched


def test_one_vertex_uploads_one_colour(screen: Any, painter: Painter) -> None:
    painter.stage.everywhere = True
    first = painter.paint(SCENES["plain"], VIEW)
    uploaded(screen, first)
    assert first.colours is not None
    record = first.colours.record.copy()
    own = first.radiance.surfaces.mesh.vertices_of(first.nodes.index("floor"))
    record[own.start + 70, 0] += 1
    other = dataclasses.replace(first, colours=dataclasses.replace(first.colours, record=record))
    moved = uploaded(screen, other)
    assert (moved.colours, moved.uploads) == (12, 1)


def test_what_is_not_known_stays_as_it_was(screen: Any, painter: Painter) -> None:
    """Vertices behind something keep their colours, so that a turned view shows no holes."""
    first = painter.paint(SCENES["plain"], VIEW)
    uploaded(screen, first)
    nothing = dataclasses.replace(first.radiance, valid=np.zeros_like(first.radiance.valid))
    assert first.colours is not None
    dark = dataclasses.replace(first.colours, record=np.zeros_like(first.colours.record))
    before = drawn(screen, first, VIEW)
    after = drawn(screen, dataclasses.replace(first, radiance=nothing, colours=dark), VIEW)
    assert np.array_equal(before, after)


def test_a_view_ahead_of_its_picture_has_no_holes(screen: Any, painter: Painter) -> None:
    """From behind, where the picture has seen nothing, and what it knows there is black."""
    scene = SCENES["plain"]
    picture = painter.paint(scene, VIEW)
    assert picture.colours is not None
    dark = np.where(picture.radiance.valid[:, None], picture.colours.record, 0)
    everywhere = dataclasses.replace(picture.radiance, valid=np.ones_like(picture.radiance.valid))
    colours = dataclasses.replace(picture.colours, record=dark.astype(np.float32))
    picture = dataclasses.replace(picture, radiance=everywhere, colours=colours)
    drawn(screen, None, VIEW)
    assert agreement(drawn(screen, picture, VIEW), tonemap(picture.linear), edges(picture)) >= 0.99
    behind = sized(VIEW, transform=looking((-1.6, 1.5, -2.6), (0.0, 0.4, 0.0)))
    made = drawn(screen, picture, behind)
    solid = painter.paint(scene, behind).coverage == 1
    assert (made[solid].max(axis=1) < 20).mean() < 0.01


def test_moving_uploads_no_shapes(screen: Any, painter: Painter) -> None:
    scene = SCENES["plain"]
    uploaded(screen, painter.paint(scene, VIEW))
    moved = Move({"cube": Transform((0.4, 0.5, -0.3), (0.0, 0.3826834, 0.0, 0.9238795))})(scene)
    picture = painter.paint(moved, VIEW, diff(scene, moved))
    assert uploaded(screen, picture).shapes == 0
    assert agreement(drawn(screen, picture, VIEW), tonemap(picture.linear), edges(picture)) >= 0.99


def test_instances_share_their_shape(screen: Any, painter: Painter) -> None:
    geometry = cube(0.3)
    copies = [
        MeshObject(
            id=f"c{i}", name="c", geometry=geometry, materials=("paint",), transform=Transform((i / 3, 1, 0))
        )
        for i in range(5)
    ]
    one, five = (Add(tuple(copies[:count]))(SCENES["plain"]) for count in (1, 5))
    first = painter.paint(one, VIEW)
    uploaded(screen, first)
    made = painter.paint(five, VIEW)
    meshes = {id(placed.mesh) for placed in made.radiance.surfaces.mesh.objects}
    assert len(meshes) == 3
    moved = uploaded(screen, made)
    assert moved.shapes == 0
    assert moved.colours > 0


def with_mesh(picture: Picture, mesh: ShadingMesh) -> Picture:
    """The same picture with a finer mesh for its first object, which shows the same light."""
    surfaces, colours = picture.radiance.surfaces, picture.colours
    assert colours is not None
    world = surfaces.mesh.with_mesh(0, mesh)
    old = surfaces.mesh.vertices_of(0).stop
    first = colours.record[:old]
    for parents in mesh.parents[old:]:
        first = np.concatenate([first, first[parents].mean(axis=0, keepdims=True)])
    record = np.concatenate([first, colours.record[old:]])
    radiance = dataclasses.replace(
        picture.radiance,
        surfaces=dataclasses.replace(surfaces, mesh=world),
        valid=np.ones(len(world), np.bool_),
    )
    return dataclasses.replace(
        picture,
        radiance=radiance,
        colours=dataclasses.replace(colours, record=record, shown=np.ones(len(world), np.bool_)),
    )


def test_finer_meshes_upload_their_new_vertices(screen: Any, painter: Painter) -> None:
    painter.stage.everywhere = True
    coarse = painter.paint(SCENES["plain"], VIEW)
    mesh = coarse.radiance.surfaces.mesh
    fine, finer = (refine(mesh.objects[0].mesh, faces=np.arange(count)) for count in (4, 12))
    extra = [len(made) - len(mesh.objects[0].mesh) for made in (fine, finer)]
    assert 0 < extra[0] < extra[1]
    first, second = (with_mesh(coarse, made) for made in (fine, finer))
    uploaded(screen, coarse)
    uploaded(screen, second)  # makes room
    for again in (coarse, second):
        moved = uploaded(screen, again)
        assert (moved.shapes, moved.colours) == (0, 0), "coarse and fine take turns for free"
    moved = uploaded(screen, first)
    sides = len(fine.faces) + int((fine.back_faces[:, 0] != NO_BACK).sum())
    assert moved.shapes <= 12 * sides + (12 + 8) * extra[0]
    assert agreement(drawn(screen, first, VIEW), tonemap(first.linear), edges(first)) >= 0.99


def test_everything_is_given_back(screen: Any, painter: Painter) -> None:
    """Opening and closing scenes leaves as many OpenGL objects as there were."""
    pictures = [
        painter.paint(SCENES[name], VIEW) for name in ("glass with a picture", "two pictures", "both sides")
    ]

    def cycle() -> int:
        for picture in pictures:
            drawn(screen, picture, VIEW)
        drawn(screen, None, VIEW)
        screen.finish()
        gone = [
            ob for ob in screen._canvas.context.shared.parser._objects.values() if not isinstance(ob, str)
        ]
        return len(gone)

    counts = [cycle() for _ in range(5)]
    assert len(set(counts[1:])) == 1


def test_a_very_large_picture_is_shown_more_coarsely(screen: Any, painter: Painter) -> None:
    from studio_ui.canvas.gl_buffers import Tally
    from studio_ui.canvas.gl_maps import Atlases

    picture = painter.paint(SCENES["picture"], VIEW)
    assert picture.colours is not None
    atlases = Atlases(Tally(), largest=40)
    with screen.target(8, 8):
        atlases.update(picture.colours.maps)
    atlas = atlases[int(np.flatnonzero(picture.colours.maps.kind)[0])]
    assert max(atlas.size) <= 40
    assert atlas.finest == (26, 18)
    atlases.clear()


def test_environments_too_large_for_the_driver(screen: Any, painter: Painter) -> None:
    scene = SetFields("sky", {"image": sky(256)})(little_scene())
    picture = painter.paint(scene, VIEW)
    there = screen.renderer._sky
    kept, there._largest = there._largest, 100
    try:
        made = drawn(screen, picture, VIEW)
    finally:
        there._largest = kept
    assert agreement(made, tonemap(picture.linear), edges(picture)) >= 0.99


def test_guesses_give_way_to_what_is_known(screen: Any) -> None:
    from studio_ui.canvas.gl_buffers import Attribute, Tally

    attribute = Attribute(3, Tally(), "colours")
    attribute.resize(4)
    values = np.full((4, 3), 0.8, np.float32)
    attribute.update(values, np.zeros(4, np.bool_), np.full(3, 0.3, np.float32))
    assert (attribute.host == np.float32(0.3)).all()
    attribute.update(values, np.array([True, False, False, False]))
    assert (attribute.host == np.float32(0.8)).all(), "what is not known yet looks like the rest of it"
    attribute.update(values / 2, np.array([False, True, False, False]))
    assert attribute.host[:, 0].tolist() == pytest.approx([0.8, 0.4, 0.8, 0.8])
