"""How values and help look in a console: short, in a designer's words where they are the scene's own."""

from __future__ import annotations

import inspect
import reprlib
from collections.abc import Mapping, Sequence
from typing import Any

from studio_core.scene.nodes import Camera, Group, Light, Material, MeshObject, Node, Scene

LONGEST = 4_000  # characters of one value
_MANY = 200  # entries of a collection
_LINES = 60  # of a scene's tree


def shown(value: Any) -> str:
    """One value as text; what is long is cut and says so."""
    match value:
        case Scene():
            text = _scene(value)
        case Node():
            text = _node(value)
        case Material():
            text = f"Material {value.name!r} ({value.model}) {_values(value.values)}".rstrip()
        case list() | tuple() if value and all(isinstance(one, Node | Material) for one in value):
            lines = [shown(one) for one in value[:_MANY]]
            text = "\n".join([*lines, *([f"… and {len(value) - _MANY} more"] if len(value) > _MANY else [])])
        case list() | tuple() | set() | frozenset() | dict() | str() | bytes() if len(value) > _MANY:
            text = _long(value)
        case _:
            text = repr(value)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}… ({len(text):,} characters in all)"


def _scene(scene: Scene) -> str:
    lines = [f"{len(scene.nodes)} nodes, {len(scene.materials)} materials"]

    def add(parent: str | None, depth: int) -> None:
        for node in scene.children(parent):
            lines.append(f"{'  ' * depth}{node.name}  ({_kind(node)}{', hidden' if node.hidden else ''})")
            add(node.id, depth + 1)

    add(None, 0)
    more = len(lines) - _LINES
    return "\n".join(lines[:_LINES] + ([f"… and {more} more"] if more > 0 else []))


def _kind(node: Node) -> str:
    return "mesh" if isinstance(node, MeshObject) else type(node).__name__.lower()


def _node(node: Node) -> str:
    said = [f"{type(node).__name__} {node.name!r}"]
    if any(node.transform.translation):
        said.append("at ({:.3g}, {:.3g}, {:.3g})".format(*node.transform.translation))
    if isinstance(node, MeshObject):
        said.append(f"{len(node.geometry.faces):,} faces")
    if isinstance(node, Light):
        said.append(f"intensity {node.intensity:.4g}")
    if isinstance(node, Camera):
        said.append(f"{node.fov:.3g}° field of view")
    if isinstance(node, Group) and node.parent is not None:
        said.append("in a group")
    said += [word for word, holds in (("hidden", node.hidden), ("locked", node.locked)) if holds]
    return ", ".join(said)


def _values(values: Mapping[str, Any]) -> str:
    def one(value: Any) -> str:
        if isinstance(value, tuple):
            return "(" + ", ".join(f"{part:.3g}" for part in value) + ")"
        return f"{value:.4g}" if isinstance(value, float) else repr(value)

    return ", ".join(f"{name} {one(value)}" for name, value in values.items())


def _long(value: Any) -> str:
    shortener = reprlib.Repr()
    shortener.maxlist = shortener.maxtuple = shortener.maxset = shortener.maxfrozenset = _MANY
    shortener.maxdict, shortener.maxstring, shortener.maxother = _MANY, LONGEST, LONGEST
    return f"{shortener.repr(value)}  ({len(value):,} long)"


def signature(thing: Any) -> str:
    """`(name, by=None)`, or nothing where Python cannot tell."""
    if not callable(thing):
        return ""
    try:
        found = inspect.signature(thing)
    except (ValueError, TypeError):
        return ""
    empty = inspect.Parameter.empty
    plain = [
        parameter.replace(annotation=empty, default=_Named(parameter.default.__name__))
        if isinstance(parameter.default, type) and parameter.default is not empty
        else parameter.replace(annotation=empty)
        for parameter in found.parameters.values()
    ]
    return str(found.replace(parameters=plain, return_annotation=inspect.Signature.empty))


class _Named(str):
    """A default that is shown as its bare name."""

    def __repr__(self) -> str:
        return str(self)


def summary(thing: Any) -> str:
    """The first line of what is written about it, for things that have a text of their own."""
    own = inspect.getdoc(thing) if callable(thing) or inspect.ismodule(thing) else None
    return own.splitlines()[0] if own else ""


def help_text(thing: Any, name: str = "") -> str:
    """Signature and text of one thing."""
    title = name or getattr(thing, "__name__", "") or type(thing).__name__
    text = inspect.getdoc(thing) or "Nothing is written about it."
    parts = [f"{title}{signature(thing)}", text]
    if inspect.isclass(thing) or inspect.ismodule(thing):
        public = [n for n in vars(thing) if not n.startswith("_") and callable(getattr(thing, n, None))]
        if public and not inspect.isclass(thing):
            parts.append("It has " + ", ".join(sorted(public)[:_MANY]) + ".")
    return "\n".join(parts)


def overview(groups: Mapping[str, Sequence[str]], names: Mapping[str, Any]) -> str:
    """All names with their first lines, by group."""
    lines = []
    for group, members in groups.items():
        lines += ["", group]
        lines += [f"  {name:<18}{_said(name, names)}".rstrip() for name in members]
    return "\n".join([*lines[1:], "", _MORE])


_MORE = (
    "help(find) tells more of one of them. Every kind of node and edit has its own name too: Camera, Move, …"
)
_OTHERS = {
    "document": "The project: its scene, history, undo",
    "scene": "The scene as it is now",
    "session": "What is looked at and chosen, and how it is computed",
    "edits": "Every way a scene can be changed",
    "nodes": "What a scene is made of",
    "np": "NumPy",
    "Path": "Names of files",
}


def _said(name: str, names: Mapping[str, Any]) -> str:
    return _OTHERS.get(name) or summary(names[name])
