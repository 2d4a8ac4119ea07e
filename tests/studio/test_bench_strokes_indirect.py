"""`lucarne bench strokes`, indirect light: changes are what they say, truth is known, outcomes are judged."""

from __future__ import annotations

import math

import numpy as np
import pytest
from path_rooms import furnished

from studio.bench import strokes_indirect, strokes_indirect_trials
from studio.bench.harness import Report
from studio.bench.interreflection_scenes import Setting
from studio.bench.strokes_indirect import is_told, judged, painted
from studio.bench.strokes_indirect_trials import (
    CHANGES,
    Change,
    Stage,
    apart,
    other,
    size_and_noise,
    slots_of,
)
from studio.headless import Headless
from studio_core.contract import Services
from studio_core.edits import Compound
from studio_core.scene.nodes import AreaLamp, Camera, Material
from studio_core.scene.transform import looking
from studio_core.strokes.paintable import material_roles
from studio_core.strokes.solution import Finding, Reason, Solution

LAMP = AreaLamp(
    id="lamp", intensity=6.0, width=1.0, height=0.6, transform=looking((0.8, 2.4, 0.9), (-0.5, 0, -0.5))
)
CAMERA = Camera(id="camera", transform=looking((0, 2.2, 4.5), (0, 0.8, 0)))
SHINY = Material(id="paint", name="Paint", model="phong", values={"exponent": 12.0, "specular": (0.4,) * 3})


@pytest.fixture(scope="module")
def program(host, workers):
    made = Headless(quiet=True)
    made.__dict__.update(registry=host, services=Services(workers, host))
    return made


@pytest.fixture(scope="module")
def stage(program, tmp_path_factory):
    scene = furnished((LAMP, CAMERA), SHINY)
    setting = Setting("small", scene, 1500, (), (-1, -1), (1, 1), "paint", "exponent", "lamp")
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("truths")
        patch.setattr(strokes_indirect_trials, "user_cache", lambda: folder)
        return Stage(setting, program)


@pytest.fixture
def quick(monkeypatch):
    monkeypatch.setattr(strokes_indirect_trials, "PATHS", 128)
    monkeypatch.setattr(strokes_indirect_trials, "SCREENED", 32)
    monkeypatch.setattr(strokes_indirect_trials, "BATCHES", 3)
    monkeypatch.setattr(strokes_indirect_trials, "KNOWN", 1.0)


def test_every_slot_has_a_material_of_its_own():
    scene = apart(furnished((LAMP, CAMERA), SHINY))
    slots = slots_of(scene)
    assert len(slots) == 4
    names = [scene[node].materials[slot] for node, slot in slots]
    assert len(set(names)) == len(names)
    assert scene.material(scene["box"].materials[0]).values == SHINY.values


@pytest.mark.parametrize("role", CHANGES)
@pytest.mark.parametrize("seed", range(4))
def test_one_role_of_a_material_changes(host, role, seed):
    made = other(SHINY, role, np.random.default_rng(seed), host)
    roles = material_roles(made, host)
    assert made.model == "phong"
    differs = {name for name in made.values if made.values[name] != SHINY.values.get(name)}
    assert differs == {roles[role]}


def test_what_cannot_shine_becomes_what_can_and_has_no_gloss_of_its_own(host):
    plain = Material(id="wall", name="Wall", values={"base_color": (0.7, 0.6, 0.5)})
    made = other(plain, "specular", np.random.default_rng(1), host)
    assert made.model == "specgloss"
    assert min(made.values["specular"]) > 0.2
    assert other(plain, "gloss", np.random.default_rng(1), host) is None


def test_noise_is_what_batches_do_not_have_in_common():
    rng = np.random.default_rng(2)
    signal = rng.normal(size=(400, 3))
    batches = signal + 0.5 * rng.normal(size=(4, 400, 3))
    size, noise = size_and_noise(batches)
    assert size == pytest.approx(np.sqrt((signal**2).mean()), rel=0.03)
    assert noise * size == pytest.approx(0.25, rel=0.1)


def test_a_trial_is_painted_by_paths_on_what_is_shown(stage, quick):
    one = stage.trial("diffuse", np.random.default_rng(5))
    assert one.change.role == "diffuse"
    assert (one.node, int(one.marks.slot[0])) != (one.change.node, one.change.slot)
    moved = one.marks.wanted.astype(np.float64) - one.marks.shown
    assert np.sqrt((moved**2).mean()) > 0.9 * strokes_indirect_trials.LEAST * one.marks.shown.mean()
    again = stage.trial("diffuse", np.random.default_rng(5))
    np.testing.assert_array_equal(again.marks.wanted, one.marks.wanted)


def test_strokes_have_noise_in_proportion_to_the_change(stage, quick):
    one = stage.trial("diffuse", np.random.default_rng(5))
    clean, noisy = (painted(one, "shape", noise, 3).marks.wanted for noise in (0.0, 0.3))
    change = np.sqrt(((clean - one.marks.shown) ** 2).mean())
    assert np.sqrt(((noisy - clean) ** 2).mean()) == pytest.approx(0.3 * change, rel=0.15)
    flat = painted(one, "flat", 0.0, 3)
    assert flat.flat
    assert np.ptp(flat.marks.wanted, axis=0).max() == 0


def test_the_first_finding_is_judged_and_others_are_told(program):
    change = Change("box", 0, "diffuse", Material(id="m", name="M", values={"base_color": (0.5, 0.5, 0.5)}))

    def solution(*found):
        made = tuple(
            Finding(node, 0, (), (Reason(meaning, 1.0, 0.0, {"base_color": value}, Compound("", ())),))
            for node, meaning, value in found
        )
        return Solution(Compound("", ()), made)

    right, wrong = ("box", "colour", (0.5, 0.5, 0.55)), ("side", "colour", (0.1, 0.1, 0.1))
    good, error = judged(solution(right, wrong), change, program)
    assert good
    assert error == pytest.approx(0.05 / np.sqrt(0.75))
    for other_one in (solution(wrong, right), solution(("box", "shine", 0.1)), Solution(Compound("", ()))):
        good, error = judged(other_one, change, program)
        assert not good
        assert math.isnan(error)
    assert is_told(solution(wrong, right), change)
    assert not is_told(solution(wrong), change)


def test_the_suite_has_the_cases_that_are_asked_for(stage, program, quick, monkeypatch):
    monkeypatch.setattr(strokes_indirect_trials, "stages", lambda program: [stage])
    monkeypatch.setattr(strokes_indirect, "QUICK_TRIALS", 1)
    report = Report("strokes", True, only="joint/indirect/shape/0.02/diffuse,joint/lamp/*")
    strokes_indirect.run(report, program)
    cases = {row.case for row in report.rows}
    assert cases == {"joint/indirect/shape/0.02/diffuse"}
    assert next(row.value for row in report.rows if row.metric == "right_parameter") == 1
