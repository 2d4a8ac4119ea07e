"""`lucarne fit-material` on folders that the lab wrote."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from studio.bench.lab import Rig, row, shoot
from studio.bench.lab_btf import ClothBtf, Weave
from studio.bench.lab_btf_files import write_pictures
from studio.bench.lab_files import write_shots
from studio.bench.lab_surfaces import library
from studio.cli import main
from studio_core.imaging.encode import write_exr
from studio_core.imaging.io import read_image
from studio_core.library.lucmat import read
from studio_plugins.residual.btf import directions
from studio_plugins.residual.samples import Ball

RIG = Rig(size=(84, 80), ball=Ball(42.3, 40.2, 36.0))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("ball")
    write_shots(shoot(library()["textured"], row(), RIG), made, lights="lp")
    return made


def test_a_folder_becomes_maps_and_a_report(folder: Path, tmp_path: Path) -> None:
    report, maps = tmp_path / "r.json", tmp_path / "m.exr"
    given = ["--lights", str(folder / "lights.lp"), "--size", "16", "--no-refine", "--basis", "albedo"]
    assert (
        main(
            [
                "fit-material",
                str(folder),
                *given,
                "--holdout",
                "0.4",
                "--report",
                str(report),
                "-o",
                str(maps),
            ]
        )
        == 0
    )
    told = json.loads(report.read_text())
    assert told["ball"]["radius"] == pytest.approx(36, abs=0.2)
    assert len(told["holdout"]["lights"]) == 5
    errors = told["holdout"]["as_given"]
    assert errors["holdout_nmse"] < 1e-3 < errors["parametric_nmse"]
    assert told["fit"]["bytes_per_texel"] == 6
    assert read_image(maps).pixels.shape[:2] == (16, 16)


def test_a_folder_becomes_a_material_of_the_library(folder: Path, tmp_path: Path) -> None:
    file, report = tmp_path / "cloth.lucmat", tmp_path / "r.json"
    given = ["--lights", str(folder / "lights.lp"), "--size", "16", "--no-refine", "--report", str(report)]
    assert main(["fit-material", str(folder), *given, "-o", str(file)]) == 0
    found = read(file)
    assert found.material.model == "captured"
    assert "captured" in found.tags
    assert found.material.textures["albedo"].image.pixels.shape == (16, 16, 3)
    assert 0 <= json.loads(report.read_text())["scene"]["off"] < 1e-4


@pytest.mark.parametrize(
    ("given", "why"),
    [
        (["--holdout", "nobody"], "nobody"),
        (["--holdout", "1.5"], "held back"),
        (["--size", "4"], "texels"),
        (["--distance", "0.5"], "outside"),
        (["--lights", "nothing.lp"], "nothing.lp"),
        (["-o", "maps.jpg"], "maps"),
        (["--white", "1,2"], "three numbers"),
        (["--white", "1,0,1"], "above zero"),
        (["--white", "1,1,1", "--white-at", "3,3,1"], "one of them"),
        (["--flat", "--distance", "0"], "in front"),
        (["--ball", "9,9,2"], "too small"),
        (["--mirror-ball", "42,40,36"], "one of them"),
    ],
)
def test_what_is_wrong_is_one_line(
    folder: Path, given: list[str], why: str, capsys: pytest.CaptureFixture[str]
) -> None:
    lights = [] if "--lights" in given else ["--lights", str(folder / "lights.lp")]
    assert main(["fit-material", str(folder), *lights, *given]) == 2
    (line,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("lucarne")]
    assert why in line


def test_a_flat_sample_with_a_white_spot(tmp_path: Path) -> None:
    rig = Rig(size=(30, 24), flat=True)
    shots = shoot(library()["textured"], row(20.0).some([0, 3, 5, 8, 10]), rig)
    folder, report = tmp_path / "swatch", tmp_path / "r.json"
    folder.mkdir()
    write_shots(shots, folder)
    given = ["--flat", "--size", "12", "--no-refine", "--basis", "albedo", "--white-at", "15,12,4"]
    assert main(["fit-material", str(folder), *given, "--report", str(report)]) == 0
    told = json.loads(report.read_text())
    assert "ball" not in told
    y, x = np.mgrid[:24, :30] + 0.5
    seen = shots.pictures[:, np.hypot(x - 15, y - 12) <= 4].mean(axis=(0, 1))
    assert told["white"][0] / told["white"][2] == pytest.approx(float(seen[0] / seen[2]), rel=1e-4)


def test_lamps_on_a_mirror_ball_and_a_ball_told(tmp_path: Path) -> None:
    """A shiny ball stands beside the sample: the same pictures tell where lamps are."""
    shots = shoot(library()["textured"], row(15.0).some([0, 2, 4, 7, 9, 11]), RIG)
    x, y = np.meshgrid(np.arange(40) + 0.5, np.arange(80) + 0.5)
    normals, views, inside = Ball(20, 40, 15).normals(x, y)
    mirrored = 2 * (normals * views).sum(axis=-1, keepdims=True) * normals - views
    beside = [np.where(inside, 9 * np.exp(300 * (mirrored @ d - 1)), 0) for d in shots.told.directions]
    for i, (picture, spot) in enumerate(zip(shots.pictures, beside, strict=True)):
        both = np.concatenate([picture, np.repeat(spot[..., None], 3, axis=-1)], axis=1)
        write_exr(tmp_path / f"{i}.exr", both.astype(np.float32))
    report = tmp_path / "r.json"
    places = ["--mirror-ball", "104,40,15", "--ball", "42.3,40.2,36"]
    given = ["--size", "16", "--no-refine", "--basis", "albedo", "--report", str(report)]
    assert main(["fit-material", str(tmp_path), *places, *given]) == 0
    told = json.loads(report.read_text())["fit"]
    assert told["light_source"] == "mirror ball"
    found = np.array([one["direction"] for one in told["lights"]])
    assert np.degrees(np.arccos((found * shots.told.directions).sum(axis=1))).max() < 3.5  # a small ball


def test_a_btf_in_a_zip_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rings = [(0.0, 1), (30.0, 5), (60.0, 6)]
    some = np.concatenate([directions(np.radians(t), 2 * np.pi * np.arange(n) / n) for t, n in rings])
    path, report = tmp_path / "cloth.zip", tmp_path / "r.json"
    write_pictures(ClothBtf(Weave(texels=16, yarns=2, height=0.02), some, full=1.0), path, "png")
    given = ["--basis", "albedo-light", "--report", str(report), "-o", str(tmp_path / "m.exr")]
    assert main(["fit-material", str(path), "--holdout", "0.25", *given]) == 0
    told = json.loads(report.read_text())
    assert told["btf"] == {"pictures": 144, "lights": 12, "views": 12, "texels": [16, 16]}
    errors = told["holdout"]["as_given"]
    assert errors["holdout_nmse"] < 0.3 * errors["parametric_nmse"]
    assert "albedo-light, 24 bytes a texel" in capsys.readouterr().out
    for wrong, why in ((["--flat"], "--flat is of photographs"), (["--holdout", "one-row"], "a share")):
        assert main(["fit-material", str(path), *wrong]) == 2
        assert why in capsys.readouterr().err
