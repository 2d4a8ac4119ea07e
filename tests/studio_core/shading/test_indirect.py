"""Light between surfaces over a backend: by any method, over edits, rounds and cancelled work."""

from __future__ import annotations

import dataclasses
import gc
import weakref

import numpy as np
import pytest
from bouncing import Bounce, BounceParams, BouncingHost
from counting_stages import StoppingJob
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import little_scene as make_little_scene

from studio_core import edits
from studio_core.colour import LUMINANCE
from studio_core.contract import Services
from studio_core.document import Document
from studio_core.errors import Cancelled, InputError, PluginError
from studio_core.false_colour import linear_colours
from studio_core.raster import PictureStage
from studio_core.scene.diff import Aspect, Changes, view_changed
from studio_core.scene.nodes import PointLamp
from studio_core.scene.transform import Transform, looking
from studio_core.session import ALL, DIRECT, INDIRECT, SHARE
from studio_core.shading.artifacts import (
    DirectRadiance,
    Hits,
    Indirect,
    LayerRadiance,
    Radiance,
    Receivers,
    Surfaces,
)
from studio_core.shading.frame import Frame, IndirectChoice
from studio_core.shading.indirect import IndirectStage, with_indirect
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params, indirect_choice, picture, scene_view
from studio_core.shading.pipeline import Pipeline
from studio_core.shading.primary import visible_vertices
from studio_core.shading.refinement import Adaptive
from studio_core.shading.stages import common_stages

LAMP = PointLamp(id="lamp", name="Lamp", intensity=4.0, transform=Transform((1.5, 2.0, 1.5)))
GOAL = Adaptive(target=0.005, extra=2000, rounds=2)
MOVE = edits.Move({"cube": Transform((0.4, 0.7, 0.1))})


class Lit:
    """A document seen through the brute-force backend, with light between surfaces."""

    def __init__(self, host, workers, scene=None, goal=None, choice=None, **values):
        self.bounce, self.other = Bounce(), Bounce()
        self.host = BouncingHost(host, {"bounce": self.bounce, "other": self.other})
        self.services = Services(workers, self.host)
        self.document = Document(scene or make_little_scene().with_nodes(LAMP))
        self.view = dataclasses.replace(scene_view(self.document.scene, None, 40, 30), antialias=1)
        backend = host.get("backend", "reference")
        self.params = backend_params(
            backend, {"directions": "1024", "vertices": 600, "lamp_samples": 4, **values}
        )
        self.choice, self.light = choice or IndirectChoice("bounce", BounceParams()), ALL
        plain = backend.stages(self.services)
        if goal is not None:
            plain = [
                *common_stages(self.services, lambda _: goal),
                *plain[len(common_stages(self.services)) :],
            ]
        self.pipeline = Pipeline([*with_indirect(plain, self.services), PictureStage(self.services)])
        self.pending, self.heard = Changes(), []
        self.document.changed.connect(self._changed)

    def _changed(self, before, after, changes):
        self.pending |= changes

    def look(self, edit=None, job=None, moving=False):
        if edit is not None:
            self.document.apply(edit)
        changes, self.pending, self.heard = self.pending, Changes(), []
        frame = Frame(
            self.document.scene, self.view, self.params, 1, moving, indirect=self.choice, light=self.light
        )
        job = job or Job("test", on_publish=self.heard.append)
        return self.pipeline.update(frame, changes, job)

    def choose(self, choice="same", light=None):
        self.choice = self.choice if choice == "same" else choice
        self.light = light or self.light
        self.pending |= view_changed(Aspect.INDIRECT)

    def made(self, kind):
        return self.pipeline.artifact(kind)

    def ran(self):
        return {run.name for run in self.pipeline.report if run.ran and not run.round}

    def check(self, level=0.5):
        """Light is as the method says at every vertex, on refined meshes too: there it is linear."""
        radiance, mesh = self.made(Radiance), self.made(Radiance).surfaces.mesh
        gains = sum(np.asarray(light.gain()) for light in (self.document.scene[n] for n in ("sky", "lamp")))
        height = 1 + mesh.positions[:, 1] + mesh.origin[1]
        seen = np.flatnonzero(visible_vertices(radiance.surfaces, self.made(Hits)))
        expected = level * height[seen, None] * gains
        np.testing.assert_allclose(radiance.indirect.irradiance[seen], np.pi * expected, rtol=1e-5)
        for term in range(radiance.width):
            np.testing.assert_allclose(radiance.indirect.terms[seen, term], expected, rtol=1e-5)
        assert np.isfinite(radiance.indirect.terms[radiance.valid]).all()


