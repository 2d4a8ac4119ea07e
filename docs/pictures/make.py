"""Makes the pictures of these pages: `python docs/pictures/make.py NAME`.

`room` renders the sample room, `windows` photographs the window when it has come to rest (both themes, 100
and 150 %; `window THEME PERCENT` makes one of them), `chair` drags a chair through the settled room as a hand
does and lets it rest, exact and refined. `capture` has the simulated phone photograph the sample room and the
capture panel make its light of that. `library` shows the library of materials in both themes. `fit` has a
ball of the lab photographed and shows the report of the material that is made of it. `bases` and `products`
draw figures 8 and 10 of the interreflection paper. `between` renders the room with the red cabinet with and
without light between surfaces. `strokes` paints on the sofa and shows why that is explained as it is,
`tint` paints light of the red cabinet off the wall.
`figures NUMBER …` plays figures of the paper on strokes, `painted` paints on the sample room.
"""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from PySide6.QtWidgets import QApplication

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "ui"), str(ROOT / "plugins")]

SIZE = (640, 360)
WINDOW = (1440, 900)
STEPS, REST = 32, 24  # pictures of the drag; how long the last one stays, in pictures
HALF = (480, 270)
DRAGGED = (-0.95, 0.0, 0.12)  # the red cabinet, metres
PER_PICTURE = 70  # milliseconds
Way = tuple[tuple[float, float], tuple[float, float]]
WAY: Way = ((0.0, 0.0), (1.55, 0.55))  # of the chair over the floor, metres in x and z
TABLE_WAY, TABLE_STEPS = ((0.0, 0.0), (0.35, 1.15)), 14
SETTLED = 180  # seconds that a window may take to come to rest
PHONE_AT = (0.7, 1.3, 0.6)  # where the phone is held in the sample room, metres
FACE, PANEL = 512, (1280, 800)  # pixels of a side of the room's cube, and of the capture panel
LIBRARY = (430, 760)
PAINTED = (
    {"colour": [0.2, 0.045, 0.035], "shading": True, "path": [[0.63, 0.42], [0.642, 0.436]],
     "brush": {"size": 0.09}, "reach": {"alike": 20}},
    {"colour": [0.26, 0.2, 0.16], "path": [[0.55, 0.595], [0.56, 0.6]], "brush": {"size": 0.03}},
)  # fmt: skip
STEPS_SHOWN = ("reflections", "join")


def room() -> None:
    """The sample room by the command line."""
    from studio.cli import main

    raise SystemExit(main(["demo", "--headless", "-o", str(HERE / "living-room.png")]))


def windows() -> None:
    """The window in both themes, plain and on a display that asks for everything half as large again."""
    for theme in ("dark", "light"):
        for percent in (100, 150):
            command = [sys.executable, __file__, "window", theme, str(percent)]
            subprocess.run(command, check=True, env={**os.environ, "QT_SCALE_FACTOR": str(percent / 100)})


def window(theme: str = "dark", percent: str = "100") -> None:
    """The window, at rest, with its error measured."""
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    os.environ["LUCARNE_STATE"] = tempfile.mkdtemp(prefix="lucarne-pictures-")
    from PIL import Image
    from PySide6.QtGui import QImage
    from PySide6.QtWidgets import QApplication

    from studio.app import assemble
    from studio.samples import sample
    from studio_ui.feed import Freshness
    from studio_ui.settings import Settings, state_folder

    application = QApplication(sys.argv[:1])
    settings = Settings(state_folder())
    settings.set("theme", theme)
    studio = assemble(settings=settings)
    studio.window.resize(*WINDOW)
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
    studio.window.docks["lighting" if theme == "light" else "properties"].raise_()
    wait(0.5)
    shown = studio.window.grab().toImage().convertToFormat(QImage.Format.Format_RGB888)
    rows = np.frombuffer(shown.constBits(), np.uint8).reshape(shown.height(), shown.bytesPerLine())
    pixels = rows[:, : 3 * shown.width()].reshape(shown.height(), shown.width(), 3)
    Image.fromarray(pixels).save(HERE / f"window-{theme}-{percent}.webp", quality=88, method=6)
    studio.close()


