"""`lucarne render` and `lucarne frames`: pictures and series of pictures, of any size."""

from __future__ import annotations

import argparse
import dataclasses
import math
import os
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studio import verbs
from studio.headless import Headless
from studio.indirect_options import NONE, check_light, chosen_indirect
from studio_core.errors import InputError
from studio_core.scene.nodes import Camera, Light, MeshObject, Scene
from studio_core.scene.transform import Vec3
from studio_core.session import SHARE, View

if TYPE_CHECKING:
    from studio_core.imaging.preview import ContactSheet

PICTURES = (".png", ".exr")
MOST_PIXELS = 16384
MOST_EXPOSURE = 64.0
MOST_FRAMES = 10_000
PROGRAM_BYTES = 6e8  # with a scene of ordinary size
SAMPLE_BYTES = 150  # of a sample while it is made, seen and shaded
ROW_BYTES = 256  # of a pixel in a row of bands
SHOW_EVERY = 0.3  # seconds between two previews


def parse_size(text: str) -> tuple[int, int]:
    """(width, height) from WxH."""
    try:
        width, height = (int(part) for part in text.lower().split("x"))
    except ValueError:
        raise InputError(f"--size {text!r}: write WIDTHxHEIGHT") from None
    if not (1 <= width <= MOST_PIXELS and 1 <= height <= MOST_PIXELS):
        raise InputError(f"--size {text!r}: expected 1 to {MOST_PIXELS} pixels each way")
    return width, height


def check_picture(options: argparse.Namespace, out: Path) -> tuple[int, int]:
    """(width, height); InputError for whatever can be told to be wrong before the work."""
    from studio_core.imaging.picture import check_finish

    verbs.check_target(out, PICTURES, "pictures")
    width, height = parse_size(options.size)
    if not abs(options.exposure) <= MOST_EXPOSURE:
        raise InputError(
            f"--exposure {options.exposure:g}: expected -{MOST_EXPOSURE:g} to {MOST_EXPOSURE:g} EV"
        )
    if options.measure is not None and not 1 <= options.measure <= 100_000:
        raise InputError(f"--measure {options.measure}: expected 1 to 100000 places")
    if not 0 <= options.dpi <= 1e5:
        raise InputError(f"--dpi {options.dpi:g}: expected dots per inch, up to 100000")
    check_light(options)
    check_finish(out, finish_of(options), options.lights)
    needed, there = _memory_needed(width, height, options.antialias), memory()
    if needed > there:
        raise InputError(
            f"--size {options.size} with --antialias {options.antialias} needs about"
            f" {needed / 1e9:.1f} GB of memory, and this machine has {there / 1e9:.1f} GB"
        )
    if options.preview is not None:
        verbs.check_target(options.preview, (".png",), "previews")
    return width, height


def _memory_needed(width: int, height: int, antialias: int) -> float:
    """Bytes for a picture: a guide and a band of it, however large it is, and what a row needs."""
    from studio_core.shading.bands import GUIDE_SAMPLES

    samples = min(width * height * antialias**2, GUIDE_SAMPLES)
    return PROGRAM_BYTES + SAMPLE_BYTES * samples + 2 * width * (ROW_BYTES + SAMPLE_BYTES * antialias**2)


def memory() -> float:
    """Bytes of memory of this machine; inf where that cannot be told."""
    with suppress(AttributeError, ValueError, OSError):
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    return math.inf


def finish_of(options: argparse.Namespace) -> Any:
    """How light becomes a file."""
    from studio_core.imaging.picture import Finish

    false_colours = options.light == SHARE
    exposure, tonemap = (0.0, "srgb") if false_colours else (options.exposure, options.tonemap)
    return Finish(exposure, tonemap, options.bits, options.dpi)


def _told(options: argparse.Namespace, program: Headless, scene: Scene) -> None:
    if not any(scene.shown(node.id) for node in scene.of(MeshObject)):
        program.say(f"{options.project} shows no mesh: the picture is background alone")
    if not any(scene.shown(light.id) for light in scene.of(Light)):
        program.say(f"{options.project} has no light: the picture is black")


def _facts(options: argparse.Namespace, scene: Scene) -> dict[str, str | float | int]:
    """What files say of themselves."""
    camera = next((c for c in scene.of(Camera) if options.camera in (None, c.name, c.id)), None)
    named = {"lucarne:camera": camera.name} if camera is not None else {}
    if options.indirect != NONE:
        named |= {"lucarne:indirect": options.indirect, "lucarne:light": options.light}
    return {"ImageDescription": options.project.stem, "lucarne:backend": options.backend, **named}


