"""Reflections of the frame: found where simulated phones have them, in either lens, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from capture_rooms import room

from studio.bench.phone import Arc, Phone, lens_light
from studio_core.capturing.artifacts import Registration
from studio_core.capturing.settings import BACK, FRONT, ReflectionSettings
from studio_core.errors import Cancelled
from studio_core.imaging.projection import Circle, Lens
from studio_core.shading.job import Job
from studio_plugins.capture.reflections import find_reflections

PHONE = Phone(size=(300, 300), lens=Lens(fov=194.0), circle=Circle(151.0, 148.0, 130.0), samples=1)


def found(phone, settings=None, seed=0, registration=None):
    truth = lens_light(room(seed), phone, seed)
    registration = registration or registered(truth)
    views = truth.view(FRONT), truth.view(BACK)
    return truth, find_reflections(*views, registration, settings or ReflectionSettings(), Job("find"))


def registered(truth, gain=(1.0, 1.0, 1.0)):
    lens = truth.phone.lens
    return Registration(truth.rotation, lens, np.array(gain), (0.0, 0.0, 0.0), 0.1, 99, True)


def apart(a, b):
    return abs((a - b + 180) % 360 - 180)


@pytest.mark.parametrize("parallax", [0.0, 2.5])
@pytest.mark.parametrize("side", [FRONT, BACK])
def test_arcs_are_found_with_their_place_and_strength(side, parallax):
    arcs = (Arc(side, 70.0, 40.0, 5.0, 1.2), Arc(side, 250.0, 80.0, 7.0, 1.0))
    _, patches = found(replace(PHONE, arcs=arcs, parallax=parallax))
    assert {patch.side for patch in patches} == {side}
    azimuth = np.arange(360)
    covered = np.zeros(360, bool)
    for patch in patches:
        covered |= (azimuth - patch.azimuth) % 360 <= patch.width
        arc = min(arcs, key=lambda a: apart(patch.azimuth + patch.width / 2, a.azimuth))
        assert apart(patch.azimuth + patch.width / 2, arc.azimuth) < arc.width / 2
        assert patch.outer == pytest.approx(97)
        assert arc.depth - 1 < patch.outer - patch.inner < arc.depth + 5
        assert abs(patch.excess - arc.stops) < 0.6
        assert patch.found
    for arc in arcs:
        there = apart(azimuth, arc.azimuth) < arc.width / 2
        assert covered[there].mean() > 0.75
    assert covered.sum() < sum(arc.width for arc in arcs) + 25


@pytest.mark.parametrize("seed", range(4))
def test_clean_pictures_are_left_alone(seed):
    """Near things are shifted by up to 2.5°, the glass spreads some light, the scales differ a little."""
    phone = replace(PHONE, parallax=2.5, glare=0.004, misalignment=(1.0, -2.0, 0.5))
    truth = lens_light(room(seed), phone, seed)
    _, patches = found(phone, seed=seed, registration=registered(truth, (1.05, 1.05, 1.05)))
    assert patches == ()


def test_falloff_and_gain_are_undone_first():
    phone = replace(PHONE, falloff=0.45, arcs=(Arc(BACK, 100.0, 50.0, 6.0, 1.2),))
    truth = lens_light(room(1), phone, 1)
    known = replace(registered(truth, (4.0, 4.0, 4.0)), falloff=(-0.225, -0.225, 0.0))
    front = truth.view(FRONT)
    front = replace(front, light=front.light * 4)
    patches = find_reflections(front, truth.view(BACK), known, ReflectionSettings(), Job("find"))
    assert [patch.side for patch in patches] == [BACK]


def test_sensitivity_decides_about_weak_ones():
    phone = replace(PHONE, arcs=(Arc(FRONT, 180.0, 60.0, 6.0, 0.32),))
    assert found(phone, ReflectionSettings(sensitivity=0.5))[1] == ()
    assert len(found(phone, ReflectionSettings(sensitivity=2.5))[1]) >= 1


def test_nothing_can_be_told_without_a_second_lens_or_an_overlap():
    truth = lens_light(room(), PHONE, 0)
    front, back = truth.view(FRONT), truth.view(BACK)
    job = Job("find")
    assert find_reflections(front, None, None, ReflectionSettings(), job) == ()
    off = ReflectionSettings(automatic=False)
    assert find_reflections(front, back, registered(truth), off, job) == ()
    narrow = replace(PHONE, lens=Lens(fov=178.0), arcs=(Arc(FRONT, 90.0),))
    assert found(narrow)[1] == ()
    dark = replace(front, light=np.zeros_like(front.light))
    assert find_reflections(dark, back, registered(truth), ReflectionSettings(), job) == ()
    unseen = replace(front, usable=np.zeros_like(front.usable))
    assert find_reflections(unseen, back, registered(truth), ReflectionSettings(), job) == ()


def test_it_can_be_cancelled():
    truth = lens_light(room(), PHONE, 0)
    job = Job("find")
    job.cancel()
    with pytest.raises(Cancelled):
        find_reflections(truth.view(FRONT), truth.view(BACK), registered(truth), ReflectionSettings(), job)