def frames(
    project: str = "living-room", thing: str = "Chair at the back", way: Way = WAY, steps: int = STEPS
) -> Iterator[np.ndarray]:
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
    scene = open_scene(sample(project))
    held = next(n for n in scene.nodes.values() if n.name == thing)
    backend = program.registry.get("backend", "cuts")
    pipeline = Pipeline([*backend.stages(program.services), PictureStage(program.services)])
    view = dataclasses.replace(scene_view(scene, None, *SIZE), antialias=2)
    params = backend.Params()
    pipeline.update(Frame(scene, view, params), everything(scene), Job("room"))
    shown = scene
    for step in range(steps + 1):
        share = 0.5 - 0.5 * np.cos(np.pi * step / steps)
        x, z = (a + share * (b - a) for a, b in zip(*way, strict=True))
        moved = Move({held.id: Transform((float(x), 0.0, float(z))) @ held.transform})(scene)
        last = step == steps
        changes = diff(shown, moved)
        if last:
            changes |= view_changed() | view_changed(Aspect.QUALITY)
        frame = Frame(moved, view, params, step, moving=not last)
        picture, shown = pipeline.update(frame, changes, Job("drag")), moved
        yield tonemap(picture.linear, 0.0, "srgb")


def chair() -> None:
    """A drag, and the rest after it."""
    _filmed(frames(), "dragged-chair")


def captured() -> None:
    """The coffee table, dragged over captured stone in front of the captured sofa."""
    _filmed(frames("captured-room", "Coffee table", TABLE_WAY, TABLE_STEPS), "captured-room")


def between() -> None:
    """Straight light alone and all light, before and after the red cabinet is dragged."""
    from PIL import Image

    from studio.headless import Headless
    from studio.samples import sample
    from studio.verbs import open_scene
    from studio_core.edits import Move
    from studio_core.kernels.tonemap import tonemap
    from studio_core.params import build
    from studio_core.scene.transform import Transform
    from studio_core.shading.frame import IndirectChoice
    from studio_core.shading.offline import picture, scene_view

    program = Headless(quiet=True)
    scene = open_scene(sample("red-cabinet"))
    cabinet = next(n for n in scene.nodes.values() if n.name == "Red cabinet")
    moved = Move({cabinet.id: Transform(DRAGGED) @ cabinet.transform})(scene)
    backend, method = program.registry.get("backend", "cuts"), program.registry.get("indirect", "gather")
    choices = (None, IndirectChoice("gather", build(method.Params, {"bounces": 6})))
    rows = []
    for shown in (scene, moved):
        view = dataclasses.replace(scene_view(shown, None, *HALF), antialias=2)
        made = [
            picture(shown, view, backend, backend.Params(), program.services, indirect=choice).linear
            for choice in choices
        ]
        rows.append(np.hstack([tonemap(linear, 0.0, "srgb") for linear in made]))
    Image.fromarray(np.vstack(rows)).save(HERE / "red-cabinet.webp", quality=86, method=6)


def _filmed(pictures: Iterator[np.ndarray], name: str) -> None:
    from PIL import Image

    made = [Image.fromarray(pixels) for pixels in pictures]
    times = [PER_PICTURE] * (len(made) - 1) + [REST * PER_PICTURE]
    made[0].save(
        HERE / f"{name}.webp",
        save_all=True,
        append_images=made[1:],
        duration=times,
        loop=0,
        quality=82,
        method=6,
    )


def around() -> np.ndarray:
    """(2 FACE, 4 FACE, 3) the light at one place of the sample room, its furniture in the middle."""
    from studio.headless import Headless
    from studio.samples import sample
    from studio.verbs import open_scene
    from studio_core.imaging.cubemap import equirect_from_cube
    from studio_core.raster import PictureStage
    from studio_core.scene.diff import everything
    from studio_core.scene.transform import looking
    from studio_core.session import View
    from studio_core.shading.frame import Frame
    from studio_core.shading.job import Job
    from studio_core.shading.pipeline import Pipeline

    program = Headless(quiet=True)
    scene = open_scene(sample())
    backend = program.registry.get("backend", "cuts")
    pipeline = Pipeline([*backend.stages(program.services), PictureStage(program.services)])
    up, back, ahead = (0, 1, 0), (0, 0, 1), (0, 0, -1)
    sides = [((1, 0, 0), up), ((-1, 0, 0), up), (up, back), ((0, -1, 0), ahead), (back, up), (ahead, up)]
    faces = []
    for towards, above in sides:
        place = looking(PHONE_AT, np.add(PHONE_AT, towards), above)
        frame = Frame(scene, View(place, 90.0, FACE, FACE), backend.Params())
        faces.append(pipeline.update(frame, everything(scene), Job("room")).linear)
    light = equirect_from_cube(np.stack(faces).astype(np.float32))
    return np.roll(light, round(-0.4 * light.shape[1]), axis=1)