class _Preview:
    """A small picture of what there is so far, written now and then."""

    def __init__(self, path: Path | None, size: tuple[int, int], finish: Any, longest: int = 480) -> None:
        from studio_core.imaging.preview import Preview

        self.small = Preview(size, finish, longest)
        self._path, self._last = path, 0.0

    def __call__(self, band: Any) -> None:
        self.small.add(band.top, band.linear, band.alpha)
        if self._path is not None and time.monotonic() - self._last > SHOW_EVERY:
            self.write()

    def write(self) -> None:
        """Now."""
        if self._path is not None:
            self.small.write(self._path)
            self._last = time.monotonic()


def _viewed(options: argparse.Namespace, scene: Scene, size: tuple[int, int], camera: str | None) -> View:
    from studio_core.shading.offline import scene_view

    view = scene_view(scene, camera, *size)
    return dataclasses.replace(view, antialias=options.antialias, fine_edges=options.antialias > 1)


def render(options: argparse.Namespace, program: Headless) -> None:
    """`lucarne render`."""
    from studio_core.shading.bands import Parts, PictureMaker
    from studio_core.shading.picture_out import write_view

    size = check_picture(options, options.out)
    backend, params = verbs.chosen_backend(options, program)
    choice = chosen_indirect(options, program)
    scene = verbs.open_scene(options.project)
    _told(options, program, scene)
    view, finish = _viewed(options, scene, size, options.camera), finish_of(options)
    maker = PictureMaker(backend, params, program.services, indirect=choice, light=options.light)
    parts = Parts(transparent=options.alpha, lights=options.lights)
    preview = None if options.preview is None else _Preview(options.preview, size, finish)
    with program.job("Rendering") as job:
        given: dict[str, Any] = {
            "places": options.measure or 0,
            "facts": _facts(options, scene),
            "watch": preview,
        }
        made = write_view(maker, scene, view, options.out, finish, job, parts=parts, **given)
        if preview is not None:
            preview.write()
    if not made.finite:
        program.say(f"{options.out}: some pixels are not finite")
    vertices = len(made.radiance.valid)
    values: dict[str, Any] = {
        "project": str(options.project),
        "picture": str(options.out),
        "backend": backend.id,
        "width": size[0],
        "height": size[1],
        "vertices": vertices,
        "shaded": int(made.radiance.valid.sum()),
        "directions": made.radiance.directions,
        "finite": made.finite,
        "mean": made.mean if made.finite else None,
        "counts": dict(made.radiance.counts),
        "indirect": None if choice is None else {"method": choice.method, **_told_by(choice, made.radiance)},
        "light": options.light,
        "seconds": {"shading": round(made.shading, 3), "composing": round(made.composing, 3)},
    }
    text = f"{options.out}: {size[0]}×{size[1]}, {vertices} vertices"
    if made.error is not None:
        values["error"] = made.error.as_dict()
        text += f", error {made.error.picture}"
    verbs.result(options, program, values, text)


def _told_by(choice: Any, radiance: Any) -> dict[str, object]:
    return {"params": dataclasses.asdict(choice.params), "facts": dict(radiance.facts)}


@dataclass(frozen=True)
class Shot:
    """One frame of a series."""

    scene: Scene
    view: View


def frames(options: argparse.Namespace, program: Headless) -> None:
    """`lucarne frames`: a turntable, a turn of the light, or a path through cameras, as numbered pictures."""
    from studio_core.imaging.preview import ContactSheet
    from studio_core.shading.bands import Parts, PictureMaker
    from studio_core.shading.job_parts import JobPart
    from studio_core.shading.picture_out import write_view

    size = check_picture(options, options.out)
    if options.sheet is not None:
        verbs.check_target(options.sheet, (".png",), "contact sheets")
    count = frame_count(options)
    backend, params = verbs.chosen_backend(options, program)
    choice = chosen_indirect(options, program)
    scene = verbs.open_scene(options.project)
    _told(options, program, scene)
    shots, finish = shots_of(options, scene, size, count), finish_of(options)
    paths = [frame_path(options.out, number, count) for number in range(1, count + 1)]
    for path in paths:
        verbs.check_target(path)
    sheet = ContactSheet(count, size)
    there = _kept(paths, size, sheet) if options.resume else set()
    maker = PictureMaker(backend, params, program.services, indirect=choice, light=options.light)
    facts, parts = _facts(options, scene), Parts(transparent=options.alpha, lights=options.lights)
    finite, shown, started = True, 0.0, time.perf_counter()
    errors: list[dict[str, object]] = []
    with program.job("Rendering") as job:
        for index, (shot, path) in enumerate(zip(shots, paths, strict=True)):
            part = JobPart(job, index / count, (index + 1) / count, f"Frame {index + 1} of {count}")
            part.at(0)
            if index in there:
                continue
            small = _Preview(None, size, finish, max(sheet.cell))
            told = {**facts, "lucarne:frame": f"{index + 1} of {count}"}
            given: dict[str, Any] = {
                "parts": parts,
                "places": options.measure or 0,
                "facts": told,
                "watch": small,
            }
            made = write_view(maker, shot.scene, shot.view, path, finish, part, **given)
            finite &= made.finite
            if made.error is not None:
                errors.append({"number": index + 1, **made.error.as_dict()})
            sheet.put(index, small.small.shown())
            if options.sheet is not None and time.monotonic() - shown > SHOW_EVERY:
                sheet.write(options.sheet)
                shown = time.monotonic()
            program.tell(job, {"frame": str(path), "number": index + 1, "of": count})
        if options.sheet is not None:
            sheet.write(options.sheet)
    if not finite:
        program.say(f"{paths[0].parent}: some pixels are not finite")
    seconds = time.perf_counter() - started
    values: dict[str, Any] = {
        "project": str(options.project),
        "frames": [str(path) for path in paths],
        "kept": len(there),
        "backend": backend.id,
        "indirect": choice.method if choice is not None else None,
        "light": options.light,
        "width": size[0],
        "height": size[1],
        "finite": finite,
        "seconds": round(seconds, 3),
    }
    if errors:
        values["errors"] = errors
    kept = f", {len(there)} of them were there" if there else ""
    verbs.result(options, program, values, f"{paths[0]} … {paths[-1].name}: {count} frames{kept}")


