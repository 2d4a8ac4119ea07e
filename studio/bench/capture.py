"""`lucarne bench capture`: rooms that are known, photographed by a simulated phone, captured and compared.

Rows MAP/CASE are over the HDR maps of the shared data, each photographed by several random phones of the set
that nothing was tuned on; figures are those of the worst phone, their spread half the range over phones. What
the metrics are stands in benchmarks/README.md.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from studio.bench import capture_floor
from studio.bench import capture_measure as measure
from studio.bench.harness import Report
from studio.bench.phone import Phone, Shots, clipped_share, exposure_scale, lens_light, shoot
from studio.bench.phone_random import random_phone
from studio.headless import Headless
from studio_core.capturing.artifacts import CaptureState
from studio_core.capturing.settings import (
    BACK,
    FRONT,
    LUX,
    SIDES,
    BracketSettings,
    CalibrationSettings,
    CaptureSettings,
    LensSettings,
    ReflectionSettings,
    Shot,
    StitchSettings,
)
from studio_core.imaging.latlong import pixel_directions, pixel_solid_angles

if TYPE_CHECKING:
    from studio_core.contract import CaptureRun
    from studio_core.shading.job import Job

F32 = npt.NDArray[np.float32]
IN_PARTS = True
CAPTURER = "fisheye"
MAPS = {
    "interior": "cc0/hdri_polyhaven_cc0/interior.exr",
    "courtyard": "cc0/hdri_polyhaven_cc0/courtyard.exr",
    "studio": "cc0/hdri_polyhaven_cc0/studio.exr",
    "sunset": "cc0/hdri_polyhaven_cc0/sunset.exr",
    "KernerEnv": "third_party/openexr_env/KernerEnvLatLong.exr",
}
LADDERS = ((-2.0, 0.0, 2.0), (-4.0, -2.0, 0.0, 2.0, 4.0), (-6.0, -4.0, -2.0, 0.0, 2.0))
FULL = 0.85
"""Of the darkest exposure: lamps that are turned down fill so much of it."""
COVERED = 0.005
"""Share of a room's energy beyond the darkest exposure, under which its range counts as captured."""


@dataclass(frozen=True)
class Setup:
    """How much is measured: phones a map, pixels of the circle's radius, columns of the environment.

    registered: phones a map that are only registered.
    """

    phones: int = 2
    radius: float = 300.0
    registered: int = 6
    width: int = 1024
    captures: int = 200
    heaps: int = 20
    clone: tuple[int, int] = (1000, 1000)
    megapixels: float = 12.0


QUICK = Setup(
    phones=1, radius=220.0, registered=1, width=512, captures=24, heaps=2, clone=(500, 500), megapixels=1.0
)


def run(report: Report, program: Headless) -> None:
    """All cases; those over maps are left out, saying so, where the maps are not there."""
    setup = QUICK if report.quick else Setup()
    maps = dict(found_maps())
    if not maps:
        report.notes.append("The shared HDR maps are not there (LUCARNE_TEST_DATA): no rows over maps.")
    for index, (name, path) in enumerate(maps.items()):
        wanted = [case for case in CASES if report.wants(f"{name}/{case}")]
        if wanted:
            room = read_map(path)
            _over_phones(report, program, setup, name, room, index, wanted)
            report.keep()
    _others(report, program, setup, maps)


def _others(report: Report, program: Headless, setup: Setup, maps: Mapping[str, Path]) -> None:
    from studio.bench import (
        capture_brackets,
        capture_clone,
        capture_pipeline,
        capture_reflections,
        capture_registration,
        capture_removal,
    )

    if report.wants(capture_registration.CASE) and maps:
        rooms = {name: read_map(path) for name, path in maps.items()}
        capture_registration.measure(report, program, rooms, setup.registered, setup.radius)
        report.keep()
    if report.wants("brackets") and maps:
        rooms = {name: read_map(path) for name, path in maps.items()}
        capture_brackets.measure(report, rooms, setup.heaps)
        report.keep()
    if report.wants("reflections") and maps:
        with program.job("reflections") as job:
            rooms = {name: read_map(path) for name, path in maps.items()}
            capture_reflections.measure(report, job, rooms, setup.captures)
        report.keep()
    if report.wants(capture_removal.CASE) and maps:
        with program.job(capture_removal.CASE) as job:
            rooms = {name: read_map(path) for name, path in maps.items()}
            capture_removal.measure(report, job, rooms, setup.captures)
        report.keep()
    if report.wants("clone"):
        capture_clone.measure(report, setup.clone)
        report.keep()
    if report.wants("pipeline") and maps:
        room = read_map(next(iter(maps.values())))
        with tempfile.TemporaryDirectory(prefix="lucarne-bench-") as folder:
            capture_pipeline.measure(report, program, room, setup.megapixels, Path(folder))
        report.keep()


