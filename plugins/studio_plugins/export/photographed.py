"""What belongs to a photographed room and has no counterpart in other programs' files."""

from __future__ import annotations

from studio_core.scene.bounds import only_catches
from studio_core.scene.nodes import FAR_AWAY, Environment, Group, MeshObject, Scene


def without_catchers(scene: Scene) -> tuple[Scene, list[str]]:
    """The scene with groups in place of what only catches shadows, and in sentences what is lost."""
    notes, left = [], []
    for node in scene.of(MeshObject):
        if not scene.shown(node.id):
            continue
        if only_catches(scene, node):
            left.append(Group(id=node.id, name=node.name, parent=node.parent, transform=node.transform))
            notes.append(f"{node.name} only catches shadows; it was left out.")
        elif any(scene.material(material).catches for material in node.materials):
            notes.append(f"{node.name} catches shadows in places; these are ordinary surfaces in the file.")
    return scene.with_nodes(*left), notes


def background_notes(scene: Scene) -> list[str]:
    """What a background lacks where the environment is seen as it lights the scene, far away."""
    notes = []
    for environment in scene.of(Environment):
        if scene.shown(environment.id) and environment.background:
            if environment.projection != FAR_AWAY:
                notes.append(f"{environment.name}: its picture is far away in the file, not on the ground.")
            if environment.background_azimuth % 360:
                notes.append(f"{environment.name}: its background is turned as its light is in the file.")
    return notes
