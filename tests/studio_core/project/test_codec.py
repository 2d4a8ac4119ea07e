"""Items, arrays and lists as text and bytes, and back."""

from __future__ import annotations

import dataclasses
import gc
import json
import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from project_support.strategies import images, scenes

from studio_core.arrays import frozen_map
from studio_core.errors import ProjectError
from studio_core.project import blobs, codec, pages
from studio_core.project.canonical import dumps, loads, text_hash
from studio_core.project.memo import Memo
from studio_core.project.validate import check_scene
from studio_core.scene.geometry import Geometry, Image, Table, Texture
from studio_core.scene.nodes import (
    Camera,
    Environment,
    Group,
    Material,
    MeshObject,
    Node,
    PointLamp,
    Scene,
    SpotLamp,
)
from studio_core.scene.paint import Paint
from studio_core.scene.transform import Transform

SLOW = settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
TRIANGLE = Geometry(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.uint32))
PAINT = Material(id="paint", name="Paint")


def back(*items: Node | Material) -> list[Any]:
    """The items through text and packed bytes."""
    stored: dict[str, tuple[blobs.ArrayRef, list[bytes]]] = {}
    texts = []
    for item in items:
        text, needed = codec.encode_item(item)
        texts.append(text)
        for blob in needed:
            parts = [bytes(p) for p in blobs.pack(blob.array, blob.ref, squeeze=blob.squeeze)]
            stored[blob.ref.blob] = (blob.ref, parts)

    def fetch(ref: blobs.ArrayRef, part: str, squeezed: bool) -> npt.NDArray[Any]:
        parts = stored[ref.blob][1]
        blobs.check_parts(ref, [len(p) for p in parts], part, squeezed=squeezed)
        return blobs.unpack(ref, iter(parts), part)

    inward = codec.Inward(fetch)
    return [inward.item(loads(text, "an item"), "an item") for text in texts]


def mesh(**changes: Any) -> MeshObject:
    made = MeshObject(id="chair", name="Chair", geometry=TRIANGLE, materials=("paint",))
    return dataclasses.replace(made, **changes)


@given(scenes())
@SLOW
def test_items_come_back_bit_for_bit(scene: Scene) -> None:
    items = [*scene.nodes.values(), *scene.materials.values()]
    for before, after in zip(items, back(*items), strict=True):
        assert codec.encode_item(before)[0] == codec.encode_item(after)[0]
        for name in ("name", "parent", "transform", "values", "intensity", "tint", "fov"):
            assert getattr(before, name, None) == getattr(after, name, None)
        if isinstance(before, MeshObject):
            for (_, one), (_, two) in zip(before.geometry.parts(), after.geometry.parts(), strict=True):
                assert one.dtype == two.dtype
                assert one.tobytes() == two.tobytes()
        if isinstance(before, Environment):
            assert before.image.pixels.tobytes() == after.image.pixels.tobytes()
            assert before.image.encoding == after.image.encoding


@pytest.mark.parametrize(("written", "read"), [(1e308, 170.0), (-1e308, 1.0), (0.0, 1.0), (45.5, 45.5)])
def test_numbers_out_of_range_are_brought_into_it(written: float, read: float) -> None:
    (camera,) = back(Camera(id="c", name="Eye", fov=written))
    assert camera.fov == read
    (lamp,) = back(SpotLamp(id="l", name="Spot", intensity=-1.0, tint=(2e3, 1.0, -3.0), cone=1e9))
    assert (lamp.intensity, lamp.tint, lamp.cone) == (0.0, (1e3, 1.0, 0.0), 90.0)
    (glass,) = back(Material(id="m", name="Glass", opacity=-7.0, values=frozen_map({"base_color": 1e9})))
    assert glass.opacity == 0.0
    assert glass.values["base_color"] == 1e9  # checked where the model is known


def test_equal_meshes_and_pictures_become_one_object() -> None:
    twin = Geometry(TRIANGLE.positions.copy(), TRIANGLE.faces.copy())
    sky = Image(np.ones((2, 4, 3), np.float32))
    again = Image(np.ones((2, 4, 3), np.float32))
    one, two, paint, light = back(
        mesh(),
        mesh(id="other", geometry=twin),
        dataclasses.replace(PAINT, textures=frozen_map({"colour": Texture(sky)})),
        Environment(id="sky", name="Sky", image=again),
    )
    assert one.geometry is two.geometry
    assert paint.textures["colour"].image is light.image