@pytest.fixture
def lit(host, workers):
    return lambda *args, **named: Lit(host, workers, *args, **named)


def tiers(count, published=False):
    return IndirectChoice("bounce", BounceParams(tiers=count, published=published))


def test_without_a_method_nothing_is_done(lit) -> None:
    one = lit()
    one.choose(None)
    one.look()
    assert one.made(Indirect) is None
    assert one.made(Radiance) is one.made(DirectRadiance)
    assert not one.bounce.made


def test_the_layer_is_added_to_light_from_lamps_and_sky(lit) -> None:
    one = lit()
    shown = one.look()
    one.check()
    radiance, direct = one.made(Radiance), one.made(DirectRadiance)
    assert radiance.layers is direct.layers
    assert radiance.final
    assert radiance.facts == {"bytes": 1000.0}
    assert radiance.counts["indirect_rays"] == 16
    one.choose(None)
    assert (shown.linear >= one.look().linear - 1e-6).all()
    assert shown.linear.mean() > 1.2 * one.made(PictureStage.gives).linear.mean()


def test_edits_reach_the_method_and_what_stayed_is_kept(lit) -> None:
    one = lit()
    one.look()
    even, bounce = one.bounce.made[0]
    before = one.made(Indirect)
    one.look(edits.SetMaterial("matt", {"base_color": (0.9, 0.1, 0.1)}))
    assert one.made(Indirect) is before
    assert (even.runs, bounce.runs) == (1, 1)
    one.look(edits.SetFields("lamp", {"intensity": 9.0}))
    assert (even.runs, bounce.runs) == (2, 2)
    one.check()
    assert "DirectStage" not in one.ran()
    one.look(MOVE)
    one.check()
    one.document.undo()
    one.look()
    one.check()
    assert even.runs == 2
    one.choose(IndirectChoice("bounce", BounceParams(level=0.25)))
    one.look()
    one.check(0.25)
    assert one.ran() == {"IndirectStage", "CombineStage", "PictureStage"}


def test_a_looking_eye_asks_for_what_it_sees(lit) -> None:
    one = lit()
    one.look()
    for eye in ((-2.0, 1.5, 3.0), (0.5, 3.0, -2.0)):
        one.view = dataclasses.replace(one.view, transform=looking(eye, (0.0, 0.3, 0.0)))
        one.pending |= view_changed()
        one.look()
        surfaces = one.made(Surfaces)
        np.testing.assert_array_equal(
            one.bounce.made[0][1].seen[-1], visible_vertices(surfaces, one.made(Hits))
        )
        one.check()
    everywhere = lit(everywhere=True)
    everywhere.look()
    assert everywhere.made(Indirect).valid.all()


def test_refined_meshes_get_what_lies_between_their_corners(lit) -> None:
    one = lit(goal=GOAL)
    one.look()
    surfaces = one.made(Surfaces)
    assert len(surfaces.mesh) > len(surfaces.unrefined.mesh)
    assert one.made(Indirect).surfaces is surfaces.unrefined
    one.check()
    seen = one.bounce.made[0][1].seen
    assert all(mask is seen[0] for mask in seen)  # the same receivers in every round
    assert one.bounce.made[0][1].runs == 1
    one.look(MOVE)
    one.check()