def found_maps() -> Iterable[tuple[str, Path]]:
    """Names and files of the maps that are there."""
    folder = Path(os.environ.get("LUCARNE_TEST_DATA") or Path(__file__).parents[2].parent / "shared" / "data")
    return [(name, folder / path) for name, path in MAPS.items() if (folder / path).is_file()]


def read_map(path: Path) -> F32:
    """(H, 2H, 3) finite light."""
    from studio_core.imaging.environment import load_environment

    image, _ = load_environment(path)
    return image.pixels


def deep_arcs(phone: Phone, seed: int) -> Phone:
    """The same with a narrower lens, and arcs that reach 2 … 4° across the seam: others are cut off by it."""
    rng = np.random.default_rng([seed, 8])
    lens = phone.lens.with_fov(min(phone.lens.fov, float(rng.uniform(190, 197))))
    depths = lens.fov / 2 - 90 + rng.uniform(2, 4, len(phone.arcs))
    arcs = tuple(replace(arc, depth=float(d)) for arc, d in zip(phone.arcs, depths, strict=True))
    return replace(phone, lens=lens, arcs=arcs)


def drawn_phone(room: F32, index: int, seed: int, radius: float) -> Phone:
    """A phone of the set that nothing was tuned on, with reflections and a ladder that suits the room."""
    phone = deep_arcs(random_phone(100 * index + seed, False, radius=radius, reflections=True), seed)
    return replace(phone, evs=ladder_of(room, phone))


def ladder_of(room: F32, phone: Phone) -> tuple[float, ...]:
    """The first ladder whose darkest exposure clips less than `COVERED` of the energy, or the last."""
    fitting = (evs for evs in LADDERS if covered(room, replace(phone, evs=evs)))
    return next(fitting, LADDERS[-1])


def covered(room: F32, phone: Phone) -> bool:
    """Whether the phone's exposures resolve nearly all of the room's energy."""
    middle = float(np.median(room.mean(axis=2)))
    darkest = min(phone.evs) + min(0.0, phone.back_ev)
    return clipped_share(room, phone.key / middle * 2.0**darkest) < COVERED


@dataclass(frozen=True)
class Case:
    """`removal`: of reflections; `wrong`: a listed step is wrong by up to 1 EV; `near`: things near enough
    that both lenses see them elsewhere; `glare`: light is spread; `meter`: two readings of a light meter tell
    how bright clipped lamps are."""

    removal: bool = True
    wrong: bool = False
    near: bool = False
    glare: bool = False
    meter: bool = False


CASES = {
    "default": Case(),
    "no-removal": Case(removal=False),
    "wrong-table": Case(wrong=True),
    "near": Case(near=True),
    "glare": Case(near=True, glare=True),
    "lamps": Case(meter=True),
}


def settings_for(case: Case, phone: Phone, width: int) -> CaptureSettings:
    """What a designer who knows the lens' model and about its field of view would leave as it is."""
    lens = LensSettings(
        model=phone.lens.model, fov=float(round(phone.lens.fov / 5) * 5), coefficients=phone.lens.coefficients
    )
    return CaptureSettings(
        lens=lens,
        reflections=ReflectionSettings(automatic=case.removal),
        stitch=StitchSettings(width=width, level=False),
    )