def frame_count(options: argparse.Namespace) -> int:
    """How many frames; InputError where the options do not say, or say what cannot be."""
    if options.path is not None:
        name, count = "--frames", options.frames
        if count is None:
            raise InputError("--path: how many frames? Write --frames N")
    else:
        name = "--turntable" if options.turntable is not None else "--relight"
        count = options.turntable if options.turntable is not None else options.relight
        if options.frames is not None:
            raise InputError(f"--frames: {name} says how many")
    if not 1 <= count <= MOST_FRAMES:
        raise InputError(f"{name} {count}: expected 1 to {MOST_FRAMES} frames")
    if not math.isfinite(options.degrees):
        raise InputError(f"--degrees {options.degrees}: expected a number")
    return int(count)


def shots_of(options: argparse.Namespace, scene: Scene, size: tuple[int, int], count: int) -> Sequence[Shot]:
    """What each frame sees."""
    from studio_core.camera_path import CameraPath, light_turned, turn_angles, turntable

    if options.path is not None:
        names = [name.strip() for name in options.path.split(",") if name.strip()]
        keys = [_viewed(options, scene, size, name) for name in names]
        path = CameraPath(keys, closed=options.closed)
        views = path.views(count, even=not options.uneven, ease=options.ease)
        return [Shot(scene, view) for view in views]
    view = _viewed(options, scene, size, options.camera)
    if options.relight is not None:
        turns = turn_angles(count, options.degrees)
        return [Shot(light_turned(scene, angle), view) for angle in turns]
    centre = None if options.around is None else _centre(scene, options.around)
    return [Shot(scene, view) for view in turntable(view, count, options.degrees, centre)]


def _centre(scene: Scene, text: str) -> Vec3:
    """The point of --around: `x,y,z`, or the middle of a node and all under it."""
    from studio_core.scene.bounds import exact_bounds
    from studio_core.scene.transform import vec3

    with suppress(ValueError):
        x, y, z = (float(part) for part in text.split(","))
        if all(math.isfinite(value) for value in (x, y, z)):
            return (x, y, z)
    found = exact_bounds(scene, [scene.named(text).id])
    if found is None:
        raise InputError(f"--around {text!r}: nothing of it is shown")
    return vec3((found[0] + found[1]) / 2)


def frame_path(out: Path, number: int, count: int) -> Path:
    """`DIR/name.png` → `DIR/name_0001.png`."""
    digits = max(4, len(str(count)))
    return out.with_name(f"{out.stem}_{number:0{digits}}{out.suffix}")


def _kept(paths: Sequence[Path], size: tuple[int, int], sheet: ContactSheet) -> set[int]:
    """Which frames of that size are there, put on the sheet: files are whole or not there."""
    from studio_core.imaging.io import ImageDecoder
    from studio_core.imaging.resample import resize_area
    from studio_core.kernels.tonemap import tonemap

    found = set()
    with ImageDecoder() as decoder:
        for index, path in enumerate(paths):
            with suppress(InputError):
                pixels = decoder.read(path).pixels
                if pixels.shape[1::-1] != size:
                    continue
                found.add(index)
                if sheet.has(index):
                    small = resize_area(pixels, *sheet.cell)[:, :, :3]
                    sheet.put(index, small if small.dtype.kind == "u" else tonemap(small))
    return found
