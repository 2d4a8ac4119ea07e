"""Materials in the paper's terms: known models come out as what they are, all others as something valid."""

from __future__ import annotations

import numpy as np
import pytest
from path_rooms import furnished, stand
from scenes import sky

from studio_core.contract import Services
from studio_core.parallel import Workers
from studio_core.scene.nodes import Environment, Material
from studio_core.transport.reflectance import VertexCoefficients
from studio_plugins.slf.appearance import Appearance
from studio_plugins.slf.ladder import alpha_of_exponent, level_of_alpha

SKY = Environment(id="sky", name="Sky", image=sky(), intensity=1.0)


def appearance(host, material):
    services = Services(Workers(1), host)
    scene = furnished([SKY], material)
    made = stand(scene, services, 200)
    mesh = made.surfaces.unrefined.mesh
    row = made.shapes.rows(mesh).astype(np.int64)
    found = Appearance().of(made.shapes, row, VertexCoefficients(services)(scene, made.surfaces))
    own = made.surfaces.materials.index(material.id)
    one = np.flatnonzero(mesh.material == own)[0]
    return found.diffuse[one], found.specular[one], found.level[one]


def test_matte_is_matte(host):
    values = {"base_color": (0.7, 0.4, 0.2)}
    diffuse, specular, _ = appearance(host, Material(id="paint", name="P", model="lambert", values=values))
    assert np.allclose(diffuse, (0.7, 0.4, 0.2), rtol=0.01)
    assert not specular.any()


@pytest.mark.parametrize("exponent", [8.0, 30.0, 200.0])
def test_phongs_lobe_is_found_at_its_level(host, exponent):
    values = {"diffuse": (0.3, 0.2, 0.1), "specular": (0.4, 0.4, 0.4), "exponent": exponent}
    diffuse, specular, level = appearance(host, Material(id="paint", name="P", model="phong", values=values))
    assert abs(level - level_of_alpha(alpha_of_exponent(exponent))) < 1
    assert np.allclose(diffuse, (0.3, 0.2, 0.1), atol=0.08)
    assert (specular > 0.15).all()
    assert (specular < 0.6).all()


def test_every_model_is_something_valid(host):
    for model in host.names("brdf"):
        diffuse, specular, level = appearance(host, Material(id="paint", name="P", model=model))
        assert np.isfinite([*diffuse, *specular, level]).all(), model
        assert (diffuse >= 0).all(), model
        assert (specular >= 0).all(), model
        assert (diffuse + specular <= 1 + 1e-9).all(), model
        assert 0 <= level <= 19, model