def test_how_a_picture_lies_is_kept_and_older_files_lay_it_straight() -> None:
    sky = Image(np.ones((2, 4, 3), np.float32))
    laid = Texture(sky, (2.0, 3.0), (0.1, 0.2), 30.0, 1.5)
    paint = dataclasses.replace(PAINT, textures=frozen_map({"colour": laid}))
    (made,) = back(paint)
    assert made.textures["colour"].affine == laid.affine
    text, blobs_ = codec.encode_item(paint)
    written = loads(text, "an item")
    for name in ("rotation", "aspect"):
        del written["textures"]["colour"][name]
    packed = {
        b.ref.blob: (b.ref, [bytes(p) for p in blobs.pack(b.array, b.ref, squeeze=b.squeeze)]) for b in blobs_
    }
    inward = codec.Inward(lambda ref, part, squeezed: blobs.unpack(ref, iter(packed[ref.blob][1]), part))
    older = inward.item(written, "an item")
    assert older.textures["colour"].affine == (2.0, 0.0, 0.1, 0.0, 3.0, 0.2)


def test_paint_keeps_its_looks_and_older_files_have_none() -> None:
    points = [(0.0, 1.0, 2.0), (1.0, 0.0, 0.0)], [(0.0, 1.0, 0.0)] * 2, [0, 1]
    looks = [(0.1, 0.2, 0.3), (0.4, 0.5, 0.6)]
    coat = Paint.of(*points, {"roughness": [0.1, 0.2]}, looks)
    (made,) = back(mesh(paint=coat))
    assert made.paint.key == coat.key
    text, blobs_ = codec.encode_item(mesh(paint=coat))
    written = loads(text, "an item")
    del written["paint"]["looks"]
    packed = {
        b.ref.blob: (b.ref, [bytes(p) for p in blobs.pack(b.array, b.ref, squeeze=b.squeeze)]) for b in blobs_
    }
    inward = codec.Inward(lambda ref, part, squeezed: blobs.unpack(ref, iter(packed[ref.blob][1]), part))
    older = inward.item(written, "an item")
    assert older.paint.key == Paint.of(*points, {"roughness": [0.1, 0.2]}).key != coat.key


def test_equal_tables_become_one_object_and_damaged_ones_are_refused() -> None:
    values = np.random.default_rng(0).random((3, 4, 5, 3), dtype=np.float32)
    measured = dataclasses.replace(PAINT, tables=frozen_map({"measurement": Table(values, "Felt")}))
    other = dataclasses.replace(measured, id="b", tables=frozen_map({"x": Table(values.copy(), "Felt")}))
    one, two = back(measured, other)
    assert one.tables["measurement"] is two.tables["x"]
    assert one.tables["measurement"].values.tobytes() == values.tobytes()
    assert (one.tables["measurement"].name, one.tables["measurement"].key) == ("Felt", Table(values).key)
    text = codec.encode_item(measured)[0]
    for old, new in (('"name":"Felt"', '"name":1'), ('"name":"Felt",', ""), ("[3,4,5,3]", "[3,4,15]")):
        assert old in text
        with pytest.raises(ProjectError, match="damaged"):
            codec.Inward(lambda *_: values).item(loads(text.replace(old, new), "an item"), "an item")
    with pytest.raises(ProjectError, match="finite"):
        codec.Inward(lambda *_: values * np.float32(np.inf)).item(loads(text, "an item"), "an item")


def test_unknown_models_and_parameters_survive() -> None:
    values = {"rouge": 1, "vif": 1.0, "oui": True, "nom": "é\ud800\x00", "teinte": (0.1, 5e-324, -0.0)}
    (after,) = back(Material(id="m", name="M", model="nobody.knows/v9", values=frozen_map(values)))
    assert after.model == "nobody.knows/v9"
    assert dict(after.values) == values
    assert [type(after.values[k]) for k in values] == [int, float, bool, str, tuple]
    assert math.copysign(1, after.values["teinte"][2]) == -1


def test_numpy_numbers_are_saved_as_numbers() -> None:
    values = {"a": np.float32(0.1), "b": np.int64(3), "c": np.bool_(True)}
    (after,) = back(Material(id="m", name="M", values=frozen_map(values), opacity=np.float64(0.25)))
    assert dict(after.values) == {"a": float(np.float32(0.1)), "b": 3, "c": True}
    assert (type(after.opacity), type(after.values["b"]), type(after.values["c"])) == (float, int, bool)


