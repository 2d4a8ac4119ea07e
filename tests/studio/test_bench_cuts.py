"""`lucarne bench cuts`: its rooms, edits and arithmetic, and a tiny run of the whole suite."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scenes import little_scene, sky

from studio.bench import cuts, cuts_growth, cuts_paper, cuts_peers
from studio.bench.cuts_cases import CASES, CHAIR, ONE, Case, State, orbits, sliders, turns
from studio.bench.cuts_keeping import SETTLES
from studio.bench.cuts_measure import Editor, Errors, Shaded, changed, kept_bytes
from studio.bench.cuts_scenes import NATIVE, Rooms, hall, painted, with_sun
from studio.bench.cuts_settled import points
from studio.bench.harness import Report, relative_rmse
from studio.headless import Headless
from studio_core.contract import Services
from studio_core.errors import LucarneError
from studio_core.imaging.latlong import pixel_solid_angles
from studio_core.parallel import Workers
from studio_core.params import param
from studio_core.registry import PluginHost
from studio_core.scene.diff import Aspect, diff
from studio_core.scene.nodes import Environment, MeshObject, Scene
from studio_core.shading.frame import Frame
from studio_core.shading.offline import backend_params, scene_view
from studio_plugins.export import mitsuba_run
from studio_plugins.reference.backend import BACKEND as REFERENCE
from studio_plugins.reference.backend import Params as ReferenceParams


def room() -> Scene:
    """A small scene with the names that the cases need."""
    scene = little_scene()
    chair = dataclasses.replace(scene["cube"], name=CHAIR)
    leather = dataclasses.replace(scene.material("paint"), name=ONE, model="ggx")
    return scene.with_nodes(chair).with_materials(leather)


def state(scene: Scene) -> State:
    return State(scene, dataclasses.replace(scene_view(scene, None, 48, 27), antialias=1))


# --- rooms --------------------------------------------------------------------------------------------


def test_a_sun_adds_its_share_of_light_and_touches_four_pixels() -> None:
    dim = sky(64)
    sunny = with_sun(dim, share=0.5)
    assert ((sunny.pixels != dim.pixels).any(axis=2)).sum() == 4
    angles = pixel_solid_angles(32, 64)[:, None]
    before, after = ((image.pixels.mean(axis=2, dtype=np.float64) * angles).sum() for image in (dim, sunny))
    assert after / before == pytest.approx(1.5, rel=1e-4)
    bright = np.argwhere((sunny.pixels != dim.pixels).any(axis=2))
    assert dim.pixels[tuple(bright[0])].mean() > 0.9 * dim.pixels.mean(axis=2).max()


@pytest.mark.parametrize("materials", ["diffuse", "glossy", "sharp", *NATIVE.values()])
def test_paint_keeps_ids_and_meshes(materials: str, host: PluginHost) -> None:
    scene = room()
    made = painted(scene, materials)
    assert list(made.materials) == list(scene.materials)
    assert all(made[node.id] is node for node in scene.of(MeshObject))
    assert diff(scene, made).aspects & ~Aspect.MATERIAL == Aspect.NONE
    for material in made.materials.values():
        assert host.brdf(material.model)  # values fit, too
        assert set(material.values) <= {f.name for f in dataclasses.fields(host.brdf(material.model).Params)}


@pytest.mark.parametrize("materials", NATIVE.values())
def test_native_rooms_are_native_to_mitsuba(materials: str, host: PluginHost, tmp_path: Path) -> None:
    scene = Rooms(room())("windows", materials)
    assert host.get("exporter", "mitsuba").save(scene, tmp_path, host) == ()
    text = (tmp_path / "scene.xml").read_text()
    assert "lucarne_" not in text
    assert "bitmap" not in text
    assert ('type="roughconductor"' in text) == (materials != "native-diffuse")
    assert not next(scene.of(Environment)).background


def test_the_same_room_is_the_same_scene() -> None:
    base = room()
    rooms = Rooms(base)
    assert rooms("sun", "glossy") is rooms("sun", "glossy")
    assert rooms("windows", "own") is base
    kept, lit = (next(rooms(where, "glossy").of(Environment)).image for where in ("windows", "sun"))
    assert lit.pixels.max() > 10 * kept.pixels.max()


def test_a_hall_has_instances_on_a_floor_that_is_seen(host: PluginHost) -> None:
    scene = hall(5, sky())
    tables = [node for node in scene.of(MeshObject) if node.id.startswith("table")]
    assert len(tables) == 5
    assert len({id(node.geometry) for node in tables}) == 1
    geometry = tables[0].geometry
    corners = geometry.positions[geometry.faces].astype(np.float64)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((across * geometry.normals[geometry.faces[:, 0]]).sum(axis=1) > 0).all()  # faces look outward
    places = np.array([node.transform.translation for node in tables])
    gaps = np.linalg.norm(places[:, None] - places[None], axis=2)[np.triu_indices(5, 1)]
    assert gaps.min() > 1.2


# --- edits --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_path_ends_where_it_began_and_every_step_differs(case: Case) -> None:
    base = state(painted(room(), case.materials))
    path = case.path(base, 9, case.materials)
    assert len(path) == 9
    assert path[-1] is base
    for before, after in zip([base, *path], [*path, base], strict=True):
        same = before.scene is after.scene and before.view == after.view
        assert same == (after is base and before is base)
    touched = {
        "brdf": Aspect.MATERIAL,
        "camer": Aspect.NONE,
        "light": Aspect.LIGHT,
        "move-": Aspect.TRANSFORM,
    }
    wanted = next(aspect for start, aspect in touched.items() if case.name.startswith(start))
    assert all(diff(base.scene, step.scene).aspects == wanted for step in path[:-1])


def test_one_slider_touches_one_material() -> None:
    base = state(painted(room(), "glossy"))
    (case,) = (case for case in CASES if case.name == "brdf-one")
    for step in case.path(base, 5, "glossy")[:-1]:
        assert diff(base.scene, step.scene).materials == {"paint"}


def test_sliders_go_from_soft_to_sharp_within_their_range() -> None:
    base = state(painted(room(), "sharp"))
    (case,) = (case for case in CASES if case.name == "brdf-sharp")
    path = case.path(base, 9, "sharp")[:-1]
    found = [step.scene.material("matt").values["roughness"] ** 2 for step in path]
    assert found == sorted(found, reverse=True)
    assert found[-1] == pytest.approx(0.05)
    assert found[0] < 0.2


def test_the_camera_swings_about_what_it_looks_at() -> None:
    base = state(room())
    for step in orbits(base, 7, "glossy"):
        assert step.view.target == pytest.approx(base.view.target, abs=0.06)


def test_light_turns_the_same_way_each_step() -> None:
    found = [next(step.scene.of(Environment)).azimuth for step in turns(state(room()), 4, "")]
    assert found == pytest.approx([3.7, 7.4, 11.1, 0.0])


def test_a_dragged_object_stays_on_the_floor() -> None:
    base = state(room())
    (case,) = (case for case in CASES if case.name == "move-preview")
    places = [step.scene["cube"].transform for step in case.path(base, 7, "")]
    assert {place.translation[1] for place in places} == {0.5}
    assert {place.scale for place in places} == {1.0}
    assert len({place.rotation for place in places}) > 3


@pytest.mark.parametrize(("length", "checks"), [(21, 2), (5, 1), (3, 1), (3, 4), (21, 5)])
def test_states_to_look_at_are_on_the_way(length: int, checks: int) -> None:
    found = cuts.looked(length, checks)
    assert length - 2 in found
    assert all(1 <= place <= length - 2 for place in found)
    assert 1 <= len(found) <= checks


def test_a_frame_at_rest_is_looked_at_anew() -> None:
    base = state(room())
    still = Frame(base.scene, base.view, None, 1, moving=True)
    assert not changed(still, still)
    assert changed(still, dataclasses.replace(still, moving=False)).aspects == Aspect.VIEW
    finer = dataclasses.replace(still, params="other")
    assert changed(still, finer).aspects == Aspect.QUALITY


# --- arithmetic ---------------------------------------------------------------------------------------


def shaded(values: Any, seen: Any, valid: Any = None) -> Shaded:
    made = np.asarray(values, np.float32)[:, None] * np.ones(3, np.float32)
    seen = np.asarray(seen, bool)
    valid = np.ones(len(made), bool) if valid is None else np.asarray(valid, bool)
    return Shaded(made, 2 * made, valid, seen, made[:1])


def test_errors_are_of_what_is_seen_or_of_everything() -> None:
    made, truth = shaded([1, 3, 9], [1, 1, 0]), shaded([1, 1, 1], [1, 1, 0])
    seen = Errors.of([(made, truth)])
    assert seen.vertex == seen.irradiance == relative_rmse([1, 3], [1, 1])
    assert seen.picture == 0
    assert Errors.of([(made, truth)], everywhere=True).vertex == relative_rmse([1, 3, 9], [1, 1, 1])
    both = Errors.of([(made, truth), (truth, truth)])
    assert both.vertex == relative_rmse([1, 3, 1, 1], [1, 1, 1, 1])
    assert both.vertex_p99 > 1.9


def test_a_vertex_left_out_counts() -> None:
    truth = shaded([1, 1], [1, 1])
    made = shaded([1, 0], [1, 1], valid=[1, 0])
    assert Errors.of([(made, truth)]).vertex == relative_rmse([1, 0], [1, 1])


def test_other_vertices_cannot_be_compared() -> None:
    with pytest.raises(LucarneError, match="3 shading vertices cannot be compared with 2"):
        Errors.of([(shaded([1, 1, 1], [1, 1, 1]), shaded([1, 1], [1, 1]))])


class Holder:
    """Has `__dict__`."""

    def __init__(self, *values: object) -> None:
        self.values = values


class Slotted:
    """Has none."""

    __slots__ = ("array", "empty")

    def __init__(self, array: Any) -> None:
        self.array = array


def test_kept_bytes_count_every_array_once() -> None:
    array, other = np.zeros(100, np.float64), np.zeros(7, np.uint8)
    held = Holder(array, array[10:], {"a": [other]}, Slotted(np.zeros(3, np.int16)), np.float64(1))
    held.values += (held,)
    seen: set[int] = set()
    assert kept_bytes(held, (__name__,), seen) == 800 + 7 + 6
    assert kept_bytes([array, other], (__name__,), seen) == 0
    assert kept_bytes(array[1:3], (), set()) == 800  # a view keeps all of it
    foreign = SimpleNamespace(array=array)
    assert kept_bytes([foreign], (__name__,), set()) == 0


def test_growth_is_fitted(capsys: pytest.CaptureFixture[str]) -> None:
    report = Report("cuts", False)
    suite: Any = SimpleNamespace(part=lambda name, work: work(), report=report)
    cuts_growth.grow(
        suite, "vertices", [10, 100, 1000], lambda n: {"brdf_ms": 0.5 * n, "exact_ms": n**1.5, "bytes": 0.0}
    )
    found = {(row.case, row.metric): row.value for row in report.rows}
    assert found["growth/vertices", "brdf_ms_exponent"] == pytest.approx(1)
    assert found["growth/vertices", "exact_ms_exponent"] == pytest.approx(1.5)
    assert ("growth/vertices", "bytes_exponent") not in found
    assert found["growth/vertices/100", "brdf_ms"] == 50


# --- Mitsuba ------------------------------------------------------------------------------------------


class Noisy:
    """Stands in for Mitsuba: a truth under noise that falls with the root of the samples."""

    calls = 0

    def __init__(self, folder: Path, size: tuple[int, int]) -> None:
        self.truth = np.linspace(1, 2, size[0] * size[1] * 3, dtype=np.float32).reshape(size[1], size[0], 3)
        self.truth[0] = 0

    def __call__(self, spp: int, seed: int) -> Any:
        type(self).calls += 1
        noise = np.random.default_rng(seed).normal(0, 0.4 / np.sqrt(spp), self.truth.shape)
        return (self.truth * (1 + noise)).astype(np.float32)

    def timed(self, spp: int, seed: int) -> tuple[Any, float]:
        return self(spp, seed), 0.02 * spp


@pytest.fixture
def noisy(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> type[Noisy]:
    monkeypatch.setattr(mitsuba_run, "DirectRenderer", Noisy)
    monkeypatch.setattr(cuts_peers, "user_cache", lambda: tmp_path)
    monkeypatch.setattr(Noisy, "calls", 0)
    return Noisy


def test_mitsubas_time_at_our_error(noisy: type[Noisy]) -> None:
    base = state(Rooms(room())("windows", "native-glossy"))
    found = cuts_peers.peer(base, Headless(quiet=True), (4, 16, 64), 256)
    assert found.law.exponent == pytest.approx(-0.5, abs=0.04)
    assert found.seconds == (0.08, 0.32, 1.28)
    truth = Noisy(Path(), (48, 27)).truth
    ours = truth + np.where(truth > 0, np.float32(0.05), 0) * np.sign(truth - 1.5)
    error = found.error(ours)
    assert error == pytest.approx(0.05 / truth[1:].mean(), rel=0.1)
    samples = (0.4 * np.sqrt((truth[1:] ** 2).mean()) / truth[1:].mean() / error) ** 2
    assert found.ratio(error, 0.01) == pytest.approx(2 * samples, rel=0.15)
    assert found.error(truth) < 0.3 * found.noise


def test_converged_pictures_are_kept_by_content(noisy: type[Noisy]) -> None:
    rooms, program = Rooms(room()), Headless(quiet=True)
    first = state(rooms("windows", "native-glossy"))
    calls = []
    for wanted in (
        first,
        first,
        state(rooms("sun", "native-glossy")),
        state(rooms("windows", "native-sharp")),
    ):
        before = noisy.calls
        cuts_peers.peer(wanted, program, (4,), 128)
        calls.append(noisy.calls - before)
    assert calls == [5, 1, 5, 5]


# --- all of it ----------------------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class Params(ReferenceParams):
    """What the reference does not have; no direction is split, as in the truth."""

    method: str = param("exact", "Method", choices=("exact", "svc-vcf"))
    refine: bool = param(True, "Refine")
    quarters: bool = param(False, "Split bright directions")


class Twice:
    """The reference with two methods and something to precompute."""

    id, label, Params = "cuts", "Twice", Params

    def stages(self, services: Any) -> Any:
        return REFERENCE.stages(services)

    def precompute(self, scene: Any, view: Any, params: Any, services: Any, job: Any) -> Mapping[str, int]:
        there = services.cache.get("test", params.method)
        services.cache.put({"there": np.zeros(100)}, "test", params.method)
        return {"bytes": 800, "cached": int(there is not None)}


TINY = cuts.Setup(
    width=48,
    height=27,
    vertices=600,
    directions=1 << 10,
    edits=2,
    checks=1,
    peer_edits=2,
    peer_exact=2,
    samples=(1, 4),
    converged=16,
    settles=1,
    opens=1,
    paper=cuts_paper.Sizes(receivers=50, samples=2, points=20, shells=(2, 3)),
    growth=cuts_growth.Steps((500, 1000), (cuts_growth.FEW, 6), (10, 11), 1),
)
TIMES = {"ms", "primary_ms", "compose_ms", "picture_ms", "first_picture_ms"}
ERRORS = {"vertex_rel_rmse", "vertex_p99", "irradiance_rel_rmse", "picture_rel_rmse"}


def run(backend: str, monkeypatch: pytest.MonkeyPatch, peers: bool) -> tuple[Report, dict[Any, float]]:
    monkeypatch.setattr(cuts_peers, "installed", lambda: peers)
    report, program = Report("cuts", True), Headless(quiet=True, threads=2)
    real = program.registry
    if backend == "cuts":
        program.__dict__["registry"] = SimpleNamespace(
            get=lambda kind, name: Twice() if name == "cuts" else real.get(kind, name),
            names=real.names,
            brdf=real.brdf,
        )
    try:
        cuts.measure(report, program, room(), TINY, backend)
    finally:
        program.close()
    found = {(row.case, row.metric): row.value for row in report.rows}
    assert len(found) == len(report.rows)
    assert np.isfinite(list(found.values())).all()
    json.dumps(report.as_dict(), allow_nan=False)
    return report, found


@pytest.mark.slow
def test_the_suite_has_every_promised_row(monkeypatch: pytest.MonkeyPatch, noisy: type[Noisy]) -> None:
    report, found = run("cuts", monkeypatch, peers=True)
    for sun in ("", "sun/"):
        for case in CASES:
            for paper in ("", "paper/"):
                name = f"{paper}{sun}{case.name}"
                metrics = {metric for where, metric in found if where == name}
                if paper and sun and case.name.startswith("move"):
                    assert not metrics
                    continue
                assert {*TIMES, *ERRORS, "threads"} <= metrics, name
                assert found[name, "vertex_rel_rmse"] < 1e-4, name  # the reference against itself
                assert found[name, "picture_rel_rmse"] < 1e-4, name
                assert found[name, "threads"] == 2
                assert found[name, "picture_ms"] >= found[name, "compose_ms"] > 0
                compared = not paper and not case.everywhere
                assert ("peer_picture_rel_rmse" in metrics) == compared
                for point in points(case, "sun" if sun else "windows") if compared else ():
                    assert found[name, f"peer_{point.name}_ms"] > 0
                    assert found[name, "peer_ratio"] >= found[name, f"peer_{point.name}_ratio"] > 0
                assert report.details[name]["seconds"] >= 0
                assert len(report.details[name]["ms"]) == TINY.edits
        assert found[f"{sun}all-directions", "irradiance_rel_rmse"] < 0.01  # a smooth sky
        for case in SETTLES:
            assert found[f"{sun}{case}", "metered_picture_rel_rmse"] > 0
        assert found[f"{sun}settle", "picture_rel_rmse"] > 0
    for paper in ("", "paper/"):
        assert found[f"{paper}precompute", "bytes"] > 800
        told = report.details[f"{paper}precompute"]["told"]
        assert [each["cached"] for each in told] == [0, 1]
        openings = ("ms", "cached_ms", "view_ms", "cached_view_ms")
        assert all(found[f"{paper}precompute", metric] > 0 for metric in openings)
    for shells in TINY.paper.shells:
        assert 0 < found[f"paper/shells-{shells}", "irradiance_rel_rmse"] < 1
        assert found[f"paper/shells-{shells}", "samples_possible"] == 2 * 6 * shells**3  # two objects
    assert found["paper/table", "average_nodes_of_an_svc"] >= 1
    said = report.details["paper/table"]["paper"]
    assert said["svc_and_vcf_with_heights_whole_fields"] == 270e6
    assert {f"growth/{kind}" for kind in ("vertices", "objects", "directions")} <= {case for case, _ in found}


def test_a_part_that_was_not_asked_for_is_not_measured_and_what_is_done_is_kept(tmp_path: Path) -> None:
    report, program = (
        Report("cuts", True, only="brdf*,sun/*", target=tmp_path / "r.json"),
        Headless(quiet=True),
    )
    try:
        suite = cuts.Suite(report, program, room(), TINY, tmp_path, "reference")
        done = []
        for name in ("brdf-one", "camera", "sun/camera", "paper/brdf"):
            suite.part(name, lambda name=name: (done.append(name), report.add(name, "ms", 1, "ms")))  # type: ignore[misc]
        with pytest.raises(ZeroDivisionError):
            suite.part("brdf-sharp", lambda: 1 / 0)
    finally:
        program.close()
    assert done == ["brdf-one", "sun/camera"]
    assert [row["case"] for row in json.loads((tmp_path / "r.json").read_text())["rows"]] == done


def test_the_first_exact_picture_at_rest_is_that_of_the_whole_edit(host: PluginHost) -> None:
    base = state(painted(room(), "diffuse"))
    editor, other = (Editor(REFERENCE, Services(Workers(2), host)) for _ in range(2))
    params = backend_params(REFERENCE, {"vertices": 600, "directions": "1024"})
    _, first = editor.go(base, params, moving=False)
    assert [linear is first.linear for _, linear in editor.shown][-1]
    (step,) = sliders(base, 2, "diffuse")[:1]
    seconds, picture = editor.first_exact(step, params)
    assert seconds > 0
    _, expected = other.go(step, params, moving=False)
    np.testing.assert_allclose(picture.linear, expected.linear, atol=1e-6)
    _, again = editor.go(base, params, moving=False)  # what was cut short is not forgotten
    np.testing.assert_allclose(again.linear, first.linear, atol=1e-6)


@pytest.mark.slow
def test_what_is_missing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    report, found = run("reference", monkeypatch, peers=False)
    assert not [case for case, _ in found if case.startswith("paper/") or "mitsuba" in case]
    assert not [metric for _, metric in found if metric.startswith("peer")]
    text = " ".join(report.notes)
    assert "Mitsuba 3 is not installed" in text
    assert "reference has no method, refine" in text
    assert found["memory", "bytes"] > 1000
    assert found["growth/directions/2048", "bytes"] > found["growth/directions/1024", "bytes"] > 1000
