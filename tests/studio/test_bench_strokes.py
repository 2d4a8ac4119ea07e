"""`lucarne bench strokes`: trials are what they say, and outcomes are judged as they should be."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scenes import little_scene

from studio.bench import strokes, strokes_recovery, strokes_trials
from studio.bench.harness import Report
from studio.bench.strokes_recovery import Tally, case_name, judged, offered, painted, relative, wish
from studio.bench.strokes_trials import (
    MATERIAL,
    NAMES,
    PARAMETERS,
    base_values,
    changed,
    lit_by,
    pixels_of,
    trial,
)
from studio.headless import Headless
from studio_core.edits import Compound
from studio_core.scene.nodes import AreaLamp, Light
from studio_core.strokes.solution import Finding, Reason, Solution

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def program(host, workers):
    from studio_core.contract import Services

    made = Headless(quiet=True)
    made.__dict__.update(registry=host, services=Services(workers, host))
    return made


@pytest.fixture(scope="module")
def one(program):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(strokes_trials, "QUALITY", {"directions": "1024", "vertices": "1500"})
        patch.setattr(strokes_trials, "WIDTH", 96)
        patch.setattr(strokes_trials, "HEIGHT", 64)
        made = trial(little_scene(), 2, np.random.default_rng(3), program)
    assert made is not None
    return made


@pytest.mark.parametrize("parameter", PARAMETERS)
@pytest.mark.parametrize("seed", range(8))
def test_what_is_changed_is_what_is_named(parameter, seed):
    rng = np.random.default_rng(seed)
    before = base_values(rng)
    after, roles = changed(before, parameter, rng)
    assert {role for role in NAMES if before[NAMES[role]] != after[NAMES[role]]} == roles
    assert len(roles) == {"none": 0, "mixed": 2}.get(parameter, 1)
    for role in roles:
        assert relative(after[NAMES[role]], before[NAMES[role]]) > 0.25
    assert 0 < np.min(after["specular"]) <= np.max(after["specular"]) < 1
    assert 0.1 < after["roughness"] < 1


def test_lights_are_the_map_or_two_lamps():
    day, evening = (lit_by(little_scene(), light, 2.0) for light in ("environment", "lamp"))
    assert [light.id for light in day.of(Light) if day.shown(light.id)] == ["sky"]
    assert all(isinstance(light, AreaLamp) for light in evening.of(Light) if evening.shown(light.id))
    assert len([light for light in evening.of(Light) if evening.shown(light.id)]) == 2


def test_a_trial_shows_the_change_and_nothing_else(one):
    assert one.scene[one.node].materials[one.slot] == MATERIAL
    assert len(one.before) == len(one.after["diffuse"]) == 2
    own = pixels_of(one.before[0], one.node, one.slot)
    assert own.mean() > 0.05
    assert (one.before[0].node[own] == one.before[0].nodes.index(one.node)).all()
    for parameter in PARAMETERS:
        differs = np.abs(one.after[parameter][0].linear - one.before[0].linear).max(axis=2) > 1e-6
        assert differs[own].any() == (parameter != "none")
        assert not differs[one.before[0].coverage == 0].any()


def test_strokes_show_the_picture_its_mean_or_its_clipped_light(one):
    before, after = one.before[0], one.after["diffuse"][0]
    mask = pixels_of(before, one.node, one.slot).astype(np.float32)
    under = mask > 0
    assert np.array_equal(wish(before, after, mask, "shape"), after.linear)
    flat = wish(before, after, mask, "flat")[under]
    np.testing.assert_allclose(flat, np.broadcast_to(after.linear[under].mean(axis=0), flat.shape), rtol=1e-4)
    cut = wish(before, after, mask, "clipped")[under]
    assert 0.2 < (cut < after.linear[under]).any(axis=1).mean() <= 0.9
    assert (cut <= after.linear[under]).all()


def test_noise_is_the_same_each_time_and_as_large_as_it_says(one):
    clean, noisy, again = (painted(one, "shape", noise, "diffuse", 7) for noise in (0.0, 0.1, 0.1))
    assert [stroke.together for stroke in noisy] == [False, True]
    assert noisy[0].table.key == again[0].table.key
    ratio = noisy[0].marks.wanted / clean[0].marks.wanted
    assert ratio.std() == pytest.approx(0.1, rel=0.2)
    assert painted(one, "flat", 0.02, "diffuse", 7)[0].flat


def solution(one, meaning, values):
    reason = Reason(meaning, 1.0, 0.0, values, Compound("", ()))
    return Solution(Compound("", ()), (Finding(one.node, one.slot, (), (reason,)),))


def test_outcomes_are_judged_by_the_first_reason(one):
    truth = one.truth["diffuse"][0]
    assert judged(solution(one, "colour", truth), one, "diffuse") == (True, 0.0)
    assert judged(solution(one, "shine", truth), one, "diffuse")[0] is False
    assert judged(solution(one, "colour and shine", truth), one, "diffuse")[0] is False
    far = {**truth, "diffuse": tuple(1.1 * c for c in truth["diffuse"])}
    assert judged(solution(one, "colour", far), one, "diffuse")[1] == pytest.approx(0.1)
    assert judged(solution(one, "", truth), one, "none")[0] is True
    assert judged(Solution(Compound("", ())), one, "none")[0] is True
    assert judged(Solution(Compound("", ())), one, "gloss")[0] is False
    both = (
        solution(one, "shine", truth).findings[0].reasons + solution(one, "colour", truth).findings[0].reasons
    )
    told = Solution(Compound("", ()), (Finding(one.node, one.slot, (), both),))
    assert judged(told, one, "diffuse")[0] is False
    assert [offered(told, one, name) for name in ("diffuse", "specular", "gloss", "none")] == [
        True,
        True,
        False,
        False,
    ]
    assert offered(Solution(Compound("", ())), one, "none")


def test_rows_are_shares_and_medians():
    tally, report = Tally(), Report("strokes", True)
    for outcome in ((True, 0.1), (True, 0.3), (True, 0.2), (False, math.nan)):
        tally.add(outcome, True)
    tally.tell(report, "case")
    told = {row.metric: row for row in report.rows}
    assert told["right_parameter"].value == 0.75
    assert told["offered"].value == 1
    assert told["right_parameter"].spread == pytest.approx(math.sqrt(0.75 * 0.25 / 4))
    assert told["value_error"].value == pytest.approx(0.2)


def test_the_suite_has_the_cases_that_are_asked_for(one, program, monkeypatch):
    monkeypatch.setattr(strokes_recovery, "trials", lambda light, count, program: [one])
    report = Report("strokes", True, only="joint/environment/shape/0.02/*,none/*")
    strokes.run(report, program)
    cases = {row.case for row in report.rows if row.metric == "right_parameter"}
    assert cases == {case_name("joint", "environment", "shape", 0.02, name) for name in PARAMETERS}
    by_case = {row.case: row.value for row in report.rows if row.metric == "right_parameter"}
    assert by_case["joint/environment/shape/0.02/none"] == 1
    assert by_case["joint/environment/shape/0.02/diffuse"] == 1


def test_the_benchmarks_page_tells_of_the_metrics():
    text = (ROOT / "benchmarks" / "README.md").read_text()
    for word in ("right_parameter", "value_error", "bench strokes"):
        assert word in text
