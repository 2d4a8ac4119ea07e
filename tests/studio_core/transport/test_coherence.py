"""Points in an order in which their rays go alike."""

from __future__ import annotations

import numpy as np

from studio_core.transport.coherence import coherent


def test_points_that_face_alike_stand_together_and_neighbours_follow_each_other() -> None:
    rng = np.random.default_rng(1)
    positions = rng.random((600, 3)).astype(np.float32)
    normals = np.repeat(np.concatenate([np.eye(3), -np.eye(3)]), 100, axis=0).astype(np.float32)
    shuffled = rng.permutation(600)
    order = coherent(positions[shuffled], normals[shuffled])
    assert sorted(order) == list(range(600))
    facing = normals[shuffled][order]
    assert (np.abs(np.diff(facing, axis=0)).sum(axis=1) > 0).sum() == 5
    steps = np.linalg.norm(np.diff(positions[shuffled][order], axis=0), axis=1)
    assert steps.mean() < 0.6 * np.linalg.norm(positions[:-1] - positions[1:], axis=1).mean()


def test_no_points_have_an_order() -> None:
    nothing = np.zeros((0, 3), np.float32)
    assert len(coherent(nothing, nothing)) == 0
