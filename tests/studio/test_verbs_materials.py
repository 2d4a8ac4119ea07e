"""`lucarne fit-brdf`: what it finds, writes and refuses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from oracles.brdf import blinn_phong

from studio.cli import BAD_INPUT, main
from studio_core.brdfs import merl
from studio_core.brdfs.half_difference import grid
from studio_core.library import lucmat

VALUES = {"diffuse": (0.3, 0.2, 0.1), "specular": (0.1, 0.1, 0.1), "exponent": 300.0}


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("measured") / "lacquer.binary"
    wi, wo = grid(merl.SHAPE)
    known = (wi[..., 2] > 0) & (wo[..., 2] > 0)
    values = np.zeros((*merl.SHAPE, 3))
    values[known] = blinn_phong(VALUES, wo[known], wi[known])
    merl.write(path, values, known)
    return path


def test_the_nearest_model_comes_first_and_becomes_a_material(
    measured: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, report = tmp_path / "lacquer.lucmat", tmp_path / "report.json"
    models = ["--model", "lambert", "--model", "blinn-phong"]
    assert main(["fit-brdf", str(measured), *models, "-o", str(out), "--report", str(report), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert json.loads(report.read_text()) == told
    assert [fit["model"] for fit in told["fits"]] == ["blinn-phong", "lambert"]
    best, worst = told["fits"]
    assert best["values"]["exponent"] == pytest.approx(300, rel=0.01)
    assert best["metric"] < 1e-3 < worst["metric"]
    assert sum(part["count"] for part in worst["by_half_degrees"].values()) == told["samples"]
    kept = lucmat.read(out)
    assert (kept.name, kept.material.model) == ("lacquer", "blinn-phong")
    assert kept.about == "Fitted to lacquer.binary"


def test_text_is_fitted_as_it_stands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = "".join(f"{i},{o},{p},0.1,0.05\n" for i in (0, 40) for o in (10, 50) for p in (0, 90, 180))
    (tmp_path / "chalk.csv").write_text("theta_i,theta_o,phi,500,600\n" + rows)
    assert main(["fit-brdf", str(tmp_path / "chalk.csv"), "--model", "lambert", "--json"]) == 0
    said = capsys.readouterr()
    (fit,) = json.loads(said.out)["fits"]
    assert fit["rmse"] < 1e-4
    assert "from 500 to 600 nm" in said.err
    assert main(["fit-brdf", str(tmp_path / "chalk.csv"), "--model", "lambert"]) == 0
    assert capsys.readouterr().out.startswith("lambert:base_color=0")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["none.binary"], "there is no such file"),
        (["none.binary", "--model", "plush"], "no brdf 'plush'"),
        (["none.binary", "--model", "measured"], "nothing to fit"),
        (["box.obj", "--model", "lambert"], "no measured material"),
        (["none.binary", "-o", "x.txt"], "materials are written as .lucmat"),
        (["none.binary", "--report", "x.txt"], "reports are written as .json"),
    ],
)
def test_what_cannot_be_is_told(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    words: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "box.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert main(["fit-brdf", *arguments]) == BAD_INPUT
    assert words in capsys.readouterr().err
