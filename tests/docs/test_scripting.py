"""The recipes of docs/scripting.md run as they stand on the sample room."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from studio import samples
from studio.verbs_script import _save
from studio_core.contract import Services
from studio_core.document import Document
from studio_core.parallel import Workers
from studio_core.project.store import load
from studio_core.registry import PluginHost
from studio_core.scene.nodes import Camera, Environment, MeshObject, Scene
from studio_core.scene.room import Room
from studio_core.scripting import Interpreter, Names
from studio_core.scripting.names import GROUPS
from studio_core.session import Session
from studio_core.shading.offline import scene_view
from studio_core.strokes.stroke import Stroke

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "scripting.md").read_text("utf-8")
RECIPES = dict(re.findall(r"^### (.+?)\n.*?```python\n(.*?)```", PAGE, re.MULTILINE | re.DOTALL))


def moved(before: Scene, after: Scene) -> list[str]:
    return [
        node.name
        for node in after.nodes.values()
        if node.id in before.nodes and before[node.id].transform != node.transform
    ]


def made(before: Scene, after: Scene) -> list[str]:
    return [node.name for node in after.nodes.values() if node.id not in before.nodes]


CHECKS: dict[str, Callable[[Scene, Scene, str, Path], bool]] = {
    "A row of chairs": lambda b, a, said, _: len(made(b, a)) == 4 and said == "5 chairs\n",
    "Turn everything that is chosen": lambda b, a, *_: moved(b, a) == ["Armchair", "Floor lamp"],
    "A list of measured sizes": lambda b, a, said, _: "Sofa " in said and a is b,
    "Another material everywhere": lambda b, a, said, _: (
        int(said.split()[0]) == sum("material-walnut" in node.materials for node in b.of(MeshObject)) > 0
        and not any("material-walnut" in node.materials for node in a.of(MeshObject))
    ),
    "A material of the library": lambda b, a, *_: (
        {m.name for m in a.materials.values()} - {m.name for m in b.materials.values()} == {"Walnut, oiled"}
    ),
    "A new material for one thing": lambda b, a, *_: len(a.materials) == len(b.materials) + 1,
    "Sweep the light and write pictures": lambda b, a, said, folder: len([*folder.glob("light-*.png")]) == 3,
    "A picture through every camera": lambda b, a, said, folder: len([*folder.glob("*.png")]) == 3,
    "The lamp on, the daylight off": lambda b, a, *_: next(a.of(Environment)).hidden,
    "How bright a picture is": lambda b, a, said, _: 0 < float(said.split()[1].rstrip(",")) < 5,
    "Paint the light that is wanted": lambda b, a, said, _: "%" in said and len([*a.of(Stroke)]) == 1,
    "Stand things on what lies below them": lambda b, a, *_: (
        0 <= a.world("group-armchair").translation[1] < 0.05
    ),
    "Chairs in a row with equal gaps": lambda b, a, *_: len(made(b, a)) == 2,
    "A camera on a circle around a thing": lambda b, a, *_: len([*a.of(Camera)]) == len([*b.of(Camera)]) + 4,
    "A room beside this one, wider later": lambda b, a, *_: (
        made(b, a) == ["Study"] and [len(room.placed()) for room in a.of(Room)] == [3]
    ),
    "Find what is below the floor": lambda b, a, said, _: said.strip() != "" and a is b,
    "Variants of one thing, side by side": lambda b, a, *_: len(a.materials) == len(b.materials) + 3,
    "Everything as one step, or not at all": lambda b, a, *_: moved(b, a) == ["Rug", "Sofa"],
    "A copy without its history": lambda b, a, said, folder: (
        list(load(folder / "for-the-client.lucarne").scene.nodes) == list(a.nodes)
    ),
}


def test_every_recipe_is_checked() -> None:
    assert set(RECIPES) == set(CHECKS)
    assert PAGE.count("```python") == len(RECIPES)


@pytest.mark.parametrize("title", list(RECIPES))
def test_a_recipe_does_what_its_title_says(
    title: str, host: PluginHost, workers: Workers, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    before = load(samples.sample()).scene
    document = Document(before)
    session = Session(scene_view(before, None, 120, 80))
    session.shade_with("reference", {"directions": "1024"})
    names = Names(
        document, session, host, lambda: Services(workers, host), save=partial(_save, document, None)
    )
    said: list[str] = []
    outcome = Interpreter(document, names.namespace, lambda text, _: said.append(text)).run(RECIPES[title])
    assert outcome.ok, outcome.detail
    assert CHECKS[title](before, document.scene, "".join(said), tmp_path)
    assert len(document.history) <= 2
    document.undo()
    assert document.scene is before


def test_the_page_speaks_of_names_that_exist() -> None:
    known = {name for members in GROUPS.values() for name in members} | {"help"}
    for name in re.findall(r"`(\w+)\(", PAGE):
        assert name in known | {"input"}, name
