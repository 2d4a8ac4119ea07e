"""Response and exposures against cameras whose curve is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from camera_support import FAMILIES, Camera, bracket, room, taken

from studio_core.capturing.artifacts import Exposures, Response
from studio_core.errors import InputError
from studio_core.imaging.curve_spline import KNOTS, basis
from studio_core.imaging.exposure_check import compared, shared_scale
from studio_core.imaging.levels import find_levels
from studio_core.imaging.response import solve_response

SIZE = (240, 180)
EVS = (-4.0, -2.0, 0.0, 2.0)


def curve_error(response: Response, camera: Camera) -> list[float]:
    """RMS of relative exposure of each channel between black and white."""
    number = np.linspace(0, 1, response.curve.shape[1])
    truth = camera.truth(256, number)
    made = []
    for c in range(3):
        inside = (number > response.black[c] / response.top + 0.03) & (
            number < response.white[c] / response.top
        )
        ratio = np.exp2(response.curve[c] - truth[c])[inside]
        made.append(float(np.sqrt(np.mean((ratio - 1) ** 2))))
    return made


def ev_error(exposures: Exposures, evs: tuple[float, ...]) -> float:
    off = np.asarray(exposures.solved) - evs
    return float(np.abs(off - np.median(off)).max())


@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_the_curve_and_the_exposures_are_found(family: str) -> None:
    seed, camera = 11 + len(family), Camera(FAMILIES[family])
    sides = {
        "front": taken(camera, room(seed, *SIZE), EVS, seed=seed),
        "back": taken(camera, room(seed + 50, *SIZE), (-3.0, -1.0, 1.0), seed=seed + 1),
    }
    response, exposures = solve_response(sides)
    assert response.measured
    assert not response.notes
    assert max(curve_error(response, camera)) < 0.02
    assert ev_error(exposures["front"], EVS) < 0.05
    assert ev_error(exposures["back"], (-3.0, -1.0, 1.0)) < 0.05
    assert exposures["front"].wrong == exposures["back"].wrong == ()


@pytest.mark.parametrize(("jpeg", "bits"), [(90, 8), (None, 16)])
def test_compression_and_sixteen_bits(jpeg: int | None, bits: int) -> None:
    camera = Camera(FAMILIES["film"], jpeg=jpeg, bits=bits)
    response, exposures = solve_response({"front": taken(camera, room(21, 320, 240), EVS)})
    assert max(curve_error(response, camera)) < 0.02
    assert ev_error(exposures["front"], EVS) < 0.05
    assert response.curve.shape == (3, 256 if bits == 8 else 4096)


@pytest.mark.parametrize("off", [-1.0, 1.0])
@pytest.mark.parametrize(("shot", "whole_step"), [(0, False), (1, False), (2, True)])
def test_one_wrong_listed_exposure_of_two_lenses_is_named(shot: int, whole_step: bool, off: float) -> None:
    evs = (-2.0, 0.0, 2.0)
    listed = [ev + (off if i == shot or (whole_step and i > shot) else 0) for i, ev in enumerate(evs)]
    camera = Camera(FAMILIES["film"])
    sides = {
        "front": taken(camera, room(31, *SIZE), evs, listed),
        "back": taken(camera, room(32, *SIZE), evs, seed=1),
    }
    response, exposures = solve_response(sides)
    assert max(curve_error(response, camera)) < 0.02
    assert ev_error(exposures["front"], evs) < 0.1
    assert exposures["front"].wrong == (shot,)
    assert exposures["back"].wrong == ()
    assert f"shot {shot + 1} was exposed otherwise" in exposures["front"].notes[0]


def test_shots_in_any_order_keep_their_places() -> None:
    evs = (0.0, -4.0, 2.0, -2.0)
    taken_so = taken(Camera(), room(35, *SIZE), evs, (0.0, -4.0, 3.0, -2.0))
    _, exposures = solve_response({"front": taken_so})
    assert exposures["front"].listed == (0.0, -4.0, 3.0, -2.0)
    assert exposures["front"].wrong == (2,)
    assert ev_error(exposures["front"], evs) < 0.1


def test_a_camera_whose_white_balance_drifts() -> None:
    camera, light = Camera(), room(36, *SIZE)
    drift = np.array([[0.06, 0, -0.04], [0, 0, 0], [0.02, 0, 0.05], [-0.05, 0, 0.03]])
    frames = [
        camera.shoot(light * np.exp2(t), ev, i) for i, (ev, t) in enumerate(zip(EVS, drift, strict=True))
    ]
    _, exposures = solve_response({"front": bracket(frames, EVS)})
    # what goes along with the exposures is part of the curve
    along = np.asarray(EVS) - np.mean(EVS)
    rest = drift - drift.mean(0) - along[:, None] * (along @ (drift - drift.mean(0)) / (along @ along))
    np.testing.assert_allclose(np.asarray(exposures["front"].tints), rest, atol=0.02)


def test_film_begins_above_zero_and_ends_below_full() -> None:
    camera = Camera(FAMILIES["film"], floor=15 / 255, ceiling=238 / 255)
    response, _ = solve_response({"front": taken(camera, room(41, *SIZE), (-6.0, *EVS))})
    assert all(13 <= black <= 18 for black in response.black)
    assert all(230 <= white <= 238 for white in response.white)
    assert max(curve_error(response, camera)) < 0.03


def test_linear_numbers_have_a_line_and_exposures_that_need_no_list() -> None:
    camera = Camera((lambda x: x,) * 3, bits=32)
    response, exposures = solve_response(
        {"front": taken(camera, room(51, *SIZE), (-2.0, 0.0, 2.3), (-2.0, 0.0, 3.0))}
    )
    assert response.linear
    assert not response.measured
    assert ev_error(exposures["front"], (-2.0, 0.0, 2.3)) < 0.03
    assert exposures["front"].wrong == (2,)
    assert max(curve_error(response, camera)) < 1e-6


def test_a_camera_with_half_the_light_has_more_noise() -> None:
    noises = []
    for electrons in (4000.0, 16000.0):
        camera = Camera(electrons=electrons, bits=16)
        response, _ = solve_response({"front": taken(camera, room(61, 320, 240), EVS)})
        noises.append(response.noise)
        # photons: variance of exposure 1 / electrons of full exposure, here in units of the middle one
        middle = float(np.interp(0.5, FAMILIES["sRGB"][0](np.linspace(0, 1, 4097)), np.linspace(0, 1, 4097)))
        assert response.noise[2] == pytest.approx(1 / (electrons * middle), rel=0.5)
    assert noises[0][2] > 2 * noises[1][2]


@pytest.mark.parametrize("evs", [(0.0,), (0.0, 0.0)])
def test_without_different_exposures_the_curve_is_assumed(evs: tuple[float, ...]) -> None:
    response, exposures = solve_response({"front": taken(Camera(), room(71, *SIZE), evs)})
    assert not response.measured
    assert "assumed" in response.notes[0]
    assert max(curve_error(response, Camera())) < 0.01
    np.testing.assert_allclose(exposures["front"].solved, evs, atol=0.02)


def test_two_exposures_are_enough() -> None:
    response, exposures = solve_response({"front": taken(Camera(), room(72, *SIZE), (-2.0, 0.5))})
    assert response.measured
    assert max(curve_error(response, Camera())) < 0.04
    assert ev_error(exposures["front"], (-2.0, 0.5)) < 0.05


@pytest.mark.parametrize("number", [0, 255])
def test_pictures_of_one_number_change_nothing(number: int) -> None:
    frames = [np.full((40, 60, 3), number, np.uint8)] * 3
    response, exposures = solve_response({"front": bracket(frames, (-2.0, 0.0, 2.0))})
    assert not response.measured
    assert np.isfinite(response.curve).all()
    np.testing.assert_allclose(exposures["front"].solved, (-2.0, 0.0, 2.0), atol=1e-6)


def test_a_black_exposure_keeps_its_listed_place() -> None:
    good = taken(Camera(), room(73, *SIZE), EVS)
    frames = [np.zeros_like(good.shots[0].pixels), *(s.pixels for s in good.shots)]
    response, exposures = solve_response({"front": bracket(frames, (-12.0, *EVS))})
    assert max(curve_error(response, Camera())) < 0.02
    assert exposures["front"].solved[0] == pytest.approx(-12, abs=0.3)


def test_settings_can_take_curve_and_exposures_as_given() -> None:
    camera = Camera(FAMILIES["film"])
    sides = {"front": taken(camera, room(74, *SIZE), EVS, (-4.0, -2.0, 0.0, 3.0))}
    response, exposures = solve_response(sides, response="sRGB", exposures="listed")
    assert not response.measured
    assert max(curve_error(response, Camera())) < 0.01
    assert exposures["front"].solved == (-4.0, -2.0, 0.0, 3.0)
    linear, _ = solve_response(sides, response="linear")
    assert linear.linear
    np.testing.assert_allclose(
        np.exp2(linear.curve[1, [64, 128, 250]]), np.array([64, 128, 250]) / 127.5, rtol=1e-4
    )


def test_moved_things_do_not_bend_the_curve() -> None:
    camera, light = Camera(FAMILIES["film"]), room(75, *SIZE)
    frames = []
    for i, ev in enumerate(EVS):
        own = light.copy()
        own[40:110, 30 * i : 30 * i + 50] = 0.4
        frames.append(camera.shoot(own, ev, i))
    response, exposures = solve_response({"front": bracket(frames, EVS)})
    assert max(curve_error(response, camera)) < 0.025
    assert ev_error(exposures["front"], EVS) < 0.05


def test_photographs_that_do_not_fit_are_refused_in_one_sentence() -> None:
    small, large = np.zeros((20, 30, 3), np.uint8), np.zeros((30, 40, 3), np.uint8)
    with pytest.raises(InputError, match="shot 2 is 40 × 30 pixels, and shot 1 of the same bracket 30 × 20"):
        solve_response({"front": bracket([small, large], (0.0, 2.0))})
    with pytest.raises(InputError, match="16 bit"):
        solve_response({"front": bracket([small, small.astype(np.uint16)], (0.0, 2.0))})


def test_splines_sum_to_one_and_rise() -> None:
    number = np.linspace(0, 1, 301)
    np.testing.assert_allclose(basis(number).sum(axis=1), 1)
    assert (np.diff(basis(number) @ np.arange(KNOTS)) > 0).all()


def test_the_median_step_decides_about_the_scale() -> None:
    sure, seen = [np.ones(3, np.bool_)] * 2, [np.ones(2, np.bool_)] * 2
    solved = [np.array([0.0, 1.0, 2.0])] * 2
    listed: list[npt.NDArray[np.float64]] = [np.array([0.0, 2.0, 5.0]), np.array([0.0, 2.0, 4.0])]
    assert shared_scale(solved, listed, sure, seen) == pytest.approx(2)
    assert shared_scale(solved, [np.zeros(3)] * 2, sure, seen) is None
    guessed = [np.zeros(3, np.bool_), np.ones(3, np.bool_)]
    assert shared_scale(solved, [np.array([0.0, 9.0, 18.0]), listed[1]], guessed, seen) == pytest.approx(2)


def test_guessed_exposures_are_never_wrong() -> None:
    made, _ = compared(
        np.array([0.0, 1.0, 4.0]), np.array([0.0, 2.0, 4.0]), np.zeros(3, np.bool_), ["a", "b", "c"]
    )
    assert made.wrong == ()


def test_a_wall_that_is_bright_in_one_exposure_is_no_clipping() -> None:
    dark, bright = np.full((2, 60, 80, 3), 40, np.uint8)
    bright[:30] = 180
    levels = find_levels([dark, bright], [0.0, 2.0])
    assert min(levels.white) > 180
    both = find_levels([np.minimum(bright, 180), np.maximum(bright, 180)], [0.0, 2.0])
    assert max(both.white) <= 180  # what is brighter stays at 180: film ends there


def test_of_three_exposures_the_one_that_fits_an_ordinary_camera_is_right() -> None:
    sure, seen = [np.ones(3, np.bool_)], [np.ones(2, np.bool_)]
    solved = [np.array([-2.0, 0.0, 2.0])]
    for listed, factor in (((-2, 0, 1), 1), ((-1, 0, 2), 1), ((-2, 1, 2), 1), ((-2, 0, 4), 1)):
        found = shared_scale(solved, [np.array(listed, float)], sure, seen, usual=1.05)
        assert found == pytest.approx(factor)


def test_film_whose_ladder_of_one_stop_has_steps_of_none() -> None:
    film = Camera(FAMILIES["film"], floor=15.5 / 255, ceiling=246 / 255)
    true = tuple(np.cumsum([-7.0, 1.0, 0.0, 1.0, 1.0, 1.3, 0.0, 1.0, 1.0, 0.5]).tolist())
    listed = tuple(float(i) - 7 for i in range(len(true)))
    response, exposures = solve_response({"front": taken(film, room(76, *SIZE, stops=14), true, listed)})
    assert max(curve_error(response, film)) < 0.03
    assert ev_error(exposures["front"], true) < 0.1
    assert set(exposures["front"].wrong) & {1, 2}
    assert set(exposures["front"].wrong) & {5, 6}
    assert "0.0 EV instead of 1.0 EV" in exposures["front"].notes[0]


def test_guessed_steps_are_said_to_be_guessed() -> None:
    shots = taken(Camera(), room(77, *SIZE), (-2.0, 0.0, 2.0))
    response, _ = solve_response({"front": replace(shots, certain=(False,) * 3)})
    assert "guess" in response.notes[0]
    same = replace(shots, listed=(0.0,) * 3)
    response, exposures = solve_response({"front": same})
    assert "ordinary camera" in response.notes[0]
    assert ev_error(exposures["front"], (-2.0, 0.0, 2.0)) < 0.35
