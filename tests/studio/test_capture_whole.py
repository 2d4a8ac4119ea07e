"""`lucarne capture` with the real pipeline, on files of a simulated phone: good brackets and odd ones."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from studio.bench.capture_measure import irradiance_error
from studio.bench.phone import Arc, Phone, Shots, shoot
from studio.bench.phone_files import as_dual, write_photograph, write_shots
from studio.bench.phone_response import Curve
from studio.cli import BAD_INPUT, main
from studio_core.capturing.standing import HALF_TURN
from studio_core.imaging.encode import write_exr
from studio_core.imaging.environment import load_environment
from studio_core.imaging.photograph import Photograph, ShotFacts
from studio_core.imaging.projection import Circle

PHONE = Phone(
    size=(400, 300),
    circle=Circle(203, 148, 138),
    evs=(-2, 0, 2),
    curve=Curve("filmic", 2.2, 0.5),
    jpeg=95,
    misalignment=(1.2, -0.9, 1.5),
    falloff=0.15,
    parallax=0.5,
    shake=0.1,
)


def _room(height: int = 192) -> np.ndarray:
    """Walls, pictures on them and windows, within the range of three exposures."""
    import cv2

    rng = np.random.default_rng(5)
    width = 2 * height
    tone = np.zeros((height, width))
    for size in (6, 12, 24, 48, 96):
        grain = rng.normal(size=(size, 2 * size))
        tone += 0.3 * cv2.resize(
            np.hstack([grain, grain[:, :1]]), (width, height), interpolation=cv2.INTER_LINEAR
        )
    for _ in range(60):
        y, x = rng.integers(0, height), rng.integers(0, width)
        rows, columns = rng.integers(5, height // 5), rng.integers(5, width // 10)
        tone[y : y + rows, (x + np.arange(columns)) % width] += rng.normal(0, 0.7)
    light = 2.0 ** np.clip(tone, -3, 2.5)[..., None] * (1.0, 0.9, 0.75)
    return light.astype(np.float32)


@dataclass
class Taken:
    """A bracket as files."""

    shots: Shots
    front: list[str]
    back: list[str]


@pytest.fixture(scope="module")
def taken(tmp_path_factory: pytest.TempPathFactory) -> Taken:
    shots = shoot(_room(), PHONE, 3)
    front, back = write_shots(shots, tmp_path_factory.mktemp("photographs"), position=True)
    return Taken(shots, [str(p) for p in front], [str(p) for p in back])


def _capture(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], *arguments: str
) -> tuple[np.ndarray, dict[str, Any]]:
    """The environment and what was told; everything is finite."""
    out = tmp_path / "room.exr"
    capsys.readouterr()
    status = main(["capture", "--set", "stitch.width=256", *arguments, "-o", str(out), "--json", "--quiet"])
    said = capsys.readouterr()
    assert status == 0, said.err
    image, _ = load_environment(out)
    assert np.isfinite(image.pixels).all()
    assert (image.pixels >= 0).all()
    assert image.pixels.any()
    return image.pixels, json.loads(said.out)


def _error(made: np.ndarray, shots: Shots) -> float:
    turned = HALF_TURN @ shots.truth.room_from_front.T
    return irradiance_error(made, _room(), turned)


def test_the_light_that_comes_out_is_the_rooms(
    taken: Taken, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cube = tmp_path / "cube"
    made, told = _capture(
        tmp_path,
        capsys,
        *("--front", *taken.front, "--back", *taken.back, "--set", "stitch.level=no"),
        *("--cubemap", str(cube), "--report", str(tmp_path / "r.json")),
    )
    assert _error(made, taken.shots) < 0.03
    assert told["unresolved"] < 0.1
    report = json.loads((tmp_path / "r.json").read_text())
    assert report
    faces, _ = load_environment(cube)
    assert abs(faces.pixels.mean() / made.mean() - 1) < 0.05
    for path in (tmp_path / "room.exr", tmp_path / "r.json", cube / "px.exr"):
        assert b"GPS" not in path.read_bytes()


def test_which_photograph_is_which_is_found_out(
    taken: Taken, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    heap = [*taken.back[::-1], *taken.front[::-1]]
    made, _ = _capture(tmp_path, capsys, *heap, "--set", "stitch.level=no")
    assert _error(made, taken.shots) < 0.03


def test_two_circles_in_one_turned_picture(
    taken: Taken, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    dual, _, _ = as_dual(taken.shots, (1, 3))
    files = []
    for shot in dual:
        files.append(str(tmp_path / shot.facts.name))
        write_photograph(shot, Path(files[-1]))
    made, told = _capture(tmp_path, capsys, "--dual", *files)
    assert told["unresolved"] < 0.1
    assert made.std() > 0.1


def _equirectangular(phone: Phone) -> list[Photograph]:
    room, made = _room(), []
    rng = np.random.default_rng(1)
    for index, ev in enumerate(phone.evs):
        numbers = [phone.curve.encode(room[:, :, c] * 0.2 * 2.0**ev, c) for c in range(3)]
        pixels = np.rint(255 * np.stack(numbers, 2) + rng.normal(0, 0.5, room.shape)).clip(0, 255)
        facts = ShotFacts(f"all_{index}.png", seconds=2.0**ev / 60, iso=100.0, taken=float(index))
        made.append(Photograph(pixels.astype(np.uint8), facts, str(index)))
    return made


def test_an_equirectangular_bracket(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = []
    for shot in _equirectangular(PHONE):
        files.append(str(tmp_path / shot.facts.name))
        write_photograph(shot, Path(files[-1]))
    made, _ = _capture(tmp_path, capsys, "--equirect", *files, "--set", "stitch.level=no")
    assert irradiance_error(made, _room(), np.eye(3)) < 0.03


def test_an_environment_stays_what_it_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    room = _room(64) * np.geomspace(1e-3, 1e3, 128, dtype=np.float32)[None, :, None]
    write_exr(tmp_path / "all.exr", room)
    given = ["--equirect", str(tmp_path / "all.exr"), "--set", "stitch.level=no", "--set", "stitch.width=128"]
    made, _ = _capture(tmp_path, capsys, *given)
    np.testing.assert_allclose(made / made.mean(), room / room.mean(), rtol=1e-4)


def test_odd_brackets_give_a_result_and_say_what_was_wrong(
    taken: Taken, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = tmp_path / "broken.jpg"
    broken.write_bytes(Path(taken.front[0]).read_bytes()[:3000])
    shot, cropped = taken.shots.front[1], tmp_path / "cropped.jpg"
    facts = replace(shot.facts, name="cropped.jpg")
    write_photograph(Photograph(shot.pixels[::2, ::2].copy(), facts, "0"), cropped)
    front = [*taken.front, str(broken), str(cropped)]
    _, told = _capture(tmp_path, capsys, "--front", *front, "--back", *taken.back)
    for path in (broken, cropped):
        assert any(path.name in note for note in told["notes"])
    _, told = _capture(tmp_path, capsys, "--front", *taken.front)
    assert told["unresolved"] > 0.3
    assert told["notes"]
    _, told = _capture(tmp_path, capsys, "--single", taken.front[1])
    assert told["notes"]


def test_photographs_that_tell_nothing(
    taken: Taken, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bare = tmp_path / "bare"
    bare.mkdir()
    front, back = write_shots(taken.shots, bare, exif=False)
    made, told = _capture(
        tmp_path,
        capsys,
        *("--front", *map(str, front), "--back", *map(str, back), "--set", "stitch.level=no"),
    )
    assert told["notes"]
    assert _error(made, taken.shots) < 0.06


def _refused(capsys: pytest.CaptureFixture[str], out: Path, arguments: Sequence[str]) -> str:
    capsys.readouterr()
    assert main(["capture", *arguments, "-o", str(out), "--quiet", "--set", "stitch.width=128"]) == BAD_INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert not out.exists()
    return line


def test_what_gives_no_light_is_one_sentence(
    taken: Taken, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    black = Photograph(np.zeros((120, 160, 3), np.uint8), ShotFacts("black.png"), "0")
    write_photograph(black, tmp_path / "black.png")
    assert _refused(capsys, tmp_path / "room.exr", ["--front", str(tmp_path / "black.png")])


@pytest.mark.slow
def test_reflections_are_taken_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arcs = (Arc("front", 60, 60, 7, 1.5), Arc("back", 200, 60, 7, 1.5))
    shots = shoot(_room(), replace(PHONE, arcs=arcs), 4)
    front, back = write_shots(shots, tmp_path)
    files = ["--front", *map(str, front), "--back", *map(str, back), "--set", "stitch.level=no"]
    clean, _ = _capture(tmp_path, capsys, *files)
    spoilt, _ = _capture(tmp_path, capsys, *files, "--set", "reflections.automatic=no")
    assert _error(clean, shots) < _error(spoilt, shots)
