"""The kind `fitter`: a folder becomes a material that can be asked how good it is."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from studio.bench.lab import Rig, row, shoot
from studio.bench.lab_files import write_shots
from studio.bench.lab_surfaces import library
from studio_core.errors import Cancelled, InputError
from studio_core.fitting import CHECKERBOARD, NONE, FitRequest, relative_error
from studio_core.registry import PluginHost
from studio_core.shading.job import Job
from studio_plugins.residual import plugin
from studio_plugins.residual.fitter import FittedPhotographs, ResidualFitter
from studio_plugins.residual.result import Settings
from studio_plugins.residual.samples import Ball

RIG = Rig(size=(84, 80), ball=Ball(42.3, 40.2, 36.0), white=100.0)
QUICK = ResidualFitter(
    settings=Settings(models=("lambert",), among=("none", "albedo"), table=False, refine=1)
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("ball")
    write_shots(shoot(library()["textured"], row(), RIG), made)
    return made


@pytest.fixture(scope="module")
def request_(folder: Path) -> FitRequest:
    return FitRequest(folder, size=16)


@pytest.fixture(scope="module")
def fitted(request_: FitRequest) -> FittedPhotographs:
    return QUICK.fit(request_, Job("fit"))


def test_the_registry_has_it() -> None:
    fitter = PluginHost((plugin,)).get("fitter", "photographs")
    assert isinstance(fitter, ResidualFitter)
    assert fitter.label


def test_lamps_that_were_not_seen_are_predicted(fitted: FittedPhotographs) -> None:
    unseen, seen = fitted.figures.unseen, fitted.figures.seen
    assert unseen is not None
    assert unseen.whole < 2e-3 < 0.02 < unseen.alone
    assert seen.whole < 2e-3
    assert [lamp.held for lamp in fitted.lamps].count(True) == 6
    assert fitted.figures.texels == (16, 16)
    assert fitted.figures.bytes_per_texel == 6
    assert fitted.figures.bytes_in_all >= 16 * 16 * 3 * 2


def test_errors_are_those_of_the_pictures(fitted: FittedPhotographs) -> None:
    for i in (0, 5):
        error = relative_error(fitted.reconstruction(i), fitted.photograph(i), fitted.trusted(i))
        assert float(np.nanmean(error.astype(float) ** 2)) == pytest.approx(fitted.lamps[i].whole, rel=1e-3)


def test_another_lamp_is_what_lamps_nearby_say(fitted: FittedPhotographs) -> None:
    """Under a lamp of the folder: its photograph."""
    lamp = fitted.lamps[3]
    made, use = fitted.relit(lamp.azimuth, lamp.height), fitted.trusted(3)
    seen = fitted.photograph(3)
    assert float(((made - seen)[use] ** 2).sum() / (seen[use] ** 2).sum()) < 2e-3


def test_material_and_report(fitted: FittedPhotographs, folder: Path) -> None:
    assert fitted.material.model == "captured"
    assert fitted.material.name == folder.name
    assert fitted.tags == ("captured",)
    told = json.loads(json.dumps(fitted.report, allow_nan=False))
    assert len(told["lamps"]) == 12
    assert told["ball"]["radius"] == pytest.approx(36, abs=0.3)
    assert len(told["fit"]["lights"]) == 12, "the material is made of all lamps"
    assert len(told["measured_fit"]["lights"]) == 6
    assert told["unseen_as_told"]["whole"] == pytest.approx(told["unseen"]["whole"], abs=1e-3)
    assert all(note[0].isupper() and note.endswith(".") for note in fitted.notes)


def test_without_lamps_held_back(request_: FitRequest) -> None:
    made = QUICK.fit(replace(request_, held=NONE, size=8), Job("fit"))
    assert made.figures.unseen is None
    assert not any(lamp.held for lamp in made.lamps)
    assert made.report["measured_fit"] is None


def test_the_bar_goes_up_and_it_stops_when_asked(request_: FitRequest) -> None:
    shares: list[float] = []

    def follow(job: Job) -> None:
        shares.append(job.done / job.total)
        if job.label == "Fitting" and len(shares) > 14:
            job.cancel()

    with pytest.raises(Cancelled):
        QUICK.fit(replace(request_, size=8), Job("fit", follow))
    assert shares == sorted(shares)
    assert shares[-1] < 0.75


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"folder": Path("nowhere")}, "no such folder"),
        ({"size": 4}, "4 texels"),
        ({"distance": 0.5}, "outside of the ball"),
        ({"flat": True, "distance": 0.05}, "in front"),
        ({"held": "thirds"}, "thirds"),
        ({"held": "one-row"}, "held back"),
        ({"lamps": Path("nothing.lp")}, "nothing.lp"),
    ],
)
def test_what_is_wrong_is_a_sentence(request_: FitRequest, changes: dict[str, object], why: str) -> None:
    with pytest.raises(InputError, match=why) as told:
        QUICK.fit(replace(request_, **changes), Job("fit"))  # type: ignore[arg-type]
    assert "\n" not in str(told.value)


def test_a_flat_piece(tmp_path: Path) -> None:
    lights = row(20.0).some([0, 2, 4, 6, 8, 10, 11])
    write_shots(shoot(library()["textured"], lights, Rig(size=(30, 24), flat=True)), tmp_path)
    made = QUICK.fit(FitRequest(tmp_path, flat=True, size=20, held=CHECKERBOARD), Job("fit"))
    assert made.figures.texels == (20, 16)
    assert made.photograph(0).shape == made.relit(10.0, 20.0).shape == (16, 20, 3)
    assert made.figures.unseen is not None
    assert made.figures.unseen.whole < made.figures.unseen.alone
