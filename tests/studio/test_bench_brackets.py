"""`lucarne bench capture`, case `brackets`: heaps of simulated phones, parted and counted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from studio.bench import capture_brackets
from studio.bench.harness import Report
from studio_core.imaging.resample import resize_area


@pytest.fixture(scope="module")
def room() -> np.ndarray:
    coarse = np.exp(np.random.default_rng(2).normal(0, 1, (16, 32, 3))).astype(np.float32)
    return resize_area(coarse, 128, 256)


def test_rows_tell_how_many_heaps_were_parted_rightly(room: np.ndarray) -> None:
    report = Report("capture", quick=True)
    capture_brackets.measure(report, {"room": room}, 1)
    found = {row.metric: row.value for row in report.rows}
    told_rows = {f"{kind}_{told}" for kind in ("parted", "one") for told in capture_brackets.TOLD}
    assert set(found) == told_rows | {"layout_dual", "layout_wide"}
    assert found["layout_dual"] == found["layout_wide"] == 1
    shots = capture_brackets.taken(room, 0)
    for told in capture_brackets.TOLD:
        assert found[f"parted_{told}"] == capture_brackets.parted(shots, told, 0)
        assert found[f"one_{told}"] == capture_brackets.stayed_one(shots, told, 0)
    assert found["parted_exif"] == 1


def test_a_wrong_way_to_part_them_is_counted_as_wrong(room: np.ndarray) -> None:
    shots = capture_brackets.taken(room, 0)
    swapped = replace(shots, front=(*shots.front, shots.back[0]), back=shots.back[1:])
    for told in capture_brackets.TOLD:
        assert capture_brackets.parted(shots, told, 0)
        assert not capture_brackets.parted(swapped, told, 0)
        assert not capture_brackets.stayed_one(swapped, told, 0)
