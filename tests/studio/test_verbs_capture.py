"""`lucarne capture` with a capturer of the test's own: what it is given, what is written, what is refused."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scenes import little_scene

from studio.bench.phone import Phone, shoot
from studio.bench.phone_files import write_shots
from studio.cli import BAD_INPUT, main
from studio.headless import Headless
from studio.verbs_script import open_project
from studio_core.capturing.artifacts import Calibration, Captured, CaptureState
from studio_core.capturing.keeping import recall
from studio_core.capturing.settings import (
    AUTOMATIC,
    DUAL,
    EQUIRECTANGULAR,
    SINGLE,
    TWO_PICTURES,
    CaptureSettings,
)
from studio_core.errors import InputError
from studio_core.imaging.environment import load_environment
from studio_core.imaging.photograph import Photograph
from studio_core.imaging.projection import Circle
from studio_core.project.lock import acquire
from studio_core.project.store import load, save
from studio_core.scene.capture import Capture
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Environment


class Photographer:
    """Gives one picture whatever the photographs show; remembers how it was asked."""

    label = "Photographer"

    def __init__(self) -> None:
        self.asked: list[tuple[Sequence[Photograph], CaptureSettings]] = []
        self.fails: Exception | None = None

    def open(self, services: Any) -> Photographer:
        return self

    def run(
        self, photographs: Sequence[Photograph], settings: CaptureSettings, job: Any, until: str = ""
    ) -> CaptureState:
        self.asked.append((photographs, settings))
        job.checkpoint(1, 2)
        if self.fails is not None:
            raise self.fails
        pixels = np.linspace(0.1, 4, 16 * 32 * 3, dtype=np.float32).reshape(16, 32, 3)
        unresolved = np.zeros((16, 32), np.uint8)
        unresolved[0, :8] = 3
        faces = np.arange(6, dtype=np.float32)[:, None, None, None] * np.ones((6, 8, 8, 3), np.float32)
        calibration = Calibration(luminance_scale=120.0)
        captured = Captured(Image(pixels), faces, unresolved, calibration, {"spread": 0.2}, ("A note.",))
        return CaptureState(captured=captured, notes=("Another note.",))


@pytest.fixture
def photographer(monkeypatch: pytest.MonkeyPatch) -> Photographer:
    made = Photographer()
    real = Headless.registry.func  # type: ignore[attr-defined]

    def registry(program: Headless) -> Any:
        host = real(program)
        return SimpleNamespace(
            get=lambda kind, name: made if kind == "capturer" else host.get(kind, name),
            names=host.names,
            brdf=host.brdf,
        )

    monkeypatch.setattr(Headless, "registry", property(registry))
    return made


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[str], list[str]]:
    """Front and back brackets of three."""
    folder = tmp_path_factory.mktemp("photographs")
    phone = Phone(size=(60, 48), circle=Circle(30, 24, 21), samples=1)
    room = np.random.default_rng(1).uniform(0.5, 1, (16, 32, 3)).astype(np.float32)
    front, back = write_shots(shoot(room, phone), folder)
    return [str(p) for p in front], [str(p) for p in back]


Files = tuple[list[str], list[str]]


def test_photographs_settings_and_results(
    photographer: Photographer, files: Files, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    front, back = files
    written = tmp_path / "settings.json"
    written.write_text('{"lens": {"fov": 200}, "stitch": {"width": 256}}')
    out, report, cube = tmp_path / "room.exr", tmp_path / "report.json", tmp_path / "cube"
    where = ["-o", str(out), "--report", str(report), "--cubemap", str(cube)]
    decided = ["--settings", str(written), "--set", "stitch.width=512", "--set", "lens.model=equisolid"]
    assert main(["capture", "--front", *front, "--back", *back, *decided, *where, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["notes"] == ["Another note.", "A note."]
    assert (said["width"], said["height"], said["photographs"]) == (32, 16, 6)
    assert said["unresolved"] == pytest.approx(8 / 512)
    ((photographs, settings),) = photographer.asked
    assert [p.facts.name for p in photographs] == [Path(p).name for p in front + back]
    assert [s.side for s in settings.bracket.shots] == ["front"] * 3 + ["back"] * 3
    assert [s.photograph for s in settings.bracket.shots] == [p.digest for p in photographs]
    assert settings.bracket.layout == TWO_PICTURES
    assert (settings.lens.fov, settings.lens.model, settings.stitch.width) == (200.0, "equisolid", 512)
    image, _ = load_environment(out)
    np.testing.assert_array_equal(image.pixels[0, 0], np.float32([0.1, 0.1 + 3.9 / 1535, 0.1 + 7.8 / 1535]))
    assert json.loads(report.read_text()) == {"spread": 0.2, "notes": ["Another note.", "A note."]}
    assert len(list(cube.iterdir())) == 6
    assert sorted(p.name for p in tmp_path.iterdir()) == ["cube", "report.json", "room.exr", "settings.json"]


def test_one_line_for_people(
    photographer: Photographer, files: Files, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "room.hdr"
    assert main(["capture", *files[0], "-o", str(out), "--quiet"]) == 0
    said = capsys.readouterr()
    assert said.out == f"{out}: 32 × 16 from 3 photographs, 1.6 % unresolved\n"
    assert said.err == "Another note.\nA note.\n"
    settings = photographer.asked[0][1]
    assert settings.bracket.shots == ()
    assert settings.bracket.layout == AUTOMATIC


@pytest.mark.parametrize(
    ("kind", "layout"),
    [("dual", DUAL), ("single", SINGLE), ("equirect", EQUIRECTANGULAR), ("front", AUTOMATIC)],
)
def test_other_layouts(
    kind: str, layout: str, photographer: Photographer, files: Files, tmp_path: Path
) -> None:
    assert main(["capture", f"--{kind}", *files[0], "-o", str(tmp_path / "room.exr")]) == 0
    assert photographer.asked[0][1].bracket.layout == layout


def test_typed_exposures_and_a_name_with_an_at(
    photographer: Photographer, files: Files, tmp_path: Path
) -> None:
    odd = tmp_path / "twice@2"
    odd.write_bytes(Path(files[0][1]).read_bytes())
    given = [f"{files[0][0]}@-2.5", str(odd)]
    assert main(["capture", "--front", *given, "-o", str(tmp_path / "room.exr")]) == 0
    photographs, settings = photographer.asked[0]
    assert [shot.ev for shot in settings.bracket.shots] == [-2.5, None]
    assert photographs[1].facts.name == "twice@2"


def test_what_cannot_be_read_is_a_warning(
    photographer: Photographer, files: Files, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = tmp_path / "broken.jpg"
    broken.write_bytes(b"no picture")
    given = [*files[0], files[0][0], str(broken)]
    assert main(["capture", "--front", *given, "-o", str(tmp_path / "room.exr"), "--json"]) == 0
    notes = json.loads(capsys.readouterr().out)["notes"]
    assert len(photographer.asked[0][0]) == 3
    assert "twice" in notes[0]
    assert "broken.jpg" in notes[1]


def test_a_project_gets_the_capture_and_its_light_as_one_step(
    photographer: Photographer, tmp_path: Path
) -> None:
    phone = Phone(size=(60, 48), circle=Circle(30, 24, 21), samples=1)
    room = np.ones((16, 32, 3), np.float32)
    front, _ = write_shots(shoot(room, phone), tmp_path, position=True)
    project = tmp_path / "flat.lucarne"
    given = ["capture", "--front", *map(str, front), "--set", "lens.fov=200", "--project", str(project)]
    assert main([*given, "--quiet"]) == 0
    loaded = load(project)
    (capture,), (light,) = loaded.scene.of(Capture), loaded.scene.of(Environment)
    assert light.image.pixels.shape == (16, 32, 3)
    assert light.luminance_scale == 120.0
    assert capture.environment == light.id
    assert capture.settings.lens.fov == 200.0
    assert [shot.side for shot in capture.settings.bracket.shots] == ["front"] * 3
    assert json.loads(capture.report) == {"spread": 0.2}
    for kept, shot in zip(capture.photographs, photographer.asked[0][0], strict=True):
        assert kept.path == ""
        again = recall(kept)
        np.testing.assert_array_equal(again.pixels, shot.pixels)
        assert again.digest == shot.digest
    assert b"GPS" not in b"".join(kept.data.pixels.tobytes() for kept in capture.photographs if kept.data)
    save(tmp_path / "room.lucarne", little_scene())
    before = load(tmp_path / "room.lucarne").scene
    assert main([*given[:-1], str(tmp_path / "room.lucarne"), "--quiet"]) == 0
    document, _ = open_project(tmp_path / "room.lucarne")
    assert len(list(document.scene.of(Capture))) == 1
    assert len(list(document.scene.of(Environment))) == 1
    assert document.history[document.position].label == "Capture the room's light"
    document.undo()
    assert sorted(document.scene.nodes) == sorted(before.nodes)
    assert not list(document.scene.of(Capture))


def test_a_project_that_is_open_is_left_alone(
    photographer: Photographer, files: Files, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    project = tmp_path / "room.lucarne"
    save(project, little_scene())
    before = project.read_bytes()
    with acquire(project):
        _refused(capsys, [*files[0], "--project", str(project)], "room.lucarne")
    assert photographer.asked == []
    assert project.read_bytes() == before


def _refused(capsys: pytest.CaptureFixture[str], arguments: list[str], *words: str) -> None:
    capsys.readouterr()
    assert main(["capture", *arguments]) == BAD_INPUT
    said = capsys.readouterr()
    (line,) = said.err.splitlines()
    assert said.out == ""
    for word in words:
        assert word in line


def test_bad_input_is_one_line(
    photographer: Photographer, files: Files, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    front, back = files
    out = ["-o", str(tmp_path / "room.exr")]
    (tmp_path / "s.json").write_text('{"lense": {}}')
    (tmp_path / "b.json").write_bytes(b"\xff\xfe")
    (tmp_path / "broken.jpg").write_bytes(b"no picture")
    (tmp_path / "other.lucarne").write_bytes(b"no project")
    _refused(capsys, [*out], "no photographs")
    _refused(capsys, front, "nothing to write")
    _refused(capsys, [*front, "-o", str(tmp_path / "room.png")], "room.png", ".exr")
    _refused(capsys, [*front, "-o", str(tmp_path / "no" / "room.exr")], "no folder")
    _refused(capsys, [*front, *out, "--cubemap", out[1]], "room.exr")
    _refused(capsys, [*front, *out, "--cubemap", front[0]], "six faces")
    _refused(capsys, [*front, *out, "--cubemap", front[0], "--cube-layout", "strip"], ".jpg", ".exr")
    _refused(capsys, [*front, *out, "--project", str(tmp_path / "other.lucarne")], "other.lucarne")
    _refused(capsys, [*front, "--back", *back, *out], "--front and --back")
    _refused(capsys, ["--back", *back, *out], "--single")
    _refused(capsys, ["--front", *front, "--dual", *back, *out], "--front and --back")
    _refused(capsys, ["--front", *front, "--back", front[0], *out], "front_1.jpg", "back view")
    _refused(capsys, [*front, *out, "--settings", str(tmp_path / "s.json")], "s.json", "lense")
    _refused(capsys, [*front, *out, "--settings", str(tmp_path / "b.json")], "b.json", "UTF-8")
    _refused(capsys, [*front, *out, "--settings", str(tmp_path / "none.json")], "none.json", "no such file")
    _refused(capsys, [*front, *out, "--set", "lens.fov=3"], "--set", "lens.fov", "100 to 280")
    _refused(capsys, [str(tmp_path / "broken.jpg"), *out], "broken.jpg")
    _refused(
        capsys, [str(tmp_path / "broken.jpg"), str(tmp_path / "gone.jpg"), *out], "no photograph can be used"
    )
    _refused(capsys, ["--front", f"{front[0]}@999", *out], "@999", "64 EV")
    assert photographer.asked == []
    assert not (tmp_path / "room.exr").exists()


def test_nothing_is_written_when_it_fails_or_is_stopped(
    photographer: Photographer, files: Files, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "room.exr"
    photographer.fails = InputError("the photographs are all black")
    assert main(["capture", *files[0], "-o", str(out)]) == BAD_INPUT

    def stopped(photographs: Any, settings: Any, job: Any) -> Any:
        job.cancel()
        job.checkpoint()

    monkeypatch.setattr(photographer, "run", stopped)
    assert main(["capture", *files[0], "-o", str(out), "--report", str(tmp_path / "r.json")]) == 130
    assert list(tmp_path.iterdir()) == []


def test_settings_of_a_file_hold_for_the_photographs_it_names(
    photographer: Photographer, files: Files, tmp_path: Path
) -> None:
    assert main(["capture", "--front", *files[0], "-o", str(tmp_path / "room.exr")]) == 0
    shots = photographer.asked[0][1].bracket.shots
    named = {"photograph": shots[1].photograph, "ev": 0.25, "used": False}
    gone = {"photograph": "00" * 16, "ev": 1.0}
    (tmp_path / "s.json").write_text(json.dumps({"bracket": {"shots": [gone, named]}}))
    again = ["capture", "--front", *files[0], "--settings", str(tmp_path / "s.json")]
    assert main([*again, "-o", str(tmp_path / "room.exr")]) == 0
    assert photographer.asked[1][1].bracket.shots == (
        shots[0],
        replace(shots[1], ev=0.25, used=False),
        shots[2],
    )