def test_missing_fields_take_defaults_and_unknown_ones_are_refused() -> None:
    def refuse(*_: Any) -> Any:
        raise AssertionError("no array is needed")

    inward = codec.Inward(refuse)
    assert inward.item({"type": "group", "id": "g"}, "x") == Group(id="g")
    with pytest.raises(ProjectError, match=r"'Seat' \(g\) has the unknown field 'glow'"):
        inward.item({"type": "group", "id": "g", "name": "Seat", "glow": 1.0}, "x")
    with pytest.raises(ProjectError, match="lacks the field 'id'"):
        inward.item({"type": "group"}, "item")


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("fov", 45),
        ("fov", True),
        ("fov", "45.0"),
        ("fov", None),
        ("hidden", 1),
        ("name", None),
        ("parent", 3),
        ("transform", {"translation": [0.0, 0.0], "rotation": [1.0, 0.0, 0.0, 0.0], "scale": 1.0}),
        ("transform", {"translation": [0.0, 0.0, 0.0], "rotation": [2.0, 0.0, 0.0, 0.0], "scale": 1.0}),
        ("transform", {"scale": -1.0}),
        ("transform", {"shear": 1.0}),
        ("transform", []),
        ("type", "Camera"),
        ("type", ["camera"]),
    ],
)
def test_wrong_types_are_refused_by_name(field: str, value: object) -> None:
    good = json.loads(codec.encode_item(Camera(id="eye", name="Eye"))[0])
    inward = codec.Inward(lambda *_: np.empty(0))
    assert inward.item(good, "x") == Camera(id="eye", name="Eye")
    with pytest.raises(ProjectError, match=r"item 7|Eye"):
        inward.item({**good, field: value}, "item 7")


@pytest.mark.parametrize("bad", [math.nan, math.inf, "bright", None, 1j])
def test_what_a_file_cannot_hold_is_refused_on_the_way_out(bad: Any) -> None:
    with pytest.raises(ProjectError, match=r"'Lamp'.*intensity"):
        codec.encode_item(PointLamp(id="l", name="Lamp", intensity=bad))
    values = {"glow": (bad, 1.0, 1.0)}
    with pytest.raises(ProjectError, match=r"'M'.*values.*glow"):
        codec.encode_item(Material(id="m", name="M", values=frozen_map(values)))


@pytest.mark.parametrize(
    "text",
    [
        "NaN",
        "[1e999]",
        "-Infinity",
        "[" * 100_000,
        '{"a":1,"a":2}',
        "9" * 5000,
        "-" + "9" * 21,
        "",
        "{",
        '"\n"',
        " " * ((4 << 20) + 1),
    ],
)
def test_json_traps_are_project_errors(text: str) -> None:
    with pytest.raises(ProjectError, match="the view"):
        loads(text, "the view")


def test_digest_follows_content_and_order() -> None:
    one, two = Group(id="a", name="A"), Group(id="b", name="B")
    base = Scene().with_nodes(one, two)
    same = Scene().with_nodes(Group(id="a", name="A"), Group(id="b", name="B"))
    assert codec.scene_digest(base) == codec.scene_digest(same)
    others = [Scene(), Scene().with_nodes(two, one), base.with_materials(PAINT)]
    others += [base.with_nodes(dataclasses.replace(one, hidden=True)), Scene().with_nodes(one)]
    assert len({codec.scene_digest(s) for s in (base, *others)}) == len(others) + 1


def test_digest_of_a_scene_hashes_only_what_is_new(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = Scene().with_nodes(*(Group(id=f"g{k}", name="G") for k in range(500)))
    codec.scene_digest(scene)
    made: list[str] = []
    plain = codec.encode_item
    monkeypatch.setattr(codec, "encode_item", lambda item: made.append(item.id) or plain(item))  # type: ignore[func-returns-value]
    codec.scene_digest(scene.with_nodes(Group(id="g7", name="Changed")))
    assert made == ["g7"]


def test_memo_lets_go_of_the_dead() -> None:
    memo: Memo[str] = Memo(lambda item: item.name)
    items = [Group(id=str(k), name=str(k)) for k in range(50)]
    assert [memo(item) for item in items] == [str(k) for k in range(50)]
    assert len(memo) == 50
    del items
    gc.collect()
    assert len(memo) == 0


@given(images())
@SLOW
def test_packed_pictures_come_back(image: Image) -> None:
    ref = blobs.array_ref(image.pixels)
    parts = [bytes(p) for p in blobs.pack(image.pixels, ref, squeeze=True)]
    blobs.check_parts(ref, [len(p) for p in parts], "x", squeezed=True)
    assert blobs.unpack(ref, iter(parts), "x").tobytes() == image.pixels.tobytes()


def test_large_arrays_lie_in_several_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blobs, "PART_BYTES", 1000)
    rng = np.random.default_rng(5)
    for squeeze in (False, True):
        pixels = np.repeat(rng.random((40, 10, 3), dtype=np.float32), 2, axis=1)
        ref = blobs.array_ref(pixels)
        parts = [bytes(p) for p in blobs.pack(pixels, ref, squeeze=squeeze)]
        assert len(parts) == 10
        assert blobs.unpack(ref, iter(parts), "x").tobytes() == pixels.tobytes()