def capture() -> None:
    """Photographs of the sample room, and the panel on two of its steps."""
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    os.environ["LUCARNE_STATE"] = tempfile.mkdtemp(prefix="lucarne-pictures-")
    from PIL import Image
    from PySide6.QtGui import QImage
    from PySide6.QtWidgets import QApplication

    from studio.app import assemble
    from studio.bench.phone import Arc, Phone, shoot
    from studio.bench.phone_files import write_shots
    from studio_core.imaging.projection import Circle, Lens
    from studio_ui.settings import Settings, state_folder

    phone = Phone(
        size=(1480, 1110),
        lens=Lens(fov=196),
        circle=Circle(735.0, 562.0, 490.0),
        evs=(-4.0, -2.0, 0.0, 2.0),
        listed_errors=((0.0, 0.0, 0.8, 0.0), ()),
        arcs=(Arc("front", 35, 45, 6, 1.3), Arc("back", 200, 35, 6, 1.0)),
        falloff=0.2,
        misalignment=(1.5, -1.0, 0.8),
        tilt=(2.0, 3.0, -2.0),
        shake=0.1,
        jpeg=94,
    )
    folder = Path(tempfile.mkdtemp(prefix="lucarne-shots-"))
    front, back = write_shots(shoot(around(), phone, 1), folder)
    application = QApplication(sys.argv[:1])
    settings = Settings(state_folder())
    settings.set("capture_placed", True)
    studio = assemble(settings=settings)
    studio.window.show()
    panel, dock = studio.window.capture_panel, studio.window.docks["capture"]

    def wait(for_what: Callable[[], bool]) -> None:
        until = time.monotonic() + 5 * SETTLED
        while not for_what():
            if time.monotonic() > until:
                raise SystemExit("the capture did not come to an end")
            application.processEvents()
            time.sleep(0.01)

    panel.reading.take([*front, *back])
    wait(lambda: panel.desk.capture is not None)
    dock.setFloating(True)
    dock.resize(*PANEL)
    wait(lambda: "captured" in panel.desk.fresh and not studio.context.tasks.running)
    for step in STEPS_SHOWN:
        panel.work.go(step)
        shown_until = time.monotonic() + 3
        wait(lambda until=shown_until: time.monotonic() > until)
        shown = dock.grab().toImage().convertToFormat(QImage.Format.Format_RGB888)
        rows = np.frombuffer(shown.constBits(), np.uint8).reshape(shown.height(), shown.bytesPerLine())
        pixels = rows[:, : 3 * shown.width()].reshape(shown.height(), shown.width(), 3)
        Image.fromarray(pixels).save(HERE / f"capture-{step}.webp", quality=86, method=6)
    studio.close()


def library() -> None:
    """The library as a person finds it, dark beside light."""
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    os.environ["LUCARNE_STATE"] = tempfile.mkdtemp(prefix="lucarne-pictures-")
    os.environ["LUCARNE_MATERIALS"] = tempfile.mkdtemp(prefix="lucarne-materials-")
    from PIL import Image
    from PySide6.QtWidgets import QApplication

    application = QApplication(sys.argv[:1])
    both = [shelf(application, theme) for theme in ("dark", "light")]
    Image.fromarray(np.hstack(both)).save(HERE / "library.webp", quality=88, method=6)


def shelf(application: QApplication, theme: str) -> np.ndarray:
    """The library's panel, with a material of the sample room kept in it."""
    from PySide6.QtGui import QImage

    from studio.app import assemble
    from studio.samples import sample
    from studio_ui.settings import Settings, state_folder

    settings = Settings(state_folder())
    settings.set("theme", theme)
    studio = assemble(settings=settings)
    panel, dock = studio.window.panels["library"], studio.window.docks["library"]
    until = time.monotonic() + SETTLED

    def wait(for_what: Callable[[], bool]) -> None:
        while not for_what():
            if time.monotonic() > until:
                raise SystemExit("the library was not drawn")
            application.processEvents()
            time.sleep(0.01)

    studio.window.show()
    studio.window.files.open_copy(sample())
    wait(lambda: bool(studio.context.document.scene.materials))
    panel.keep(tuple(m.id for m in studio.context.document.scene.materials.values() if m.name == "Woven rug"))
    dock.setFloating(True)
    dock.resize(*LIBRARY)
    dock.show()
    work, rest = studio.window.panels["materials"].work, time.monotonic() + 2
    wait(lambda: studio.context.warm and bool(panel.view.entries) and time.monotonic() > rest)
    wait(lambda: not work.busy)
    shown = panel.grab().toImage().convertToFormat(QImage.Format.Format_RGB888)
    rows = np.frombuffer(shown.constBits(), np.uint8).reshape(shown.height(), shown.bytesPerLine())
    studio.close()
    return rows[:, : 3 * shown.width()].reshape(shown.height(), shown.width(), 3).copy()


