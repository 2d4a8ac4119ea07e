"""Counting of found reflections: what an arc is, what is right, and rows of a few captures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from capture_rooms import room

from studio.bench import capture_removal
from studio.bench.capture_removal import Tally, add, arcs_of, turned
from studio.bench.harness import Report
from studio.bench.phone import Arc, Phone, lens_light
from studio_core.capturing.settings import BACK, FRONT
from studio_core.imaging.projection import Circle, Lens
from studio_core.shading.job import Job

PHONE = Phone(size=(300, 300), lens=Lens(fov=194.0), circle=Circle(151.0, 148.0, 130.0), samples=1)
ARCS = (Arc(FRONT, 350.0, 40.0, 5.0, 1.4), Arc(FRONT, 120.0, 60.0, 6.0, 0.45))


def test_arcs_are_what_is_seen():
    truth = lens_light(room(), replace(PHONE, arcs=ARCS), 0)
    found, rim = arcs_of(truth.front, truth.phone)
    assert rim.shape == (720,)
    assert len(found) == 2
    strong, weak = sorted(found, key=lambda arc: -arc[1])
    assert strong[1] == pytest.approx(1.4, abs=0.3)
    assert weak[1] == pytest.approx(0.45, abs=0.2)
    assert 35 < len(strong[0]) / 2 < 47
    assert {0, 719} <= set(strong[0].tolist())
    assert arcs_of(truth.back, truth.phone)[0] == []


def test_what_is_found_is_counted_and_what_is_left():
    truth, tally = lens_light(room(), replace(PHONE, arcs=ARCS), 0), Tally()
    add(tally, truth, 0, "room")
    rows = tally.rows()
    assert (tally.strong, tally.weak, tally.searched) == (1, 1, 1)
    assert rows["reflection_recall"] == 1
    assert rows["reflection_precision"] == 1
    assert rows["clean_touched"] == 0
    assert rows["stops_left"] < 0.5 * rows["stops_before"]


def test_what_is_missed_or_wrong_is_counted(monkeypatch):
    from studio_plugins.capture import reflections

    truth, tally = lens_light(room(), replace(PHONE, arcs=ARCS), 0), Tally()
    wrong = capture_removal.Patch(BACK, 100.0, 30.0, 90.0, 97.0, found=True)
    monkeypatch.setattr(reflections, "find_reflections", lambda *_: (wrong,))
    add(tally, truth, 0, "room")
    rows = tally.rows()
    assert rows["reflection_recall"] == rows["reflection_precision"] == 0
    assert rows["clean_touched"] == 1
    assert np.isnan(rows["stops_left"])
    assert len(tally.missed) == 1
    assert len(tally.wrong) == 2


def test_rows_of_a_case():
    report = Report("capture", True)
    tally = capture_removal.measure(report, Job("x"), {"room": room()}, 2, radius=80.0)
    assert tally.searched == 2
    rows = {row.metric: row.value for row in report.rows}
    assert rows["captures"] == 2
    assert {row.case for row in report.rows} == {"reflections-known-stand"}
    assert {"reflection_recall", "reflection_precision", "clean_touched", "stops_left"} <= set(rows)


def test_rooms_are_turned_not_changed():
    light = room(1)
    made = [turned(light, seed) for seed in range(4)]
    for one in made:
        np.testing.assert_array_equal(np.sort(one, axis=1), np.sort(light, axis=1))
    assert not np.array_equal(made[0], made[1])