def with_sides(settings: CaptureSettings, shots: Shots) -> CaptureSettings:
    """Which photographs are front and back is told."""
    told = [Shot(p.digest, FRONT) for p in shots.front] + [Shot(p.digest, BACK) for p in shots.back]
    return replace(settings, bracket=BracketSettings(shots=tuple(told)))


def wrong_table(phone: Phone, seed: int) -> tuple[Phone, str, int]:
    """A phone whose files list one step wrong by 0.5 … 1 EV; the side, and the shot after that step."""
    rng = np.random.default_rng([seed, 3])
    count = len(phone.evs)
    side, after = int(rng.integers(2)), int(rng.integers(1, count))
    error = float(rng.uniform(0.5, 1.0) * rng.choice([-1, 1]))
    errors = [(0.0,) * count, (0.0,) * count]
    errors[side] = (0.0,) * after + (error,) * (count - after)
    return replace(phone, listed_errors=(errors[0], errors[1])), SIDES[side], after


def _over_phones(
    report: Report, program: Headless, setup: Setup, name: str, room: F32, index: int, wanted: list[str]
) -> None:
    found: dict[tuple[str, str], list[float]] = {}
    details: dict[str, list[dict[str, object]]] = {}
    for seed in range(setup.phones):
        drawn = drawn_phone(room, index, seed, setup.radius)
        shots: Shots | None = None
        capture: CaptureRun | None = None
        within = dimmed(room, drawn)
        for kind in wanted:
            case, wrong = CASES[kind], None
            phone = drawn if case.glare else replace(drawn, glare=0.0)
            phone = phone if case.near else replace(phone, parallax=0.0)
            if case.meter and covered(room, phone):
                continue
            if case.wrong:
                phone, *wrong = wrong_table(phone, seed)
            light = room if case.meter else within
            if shots is None or capture is None or case.meter or shots.truth.phone != phone:
                shots = shoot(light, phone, seed)
                capture = program.registry.get("capturer", CAPTURER).open(program.services)
            case_name = f"{name}/{kind}"
            with program.job(f"{case_name} {seed + 1}/{setup.phones}") as job:
                before, state = _captured(capture, case, shots, light, setup.width, job)
            values = measured(state, shots, light, wrong)
            if case.meter:
                without = measured(before, shots, light)
                values["irradiance_unmetered_rel_rmse"] = without["irradiance_rel_rmse"]
            if kind == "default":
                values |= {"dimmed_energy": 1 - _energy(within) / _energy(room)}
                values |= floor_of(shots, light, setup.width)
            for metric, figure in values.items():
                found.setdefault((case_name, metric), []).append(figure)
            told = {"phone": seed, "evs": list(phone.evs), **values, "notes": list(state.notes)}
            details.setdefault(case_name, []).append(told)
    for (case_name, metric), figures in found.items():
        worst = min(figures) if metric in ("wrong_named", "compared") else max(figures)
        report.add(case_name, metric, worst, UNITS.get(metric, "1"), (max(figures) - min(figures)) / 2)
    report.details.update(details)


def _captured(
    capture: CaptureRun, case: Case, shots: Shots, room: F32, width: int, job: Job
) -> tuple[CaptureState, CaptureState]:
    """Without a light meter, and as the case has it."""
    photographs = (*shots.front, *shots.back)
    settings = with_sides(settings_for(case, shots.truth.phone, width), shots)
    state: CaptureState = capture.run(photographs, settings, job)
    if not case.meter:
        return state, state
    calibration = with_meter(room, shots, measure.finished_from_room(state, shots.truth))
    return state, capture.run(photographs, replace(settings, calibration=calibration), job)


def with_meter(
    room: F32, shots: Shots, finished_from_room: npt.NDArray[np.float64], lux: float = 1000.0
) -> CalibrationSettings:
    """Two readings of a meter that faces what no exposure resolves: with that shaded, and `lux` with it."""
    resolved = dimmed(room, shots.truth.phone)
    clipped = np.any(room > resolved, axis=2)
    height, width = clipped.shape
    lost = (room - resolved).sum(axis=2) * pixel_solid_angles(height, width)[:, None]
    facing = (pixel_directions(height, width) * lost[:, :, None]).sum(axis=(0, 1))
    facing /= np.linalg.norm(facing)
    shaded = np.where(clipped[:, :, None], np.float32(0), room)
    read = [measure.irradiance(light, facing[None])[0] @ measure.LUMINANCE for light in (shaded, room)]
    x, y, z = (float(a) for a in finished_from_room @ facing)
    return CalibrationSettings(
        scale=LUX, lux=lux * read[0] / read[1], facing=(x, y, z), sun=True, sun_lux=lux
    )


