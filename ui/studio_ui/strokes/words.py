"""What strokes, findings and steps of the history are called."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from studio_core.scene.nodes import MeshObject, NodeId, Scene
from studio_core.strokes.solution import Finding, Reason
from studio_core.strokes.stroke import (
    BLUR,
    BRIGHTEN,
    CLONE,
    DARKEN,
    FIXATE,
    REPLACE,
    SHARPEN,
    SMEAR,
    Stroke,
)

TOOLS: Mapping[str, tuple[str, str, str, str]] = {
    REPLACE: ("Colour", "Colour", "Paint colour on", "This colour, from here on"),
    BRIGHTEN: ("Brighten", "Light", "Brighten", "More light here"),
    DARKEN: ("Darken", "Shade", "Darken", "Less light here"),
    BLUR: ("Blur", "Blur", "Blur", "Softer, within each surface"),
    SHARPEN: ("Sharpen", "Sharpness", "Sharpen", "Crisper, within each surface"),
    CLONE: ("Clone", "Clone", "Clone onto", "What is seen elsewhere: Ctrl+click says where"),
    SMEAR: ("Smear", "Smear", "Smear", "Drag colour along, as a finger does"),
    FIXATE: ("Keep", "Kept place", "Keep", "What is here stays, whatever other strokes ask for"),
}
"""By tool: on its button, in names of strokes, in the history, and what it does."""
SEPARATOR = " · "
_NOTHING = "nothing needs to change"
_MOST = 3  # parameters that are told


def painted_on(scene: Scene, objects: Iterable[NodeId]) -> str:
    """`Chair`, `3 things`: what strokes lie on, as a whole."""
    tops = {}
    for node in objects:
        if node in scene.nodes:
            line = [scene[node], *scene.ancestors(node)]
            loose = [one for one in line if not one.locked] or line[:1]  # of a room that is fixed, its part
            tops[loose[-1].id] = loose[-1].name
    if len(tops) == 1:
        return next(iter(tops.values()))
    return f"{len(tops)} things" if tops else "nothing"


def place(scene: Scene, node: NodeId, slot: int = 0) -> str:
    """`Chair · Seat`, with the material where there are several."""
    if node not in scene.nodes:
        return "What is gone"
    thing = scene[node]
    above = list(scene.ancestors(node))
    parts = [above[-1].name] if above else []
    parts.append(thing.name)
    if isinstance(thing, MeshObject) and len(thing.materials) > 1 and slot < len(thing.materials):
        parts.append(scene.material(thing.materials[slot]).name)
    return SEPARATOR.join(parts)


def explained(reason: Reason) -> str:
    """`explains 93 % of the stroke`."""
    share = min(max(reason.explained, 0.0), 1.0)
    return f"explains {100 * share:.0f} % of the stroke"


def number(value: object) -> str:
    """Of a parameter."""
    if isinstance(value, tuple):
        return " ".join(f"{float(part):.2f}" for part in value)
    return f"{float(value):.3g}" if isinstance(value, int | float) else str(value)


def changed(
    before: Mapping[str, object],
    labels: Mapping[str, str],
    reason: Reason,
    shown: Callable[[object], str] = number,
) -> str:
    """`shine 0.04 → 0.35`: what differs from the values before, the largest change first."""
    told = []
    for name, value in reason.values.items():
        old = before.get(name)
        if old is None or _apart(old, value) > 2e-3:
            was = "" if old is None else f"{shown(old)} → "
            far = 1e9 if old is None else _apart(old, value)
            told.append((far, f"{labels.get(name, name).lower()} {was}{shown(value)}"))
    told.sort(key=lambda one: -one[0])
    return ", ".join(text for _, text in told[:_MOST])


def sentence(where: str, reason: Reason, change: str) -> str:
    """`Chair · Seat: shine 0.04 → 0.35, explains 93 % of the stroke`."""
    if not reason.meaning:
        return f"{where}: {_NOTHING}"
    return f"{where}: {change or reason.meaning}, {explained(reason)}"


def nothing_found(stroke: Stroke) -> str:
    """Where a stroke has no explanation at all."""
    if stroke.tool == FIXATE:
        return "What is here stays, as far as other strokes allow."
    if stroke.indirect:
        return (
            "Nothing that lights this place, or shows in it, can make it look so. A colour nearer to what "
            "is seen there may do, or the surface itself."
        )
    return "Nothing was found to change."


def silence(finding: Finding) -> str:
    """What cannot be told from where was painted; empty where all can."""
    if not finding.silent:
        return ""
    *first, last = finding.silent
    names = f"{', '.join(first)} and {last}" if first else last
    return f"Cannot tell from here: {names}"


def _apart(one: object, other: object) -> float:
    a, b = (one if isinstance(one, tuple) else (one,)), (other if isinstance(other, tuple) else (other,))
    if len(a) != len(b):
        return 1e9
    return max(abs(float(x) - float(y)) for x, y in zip(a, b, strict=True))


__all__ = [
    "SEPARATOR", "TOOLS", "changed", "explained", "nothing_found", "number", "painted_on", "place",
    "sentence", "silence",
]  # fmt: skip
