"""What elements make of the sky: once each, until its light is another."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from path_rooms import furnished, stand
from scenes import sky

from studio_core.contract import Services
from studio_core.parallel import Workers
from studio_core.scene.nodes import Environment, Light
from studio_plugins.slf.preconvolved import Preconvolved
from studio_plugins.slf.series import convolve, half_kernels, half_level, light_of, matte_of
from studio_plugins.slf.whole import CHUNK, Whole

SKY = Environment(id="sky", name="Sky", image=sky(), intensity=1.0)
COUNT = 5 * CHUNK + 3


@pytest.fixture(scope="module")
def room(host):
    scene, services = furnished([SKY]), Services(Workers(2), host)
    return scene, stand(scene, services, 1500), services


def followed(whole, room, gain=1.0):
    scene, made, _ = room
    lights = {
        light.id: dataclasses.replace(light, intensity=gain)
        for light in scene.of(Light)
        if scene.shown(light.id)
    }
    everything = np.ones(len(made.surfaces.unrefined.mesh), np.bool_)
    whole.update(made.surfaces, made.casters, made.lighting, lights, everything)


def test_each_is_made_once_and_says_what_the_series_say(room):
    whole, light = Whole(room[2].workers, COUNT), Preconvolved(room[2].workers)
    followed(whole, room)
    count = len(whole.elements)
    own = np.zeros((count, 2, 3))
    own[:, 0, 0], own[CHUNK : 2 * CHUNK, 1] = 0.5, (0.0, 0.3, 12.0)
    some = np.zeros(count, np.bool_)
    some[: 3 * CHUNK] = True
    assert light.update(whole, own, some) == 3 * CHUNK
    assert light.update(whole, own, some) == 0
    assert light.update(whole, own, np.ones(count, np.bool_)) == count - 3 * CHUNK
    series = whole.incident(whole.dark(), 0, count)
    np.testing.assert_allclose(light.matte, matte_of(series), rtol=1e-5, atol=1e-7)
    there = series[CHUNK : 2 * CHUNK]
    sent = np.empty_like(there)
    convolve(there, half_kernels(), half_level(np.full(CHUNK, 12.0)), sent)
    wanted = np.maximum(light_of(sent), 0)
    np.testing.assert_allclose(light.sent(1, CHUNK, 2 * CHUNK), wanted, rtol=1e-3, atol=1e-4 * wanted.max())
    followed(whole, room)
    assert light.update(whole, own, some) == 0
    assert light.update(whole, 2 * own, some) == 3 * CHUNK


def test_other_light_makes_all_anew(room):
    whole, light = Whole(room[2].workers, COUNT), Preconvolved(room[2].workers)
    followed(whole, room)
    own = np.zeros((len(whole.elements), 1, 3))
    every = np.ones(len(own), np.bool_)
    light.update(whole, own, every)
    before = light.matte
    followed(whole, room, gain=2.0)
    assert light.update(whole, own, every) == len(own)
    np.testing.assert_allclose(light.matte, 2 * before, rtol=2e-3, atol=1e-6)