def test_declared_sizes_bound_what_is_unpacked() -> None:
    bomb = np.zeros((1000, 1000, 3), np.uint8)
    ref = blobs.array_ref(bomb)
    (data,) = blobs.pack(bomb, ref, squeeze=True)
    assert len(data) < 20_000
    small = dataclasses.replace(ref, shape=(100, 100, 3))
    with pytest.raises(ProjectError, match="wrong size"):
        blobs.unpack(small, iter([bytes(data)]), "x")
    with pytest.raises(ProjectError, match="does not fit"):
        blobs.check_parts(ref, [100], "x", squeezed=True)
    with pytest.raises(ProjectError, match="does not fit"):
        blobs.check_parts(ref, [len(data)], "x", squeezed=False)
    with pytest.raises(ProjectError, match="does not match its address"):
        blobs.unpack(dataclasses.replace(ref, blob="0" * 32), iter([bytes(data)]), "x")
    with pytest.raises(ProjectError, match="x is damaged"):
        blobs.unpack(ref, iter([b"\x00" * 50]), "x")


@pytest.mark.parametrize(
    "change",
    [
        {"shape": [2**31, 3]},
        {"shape": [2**30, 3]},
        {"shape": [-1, 3]},
        {"shape": [3.0, 3]},
        {"shape": [True, 3]},
        {"shape": [3, 4]},
        {"shape": [3]},
        {"shape": "33"},
        {"dtype": "<f8"},
        {"dtype": "|O"},
        {"dtype": ["<f4"]},
        {"blob": "A" * 32},
        {"blob": "0" * 31},
        {"blob": 5},
        {"more": 1},
    ],
)
def test_absurd_references_are_refused(change: dict[str, Any]) -> None:
    good = {"blob": "0" * 32, "dtype": "<f4", "shape": [3, 3]}
    assert blobs.parse_ref(good, "x", ("<f4",), (None, 3)).nbytes == 36
    with pytest.raises(ProjectError):
        blobs.parse_ref({**good, **change}, "x", ("<f4",), (None, 3))


HASHES = st.lists(st.integers(0, 2**128 - 1).map(lambda n: f"{n:032x}"), max_size=600)


def expand(root: str | None, texts: dict[str, str]) -> list[str]:
    return pages.expand(root, lambda a: pages.parse(loads(texts[a], a), a), "the list")


@given(HASHES)
@SLOW
def test_lists_come_back_from_their_pages(hashes: list[str]) -> None:
    root, texts = pages.build(hashes)
    assert expand(root, texts) == hashes
    assert all(text_hash(text) == address for address, text in texts.items())


def test_one_change_in_a_long_list_changes_few_pages() -> None:
    hashes = [text_hash(str(k)) for k in range(20_000)]
    before = set(pages.build(hashes)[1])
    for changed in (
        [*hashes[:9000], text_hash("new"), *hashes[9000:]],
        [*hashes[:50], *hashes[51:]],
        [*hashes[:777], text_hash("other"), *hashes[778:]],
        [*hashes, text_hash("last")],
    ):
        assert len(set(pages.build(changed)[1]) - before) <= 8


def test_a_list_that_names_one_page_again_and_again_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pages, "MAX_ENTRIES", 10_000)
    texts: dict[str, str] = {}
    below = ["0" * 32] * 256
    for level in range(13):
        text = dumps({"type": "page", "level": level, "of": below}, "x")
        texts[text_hash(text)] = text
        below = [text_hash(text)] * 256
    with pytest.raises(ProjectError, match="more than"):
        expand(below[0], texts)
    loop = {"a" * 32: (1, ("a" * 32,))}
    with pytest.raises(ProjectError, match="wrong level"):
        pages.expand("a" * 32, loop.__getitem__, "x")


@pytest.mark.parametrize(
    ("scene", "cause"),
    [
        (Scene(frozen_map({"b": Group(id="a")})), "stands under 'b'"),
        (Scene().with_nodes(Group(id="a", name="A", parent="gone")), "parent 'gone' of the node 'A'"),
        (Scene().with_nodes(Group(id="a", parent="a")), "own ancestor"),
        (Scene().with_nodes(*(Group(id=str(k), parent=str((k + 1) % 5)) for k in range(5))), "own ancestor"),
        (Scene().with_nodes(mesh()), "material 'paint' of the mesh 'Chair'"),
        (Scene().with_nodes(mesh(materials=())), "uses slot 0"),
    ],
)
def test_scenes_that_do_not_hold_together(scene: Scene, cause: str) -> None:
    with pytest.raises(ProjectError, match=cause):
        check_scene(scene)


def test_scenes_that_hold_together() -> None:
    deep = [Group(id=str(k), parent=str(k - 1) if k else None) for k in range(5000)]
    check_scene(Scene().with_nodes(*deep, mesh(parent="4999")).with_materials(PAINT))
    check_scene(Scene().with_nodes(Group(id="a", transform=Transform(scale=3.0))))
