"""What the command palette finds in the scene: its things, to choose them; its materials, to assign them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import islice

from studio_core.scene.nodes import MaterialId, NodeId
from studio_ui.context import Context
from studio_ui.objects.choosing import meshes_below
from studio_ui.objects.material_drag import assigned
from studio_ui.palette.palette import Entry
from studio_ui.panels.node_kinds import LISTED_APART, kind_name

_MOST = 300
"""Of things and of materials each: in scenes of more, the outliner finds what is looked for."""
_AFTER = -6.0
"""Commands come first where both fit."""


def scene_entries(context: Context) -> Iterator[Entry]:
    """Things from the top of the scene down, then materials."""
    scene, session = context.document.scene, context.session
    things = (node for node in scene.nodes.values() if not isinstance(node, LISTED_APART))
    for node in islice(things, _MOST):
        run = partial(session.select, [node.id])
        place = f"Choose ▸ {kind_name(node)}"
        yield Entry(f"choose.{node.id}", node.name, place, run, rank=_AFTER, kept=False)
    chosen = tuple(n for n in session.selection if n in scene.nodes)
    reason = "" if meshes_below(scene, chosen) else "No object is chosen"
    for material in islice(scene.materials.values(), _MOST):
        run = partial(_assign, context, chosen, material.id)
        name, place = f"assign.{material.id}", "Assign material"
        yield Entry(name, material.name, place, run, reason=reason, rank=_AFTER, kept=False)


def _assign(context: Context, nodes: tuple[NodeId, ...], material: MaterialId) -> None:
    edit = assigned(context.document.scene, nodes, material, None)
    if edit is not None:
        context.editing.apply(edit)
