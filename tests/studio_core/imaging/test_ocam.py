"""Lens files of OCamCalib: a real one against its own way back, made ones, and damaged ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from oracles import fisheye

from studio_core.errors import InputError
from studio_core.imaging.ocam import read_ocam
from studio_core.imaging.projection import pixel_points, project, unproject

GOOD = """# direct
5 -240.0 0.0 1.4e-03 -7e-07 1.1e-09
# inverse
3 100 50 2
# centre
{row} {column}
1.02 -0.01 0.02
600 800
"""


def lines(path: Path) -> list[list[float]]:
    return [
        [float(word) for word in line.split()]
        for line in path.read_text().splitlines()
        if line.strip() and not line.startswith("#")
    ]


def test_a_real_lens_agrees_with_its_own_way_back(shared_data: Path) -> None:
    real = shared_data / "third_party/fisheye_ocamcalib_mit/ocamcamera/calib_results_0.txt"
    lens, circle, size = read_ocam(real)
    (_, *direct), (_, *inverse), centre, affine, _ = lines(real)
    assert size == (1600, 1600)
    assert 180 < lens.fov < 195
    points = pixel_points(1600, 1600)[::53, ::53].reshape(-1, 2)
    distance = np.hypot(*(points - (circle.x, circle.y)).T)
    points = points[(distance < 0.97 * circle.radius) & (distance > 1)]
    directions, seen = unproject(lens, circle, points)
    assert seen.all()
    for (x, y), (right, up, back) in zip(points, directions, strict=True):
        row, column = y - 0.5, x - 0.5  # the toolbox counts pixels' centres from 0
        wanted = fisheye.ocam_direction(row, column, direct, tuple(centre), tuple(affine))
        assert (-up, right, back) == pytest.approx(wanted, abs=2e-6)
        again = fisheye.ocam_pixel(wanted, inverse, tuple(centre), tuple(affine))
        assert again == pytest.approx((row, column), abs=0.5)  # its inverse is a fit
    assert project(lens, circle, directions)[0] == pytest.approx(points, abs=2e-3)


def test_a_made_file(tmp_path: Path) -> None:
    path = tmp_path / "calib_results.txt"
    path.write_text(GOOD.format(row=290, column=410))
    lens, circle, size = read_ocam(path)
    assert size == (800, 600)
    assert (circle.x, circle.y, circle.radius) == (410.5, 290.5, 290.5)
    for row, column in ((290.0, 500.0), (120.0, 333.0), (560.0, 410.0)):
        found, _ = unproject(lens, circle, np.array([column + 0.5, row + 0.5]))
        polynomial = [-240.0, 0.0, 1.4e-03, -7e-07, 1.1e-09]
        wanted = fisheye.ocam_direction(row, column, polynomial, (290, 410), (1.02, -0.01, 0.02))
        assert (-found[1], found[0], found[2]) == pytest.approx(wanted, abs=2e-6)


def test_a_polynomial_that_turns_back_ends_the_circle(tmp_path: Path) -> None:
    path = tmp_path / "calib_results.txt"
    turning = GOOD.replace("5 -240.0 0.0 1.4e-03 -7e-07 1.1e-09", "5 -240.0 0.0 1.4e-03 0 -2e-08")
    path.write_text(turning.format(row=299.5, column=399.5))
    lens, circle, _ = read_ocam(path)
    assert 100 < circle.radius < 299
    assert lens.fov < 200


@pytest.mark.parametrize(
    ("old", "new", "cause"),
    [
        ("5 -240.0", "6 -240.0", "says 6 coefficients and has 5"),
        ("5 -240.0", "5 240.0", "does not look forward"),
        ("5 -240.0", "5 nan", "finite"),
        ("5 -240.0 0.0", "5 -240.0 many", "no numbers"),
        ("3 100 50 2", "3 100 50", "coefficients"),
        ("290 410", "290 -3", "outside the picture"),
        ("290 410", "290", "centre"),
        ("1.02 -0.01 0.02", "0.0 -0.01 0.02", "affine"),
        ("600 800", "600.5 800", "picture"),
        ("600 800", "1e300 800", "picture"),
        ("600 800", "", "four|4 of the five"),
        ("1.4e-03", "-1", "turns back|finite"),
    ],
)
def test_damaged_files_are_refused_in_one_sentence(tmp_path: Path, old: str, new: str, cause: str) -> None:
    path = tmp_path / "calib_results.txt"
    good = GOOD.format(row=290, column=410)
    assert old in good
    path.write_text(good.replace(old, new))
    with pytest.raises(InputError, match=cause) as refused:
        read_ocam(path)
    assert "calib_results.txt" in str(refused.value)
    assert "\n" not in str(refused.value)


def test_missing_binary_and_endless_files(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        read_ocam(tmp_path / "none.txt")
    for name, data in (("a.txt", b"\0\1\2" * 50), ("b.txt", b"1 2\n" * 40000), ("c.txt", b"\xff\xfe\xfa")):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(InputError, match=name):
            read_ocam(tmp_path / name)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(st.integers(0, 200), st.characters(codec="ascii")), min_size=1, max_size=8))
def test_changed_characters_give_a_lens_or_a_sentence(tmp_path: Path, changes: list[tuple[int, str]]) -> None:
    text = list(GOOD.format(row=290, column=410))
    for place, character in changes:
        text[place % len(text)] = character
    path = tmp_path / "changed.txt"
    path.write_text("".join(text))
    try:
        lens, circle, _ = read_ocam(path)
    except InputError:
        return
    found, _ = unproject(lens, circle, np.array([circle.x + 10, circle.y]))
    assert np.isfinite(found).all()
