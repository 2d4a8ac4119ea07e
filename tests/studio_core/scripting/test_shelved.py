"""The library in scripts: found by name or words, added once, kept."""

from __future__ import annotations

import pytest

from studio_core.contract import Services
from studio_core.document import Document
from studio_core.errors import EditError
from studio_core.library.lucmat import read
from studio_core.scene.nodes import Material, Scene
from studio_core.scripting import Names
from studio_core.session import Session


@pytest.fixture
def names(host, workers, monkeypatch, tmp_path):
    monkeypatch.setenv("LUCARNE_MATERIALS", str(tmp_path / "mine"))
    scene = Scene().with_materials(Material(id="rug", name="Rug", values={"base_color": (0.1, 0.2, 0.3)}))
    return Names(Document(scene), Session(), host, lambda: Services(workers, host))


def test_a_material_of_the_library_comes_in_once(names):
    walnut = names.add_material("walnut, OILED")
    assert (walnut.name, walnut.model) == ("Walnut, oiled", "plastic")
    assert names.add_material("waln") is walnut
    assert [step.label for step in names.namespace["document"].history][1:] == ["Add Walnut, oiled"]
    names.change(walnut, roughness=0.9)
    assert names.add_material("Walnut, oiled").id != walnut.id, "changed, it is another one"


def test_several_or_none_are_told(names):
    with pytest.raises(EditError, match="of one material of the library: 'Brass, polished', 'Br"):
        names.add_material("brass")
    with pytest.raises(EditError, match=r"'nothing' is not the name of one material of the library$"):
        names.add_material("nothing")


def test_what_is_kept_comes_back_in_another_project(names, tmp_path):
    path = names.keep_material("Rug", "fabric")
    assert path == tmp_path / "mine" / "Rug.lucmat"
    assert read(path).tags == ("fabric",)
    assert names.add_material("Rug").id == "rug"
    other = names.keep_material("Rug", "floor")
    assert other == path, "it is kept already"
