"""The shelf: what it lists, finds, keeps and deletes."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.errors import InputError
from studio_core.library import shelf as module
from studio_core.library.lucmat import Kept, read
from studio_core.library.shelf import Shelf, file_stem, folded
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Material


def material(name: str) -> Material:
    return Material(id="m", name=name)


@pytest.fixture
def shelf(tmp_path: Path) -> Shelf:
    built_in = [Kept(material("Brass"), ("metal",)), Kept(material("Wall paint"), ("paint", "matt"))]
    return Shelf(tmp_path / "materials", built_in)


def names(shelf: Shelf, *what: str, tags: tuple[str, ...] = ()) -> list[str]:
    return [entry.name for entry in shelf.find(" ".join(what), tags)]


def test_an_empty_folder_has_what_is_built_in(shelf: Shelf) -> None:
    assert names(shelf) == ["Brass", "Wall paint"]
    assert not shelf.folder.exists()


def test_what_is_kept_is_found(shelf: Shelf) -> None:
    path = shelf.add(material("Chêne huilé"), ("wood", "floor"), "from Lyon")
    assert path.name == "Chêne huilé.lucmat"
    assert names(shelf) == ["Brass", "Wall paint", "Chêne huilé"]
    assert names(shelf, "chene") == ["Chêne huilé"]
    assert names(shelf, "HUI", "flo") == ["Chêne huilé"]
    assert names(shelf, "lyon") == ["Chêne huilé"]
    assert names(shelf, "hene") == []  # words are found from their beginning
    assert names(shelf, tags=("Wood",)) == ["Chêne huilé"]
    assert names(shelf, "brass", tags=("wood",)) == []
    assert shelf.tags() == {"floor": 1, "matt": 1, "metal": 1, "paint": 1, "wood": 1}


def test_names_that_are_taken_get_a_number(shelf: Shelf) -> None:
    made = [shelf.add(material("Oak")).name for _ in range(3)]
    assert made == ["Oak.lucmat", "Oak 2.lucmat", "Oak 3.lucmat"]
    assert [read(shelf.folder / name).name for name in made] == ["Oak"] * 3


def test_only_what_changed_is_read_again(shelf: Shelf, monkeypatch: pytest.MonkeyPatch) -> None:
    paths = [shelf.add(material(name)) for name in ("Ash", "Beech")]
    looked: list[str] = []

    def watched(path: Path) -> Kept:
        looked.append(path.name)
        return read(path)

    monkeypatch.setattr(module, "read", watched)
    shelf.entries()
    assert looked == ["Ash.lucmat", "Beech.lucmat"]
    shelf.entries()
    assert len(looked) == 2
    os.utime(paths[1], ns=(1, 1))
    shelf.entries()
    assert looked[2:] == ["Beech.lucmat"]
    paths[0].unlink()
    assert names(shelf) == ["Brass", "Wall paint", "Beech"]


def test_a_damaged_file_is_listed_with_its_reason(shelf: Shelf) -> None:
    shelf.add(material("Good"))
    (shelf.folder / "Bad.lucmat").write_bytes(b"no material")
    bad = next(entry for entry in shelf.entries() if entry.kept is None)
    assert bad.name == "Bad"
    assert bad.problem == "Bad.lucmat is not a Lucarne material"
    assert names(shelf, "good") == ["Good"]
    shelf.remove(bad)
    assert names(shelf) == ["Brass", "Wall paint", "Good"]


def test_the_same_material_is_put_there_once(shelf: Shelf) -> None:
    oak = Kept(Material(id="a", name="Oak", values={"roughness": 0.5}), ("wood",))
    path = shelf.put(oak)
    assert shelf.put(Kept(replace(oak.material, id="b"))) == path
    other = shelf.put(Kept(replace(oak.material, values={"roughness": 0.6})))
    assert other.name == "Oak 2.lucmat"
    assert shelf.put(Kept(replace(oak.material, name="Brass"))).name == "Brass.lucmat", "a preset is no file"


def test_names_and_tags_change(shelf: Shelf) -> None:
    first = shelf.add(material("Oak"), ("wood",), "of Lyon")
    moved = shelf.change(shelf.entries()[-1], name="Chêne")
    assert (moved.name, first.exists()) == ("Chêne.lucmat", False)
    found = read(moved)
    assert (found.name, found.tags, found.about) == ("Chêne", ("wood",), "of Lyon")
    assert shelf.change(shelf.entries()[-1], tags=("floor", "oiled")) == moved
    assert shelf.entries()[-1].tags == ("floor", "oiled")
    with pytest.raises(InputError, match="Brass belongs to the program"):
        shelf.change(shelf.entries()[0], name="Gold")


def test_large_pictures_stay_in_their_file(shelf: Shelf) -> None:
    pixels = np.random.default_rng(1).random((640, 640, 3), np.float32)
    woven = Material(id="m", name="Woven", textures={"base_color": Texture(Image(pixels))})
    shelf.add(woven)
    entry = shelf.entries()[-1]
    assert not entry.whole
    assert entry.kept is not None
    assert not entry.kept.material.textures
    np.testing.assert_array_equal(shelf.fetch(entry).material.textures["base_color"].image.pixels, pixels)
    moved = shelf.change(entry, name="Cloth")
    assert "base_color" in read(moved).material.textures
    assert shelf.put(Kept(replace(woven, name="Cloth"))) == moved


def test_tags_that_differ_in_case_are_one(shelf: Shelf) -> None:
    shelf.add(material("A"), ("Métal", "metal"))
    assert shelf.tags() == {"metal": 2, "matt": 1, "paint": 1}


def test_what_is_built_in_stays(shelf: Shelf) -> None:
    with pytest.raises(InputError, match="Brass belongs to the program"):
        shelf.remove(shelf.entries()[0])


@given(st.text())
def test_every_name_gives_a_file_name(name: str) -> None:
    made = file_stem(name)
    assert made
    assert made == made.strip(" .")
    assert not set(made) & set('<>:"/\\|?*\n\0')
    assert len(made.encode()) <= 81
    assert file_stem("CON") == "CON-"


@given(st.text())
def test_folding_twice_is_folding_once(text: str) -> None:
    assert folded(folded(text)) == folded(text)
