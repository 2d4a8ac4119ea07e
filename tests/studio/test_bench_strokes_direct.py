"""Parts of one stroke: timed while they are asked for, and left as they were."""

from __future__ import annotations

import numpy as np
from plugins.slf.strokes import MODEL, painted, reflectance

from studio.bench.strokes_direct import PARTS, parts
from studio_plugins.slf import explaining


def test_parts_are_timed_and_left_as_they_were():
    originals = [getattr(owner, attribute) for owner, attribute in PARTS.values()]
    now = reflectance((0.5, 0.3, 0.2), (0.1, 0.1, 0.1), 8)
    samples = painted(np.random.default_rng(0), now, now)
    with parts() as spent:
        explaining.decide(samples, MODEL, now)
    assert spent["decision"] > 0
    assert not any(spent[name] for name in PARTS if name != "decision")
    assert [getattr(owner, attribute) for owner, attribute in PARTS.values()] == originals
