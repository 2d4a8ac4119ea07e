"""Patterns laid by scripts: a size in metres, turned, one step of the history."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scenes import floor

from studio.bench.pattern_samples import marble
from studio_core.contract import Services
from studio_core.document import Document
from studio_core.errors import EditError
from studio_core.scene.geometry import Geometry, Image, Texture
from studio_core.scene.nodes import Material, MeshObject, Scene
from studio_core.scene.pattern import PatternRuler, pattern_size
from studio_core.scripting import Names
from studio_core.session import Session


@pytest.fixture
def names(host, workers):
    mesh = floor()
    mesh = Geometry(mesh.positions, mesh.faces, uvs=0.25 * mesh.positions[:, [0, 2]])
    picture = Texture(Image(np.zeros((2, 4, 3), np.float32)))
    oak = Material(id="oak", name="Oak", textures={"base_color": picture})
    scene = Scene().with_materials(oak, Material(id="plain", name="Plain"))
    scene = scene.with_nodes(MeshObject(id="floor", name="Floor", geometry=mesh, materials=("oak",)))
    return Names(Document(scene), Session(), host, lambda: Services(workers, host))


def size_of(names):
    lengths = PatternRuler().lengths(names.scene, "oak")
    return pattern_size(names.material("Oak").textures["base_color"], lengths)


def test_a_pattern_gets_a_size_in_metres(names):
    assert size_of(names) == pytest.approx((4, 4))
    names.lay_pattern("Oak", size=0.5)
    assert size_of(names) == pytest.approx((0.5, 0.5))
    names.lay_pattern("Oak", size=(0.2, 1.2), turned=30)
    assert size_of(names) == pytest.approx((0.2, 1.2))
    assert names.material("Oak").textures["base_color"].rotation == 30
    assert len(names._document.history) == 3
    names.undo(2)
    assert size_of(names) == pytest.approx((4, 4))


def test_what_cannot_be_laid_is_said(names):
    with pytest.raises(EditError, match="has no pictures"):
        names.lay_pattern("Plain", size=1.0)
    with pytest.raises(EditError, match="cannot be"):
        names.lay_pattern("Oak", size=(0.5, -1.0))
    oak = names.material("Oak")
    flat = dataclasses.replace(oak.textures["base_color"], scale=(0.0, 1.0))
    names.apply(names.namespace["SetTexture"]("oak", "base_color", flat))
    with pytest.raises(EditError, match="cannot be"):
        names.lay_pattern("Oak", size=0.5)


def test_a_pattern_is_grown(names):
    sample = Image(marble(40))
    textures = {"base_color": Texture(sample), "roughness": Texture(sample, (2.0, 2.0))}
    names.apply(names.namespace["SetTexture"]("oak", "base_color", textures["base_color"]))
    names.apply(names.namespace["SetTexture"]("oak", "roughness", textures["roughness"]))
    names.grow_pattern("Oak", times=1.5)
    made = names.material("Oak").textures
    assert {one.image.pixels.shape for one in made.values()} == {(60, 60, 3)}
    assert made["base_color"].scale == pytest.approx((2 / 3, 2 / 3))
    assert made["roughness"].scale == pytest.approx((4 / 3, 4 / 3))
    assert len(names._document.history) == 4
    with pytest.raises(EditError, match="no pictures"):
        names.grow_pattern("Plain")


def test_what_has_no_coordinates_gets_some(names):
    mesh = names.find("Floor").geometry
    bare = Geometry(mesh.positions, mesh.faces)
    names.apply(names.namespace["SetGeometry"]("floor", bare))
    assert names.unwrap("Floor") == 1
    assert size_of(names) == pytest.approx((1, 1), rel=1e-3)
    assert names.unwrap("Floor") == 0
    assert len(names._document.history) == 3
