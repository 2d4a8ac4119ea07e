"""Importers and exporters of other people: what goes wrong is named, and what was there stays."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from scenes import little_scene

from studio_core.contract import API, ImportedModel, Plugin
from studio_core.errors import Cancelled, InputError, LucarneError, PluginError
from studio_core.registry import PluginHost
from studio_core.scene.nodes import Group, Material, Scene


class Stranger:
    """An importer and exporter at once, as bad as it is told to be."""

    label = "Stranger"
    extensions = (".odd",)

    def __init__(self) -> None:
        self.does: Callable[..., Any] = lambda *given: None

    def load(self, path: Path, unit: float = 1.0) -> Any:
        return self.does(path)

    def save(self, scene: Scene, path: Path, registry: Any) -> Any:
        return self.does(path)


@pytest.fixture
def stranger() -> Stranger:
    return Stranger()


@pytest.fixture
def host(stranger: Stranger, monkeypatch: pytest.MonkeyPatch) -> PluginHost:
    module = type(sys)("stranger_module")
    module.THING = stranger  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "stranger_module", module)
    provides = {kind: {"odd": "stranger_module:THING"} for kind in ("importer", "exporter")}
    return PluginHost([Plugin("stranger", API, provides)])


def raises(error: BaseException) -> Callable[..., Any]:
    def fail(*given: object) -> Any:
        raise error

    return fail


NONSENSE: dict[str, Callable[..., Any]] = {
    "nothing": lambda path: None,
    "a list": lambda path: [],
    "no nodes": lambda path: ImportedModel(("a", "b"), ()),  # type: ignore[arg-type]
    "the same node twice": lambda path: ImportedModel((Group(id="a"), Group(id="a")), ()),
    "a parent that is not there": lambda path: ImportedModel((Group(id="a", parent="b"),), ()),
    "its own parent": lambda path: ImportedModel((Group(id="a", parent="a"),), ()),
    "an error": raises(ZeroDivisionError("oh")),
    "leaving": raises(SystemExit(3)),
    "an error of ours": raises(PluginError("no licence")),
}


@pytest.mark.parametrize("how", list(NONSENSE))
def test_what_is_no_model_is_refused_and_named(host: PluginHost, stranger: Stranger, how: str) -> None:
    stranger.does = NONSENSE[how]
    importer = host.get("importer", "odd")
    assert (importer.label, importer.extensions) == ("Stranger", (".odd",))
    with pytest.raises(PluginError, match=r"a\.odd could not be read: a mistake in the plugin stranger"):
        importer.load(Path("a.odd"))
    (failure,) = host.failures
    assert (failure.plugin, failure.what.split(":")[0]) == ("stranger", "reading a.odd")
    assert "Traceback" in failure.traceback
    with pytest.raises(PluginError):
        importer.load(Path("a.odd"))
    assert len(host.failures) == 1


@pytest.mark.parametrize("error", [InputError("a.odd: it is empty"), Cancelled("reading")])
def test_what_an_importer_may_raise_comes_through(
    host: PluginHost, stranger: Stranger, error: Exception
) -> None:
    stranger.does = raises(error)
    with pytest.raises(type(error), match=str(error)):
        host.get("importer", "odd").load(Path("a.odd"))
    assert host.failures == []


def test_a_sound_model_comes_through(host: PluginHost, stranger: Stranger) -> None:
    model = ImportedModel((Group(id="a"),), (Material(id="m"),))
    stranger.does = lambda path: model
    assert host.get("importer", "odd").load(Path("a.odd")) is model


def half(path: Path) -> None:
    path.write_text("half of")
    (path.parent / "texture.png").write_text("it")
    raise OSError(28, "No space left on device")


@pytest.mark.parametrize("does", [half, lambda path: None, raises(SystemExit()), raises(InputError("no"))])
def test_what_was_there_stays_when_writing_fails(
    host: PluginHost, stranger: Stranger, does: Callable[..., Any], tmp_path: Path
) -> None:
    stranger.does = does
    target = tmp_path / "a.odd"
    target.write_text("mine")
    with pytest.raises(LucarneError):
        host.get("exporter", "odd").save(little_scene(), target, host)
    assert target.read_text() == "mine"
    assert [path.name for path in tmp_path.iterdir()] == ["a.odd"]


def test_what_is_written_is_put_in_its_place(host: PluginHost, stranger: Stranger, tmp_path: Path) -> None:
    def write(path: Path) -> list[str]:
        path.write_text("whole")
        (path.parent / "textures").mkdir()
        (path.parent / "textures" / "a.png").write_text("picture")
        return ["the lamp was left out"]

    stranger.does = write
    (tmp_path / "textures").mkdir()
    (tmp_path / "textures" / "old.png").write_text("old")
    notes = host.get("exporter", "odd").save(little_scene(), tmp_path / "a.odd", host)
    assert notes == ("the lamp was left out",)
    assert (tmp_path / "a.odd").read_text() == "whole"
    assert sorted(path.name for path in (tmp_path / "textures").iterdir()) == ["a.png", "old.png"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.odd", "textures"]
    with pytest.raises(InputError, match="cannot be written"):
        host.get("exporter", "odd").save(little_scene(), tmp_path / "nowhere" / "a.odd", host)


def test_the_programs_own_are_handed_out_as_they_are(host: PluginHost) -> None:
    from studio_plugins.meshes import plugin as meshes

    host.add(meshes)
    name = host.names("importer")[-1]
    assert host.bundled("importer", name)
    assert type(host.get("importer", name)).__module__.startswith("studio_plugins.")


def test_errors_are_traced_to_whose_code_they_went_through(host: PluginHost) -> None:
    module = sys.modules["stranger_module"]
    exec("def fails(call):\n    call()\n", module.__dict__)
    module.__dict__["__name__"] = "stranger_module"
    with pytest.raises(ZeroDivisionError) as caught:
        module.__dict__["fails"](raises(ZeroDivisionError()))
    found = host.culprit(caught.value)
    assert found is not None
    assert found.id == "stranger"
    with pytest.raises(ZeroDivisionError) as own:
        raises(ZeroDivisionError())()
    assert host.culprit(own.value) is None