def fit() -> None:
    """The report of a material from photographs: a glossy one with spots that are not."""
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    os.environ["LUCARNE_STATE"] = tempfile.mkdtemp(prefix="lucarne-pictures-")
    from PySide6.QtWidgets import QApplication

    from studio.app import assemble
    from studio.bench.lab import dome, shoot
    from studio.bench.lab_files import write_shots
    from studio.bench.lab_surfaces import library
    from studio.bench.materials_captured import REAL
    from studio_ui.settings import Settings, state_folder

    folder = Path(tempfile.mkdtemp(prefix="lucarne-shots-")) / "Lacquered cork"
    folder.mkdir()
    write_shots(shoot(library()["two-component"], dome((-40.0, 0.0, 40.0)), REAL), folder)
    application = QApplication(sys.argv[:1])
    studio = assemble(settings=Settings(state_folder()))
    studio.window.show()
    dialog = studio.window.fitting.show(folder)
    dialog.order.size_.setCurrentText("128 × 128")
    dialog.fit()
    page = dialog.report

    def ready() -> bool:
        return (
            page.fitted is not None and page.ball.image is not None and page.pictures.view.shown is not None
        )

    rest = time.monotonic() + 5 * SETTLED
    while not ready():
        if time.monotonic() > rest:
            raise SystemExit("nothing was fitted")
        application.processEvents()
        time.sleep(0.01)
    if not dialog.grab().save(str(HERE / "fit.webp"), "webp", 88):
        raise SystemExit("the picture cannot be written")
    studio.close()


def strokes() -> None:
    """The stroke panel after a stroke on the sofa in the colour of the armchair."""
    from painted_in_the_window import SOFA, photograph

    photograph(SOFA, HERE / "strokes.webp", WINDOW, 5 * SETTLED)


def tint() -> None:
    """The stroke panel after the red cabinet's light on the wall was painted away."""
    from painted_in_the_window import TINT, photograph

    photograph(TINT, HERE / "strokes-tint.webp", WINDOW, 5 * SETTLED)


def bases() -> None:
    """Figure 8 of the interreflection paper."""
    from studio.bench.interreflection_figures import figure_8
    from studio.bench.plot import svg
    from studio.headless import Headless

    (HERE / "interreflection-bases.svg").write_text(svg(figure_8(Headless(quiet=True).services)))


def products() -> None:
    """Figure 10 of the interreflection paper."""
    from studio.bench.interreflection_figures import figure_10
    from studio.bench.plot import svg
    from studio.headless import Headless

    (HERE / "interreflection-products.svg").write_text(svg(figure_10(Headless(quiet=True))))


def figures(*numbers: str) -> None:
    """Figures 14–22 of the paper on strokes, or some of them."""
    from PIL import Image

    from studio.bench.strokes_figure_pictures import sheet
    from studio.bench.strokes_figure_sessions import FIGURES
    from studio.bench.strokes_figures import play
    from studio.headless import Headless

    program = Headless(quiet=True)
    for number in [int(one) for one in numbers] or FIGURES:
        made = sheet(FIGURES[number], play(FIGURES[number], program))
        Image.fromarray(made).save(HERE / f"strokes-figure-{number}.webp", quality=84, method=6)


def painted() -> None:
    """The sample room, two strokes, and what becomes of it."""
    from PIL import Image

    from studio.bench.strokes_figure_pictures import sheet
    from studio.bench.strokes_figures import Act, Session, play
    from studio.headless import Headless
    from studio.samples import sample
    from studio.verbs import open_scene

    session = Session(
        "The sample room", lambda: open_scene(sample()), (Act(tuple(PAINTED)),), lambda played: {}, {}
    )
    made = sheet(session, play(session, Headless(quiet=True), size=HALF))
    Image.fromarray(made).save(HERE / "painted-room.webp", quality=86, method=6)


if __name__ == "__main__":
    makers = {"room": room, "windows": windows, "window": window, "chair": chair, "capture": capture}
    makers |= {"library": library, "captured": captured, "fit": fit, "between": between}
    makers |= {"bases": bases, "products": products, "strokes": strokes, "tint": tint}
    makers |= {"figures": figures, "painted": painted}
    makers[sys.argv[1]](*sys.argv[2:])