def test_a_vertex_between_one_that_is_known_and_one_that_is_not_takes_what_is_known(lit) -> None:
    one = lit(goal=GOAL)
    one.look()
    made, to = one.made(Indirect), one.made(DirectRadiance)
    layer = LayerRadiance(np.ones_like(made.layer.terms), np.ones_like(made.layer.irradiance))
    lone = np.zeros_like(made.valid)
    lone[np.flatnonzero(made.valid)[::3]] = True
    lift = one.pipeline.stages[-2]._lift
    terms = lift(dataclasses.replace(made, layer=layer, valid=lone), to).terms
    assert set(np.unique(terms)) == {0.0, 1.0}
    assert terms[:, 0, 0].sum() > lone.sum()
    with pytest.raises(ValueError, match="other meshes"):
        lift(dataclasses.replace(made, surfaces=to.surfaces), dataclasses.replace(to, surfaces=made.surfaces))


def test_tiers_and_refinement_share_their_rounds(lit) -> None:
    alone, both = lit(choice=tiers(3)), lit(goal=GOAL, choice=tiers(3))
    alone.look()
    alone.check()
    assert [run.name for run in alone.pipeline.report].count("IndirectStage") == 3
    refined = lit(goal=GOAL)
    refined.look()
    both.look()
    both.check()
    rounds = max(refined.pipeline.rounds, 2)
    assert both.pipeline.rounds == rounds
    assert len(both.made(Surfaces).mesh) > len(alone.made(Surfaces).mesh)
    shown = [picture.radiance.indirect for picture in both.heard]
    assert shown[0] is None  # the first time, light from lamps and sky is seen before
    brightest = np.nanmax(both.made(Radiance).indirect.irradiance) / (0.5 * np.pi)
    levels = [np.nanmax(layer.irradiance) / (0.5 * np.pi * brightest) for layer in shown[1:]]
    np.testing.assert_allclose(levels[:2], [1 / 3, 2 / 3], rtol=1e-5)
    assert both.made(Radiance).final
    assert not both.heard[1].radiance.final


def test_nobody_waits_for_tiers_while_something_moves(lit) -> None:
    one = lit(choice=tiers(4))
    one.look(moving=True)
    assert one.heard == []
    one.check(0.5 / 4)
    one.pending |= view_changed()
    one.look()
    one.check()
    assert one.bounce.made[0][1].asked == [0, 1, 2, 3]


def test_steps_that_a_method_publishes_are_seen(lit) -> None:
    one = lit(choice=tiers(4, published=True))
    shown = one.look()
    levels = [p.linear.mean() for p in (*one.heard, shown)]
    assert len(levels) >= 5
    assert (np.diff(levels[:5]) > 0).all()
    one.check()


def test_another_method_lets_the_last_one_go_and_none_keeps_it(lit) -> None:
    one = lit()
    one.look()
    one.choose(light=DIRECT)
    one.look()
    assert one.made(Indirect) is None
    one.choose(light=ALL)
    one.look()
    assert one.bounce.made[0][1].runs == 1
    gone = weakref.ref(one.bounce.made.pop()[1])
    one.choose(IndirectChoice("other", BounceParams()))
    one.look()
    gc.collect()
    assert gone() is None
    one.choose(IndirectChoice("missing", BounceParams()))
    with pytest.raises(PluginError, match="no indirect 'missing'"):
        one.look()
    one.choose(IndirectChoice("bounce", BounceParams()))
    one.look()
    one.check()


def test_which_light_is_looked_at(lit) -> None:
    one = lit(goal=GOAL)
    both = one.look().linear
    one.choose(light=INDIRECT)
    between = one.look().linear
    assert one.made(Radiance).layers == {}
    assert one.ran() == {"IndirectStage", "CombineStage", "PictureStage"}
    one.choose(light=DIRECT)
    straight = one.look().linear
    hit = one.made(PictureStage.gives).coverage == 1
    np.testing.assert_allclose((between + straight)[hit], both[hit], rtol=1e-4)
    one.choose(None, INDIRECT)
    assert not one.look().linear[hit].any()


