"""Which circle belongs to which side: what one side tells about the other's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from studio.bench.phone import Phone, shoot
from studio_core.capturing.artifacts import Bracket, Brackets
from studio_core.capturing.settings import BACK, FRONT, TWO_PICTURES
from studio_core.imaging.photograph import Photograph
from studio_core.imaging.projection import Circle
from studio_core.shading.job import Job
from studio_plugins.capture.sides import cut_out

PHONE = Phone(size=(320, 240), circle=Circle(158, 122, 105), samples=1)


def brackets(dark: bool, *, back_shift: tuple[float, float] = (0.0, 0.0), narrow: bool = False) -> Brackets:
    """Of an even room; the back may be so dark that nothing is seen of its circle."""
    room = np.random.default_rng(1).uniform(0.4, 1.6, (64, 128, 3)).astype(np.float32)
    shots = shoot(room, replace(PHONE, back_shift=back_shift), 1)

    def side(photographs: tuple[Photograph, ...], black: bool) -> Bracket:
        made = []
        for one in photographs:
            pixels = np.full_like(one.pixels, 2) if black else one.pixels
            made.append(replace(one, pixels=pixels[:, :-40] if black and narrow else pixels))
        return Bracket(tuple(made), PHONE.evs, (True,) * len(made))

    return Brackets(TWO_PICTURES, {FRONT: side(shots.front, False), BACK: side(shots.back, dark)})


def test_a_circle_that_is_not_seen_is_where_the_other_side_has_it() -> None:
    _, found = cut_out(brackets(dark=True), Job("test"))
    assert found[FRONT].confidence > 0.5
    assert found[BACK].circle == found[FRONT].circle
    assert found[BACK].confidence < 0.5  # it should be looked at


def test_circles_that_are_both_sure_stay() -> None:
    _, found = cut_out(brackets(dark=False, back_shift=(8.0, 6.0)), Job("test"))
    assert abs(found[FRONT].circle.x - 158) < 1
    assert abs(found[BACK].circle.x - 166) < 1
    assert min(one.confidence for one in found.values()) > 0.5


def test_pictures_of_another_size_tell_nothing_of_each_other() -> None:
    _, found = cut_out(brackets(dark=True, narrow=True), Job("test"))
    assert found[BACK].circle != found[FRONT].circle
    assert found[BACK].confidence == 0
