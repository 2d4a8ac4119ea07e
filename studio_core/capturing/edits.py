"""The edits that bring a capture into a scene, change it, and light the scene with it."""

from __future__ import annotations

import dataclasses

import numpy as np

from studio_core.capturing.artifacts import Captured
from studio_core.capturing.report import report_text
from studio_core.capturing.settings import CaptureSettings
from studio_core.edits import Add, Compound, Edit, SetFields
from studio_core.errors import EditError
from studio_core.scene.capture import Capture, KeptPhotograph
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Environment, NodeId, Scene, new_id
from studio_core.shading.lamps import shown_environment

_USE = "Light the scene with the capture"


def capture_of(scene: Scene, node: NodeId) -> Capture:
    """The capture of that id; EditError when it is none."""
    found = scene[node]
    if not isinstance(found, Capture):
        raise EditError(f"{found.name!r} is no capture")
    return found


def add_capture(
    photographs: tuple[KeptPhotograph, ...],
    settings: CaptureSettings | None = None,
    name: str = "Capture",
) -> Add:
    """A new capture of these photographs; nothing is lit by it yet."""
    node = Capture(
        id=new_id("capture"), name=name, photographs=photographs, settings=settings or CaptureSettings()
    )
    return Add((node,), label="Add capture")


def set_photographs(scene: Scene, node: NodeId, photographs: tuple[KeptPhotograph, ...]) -> Edit:
    """Other photographs; what was decided about those that stay is kept."""
    capture = capture_of(scene, node)
    there = {kept.digest for kept in photographs}
    bracket = capture.settings.bracket
    shots = tuple(shot for shot in bracket.shots if shot.photograph in there)
    settings = dataclasses.replace(capture.settings, bracket=dataclasses.replace(bracket, shots=shots))
    return SetFields(node, {"photographs": photographs, "settings": settings}, "Change the photographs")


def set_settings(node: NodeId, settings: CaptureSettings, label: str = "Change the capture") -> Edit:
    """Decide something about a capture."""
    return SetFields(node, {"settings": settings}, label)


def use_capture(scene: Scene, node: NodeId, captured: Captured) -> Edit:
    """Light the scene with what a capture became: one step.

    The environment that the capture lit before, or else the one that lights the scene, gets the picture and
    keeps its rotation, gain and ground; where there is none, one is added. The capture keeps cube map and
    report.
    """
    capture = capture_of(scene, node)
    chosen = scene.nodes.get(capture.environment) if capture.environment is not None else None
    if not isinstance(chosen, Environment):
        chosen = shown_environment(scene)
    scale = captured.calibration.luminance_scale
    edits: list[Edit] = []
    if chosen is None:
        chosen = Environment(
            id=new_id("environment"),
            name=capture.name,
            image=captured.environment,
            luminance_scale=scale,
        )
        edits.append(Add((chosen,)))
    else:
        light = {"image": captured.environment, "luminance_scale": scale, "name": capture.name}
        edits.append(SetFields(chosen.id, light))
    faces = captured.faces
    kept = {
        "environment": chosen.id,
        "cube": Image(np.ascontiguousarray(faces.reshape(-1, faces.shape[2], faces.shape[3]))),
        "report": report_text(captured.report),
    }
    edits.append(SetFields(node, kept))
    return Compound(_USE, tuple(edits))