UNITS = {
    "pixel_log2_median": "stop",
    "pixel_log2_p95": "stop",
    "registration_deg": "°",
    "registration_seen_deg": "°",
    "fov_error": "°",
    "arcs_log2_mean": "stop",
    "lens_arcs_log2": "stop",
    "response_log2": "stop",
    "exposure_ev_max": "EV",
}


def measured(
    state: CaptureState, shots: Shots, room: F32, wrong: Sequence[Any] | None = None
) -> dict[str, float]:
    """All metrics of a capture by name. `wrong`: the side, and the shot before which a step is wrong."""
    truth = shots.truth
    assert state.captured is not None
    turned = measure.finished_from_room(state, truth)
    made = state.captured.environment.pixels
    pixels = measure.pixel_error(state, room, truth, turned)
    values = {
        "irradiance_rel_rmse": measure.irradiance_error(made, room, turned),
        "clipped_energy": truth.clipped,
        "pixel_log2_median": pixels.median,
        "pixel_log2_p95": pixels.p95,
        "compared": pixels.share,
        "arcs_log2_mean": pixels.arcs,
        "exposure_ev_max": measure.exposure_error(state, truth),
        "nonfinite": float(measure.nonfinite(state)),
    }
    left = measure.left_in_lenses(state, truth)
    if left is not None:
        values["lens_arcs_log2"] = left
    if state.registration is not None:
        values["registration_deg"] = measure.angle_between(state.registration.rotation, truth.rotation)
        values["registration_seen_deg"] = measure.angle_between(state.registration.rotation, truth.seen)
        values["fov_error"] = abs(state.registration.lens.fov - truth.phone.lens.fov)
    if state.response is not None:
        response = measure.response_error(state.response, truth.phone.curve)
        values["response_rms"], values["response_log2"] = response.rms, response.log2
    if wrong is not None:
        values["wrong_named"] = float(_named(state, *wrong))
    return values


def floor_of(shots: Shots, room: F32, width: int) -> dict[str, float]:
    """The same errors when everything but the room is known: what the lens' pixels and parallax cost."""
    state = capture_floor.floor(shots, width)
    assert state.captured is not None
    turned = measure.finished_from_room(state, shots.truth)
    made = state.captured.environment.pixels
    return {
        "floor_irradiance_rel_rmse": measure.irradiance_error(made, room, turned),
        "floor_pixel_log2_median": measure.pixel_error(state, room, shots.truth, turned).median,
    }


def dimmed(room: F32, phone: Phone) -> F32:
    """The room with its brightest lamps turned down to what the darkest exposure of both lenses resolves."""
    part = 1 / 6
    small = replace(
        phone,
        size=(max(round(phone.size[0] * part), 16), max(round(phone.size[1] * part), 16)),
        circle=phone.circle.scaled(part),
        arcs=(),
        samples=1,
    )
    scale = exposure_scale(lens_light(room, small))
    darkest = scale * 2.0 ** (min(phone.evs) + max(0.0, phone.back_ev)) * max(phone.curve.gains)
    return np.minimum(room, np.float32(FULL / darkest))


def _energy(light: F32) -> float:
    return float((light * pixel_solid_angles(*light.shape[:2])[:, None, None]).sum())


def _named(state: CaptureState, side: str, after: int) -> bool:
    """Whether the step before shot `after` of `side` is named, and nothing else is."""
    wrong = {one: set(light.exposures.wrong) for one, light in state.lights.items()}
    hit = wrong.pop(side, set())
    return bool(hit) and hit <= {after - 1, after} and not any(wrong.values())
