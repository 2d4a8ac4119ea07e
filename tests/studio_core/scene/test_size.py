"""Sizes of imported models, and the question about absurd ones."""

from __future__ import annotations

import numpy as np
import pytest

from studio_core.contract import ImportedModel
from studio_core.scene.geometry import Geometry
from studio_core.scene.nodes import Group, MeshObject
from studio_core.scene.size import model_size, suspicious_size
from studio_core.scene.transform import Transform, axis_angle


def model(width: float, height: float, depth: float, scale: float = 1.0) -> ImportedModel:
    """A triangle that fills the box, under a turned and scaled group."""
    positions = np.array([[0, 0, 0], [width, height, 0], [0, 0, depth]], np.float32)
    group = Group(id="g", transform=Transform((5, 6, 7), axis_angle((0, 1, 0), 90), scale))
    mesh = MeshObject(
        id="m", parent="g", geometry=Geometry(positions, np.array([[0, 1, 2]], np.uint32)), materials=("x",)
    )
    return ImportedModel((group, mesh), ())


def test_sizes_are_taken_where_the_parts_stand() -> None:
    assert model_size(model(1, 2, 3, 10)) == pytest.approx((30, 10, 20))  # the turn swaps width and depth
    assert model_size(ImportedModel((), ())) == (0, 0, 0)


def test_only_absurd_sizes_are_asked_about() -> None:
    assert suspicious_size(model(1, 2, 3)) is None
    assert suspicious_size(ImportedModel((), ())) is None
    asked = suspicious_size(model(75, 85, 167))
    assert asked is not None
    assert "167 × 75 × 85 m (width × depth × height)" in asked
    assert "centimetres" in asked
    assert "millimetres" in (suspicious_size(model(1670, 850, 750)) or "")
    assert "which unit" in (suspicious_size(model(0.001, 0.002, 0.003)) or "")
