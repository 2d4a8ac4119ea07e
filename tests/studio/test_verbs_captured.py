"""`lucarne fit-material` on folders that the lab wrote."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from studio.bench.lab import Rig, row, shoot
from studio.bench.lab_files import write_shots
from studio.bench.lab_surfaces import library
from studio.cli import main
from studio_core.imaging.io import read_image
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


@pytest.mark.parametrize(
    ("given", "why"),
    [
        (["--holdout", "nobody"], "nobody"),
        (["--holdout", "1.5"], "held back"),
        (["--size", "4"], "texels"),
        (["--distance", "0.5"], "outside"),
        (["--lights", "nothing.lp"], "nothing.lp"),
        (["-o", "maps.jpg"], "maps"),
    ],
)
def test_what_is_wrong_is_one_line(
    folder: Path, given: list[str], why: str, capsys: pytest.CaptureFixture[str]
) -> None:
    lights = [] if "--lights" in given else ["--lights", str(folder / "lights.lp")]
    assert main(["fit-material", str(folder), *lights, *given]) == 2
    (line,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("lucarne")]
    assert why in line
