"""New lamps: where they hang in the scene, and with which light."""

from __future__ import annotations

from collections.abc import Callable

from studio_core.scene.nodes import AreaLamp, DirectionalLamp, Light, NodeId, PointLamp, Scene, SpotLamp
from studio_core.scene.transform import Transform, looking, vec3
from studio_ui.canvas.projection import bounds

_SUN_FROM = (0.5, 0.8, 0.4)


def _above(scene: Scene) -> tuple[tuple[float, float, float], float]:
    """The middle of the scene's floor, and a height for a lamp."""
    found = bounds(scene)
    if found is None:
        return (0.0, 0.0, 0.0), 2.2
    low, high = found
    middle = (low + high) / 2
    return vec3((middle[0], low[1], middle[2])), float(min(max(high[1] - 0.3, low[1] + 1.8), low[1] + 2.4))


def _down(scene: Scene) -> Transform:
    foot, height = _above(scene)
    return looking((foot[0], height, foot[2]), foot, (0, 0, -1))


def _point(node: NodeId, name: str, scene: Scene) -> Light:
    return PointLamp(id=node, name=name, transform=_down(scene), intensity=2.0, temperature=2700.0)


def _spot(node: NodeId, name: str, scene: Scene) -> Light:
    return SpotLamp(id=node, name=name, transform=_down(scene), intensity=5.0, temperature=2700.0)


def _area(node: NodeId, name: str, scene: Scene) -> Light:
    place = _down(scene)
    return AreaLamp(
        id=node, name=name, transform=place, intensity=8.0, temperature=4000.0, width=0.6, height=0.6
    )


def _sun(node: NodeId, name: str, scene: Scene) -> Light:
    foot, _ = _above(scene)
    place = looking([f + 3 * d for f, d in zip(foot, _SUN_FROM, strict=True)], foot)
    return DirectionalLamp(id=node, name=name, transform=place, intensity=3.0, temperature=5500.0)


LAMPS: dict[str, Callable[[NodeId, str, Scene], Light]] = {
    "Point lamp": _point,
    "Spot lamp": _spot,
    "Area lamp": _area,
    "Sun": _sun,
}
