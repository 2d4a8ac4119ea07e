"""Light lost towards the edge, and gain, from the overlap: shapes not assumed, and what misleads."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio.bench.phone import Arc, Phone, lens_light
from studio_core.capturing.artifacts import F32, F64, Registration, light_at
from studio_core.capturing.standing import HALF_TURN
from studio_core.imaging.projection import Circle, Lens
from studio_plugins.capture.falloff import Balance, balanced, from_loss
from studio_plugins.capture.overlap import Stand, unroll

Shape = Callable[[float, F64], F64]
FAMILIES: dict[str, Shape] = {
    "cosine": lambda loss, s: np.cos(s * math.acos((1 - loss) ** 0.25)) ** 4,
    "square": lambda loss, s: 1 - loss * s**2,
    "mixed": lambda loss, s: 1 - loss * (0.5 * s**2 + 0.5 * s**4),
    "sixth": lambda loss, s: 1 - loss * s**6,
    "frame": lambda loss, s: 1 - loss / (1 + np.exp((0.93 - s) / 0.03)),
}


@dataclass(frozen=True)
class Shaped(Phone):
    """A phone with another shape of falloff."""

    shape: str = "mixed"

    def falloff_at(self, s: F64) -> F64:
        return np.asarray(FAMILIES[self.shape](self.falloff, np.clip(s, 0, 1.1)), np.float64)


PHONE = Shaped(
    size=(460, 460), lens=Lens(fov=195), circle=Circle(228, 231, 210), misalignment=(1.5, -2, 1.2), samples=1
)


def room() -> F32:
    """Soft light from all around, everywhere different."""
    v, u = np.mgrid[0:128, 0:256] / 128
    light = 1.5 + np.sin(5 * np.pi * u) * np.cos(3 * v) + 0.4 * np.sin(11 * np.pi * u + 7 * v)
    return np.repeat(light[..., None], 3, axis=2).astype(np.float32)


def found(phone: Phone, loss: float | None = None, factor: float = 1.0, clip: float = 0.0) -> Balance | None:
    truth = lens_light(room(), phone, 1)
    strips = []
    rng = np.random.default_rng(0)
    for side in ("front", "back"):
        view = truth.view(side)
        light = view.light * np.exp(rng.normal(0, 0.01, view.light.shape)).astype(np.float32)
        if side == "back":
            light = light * np.float32(factor)
        clipped = light.max(axis=2) > clip if clip else None
        if clip:
            light = np.minimum(light, np.float32(clip))
        view = replace(view, light=light, clipped=clipped)
        strips.append(unroll(view, side == "back", math.radians(70), 2.2))
    return balanced(strips[0], strips[1], Stand(truth.rotation @ HALF_TURN, phone.lens.fov), loss)


@pytest.mark.parametrize("shape", FAMILIES)
@pytest.mark.parametrize("loss", [0.1, 0.5])
def test_shapes_that_were_not_assumed(shape: str, loss: float) -> None:
    balance = found(replace(PHONE, falloff=loss, shape=shape))
    assert balance is not None
    s = np.linspace(0, 0.95, 39)
    wanted = FAMILIES[shape](loss, s)
    ratio = light_at(balance.falloff, balance.rim, s) / wanted
    assert ratio.max() / ratio.min() < 1.04 + 0.1 * loss  # where light comes from is hardly changed
    uncorrected = wanted.max() / wanted.min()
    assert ratio.max() / ratio.min() < 1 + 0.75 * (uncorrected - 1)
    assert balance.gain == pytest.approx(1, abs=0.01)
    assert (balance.rim[0] > 0.3 * loss) == (shape == "frame")


def test_the_back_lens_is_darker() -> None:
    balance = found(replace(PHONE, falloff=0.3), factor=0.4)
    assert balance is not None
    assert balance.gain == pytest.approx(2.5, rel=0.01)
    assert balance.loss == pytest.approx(0.3, abs=0.05)


def test_light_that_no_exposure_resolved_does_not_count() -> None:
    free = found(replace(PHONE, falloff=0.3))
    clipped = found(replace(PHONE, falloff=0.3), clip=1.5)
    assert free is not None
    assert clipped is not None
    assert clipped.loss == pytest.approx(free.loss, abs=0.04)


def test_reflections_of_the_frame_are_no_falloff() -> None:
    arcs = (Arc("front", 40, 70, 6, 1.5), Arc("back", 250, 60, 5, 1.0))
    balance = found(replace(PHONE, falloff=0.2, arcs=arcs))
    assert balance is not None
    assert balance.loss == pytest.approx(0.2, abs=0.08)
    assert balance.gain == pytest.approx(1, abs=0.02)


def test_a_loss_that_is_known_is_kept() -> None:
    balance = found(replace(PHONE, falloff=0.3), loss=0.3, factor=2.0)
    assert balance is not None
    assert balance.falloff == from_loss(0.3)
    assert balance.gain == pytest.approx(0.5, rel=0.01)


def test_without_an_overlap_nothing_is_said() -> None:
    assert found(replace(PHONE, lens=Lens(fov=170))) is None


@given(st.floats(0, 0.8), st.floats(0, 0.9), st.floats(0.85, 1), st.floats(0.008, 0.06), st.floats(0, 5))
def test_light_falls_from_the_axis_and_never_to_nothing(
    loss: float, share: float, at: float, width: float, s: float
) -> None:
    one = Registration(np.eye(3), Lens(), np.ones(3), from_loss(loss), 0, 0, True, rim=(share, at, width))
    light = one.light_at([0.0, s, s + 0.01])
    assert 0.02 <= light[2] <= light[1] + 1e-12 <= light[0] + 2e-12 <= 1 + 3e-12
    assert 0 <= one.loss <= 0.98
