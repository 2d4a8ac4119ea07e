"""What a click or a band in the picture means: topmost groups, or parts of the group that was entered."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from studio_core.scene.arranging import is_locked
from studio_core.scene.nodes import NodeId, Scene

Counts = Mapping[NodeId, tuple[int, int]]
"""By node: pixels inside a rectangle, and all its pixels in the picture."""


def owner(scene: Scene, node: NodeId, entered: NodeId | None) -> NodeId:
    """The topmost group that holds a node; inside an entered group the part of it that holds the node."""
    chain = [node, *(above.id for above in scene.ancestors(node))]
    if entered in chain:
        index = chain.index(entered)
        return chain[index - 1] if index > 0 else node
    return chain[-1]


def is_held(scene: Scene, picked: NodeId, selection: tuple[NodeId, ...]) -> bool:
    """Whether what was picked is, or hangs under, or holds something chosen."""
    chain = {picked, *(above.id for above in scene.ancestors(picked))}
    if chain & set(selection):
        return True
    return any(picked in {a.id for a in scene.ancestors(n)} for n in selection if n in scene.nodes)


def caught(scene: Scene, counts: Counts, entered: NodeId | None, *, whole: bool) -> tuple[NodeId, ...]:
    """What a band catches: what it touches, or with `whole` only what is seen entirely inside.

    What is locked is never caught; with an entered group only parts of that.
    """
    inside: dict[NodeId, int] = {}
    seen: dict[NodeId, int] = {}
    for node, (pixels, of) in counts.items():
        if node not in scene.nodes or is_locked(scene, node):
            continue
        if entered is not None and entered not in {above.id for above in scene.ancestors(node)}:
            continue
        top = owner(scene, node, entered)
        inside[top] = inside.get(top, 0) + pixels
        seen[top] = seen.get(top, 0) + of
    found = {node for node, pixels in inside.items() if pixels and (not whole or pixels == seen[node])}
    return tuple(node for node in scene.nodes if node in found)


def joined(selection: Iterable[NodeId], more: Iterable[NodeId]) -> tuple[NodeId, ...]:
    """Both, without doubles."""
    return tuple(dict.fromkeys((*selection, *more)))
