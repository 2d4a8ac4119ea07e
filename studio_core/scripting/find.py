"""Nodes and materials by what a person calls them."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from fnmatch import fnmatch
from typing import TypeVar

from studio_core.errors import EditError
from studio_core.scene.nodes import Material, Node, NodeId, Scene


def path_of(scene: Scene, node: NodeId) -> str:
    """`Armchair/Frame`: the names from the top down."""
    above = [parent.name for parent in scene.ancestors(node)]
    return "/".join([*reversed(above), scene[node].name])


def node_named(scene: Scene, name: str) -> Node:
    """The first node of that id, name, or path (`Armchair/Frame`), else of that name in other case.

    EditError when there is none, with names that are like it.
    """
    if name in scene.nodes:
        return scene.nodes[name]
    found = _first(
        [node for node in scene.nodes.values() if node.name == name]
        or [node for node in scene.nodes.values() if "/" in name and path_of(scene, node.id).endswith(name)]
        or [node for node in scene.nodes.values() if node.name.casefold() == name.casefold()]
    )
    if found is None:
        raise EditError(_unknown("node", name, (node.name for node in scene.nodes.values())))
    return found


def material_named(scene: Scene, name: str) -> Material:
    """The material of that id or name, as with nodes."""
    if name in scene.materials:
        return scene.materials[name]
    found = _first(
        [one for one in scene.materials.values() if one.name == name]
        or [one for one in scene.materials.values() if one.name.casefold() == name.casefold()]
    )
    if found is None:
        raise EditError(_unknown("material", name, (one.name for one in scene.materials.values())))
    return found


def matching(scene: Scene, pattern: str) -> list[Node]:
    """All nodes whose name or path fits a pattern such as `Chair*`, in the outliner's order."""
    wanted = pattern.casefold()
    return [
        node
        for node in scene.nodes.values()
        if fnmatch(node.name.casefold(), wanted)
        or ("/" in pattern and fnmatch(path_of(scene, node.id).casefold(), wanted))
    ]


T = TypeVar("T")


def _first(found: list[T]) -> T | None:
    return found[0] if found else None


def _unknown(what: str, name: str, known: Iterable[str]) -> str:
    every = list(dict.fromkeys(known))
    near = difflib.get_close_matches(name, every, 3, 0.5) or every[:5]
    hint = f"did you mean {' or '.join(repr(n) for n in near)}?" if near else "there are none"
    return f"there is no {what} named {name!r}; {hint}"
