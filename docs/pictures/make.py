"""Makes the pictures of these pages: `python docs/pictures/make.py room | window | chair`, from a checkout.

`room` renders the sample room, `window` photographs the window when it has come to rest, `chair` drags a
chair through the settled room as a hand does and lets it rest, exact and refined.
"""

from __future__ import annotations

import dataclasses
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "ui"), str(ROOT / "plugins")]

SIZE = (640, 360)
STEPS, REST = 32, 24  # pictures of the drag; how long the last one stays, in pictures
PER_PICTURE = 70  # milliseconds
WAY = ((0.0, 0.0), (1.55, 0.55))  # of the chair over the floor, metres in x and z
SETTLED = 180  # seconds that a window may take to come to rest


def room() -> None:
    """The sample room by the command line."""
    from studio.cli import main

    raise SystemExit(main(["demo", "--headless", "-o", str(HERE / "living-room.png")]))


def window() -> None:
    """The window, at rest, with its error measured."""
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    os.environ["LUCARNE_STATE"] = tempfile.mkdtemp(prefix="lucarne-pictures-")
    from PySide6.QtWidgets import QApplication

    from studio.app import assemble
    from studio.samples import sample
    from studio_ui.feed import Freshness

    application = QApplication(sys.argv[:1])
    studio = assemble()
    studio.window.resize(1440, 900)
    studio.window.show()
    errors: list[object] = []
    studio.context.feed.measured.connect(lambda error: errors.append(error))
    studio.window.files.open_copy(sample())

    def wait(seconds: float = 0.0) -> None:
        until = time.monotonic() + SETTLED
        least = time.monotonic() + seconds
        while time.monotonic() < until:
            application.processEvents()
            time.sleep(0.01)
            rests = studio.context.feed.state is Freshness.CURRENT and errors and errors[-1] is not None
            if rests and time.monotonic() > least:
                return
        raise SystemExit("the window did not come to rest")

    wait(2.0)
    chosen = next(n for n in studio.context.document.scene.nodes.values() if n.name == "Chair at the back")
    studio.context.session.select([chosen.id])
    studio.window.docks["shading"].raise_()
    wait(0.5)
    studio.window.grab().save(str(HERE / "window.png"))
    studio.close()


def frames() -> Iterator[np.ndarray]:
    """8-bit pictures of a drag and of the rest after it."""
    from studio.headless import Headless
    from studio.samples import sample
    from studio.verbs import open_scene
    from studio_core.edits import Move
    from studio_core.kernels.tonemap import tonemap
    from studio_core.raster import PictureStage
    from studio_core.scene.diff import Aspect, diff, everything, view_changed
    from studio_core.scene.transform import Transform
    from studio_core.shading.frame import Frame
    from studio_core.shading.job import Job
    from studio_core.shading.offline import scene_view
    from studio_core.shading.pipeline import Pipeline

    program = Headless(quiet=True)
    scene = open_scene(sample())
    chair = next(n for n in scene.nodes.values() if n.name == "Chair at the back")
    backend = program.registry.get("backend", "cuts")
    pipeline = Pipeline([*backend.stages(program.services), PictureStage(program.services)])
    view = dataclasses.replace(scene_view(scene, None, *SIZE), antialias=2)
    params = backend.Params()
    pipeline.update(Frame(scene, view, params), everything(scene), Job("room"))
    shown = scene
    for step in range(STEPS + 1):
        share = 0.5 - 0.5 * np.cos(np.pi * step / STEPS)
        x, z = (a + share * (b - a) for a, b in zip(*WAY, strict=True))
        moved = Move({chair.id: Transform((float(x), 0.0, float(z))) @ chair.transform})(scene)
        last = step == STEPS
        changes = diff(shown, moved)
        if last:
            changes |= view_changed() | view_changed(Aspect.QUALITY)
        frame = Frame(moved, view, params, step, moving=not last)
        picture, shown = pipeline.update(frame, changes, Job("chair")), moved
        yield tonemap(picture.linear, 0.0, "srgb")


def chair() -> None:
    """A drag, and the rest after it."""
    from PIL import Image

    made = [Image.fromarray(pixels) for pixels in frames()]
    times = [PER_PICTURE] * (len(made) - 1) + [REST * PER_PICTURE]
    made[0].save(
        HERE / "dragged-chair.webp",
        save_all=True,
        append_images=made[1:],
        duration=times,
        loop=0,
        quality=82,
        method=6,
    )


if __name__ == "__main__":
    {"room": room, "window": window, "chair": chair}[sys.argv[1]]()
