"""A model's own numbers in the paper's terms and back: what an element was told is what its material gets."""

from __future__ import annotations

import numpy as np
import pytest

from studio_core.scene.nodes import Material
from studio_plugins.slf.dressed import Dressed
from studio_plugins.slf.ladder import LEVELS
from studio_plugins.slf.retold import Albedos, Numbers, Retold

COUNT = 40
GLAZE = {"diffuse": (0.4, 0.3, 0.2), "specular": (0.1, 0.1, 0.1), "roughness": 0.4}
MODELS = {
    "specgloss": GLAZE,
    "phong": {"diffuse": (0.3, 0.3, 0.3), "specular": (0.2, 0.2, 0.2), "exponent": 20.0},
    "lambert": {"base_color": (0.5, 0.4, 0.3)},
}


def retold(host, model):
    dressed = Dressed.of(Material(id="m", name="M", model=model, values=MODELS[model]), host)
    return dressed, Retold(dressed)


def numbers(rng, dressed):
    shine = rng.uniform(0.02, 0.4, (COUNT, 3)) if "specular" in dressed.roles else np.zeros((COUNT, 3))
    level = rng.uniform(3, LEVELS - 4, COUNT) if "gloss" in dressed.roles else np.zeros(COUNT)
    return Numbers(rng.uniform(0.05, 0.5, (COUNT, 3)), shine, level)


@pytest.mark.parametrize("model", [*MODELS])
def test_what_is_told_is_read_back(host, model):
    dressed, one = retold(host, model)
    rng = np.random.default_rng(0)
    now = numbers(rng, dressed)
    then = Numbers(*(getattr(numbers(rng, dressed), name) for name in ("diffuse", "specular")), now.level)
    wanted = one.albedos(then)
    moved = np.ones((COUNT, 3), np.bool_) * ["diffuse" in dressed.roles, "specular" in dressed.roles, False]
    made = one.numbers(now, one.albedos(now), Albedos(wanted.reflectance, one.albedos(now).nearest), moved)
    np.testing.assert_allclose(made.diffuse, then.diffuse, rtol=0.02)
    np.testing.assert_allclose(made.specular, then.specular, rtol=0.03)
    assert np.array_equal(made.level, now.level)


def test_what_did_not_move_stays_to_the_last_bit(host):
    dressed, one = retold(host, "specgloss")
    now = numbers(np.random.default_rng(1), dressed)
    before = one.albedos(now)
    other = Albedos(0.5 * before.reflectance, before.nearest + 3.0)
    made = one.numbers(now, before, other, np.zeros((COUNT, 3), np.bool_))
    assert all(np.array_equal(getattr(made, n), getattr(now, n)) for n in ("diffuse", "specular", "level"))
    assert one.changes(now, made) == {}


def test_sharper_lobes_are_a_sharper_gloss(host):
    dressed, one = retold(host, "specgloss")
    now = numbers(np.random.default_rng(2), dressed)
    before = one.albedos(now)
    moved = np.zeros((COUNT, 3), np.bool_)
    moved[:, 2] = True
    made = one.numbers(now, before, Albedos(before.reflectance, before.nearest + 2.0), moved)
    np.testing.assert_allclose(one.albedos(made).level - before.level, 2, atol=0.4)
    change = one.changes(now, made)
    assert [*change] == ["roughness"]
    assert (change["roughness"] < 0).all()


def test_paint_that_lies_on_it_counts(host):
    _, one = retold(host, "specgloss")
    uvs = np.zeros((2, 2), np.float32)
    changes = {
        "diffuse": np.array([[0.1, 0, 0], [0.9, 0, 0]], np.float32),
        "roughness": np.float32([[0.1], [0]]),
    }
    made = one.now(uvs, changes)
    np.testing.assert_allclose(made.diffuse, [[0.5, 0.3, 0.2], [1.0, 0.3, 0.2]], atol=1e-6)
    np.testing.assert_allclose(made.specular, 0.1)
    assert made.level[0] < made.level[1]
