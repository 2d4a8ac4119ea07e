"""How two lenses stand to each other: rotation, field of view, gain and falloff against known ones."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from studio.bench.phone import Arc, Phone, Truth, lens_light
from studio_core.capturing.artifacts import F32, F64, Mask, Registration, View
from studio_core.capturing.settings import LensSettings, Patch, RegistrationSettings
from studio_core.capturing.standing import rotation_from
from studio_core.errors import Cancelled
from studio_core.imaging.environment import load_environment
from studio_core.imaging.projection import KANNALA_BRANDT, ORTHOGRAPHIC, Circle, Lens
from studio_core.shading.job import Job
from studio_plugins.capture.falloff import from_loss
from studio_plugins.capture.register import alone, rebalanced, register

PHONE = Phone(
    size=(460, 460),
    lens=Lens(fov=196),
    circle=Circle(228, 231, 200),
    misalignment=(1.5, -2.0, 1.2),
    back_scale=1.01,
    back_shift=(2.0, -1.5),
    falloff=0.25,
    samples=1,
)
GUESS = Lens(fov=190)


def room(seed: int = 3) -> F32:
    """An invented room: hard-edged patches and soft light on a sphere, everywhere something."""
    rng = np.random.default_rng(seed)
    height, width = 256, 512
    made = np.zeros((height, width), np.float32)
    for sigma, size in ((40, 1.0), (12, 1.0), (5, 0.7), (2.5, 0.4)):
        noise = rng.normal(size=(height, width)).astype(np.float32)
        wide = np.concatenate([noise, noise, noise], axis=1)
        soft = cv2.GaussianBlur(wide, (0, 0), sigma)[:, width : 2 * width]
        made += size * np.where(np.abs(soft) > 0.7 * soft.std(), np.sign(soft), soft / soft.std())
    tint = np.array([1.1, 1.0, 0.8], np.float32)
    return np.asarray(np.exp(0.6 * made)[..., None] * tint, np.float32)


def views(truth: Truth, lens: Lens = GUESS) -> tuple[View, View]:
    rng = np.random.default_rng(1)
    made = []
    for side in ("front", "back"):
        view = truth.view(side)
        noise = np.exp(rng.normal(0, 0.01, view.light.shape))
        made.append(replace(view, lens=lens, light=(view.light * noise).astype(np.float32)))
    return made[0], made[1]


def within(view: View) -> Mask:
    """The circle with its soft border."""
    y, x = np.mgrid[0 : view.light.shape[0], 0 : view.light.shape[1]] + 0.5
    return np.asarray(np.hypot(x - view.circle.x, y - view.circle.y) < view.circle.radius)


def apart(a: F64, b: F64) -> float:
    return math.degrees(math.acos(min(1.0, max(-1.0, (np.trace(a.T @ b) - 1) / 2))))


def registered(truth: Truth, lens: Lens = GUESS, **settings: object):
    return register(*views(truth, lens), RegistrationSettings(), LensSettings(**settings), Job("test"))


@pytest.fixture(scope="module")
def plain() -> Truth:
    return lens_light(room(), PHONE, 1)


def test_a_phone_that_is_a_little_off(plain: Truth) -> None:
    found = registered(plain)
    assert found.trusted
    assert apart(found.rotation, plain.rotation) < 0.3
    assert found.lens.fov == pytest.approx(196, rel=0.005)
    assert found.spread < 0.1
    assert found.gain == pytest.approx(1, abs=0.02)
    s = np.linspace(0, 1, 9)
    assert found.light_at(s) == pytest.approx(PHONE.falloff_at(s), abs=0.05)
    assert found.rotation @ found.rotation.T == pytest.approx(np.eye(3), abs=1e-9)


@pytest.mark.parametrize("misalignment", [(0.0, 0.0, 90.0), (-8.0, 7.0, 171.0), (4.0, -9.0, -100.0)])
def test_any_roll_of_the_back_shot(misalignment: tuple[float, float, float]) -> None:
    truth = lens_light(room(4), replace(PHONE, misalignment=misalignment), 2)
    found = registered(truth)
    assert found.trusted
    assert apart(found.rotation, truth.rotation) < 0.3


def test_a_map_of_a_real_room(shared_data: Path) -> None:
    room = load_environment(shared_data / "cc0/hdri_polyhaven_cc0/interior.exr")[0].pixels
    truth = lens_light(room, replace(PHONE, circle=Circle(228, 231, 210)), 1)
    found = registered(truth)
    assert found.trusted
    assert apart(found.rotation, truth.rotation) < 0.3
    assert found.lens.fov == pytest.approx(196, rel=0.005)


@pytest.mark.parametrize("seed", range(3))
def test_smooth_sky_and_soft_borders_do_not_hold_it_where_it_starts(seed: int) -> None:
    light = room(seed)
    light[:128] = np.linspace(4, 1, 128, dtype=np.float32)[:, None, None]
    phone = replace(PHONE, lens=Lens(fov=191), edge=0.015, tilt=(0.0, 20.0, 0.0))
    truth = lens_light(light, phone, 1)
    front, back = (replace(v, usable=within(v)) for v in views(truth, Lens(fov=190)))
    found = register(front, back, RegistrationSettings(), LensSettings(), Job("test"))
    assert found.trusted
    assert apart(found.rotation, truth.rotation) < 0.25


def test_reflections_of_the_frame_do_not_lead_astray() -> None:
    arcs = (Arc("front", 30, 90, 6, 1.5), Arc("front", 200, 60, 8, 2), Arc("back", 100, 80, 7, 1))
    truth = lens_light(room(5), replace(PHONE, arcs=arcs), 1)
    found = registered(truth)
    assert found.trusted
    assert apart(found.rotation, truth.rotation) < 0.3
    assert found.gain == pytest.approx(1, abs=0.03)


def test_falloff_is_told_by_what_no_reflection_covers() -> None:
    arcs = tuple(Arc("front", azimuth, 110, 9, 0.7) for azimuth in (40, 160, 280))
    phone = replace(PHONE, lens=Lens(fov=192), falloff=0.35, arcs=arcs)
    truth = lens_light(room(8), phone, 1)
    given = LensSettings()
    front, back = views(truth, Lens(fov=190))
    found = register(front, back, RegistrationSettings(), given, Job("test"))
    assert found.trusted
    through = {
        "front": replace(front, lens=found.lens, circle=found.front),
        "back": replace(back, lens=found.lens, circle=found.back),
    }
    patches = [Patch("front", (arc.azimuth - 57) % 360, 114.0, 85.0, 97.0) for arc in arcs]
    better = rebalanced(found, through, patches, given)

    def off(one: Registration) -> float:
        s = np.linspace(0.1, 0.95, 18)
        return float(np.abs(one.light_at(s) - phone.falloff_at(s)).max())

    assert off(better) < 0.05 < off(found)
    assert better.rotation is found.rotation
    unused = [replace(patch, used=False) for patch in patches]
    assert rebalanced(found, through, unused, given) is found
    assert rebalanced(replace(found, trusted=False), through, patches, given).falloff == found.falloff


def test_near_things_move_it_little() -> None:
    truth = lens_light(room(6), replace(PHONE, parallax=1.0), 1)
    found = registered(truth)
    assert found.trusted
    assert apart(found.rotation, truth.rotation) < 0.35
    assert found.lens.fov == pytest.approx(196, rel=0.005)


def test_exposure_and_white_of_the_back_lens(plain: Truth) -> None:
    front, back = views(plain)
    factors = np.array([0.5, 0.4, 0.7], np.float32)
    back = replace(back, light=back.light * factors)
    found = register(front, back, RegistrationSettings(), LensSettings(), Job("test"))
    assert found.gain == pytest.approx(1 / factors, rel=0.02)


def test_a_centre_that_was_found_badly_is_moved(plain: Truth) -> None:
    front, back = views(plain)
    off = Circle(front.circle.x + 1.5, front.circle.y - 1.0, front.circle.radius)
    found = register(replace(front, circle=off), back, RegistrationSettings(), LensSettings(), Job("test"))
    assert found.trusted
    assert found.front is not None
    assert found.back is not None

    def distance(a: Circle, b: Circle) -> float:
        return math.hypot(a.x - b.x, a.y - b.y)

    before = distance(off, front.circle)
    after = distance(found.front, front.circle) + distance(found.back, back.circle)
    assert after < before


def test_the_field_of_view_stays_where_it_is_known(plain: Truth) -> None:
    found = registered(plain, Lens(fov=196), fit_fov=False)
    assert found.lens == Lens(fov=196)
    assert apart(found.rotation, plain.rotation) < 0.3


def test_a_lens_with_its_own_curve() -> None:
    lens = Lens(KANNALA_BRANDT, 195, (-0.02, 0.002))
    truth = lens_light(room(7), replace(PHONE, lens=lens), 1)
    found = registered(truth, replace(lens, fov=190))
    assert found.trusted
    assert found.lens.coefficients == lens.coefficients
    assert apart(found.rotation, truth.rotation) < 0.3
    assert found.lens.fov == pytest.approx(195, rel=0.005)


def test_without_anything_to_see_it_is_refused(plain: Truth) -> None:
    rng = np.random.default_rng(2)
    front, back = views(plain)
    light = [np.exp(rng.normal(0, 0.02, front.light.shape)).astype(np.float32) for _ in range(2)]
    front, back = replace(front, light=light[0]), replace(back, light=light[1])
    settings = RegistrationSettings(yaw=3.0, exposure=1.0)
    found = register(front, back, settings, LensSettings(), Job("test"))
    assert not found.trusted
    assert len(found.notes) == 1
    assert found.rotation == pytest.approx(rotation_from(3.0, 0, 0))
    assert found.lens == GUESS
    assert found.gain == pytest.approx(0.5)


def test_what_cannot_be_registered_is_still_as_bright(plain: Truth) -> None:
    front, back = views(plain)
    rng = np.random.default_rng(2)
    factors = np.array([0.5, 0.4, 0.7], np.float32)
    light = [np.exp(rng.normal(0, 0.02, front.light.shape)).astype(np.float32) for _ in range(2)]
    front, back = replace(front, light=light[0]), replace(back, light=light[1] * factors)
    found = register(front, back, RegistrationSettings(), LensSettings(), Job("test"))
    assert not found.trusted
    assert found.gain == pytest.approx(1 / factors, rel=0.01)


def test_two_rooms_are_not_one(plain: Truth) -> None:
    other = lens_light(room(99), PHONE, 1)
    found = registered(replace(plain, back=other.back))
    assert not found.trusted
    assert found.notes


@pytest.mark.parametrize("lens", [Lens(fov=165), Lens(ORTHOGRAPHIC, 180)])
def test_lenses_that_do_not_overlap(plain: Truth, lens: Lens) -> None:
    found = registered(plain, lens)
    assert not found.trusted
    assert "overlap" in found.notes[0]
    assert found.lens == lens
    assert found.rotation == pytest.approx(np.diag([-1, 1, -1]))


def test_by_hand_it_is_as_it_was_set(plain: Truth) -> None:
    settings = RegistrationSettings(automatic=False, yaw=1.5, pitch=-2.0, roll=1.2)
    found = register(*views(plain, Lens(fov=196)), settings, LensSettings(), Job("test"))
    assert found.trusted
    assert found.rotation == pytest.approx(plain.rotation, abs=1e-9)
    assert found.gain == pytest.approx(1, abs=0.03)


def test_a_falloff_that_is_known_counts(plain: Truth) -> None:
    found = registered(plain, falloff=0.4)
    assert found.light_at(1.0) == pytest.approx(0.6)
    single = alone(views(plain)[0], LensSettings(falloff=0.3))
    assert single.falloff == from_loss(0.3)
    assert alone(views(plain)[0], LensSettings()).falloff == pytest.approx((0, 0, 0))


def test_it_can_be_cancelled(plain: Truth) -> None:
    job = Job("test")
    job.cancel()
    with pytest.raises(Cancelled):
        register(*views(plain), RegistrationSettings(), LensSettings(), job)
