"""A capture in the document: added, changed, lighting the scene, undone, saved and opened again."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from scenes import little_scene

from studio_core.capturing.artifacts import Calibration, Captured
from studio_core.capturing.edits import add_capture, capture_of, set_photographs, set_settings, use_capture
from studio_core.capturing.report import plain
from studio_core.capturing.settings import CaptureSettings, LensSettings, Patch, ReflectionSettings, Shot
from studio_core.document import Document
from studio_core.edits import Remove, SetFields
from studio_core.errors import EditError
from studio_core.imaging.photograph import ShotFacts
from studio_core.imaging.projection import Circle
from studio_core.project.codec import scene_digest
from studio_core.project.store import load, save
from studio_core.scene.arranging import roots
from studio_core.scene.capture import Capture, KeptPhotograph
from studio_core.scene.diff import Aspect, diff
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Environment, Scene


def _photograph(name: str) -> KeptPhotograph:
    bytes_ = np.frombuffer(name.encode() * 9, np.uint8).reshape(1, -1, 1)
    small = Image(np.full((4, 6, 3), 90, np.uint8), "srgb")
    facts = ShotFacts(name, seconds=1 / 30, iso=100.0, taken=12.5)
    return KeptPhotograph(name, facts, (4000, 3000), small, f"photos/{name}", Image(bytes_, "data"))


def _captured(value: float = 2.0, scale: float | None = 120.0) -> Captured:
    return Captured(
        Image(np.full((8, 16, 3), value, np.float32)),
        np.full((6, 4, 4, 3), value, np.float32),
        np.zeros((8, 16), np.uint8),
        Calibration(luminance_scale=scale),
        {"steps": np.array([1.0, float("nan")]), "wrong": (np.int64(3),)},
    )


def _with_capture(scene: Scene) -> tuple[Document, str]:
    document = Document(scene)
    document.apply(add_capture((_photograph("a.jpg"), _photograph("b.jpg")), name="Kitchen"))
    return document, next(node.id for node in document.scene.of(Capture))


def test_a_capture_lights_the_scene_in_one_step_and_nothing_before() -> None:
    document, capture = _with_capture(little_scene())
    environment = next(document.scene.of(Environment))
    document.apply(SetFields(environment.id, {"azimuth": 30.0}))
    document.apply(use_capture(document.scene, capture, _captured()))
    lit = document.scene[environment.id]
    assert isinstance(lit, Environment)
    assert (lit.image.pixels == 2).all()
    assert (lit.luminance_scale, lit.azimuth, lit.name) == (120.0, 30.0, "Kitchen")
    kept = capture_of(document.scene, capture)
    assert kept.environment == environment.id
    assert kept.cube is not None
    assert kept.cube.pixels.shape == (24, 4, 3)
    assert json.loads(kept.report) == {"steps": [1.0, None], "wrong": [3]}
    document.undo()
    assert document.scene[environment.id].image is environment.image  # type: ignore[attr-defined]
    assert capture_of(document.scene, capture).cube is None


def test_adding_and_changing_a_capture_lights_nothing_anew() -> None:
    scene = little_scene()
    document, capture = _with_capture(scene)
    assert diff(scene, document.scene).aspects == Aspect.NAME
    before = document.scene
    document.apply(set_settings(capture, CaptureSettings(lens=LensSettings(fov=183.0))))
    assert diff(before, document.scene).aspects == Aspect.NAME
    assert diff(document.scene, scene).aspects == Aspect.NAME, "nor does taking it away"


def test_a_scene_without_light_gets_an_environment_and_the_same_one_again() -> None:
    document, capture = _with_capture(Scene())
    document.apply(use_capture(document.scene, capture, _captured(1.0)))
    document.apply(use_capture(document.scene, capture, _captured(3.0)))
    (environment,) = document.scene.of(Environment)
    assert (environment.image.pixels == 3).all()
    document.apply(Remove((environment.id,)))
    document.apply(use_capture(document.scene, capture, _captured(4.0)))
    (environment,) = document.scene.of(Environment)
    assert capture_of(document.scene, capture).environment == environment.id


def test_other_photographs_keep_what_was_decided_about_those_that_stay() -> None:
    document, capture = _with_capture(Scene())
    shots = (Shot("a.jpg", "front", 1.0), Shot("b.jpg", "back", used=False))
    settings = CaptureSettings()
    bracket = dataclasses.replace(settings.bracket, shots=shots)
    document.apply(set_settings(capture, dataclasses.replace(settings, bracket=bracket)))
    document.apply(set_photographs(document.scene, capture, (_photograph("b.jpg"), _photograph("c.jpg"))))
    made = capture_of(document.scene, capture)
    assert made.settings.bracket.shots == (shots[1],)
    assert [kept.digest for kept in made.photographs] == ["b.jpg", "c.jpg"]


def test_a_capture_survives_saving(tmp_path: Path) -> None:
    document, capture = _with_capture(little_scene())
    patch = Patch("back", 350.0, 25.0, 84.0, 95.0, found=True, excess=1.2)
    settings = CaptureSettings(
        lens=LensSettings(back=Circle(310.5, 290.0, 280.25)),
        reflections=ReflectionSettings(patches=(patch,)),
    )
    document.apply(set_settings(capture, settings))
    document.apply(use_capture(document.scene, capture, _captured()))
    path = tmp_path / "kitchen.lucarne"
    save(path, document.scene)
    opened = load(path).scene
    assert scene_digest(opened) == scene_digest(document.scene)
    made = capture_of(opened, capture)
    assert made.settings == settings
    data = made.photographs[0].data
    assert data is not None
    assert data.pixels.tobytes() == b"a.jpg" * 9


def test_a_capture_stands_nowhere() -> None:
    document, capture = _with_capture(little_scene())
    assert roots(document.scene, (capture,)) == ()
    assert roots(document.scene, tuple(document.scene.nodes)) == roots(
        document.scene, tuple(little_scene().nodes)
    )


def test_what_is_no_capture_is_refused() -> None:
    scene = little_scene()
    with pytest.raises(EditError, match="no capture"):
        use_capture(scene, next(scene.of(Environment)).id, _captured())


def test_a_report_holds_plain_values_alone() -> None:
    with pytest.raises(TypeError, match="Path"):
        plain({"where": Path("x")})
