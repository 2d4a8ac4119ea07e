"""The whole fit on small pictures of the lab: what it promises of lights that it has not seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from studio.bench.lab import LabShots, Rig, dome, row, shoot, truth_map
from studio.bench.lab_surfaces import Gloss, Surface, Waves, library
from studio_core.errors import Cancelled, InputError
from studio_core.shading.job import Job
from studio_plugins.residual.errors import errors
from studio_plugins.residual.fit import fit, relit
from studio_plugins.residual.frames import tangent_frames, to_tangent
from studio_plugins.residual.masks import Masks, lit, outside_highlight
from studio_plugins.residual.reflectance_map import reflectance_maps, slopes
from studio_plugins.residual.result import ResidualFit, Settings
from studio_plugins.residual.samples import Ball, Lights, Samples
from studio_plugins.residual.solve import Solver
from studio_plugins.residual.splits import SPLITS, folds, fraction

RIG = Rig(size=(104, 100), ball=Ball(52.3, 49.6, 46.0))
LIGHTS = dome((-35.0, 0.0, 35.0)).some(np.arange(0, 38, 2))
QUICK = Settings(models=("lambert", "rough-blinn"), refine=0)


def photographed(surface: Surface, lights: Lights = LIGHTS, rig: Rig = RIG) -> tuple[Samples, LabShots]:
    shots = shoot(surface, lights, rig, 5)
    return reflectance_maps(shots.pictures, shots.clipped, rig.ball, shots.told, 20), shots


def held_out(found: ResidualFit, test: Samples, truly: np.ndarray) -> tuple[float, float]:
    """nMSE of the fit, and of its parametric model alone."""
    use, outside = test.usable & lit(test) & truly, outside_highlight(test)
    made = errors(found.predict(test.lights), test.values, use, outside)
    return made.whole, errors(found.alone(test.lights), test.values, use, outside).whole


@pytest.mark.parametrize(
    ("split", "most"), [("checkerboard", 1e-4), ("one-row", 2e-4), ("inner-outer", 2e-4)]
)
def test_texture_is_known_under_other_lights(split: str, most: float) -> None:
    samples, _ = photographed(library()["textured"])
    held = SPLITS[split](samples.lights)
    found = fit(samples.some(~held), QUICK)
    whole, alone = held_out(found, samples.some(held), np.True_)
    assert alone > 0.05
    assert whole < most
    assert found.basis.name.startswith("albedo")


def test_the_papers_residual_is_better_than_its_model_alone() -> None:
    samples, shots = photographed(library()["bumpy"])
    _, truly = truth_map(shots.surface, samples.normals, samples.views, shots.were)
    held = SPLITS["checkerboard"](samples.lights)
    plain = replace(QUICK, models=("paper",), basis="half", table=False, cautious=False)
    whole, alone = held_out(fit(samples.some(~held), plain), samples.some(held), truly[held])
    chosen, _ = held_out(fit(samples.some(~held), QUICK), samples.some(held), truly[held])
    assert whole < 0.5 * alone
    assert chosen < 0.5 * whole


def test_lights_that_are_told_wrongly_are_found() -> None:
    rig = replace(RIG, direction_error=1.0, strength_error=0.04, drift=1.0)
    shiny = Surface(
        (0.3, 0.2, 0.1), (0.2, 0.1, 0.1), Waves.random(6, 0.4), gloss=(Gloss("blinn", 150.0, (0.04,) * 3),)
    )
    samples, shots = photographed(shiny, rig=rig)

    def off(lights: Lights) -> float:
        cosine = (lights.directions * shots.were.directions).sum(axis=1)
        return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean())

    quick = Settings(models=("rough-blinn",), basis="albedo", table=False, refine=3)
    found = fit(samples, quick)
    assert off(samples.lights) > 0.5
    assert off(found.lights) < 0.15 * off(samples.lights)
    gain = found.lights.strengths[:, 0] / shots.were.strengths[:, 0]
    assert np.ptp(gain) / np.median(gain) < 0.03
    held = SPLITS["checkerboard"](samples.lights)
    some = fit(samples.some(~held), quick)
    as_told, _ = held_out(some, samples.some(held), np.True_)
    refined, _ = held_out(some, relit(some, samples.some(held)), np.True_)
    assert refined < 0.3 * as_told


def test_refined_lights_that_predict_worse_are_left_where_they_were_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    samples, _ = photographed(library()["textured"])
    turn = np.array([[0.98, 0.0, 0.199], [0.0, 1.0, 0.0], [-0.199, 0.0, 0.98]])

    def astray(some: Samples, *others: object) -> Lights:
        return replace(some.lights, directions=some.lights.directions @ turn)

    monkeypatch.setattr("studio_plugins.residual.fit.refined", astray)
    quick = Settings(models=("lambert",), basis="albedo", table=False, refine=1)
    found = fit(samples, quick)
    assert np.array_equal(found.lights.directions, samples.lights.directions)
    assert any("stay as told" in note for note in found.notes)
    careless = fit(samples, replace(quick, cautious=False))
    assert not np.allclose(careless.lights.directions, samples.lights.directions, atol=0.1)


def test_nothing_is_worse_than_the_model_alone_when_nothing_is_to_be_learned() -> None:
    rng = np.random.default_rng(4)
    samples, _ = photographed(Surface((0.5, 0.4, 0.3)), row())
    noisy = replace(
        samples, values=samples.values + rng.normal(size=samples.values.shape).astype(np.float32) * 0.05
    )
    held = SPLITS["checkerboard"](samples.lights)
    found = fit(noisy.some(~held), QUICK)
    whole, alone = held_out(found, samples.some(held), np.True_)
    assert whole <= alone * 1.2
    assert whole < 2e-3


def test_clipped_highlights_teach_nothing() -> None:
    surface = Surface(
        (0.3, 0.2, 0.1), (0.1, 0.2, 0.3), Waves.random(7, 0.4), gloss=(Gloss("blinn", 40.0, (0.2,) * 3),)
    )
    samples, _ = photographed(surface, rig=replace(RIG, white=0.5))
    assert np.count_nonzero(~samples.usable) > 100
    held = SPLITS["checkerboard"](samples.lights)
    with_masks, _ = held_out(fit(samples.some(~held), QUICK), samples.some(held), np.True_)
    without = replace(QUICK, masks=Masks(False, False, False), solver=Solver(tukey=False))
    without_masks, _ = held_out(fit(samples.some(~held), without), samples.some(held), np.True_)
    assert with_masks < 0.2 * without_masks


def test_a_fit_reports_itself_and_can_be_cancelled() -> None:
    samples, _ = photographed(library()["matte"], row())
    steps: list[tuple[int, int]] = []
    found = fit(samples, QUICK, Job("fit", lambda job: steps.append((job.done, job.total))))
    told = found.report()
    assert told["basis"] == found.basis.name
    assert sum(told["rank"].values()) == found.rank.size
    assert [one["name"] for one in told["lights"]] == list(samples.lights.names)
    assert steps[-1][0] <= steps[-1][1]
    stopped = Job("fit", lambda job: job.cancel())
    with pytest.raises(Cancelled):
        fit(samples, QUICK, stopped)
    assert np.isfinite(found.predict(Lights.at([89.0, 180.0], [0.0, 0.0]))).all()
    assert (found.predict(Lights.of([[0, 0, -1]])) == 0).all()


def test_what_cannot_be_fitted_is_said() -> None:
    samples, _ = photographed(library()["matte"], row())
    with pytest.raises(InputError, match="hardly anything"):
        fit(replace(samples, usable=np.zeros_like(samples.usable)), QUICK)
    with pytest.raises(InputError, match="no basis 'spline'"):
        fit(samples, replace(QUICK, basis="spline"))
    with pytest.raises(InputError, match="no reflectance model 'velvet'"):
        fit(samples, replace(QUICK, models=("velvet",)))


def test_tangent_frames_are_right_handed_and_turn_with_the_normal() -> None:
    n = np.concatenate([slopes(9).reshape(-1, 3), np.float32([[0, 1, 0], [0, -1, 0], [0, 0, 1]])])
    frames = tangent_frames(n)
    assert np.allclose(frames @ np.swapaxes(frames, 1, 2), np.eye(3), atol=1e-6)
    assert np.allclose(np.linalg.det(frames), 1, atol=1e-6)
    assert np.allclose(to_tangent(n, frames), [0, 0, 1], atol=1e-6)
    assert np.allclose(tangent_frames(np.array([0.0, 0, 1])), np.eye(3), atol=1e-7)
    # section 4.4, whose z points away from the camera and whose tangent points left
    x, y, z = n[:81].T
    phi = np.arcsin(y)
    theta = np.arccos(np.clip(x / np.cos(phi), -1, 1))
    assert np.allclose(frames[:81, 0], np.stack([np.sin(theta), 0 * z, -np.cos(theta)], axis=1), atol=1e-5)
    printed = np.stack([-np.sin(phi) * np.cos(theta), np.cos(phi), -np.sin(phi) * np.sin(theta)], axis=1)
    assert np.allclose(frames[:81, 1], printed, atol=1e-5)


def test_splits_hold_back_what_they_say() -> None:
    lights = dome()
    for held in (SPLITS[name](lights) for name in SPLITS):
        assert 0 < held.sum() < len(lights)
    assert (lights.angles()[~SPLITS["one-row"](lights), 1] == 0).all()
    away = lights.directions[:, 2]
    assert away[SPLITS["inner-outer"](lights)].max() <= away[~SPLITS["inner-outer"](lights)].min()
    assert np.sum(folds(row())[:3], axis=0).tolist() == [1] * 12
    assert fraction(lights, 0.5, 1).sum() == round(len(lights) / 2)
    with pytest.raises(InputError):
        fraction(lights, 1.0)
    assert folds(row().some([0])) == []
