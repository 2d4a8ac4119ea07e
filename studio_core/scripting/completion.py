"""What could come next while a command is typed: names, attributes, names of the scene's things."""

from __future__ import annotations

import builtins
import inspect
import keyword
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from studio_core.scene.nodes import Scene
from studio_core.scripting.shown import signature, summary

MOST = 200
_WORD = re.compile(r"(?:(?P<owner>[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)\.)?(?P<start>\w*)$")
_CALL = re.compile(r"(?P<name>[A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)\s*\($")
_MATERIALS = ("material", "replace_material", "materials")


@dataclass(frozen=True)
class Completion:
    """One possibility: the text to put in place of the last `length` characters, and what it is."""

    text: str
    length: int
    signature: str = ""
    summary: str = ""


def completions(before: str, namespace: Mapping[str, Any], scene: Scene) -> list[Completion]:
    """What fits the text before the cursor, in order; inside a string names of nodes or materials."""
    line = before.split("\n")[-1]
    string = _open_string(line)
    if string is not None:
        call, start = string
        return _of_scene(call, start, scene)
    found = _WORD.search(line)
    if found is None or (not found["start"] and not found["owner"]):
        return []
    start, owner = found["start"], found["owner"]
    if owner is not None:
        thing = _value(owner, namespace)
        return _sorted(thing, dir(thing), start) if thing is not None else []
    if start[0].isdigit():
        return []
    words = {*keyword.kwlist, *dir(builtins), *namespace}
    return _sorted(None, words, start, namespace)


def hint(before: str, namespace: Mapping[str, Any]) -> str:
    """Signature and first line of the function whose brackets the cursor is in, or nothing."""
    line = before.split("\n")[-1]
    opened = _open_bracket(line)
    found = _CALL.search(line[: opened + 1]) if opened >= 0 else None
    thing = _value(found["name"], namespace) if found is not None else None
    if found is None or thing is None or not callable(thing):
        return ""
    return f"{found['name']}{signature(thing)}  {summary(thing)}".rstrip()


def _sorted(
    owner: object, words: Iterable[str], start: str, values: Mapping[str, Any] | None = None
) -> list[Completion]:
    fitting = [word for word in words if word.casefold().startswith(start.casefold())]
    if not start.startswith("_"):
        fitting = [word for word in fitting if not word.startswith("_")]
    known = fitting if values is None else values
    fitting.sort(key=lambda word: (word not in known, not word.startswith(start), word.casefold()))
    made = []
    for word in fitting[:MOST]:
        thing = _attribute(owner, word) if values is None else values.get(word, getattr(builtins, word, None))
        made.append(Completion(word, len(start), signature(thing), summary(thing)))
    return made


def _of_scene(call: str, start: str, scene: Scene) -> list[Completion]:
    nodes = [(node.name, type(node).__name__) for node in scene.nodes.values()]
    materials = [(material.name, "Material") for material in scene.materials.values()]
    known = materials if call in _MATERIALS else nodes + materials
    kinds = dict(reversed(known))
    names = list(dict.fromkeys(name for name, _ in known))
    fitting = [name for name in names if name.casefold().startswith(start.casefold())]
    return [Completion(name, len(start), "", kinds[name]) for name in fitting[:MOST]]


def _value(dotted: str, namespace: Mapping[str, Any]) -> Any:
    """What the name means, without calling anything."""
    first, *rest = dotted.split(".")
    value = namespace.get(first, getattr(builtins, first, None))
    for name in rest:
        value = _attribute(value, name)
    return value


def _attribute(owner: object, name: str) -> Any:
    """An attribute; properties are asked of our own values alone, whose properties only look."""
    static = inspect.getattr_static(owner, name, None)
    if isinstance(static, property) and not type(owner).__module__.startswith("studio_core"):
        return None
    try:
        return getattr(owner, name, None)
    except Exception:
        return None


def _open_string(line: str) -> tuple[str, str] | None:
    """(function called, text so far) of a string that is open at the end of the line."""
    quote, begun = "", 0
    for at, character in enumerate(line):
        if not quote and character in "'\"":
            quote, begun = character, at
        elif quote == character and line[at - 1] != "\\":
            quote = ""
        elif not quote and character == "#":
            return None
    if not quote:
        return None
    opened = _open_bracket(line[:begun])
    found = _CALL.search(line[: opened + 1]) if opened >= 0 else None
    return (found["name"] if found is not None else "", line[begun + 1 :])


def _open_bracket(line: str) -> int:
    """Where the innermost bracket was opened that is not closed, or -1."""
    depth = 0
    for at in range(len(line) - 1, -1, -1):
        if line[at] in ")]}":
            depth += 1
        elif line[at] in "([{":
            if depth == 0:
                return at if line[at] == "(" else -1
            depth -= 1
    return -1