def test_lamps_in_every_pixel_stay(host, workers) -> None:
    one = Lit(host, workers, choice=tiers(1))
    backend = host.get("backend", "cuts")
    params = backend_params(backend, {"vertices": 600, "pixel_lamps": True, "refine": False})

    def shown(**named):
        return picture(one.document.scene, one.view, backend, params, one.services, Job("test"), **named)

    both, straight = shown(indirect=one.choice), shown()
    between = shown(indirect=one.choice, light=INDIRECT)
    hit = both.coverage == 1
    np.testing.assert_allclose(both.linear[hit], (straight.linear + between.linear)[hit], rtol=1e-4)
    assert both.radiance.pixel is not None
    assert between.radiance.pixel is None


def test_what_catches_shadows_is_lit_by_other_surfaces(lit) -> None:
    scene = make_little_scene().with_nodes(LAMP)
    matt = dataclasses.replace(scene.material("matt"), catches=True)
    one = lit(scene.with_materials(matt))
    both = one.look()
    one.choose(None)
    straight = one.look()
    floor = (straight.node == straight.nodes.index("floor")) & (straight.coverage == 1)
    assert (both.linear[floor] > 1.05 * straight.linear[floor]).all()


def test_stages_that_lack_what_methods_need_stay_as_they_are(lit, host) -> None:
    one = lit()
    plain = host.get("backend", "reference").stages(one.services)
    own = [stage for stage in plain if stage.gives is not Hits]
    assert with_indirect(own, one.services) == own
    whole = with_indirect(plain, one.services)
    assert [stage.gives for stage in whole[-3:]] == [DirectRadiance, Indirect, Radiance]
    assert isinstance(whole[-2], IndirectStage)


def test_a_choice_has_checked_parameters(lit) -> None:
    one = lit()
    assert indirect_choice(one.host, "bounce", {"tiers": "3", "level": 0.25}).params == BounceParams(0.25, 3)
    with pytest.raises(InputError, match="tiers"):
        indirect_choice(one.host, "bounce", {"tiers": "99"})


STEPS = [
    MOVE,
    edits.SetFields("lamp", {"intensity": 2.0}),
    edits.SetMaterial("matt", {"base_color": (0.2, 0.8, 0.2)}),
    edits.Move({"lamp": Transform((-1.0, 2.0, 0.5))}),
]


@settings(max_examples=8)
@given(st.lists(st.tuples(st.sampled_from(range(len(STEPS))), st.integers(0, 60)), min_size=1, max_size=4))
def test_cancelled_work_is_not_forgotten(host, workers, course) -> None:
    one = Lit(host, workers, goal=Adaptive(target=0.01, extra=300, rounds=1), choice=tiers(2))
    for step, at in course:
        try:
            one.look(STEPS[step], StoppingJob(at))
        except Cancelled:
            one.pending |= Changes()
    one.look()
    one.check()
    assert one.made(Indirect).final
    receivers = one.bounce.made[0][1].before
    assert any(isinstance(part, Receivers) for part in receivers)


def test_the_share_of_light_between_surfaces_as_colours(lit) -> None:
    one = lit(scene=make_little_scene(cube_model="phong").with_nodes(LAMP))
    every = {}
    for light in (ALL, INDIRECT, SHARE):
        one.choose(light=light)
        every[light] = one.look()
    made, hit = every[SHARE], every[ALL].coverage == 1
    luminance = np.array(LUMINANCE)
    expected = (every[INDIRECT].linear[hit] @ luminance) / (every[ALL].linear[hit] @ luminance)
    np.testing.assert_allclose(made.share[hit], expected, rtol=1e-4, atol=1e-5)
    assert 0.02 < expected.min() < expected.max() < 0.98
    np.testing.assert_allclose(made.linear[hit], linear_colours(made.share[hit]))
    assert np.isnan(made.share[every[ALL].coverage == 0]).all()
    assert made.colours is None
    assert made.shown_with(3.0, "filmic") == (0.0, "srgb")
    assert every[ALL].shown_with(3.0, "filmic") == (3.0, "filmic")
    one.choose(None)
    assert not one.look().share[hit].any()
