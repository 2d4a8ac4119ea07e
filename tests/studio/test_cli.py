"""The command line from end to end: what every verb gives, and what it says to bad input."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from oracles.raycast import nearest
from scenes import little_scene

import studio.display
import studio.verbs
import studio.verbs_pictures
from studio.bench.lab import Rig, row, shoot
from studio.bench.lab_files import write_shots
from studio.bench.lab_surfaces import library
from studio.bench.phone_files import write_photograph
from studio.cli import BAD_INPUT, INTERRUPTED, NOBODY_READS, OUR_FAULT, VERBS, main, parser
from studio_core.errors import LucarneError
from studio_core.imaging.encode import write_exr
from studio_core.imaging.io import ImageDecoder
from studio_core.imaging.latlong import direction_to_uv
from studio_core.imaging.photograph import Photograph, ShotFacts
from studio_core.project.lock import acquire
from studio_core.project.recovery import RecoveryFile, recovery_path
from studio_core.project.store import load, save
from studio_plugins.residual.samples import Ball

ROOT = Path(__file__).resolve().parents[2]
QUICK = ("--param", "directions=1024", "--param", "vertices=500")
SMALL = (*QUICK, "--size", "32x18", "--antialias", "1")


class Said(NamedTuple):
    """What a command left behind."""

    status: int
    out: str
    err: str


Run = Callable[..., Said]


@pytest.fixture
def run(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Run:
    """Runs a command in a folder of its own; what C libraries print counts as well."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("LUCARNE_TRACEBACK", raising=False)

    def call(*arguments: object) -> Said:
        capfd.readouterr()
        status = main([str(argument) for argument in arguments])
        return Said(status, *capfd.readouterr())

    return call


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project that nobody changes: a cube on a floor under a sky."""
    path = tmp_path_factory.mktemp("projects") / "room.lucarne"
    save(path, little_scene())
    return path


@pytest.fixture
def files(room: Path, tmp_path: Path, run: Run) -> Path:
    """The test's folder with a project, a model, a picture, and things that are none of these."""
    (tmp_path / "room.lucarne").write_bytes(room.read_bytes())
    whole = room.read_bytes()
    (tmp_path / "damaged.lucarne").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "text.lucarne").write_text("a shopping list\n")
    (tmp_path / "folder.lucarne").mkdir()
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "folder.obj").mkdir()
    (tmp_path / "box.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    )
    (tmp_path / "empty.obj").write_text("")
    (tmp_path / "broken.glb").write_bytes(b"glTF\x02\x00\x00\x00\xff\xff\xff\x7f")
    (tmp_path / "square.exr").write_text("no picture")
    write_exr(tmp_path / "sky.exr", np.ones((4, 8, 3), np.float32))
    write_exr(tmp_path / "square.exr", np.ones((8, 8, 3), np.float32))
    return tmp_path


def refused(said: Said, *words: str, status: int = BAD_INPUT) -> None:
    """One line on stderr with these words, nothing on stdout, no traceback."""
    assert said.status == status
    assert said.out == ""
    (line,) = said.err.splitlines()
    assert line.startswith("lucarne: ")
    assert "Traceback" not in line
    for word in words:
        assert word in line


def python(*arguments: str, **settings: Any) -> subprocess.CompletedProcess[str]:
    """A fresh interpreter that finds the project."""
    paths = os.pathsep.join(str(ROOT / folder) for folder in (".", "ui", "plugins"))
    settings["env"] = {**os.environ, "PYTHONPATH": paths, **settings.get("env", {})}
    settings = {"capture_output": True, "text": True, "check": False, "timeout": 300, **settings}
    return subprocess.run([sys.executable, "-W", "error", *arguments], **settings)


# --- what is refused ---------------------------------------------------------------------------------

RENDER = ("render", "room.lucarne", "-o", "x.png")
RADIANCE = ("radiance", "room.lucarne", "-o", "x.npz")
NEW = ("new", "made.lucarne")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("rendr",), ("'rendr'", "render", "doctor")),
        (("nix.lucarne",), ("nix.lucarne", "neither a verb nor a project file")),
        (("folder.lucarne",), ("folder.lucarne", "is a folder")),
        (("room.lucarne", "damaged.lucarne"), ("one project",)),
        (("--frobnicate",), ("VERB", "--help")),
        (("info",), ("PROJECT", "lucarne info --help")),
        (("info", "nix.lucarne"), ("nix.lucarne", "no such file")),
        (("info", "folder.lucarne"), ("folder.lucarne",)),
        (("info", "text.lucarne"), ("text.lucarne", "not a Lucarne project")),
        (("info", "damaged.lucarne"), ("damaged.lucarne",)),
        (("info", "box.obj"), ("box.obj", "not a Lucarne project")),
        (("info", "room.lucarne", "--jsn"), ("--jsn",)),
        (("render", "room.lucarne"), ("-o",)),
        (("render", "nix.lucarne", "-o", "x.png"), ("nix.lucarne", "no such file")),
        (("render", "damaged.lucarne", "-o", "x.png"), ("damaged.lucarne",)),
        (("render", "folder.lucarne", "-o", "x.png"), ("folder.lucarne",)),
        (("render", "room.lucarne", "-o", "x.jpg"), ("x.jpg", ".png", ".exr")),
        (("render", "room.lucarne", "-o", "folder.png"), ("folder.png", "is a folder")),
        (("render", "room.lucarne", "-o", "no/x.png"), ("no/x.png", "there is no folder no")),
        (("render", "room.lucarne", "-o", "box.obj/x.png"), ("box.obj/x.png", "there is no folder")),
        ((*RENDER, "--size", "0x0"), ("--size '0x0'",)),
        ((*RENDER, "--size=-1x5"), ("--size '-1x5'",)),
        ((*RENDER, "--size", "800"), ("--size '800'", "WIDTHxHEIGHT")),
        ((*RENDER, "--size", "1e3x2"), ("--size '1e3x2'", "WIDTHxHEIGHT")),
        ((*RENDER, "--size", "99999x1"), ("--size '99999x1'", "16384")),
        ((*RENDER, "--exposure", "nan"), ("--exposure nan",)),
        ((*RENDER, "--exposure", "inf"), ("--exposure inf",)),
        ((*RENDER, "--exposure", "1e300"), ("--exposure 1e+300",)),
        ((*RENDER, "--exposure", "bright"), ("--exposure", "'bright'")),
        ((*RENDER, "--antialias", "0"), ("--antialias",)),
        ((*RENDER, "--tonemap", "sepia"), ("--tonemap", "sepia", "filmic")),
        ((*RENDER, "--threads", "0"), ("--threads", "'0'")),
        ((*RENDER, "--threads", "-2"), ("--threads", "'-2'")),
        ((*RENDER, "--threads", "many"), ("--threads", "'many'")),
        ((*RENDER, "--backend", "cutz"), ("backend 'cutz'", "reference")),
        ((*RENDER, "--param", "colour=1"), ("--param", "'colour'", "directions")),
        ((*RENDER, "--param", "directions"), ("--param 'directions'", "KEY=VALUE")),
        ((*RENDER, "--param", "directions=1000"), ("--param", "1000", "1024")),
        ((*RENDER, "--param", "vertices=nan"), ("--param", "vertices", "nan")),
        ((*RENDER, "--param", "vertices=-1"), ("--param", "vertices", "500")),
        ((*RENDER, "--param", "vertices=1e99"), ("--param", "vertices", "5e+06")),
        ((*RENDER, "--param", "everywhere=perhaps"), ("--param", "everywhere", "true or false")),
        ((*RENDER, "--camera", "Nobody"), ("'Nobody'", "'Camera'")),
        ((*RENDER, "--camera", "Floor"), ("'Floor'", "'Camera'")),
        ((*RENDER, "--indirect", "bounce"), ("--indirect 'bounce'", "none")),
        ((*RENDER, "--indirect", "none", "--light", "share"), ("--light share", "--indirect")),
        ((*RENDER, "--light", "dim"), ("--light", "'dim'", "share")),
        ((*RENDER, "--light", "share", "--alpha"), ("--light share", "--alpha")),
        ((*RENDER, "--indirect", "none", "--indirect-param", "level=1"), ("--indirect-param", "--indirect")),
        ((*RENDER, "--indirect", "none", "--bounces", "3"), ("--bounces", "--indirect")),
        ((*RENDER, "--bounces", "some"), ("--bounces", "'some'")),
        (("radiance", "room.lucarne", "-o", "x.txt"), ("x.txt", ".npz")),
        (("radiance", "nix.lucarne", "-o", "x.npz"), ("nix.lucarne", "no such file")),
        ((*RADIANCE, "--directions", "0"), ("directions", "'0'", "1024")),
        ((*RADIANCE, "--directions", "many"), ("--directions", "'many'")),
        ((*RADIANCE, "--camera", "Nobody"), ("'Nobody'",)),
        ((*RADIANCE, "--indirect", "bounce"), ("--indirect 'bounce'",)),
        (("export", "room.lucarne", "-o", "x.obj"), ("x.obj", ".glb", "Mitsuba")),
        (("export", "room.lucarne", "-o", "no/x.glb"), ("no/x.glb", "there is no folder")),
        (("export", "nix.lucarne", "-o", "x.glb"), ("nix.lucarne", "no such file")),
        (("script", "nix.py"), ("nix.py", "no such file")),
        (("script", "folder.obj"), ("folder.obj",)),
        (("bench", "nix"), ("'nix'", "reference")),
        (("bench",), ("NAME",)),
        (("stress", "nix"), ("'nix'",)),
        (("bench", "reference", "--json", "no/x.json"), ("no/x.json", "there is no folder")),
        (("demo", "--headless", "-o", "x.tiff"), ("x.tiff", ".png")),
        (("demo", "--headless", "-o", "no/x.png"), ("no/x.png", "there is no folder")),
        (("demo", "--headless", "--size", "big"), ("--size 'big'",)),
        (("demo", "--headless", "--param", "x=1"), ("--param", "'x'")),
        (("new",), ("OUT.lucarne",)),
        (("new", "made.zip"), ("made.zip", ".lucarne")),
        (("new", "no/made.lucarne"), ("no/made.lucarne", "there is no folder")),
        (("new", "folder.lucarne"), ("folder.lucarne", "is a folder")),
        (("new", "text.lucarne"), ("text.lucarne", "not a Lucarne project")),
        (("new", "damaged.lucarne"), ("damaged.lucarne",)),
        ((*NEW, "--mesh", "nix.obj"), ("nix.obj", "no such file")),
        ((*NEW, "--mesh", "nix.obj@0,0,0"), ("nix.obj", "no such file")),
        ((*NEW, "--mesh", "folder.obj"), ("folder.obj",)),
        ((*NEW, "--mesh", "sky.exr"), ("sky.exr", ".obj")),
        ((*NEW, "--mesh", "empty.obj"), ("empty.obj",)),
        ((*NEW, "--mesh", "broken.glb"), ("broken.glb",)),
        ((*NEW, "--mesh", "box.obj@1,2"), ("--mesh 'box.obj@1,2'", "x,y,z")),
        ((*NEW, "--mesh", "box.obj@1,2,nan"), ("--mesh", "finite", "nan")),
        ((*NEW, "--mesh", "box.obj@a,b,c"), ("--mesh", "numbers")),
        ((*NEW, "--mesh", "box.obj@0,0,1e99"), ("--mesh", "1e+06 metres")),
        ((*NEW, "--mesh", "box.obj@0,0,0,0,-1"), ("--mesh", "scale")),
        ((*NEW, "--mesh", "box.obj@0,0,0,0,1e-30"), ("--mesh", "scale")),
        ((*NEW, "--env", "nix.exr"), ("nix.exr", "no such file")),
        ((*NEW, "--env", "square.exr"), ("square.exr", "8 × 8")),
        ((*NEW, "--env", "box.obj"), ("box.obj",)),
        ((*NEW, "--env", "folder.obj"), ("folder.obj",)),
        ((*NEW, "--floor", "-6"), ("--floor -6",)),
        ((*NEW, "--floor", "0"), ("--floor 0",)),
        ((*NEW, "--floor", "nan"), ("--floor nan",)),
        ((*NEW, "--floor", "1e9"), ("--floor 1e+09",)),
        ((*NEW, "--floor", "large"), ("--floor", "'large'")),
        ((*NEW, "--unit", "ell"), ("--unit", "'ell'")),
        ((*NEW, "--floor", "6", "--material", "Floor"), ("--material 'Floor'", "NODE=KIND")),
        ((*NEW, "--floor", "6", "--material", "Flor=ggx"), ("--material", "'Flor'", "'Floor'")),
        ((*NEW, "--floor", "6", "--material", "Floor=velvet"), ("--material", "'velvet'", "lambert")),
        ((*NEW, "--floor", "6", "--material", "Floor=ggx:shine=1"), ("--material", "'shine'", "roughness")),
        ((*NEW, "--floor", "6", "--material", "Floor=ggx:roughness=9"), ("--material", "roughness", "'9'")),
        ((*NEW, "--floor", "6", "--material", "Floor=ggx:roughness"), ("--material", "roughness=VALUE")),
        ((*NEW, "--floor", "6", "--material", "Floor=lambert:base_color=red"), ("--material", "'red'")),
        ((*NEW, "--camera", "here"), ("--camera 'here'", "from=")),
        ((*NEW, "--camera", "from=0,0,0:to=0,0,0"), ("--camera", "coincide")),
        ((*NEW, "--camera", "from=0,0,1:to=0,0,nan"), ("--camera", "finite")),
        ((*NEW, "--camera", "from=0,0,1:to=0,0,0:fov=180"), ("--camera", "fov", "170")),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else None,
)
def test_bad_input_is_refused_in_one_line(
    arguments: tuple[str, ...], words: tuple[str, ...], files: Path, run: Run
) -> None:
    before = sorted(files.rglob("*"))
    refused(run(*arguments), *words)
    assert sorted(files.rglob("*")) == before


def test_a_picture_larger_than_the_memory_is_refused(
    files: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(studio.verbs_pictures, "memory", lambda: 5e8)
    refused(run(*RENDER, "--size", "16384x16384"), "--size 16384x16384", "1.9 GB", "0.5 GB")


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="needs a folder that takes no file")
@pytest.mark.parametrize(
    "arguments",
    [
        ("render", "room.lucarne", "-o", "/proc/x.png", *SMALL),
        ("render", "room.lucarne", "-o", "/proc/x.exr", *SMALL),
        ("radiance", "room.lucarne", "-o", "/proc/x.npz", *QUICK),
        ("export", "room.lucarne", "-o", "/proc/x.glb"),
        ("export", "room.lucarne", "-o", "/proc/x"),
        ("new", "/proc/x.lucarne"),
    ],
    ids=lambda arguments: f"{arguments[0]} {Path(arguments[3]).suffix if len(arguments) > 3 else ''}",
)
def test_a_folder_that_takes_no_file_is_named(arguments: tuple[str, ...], files: Path, run: Run) -> None:
    refused(run(*arguments, "--quiet"), "x" if arguments[0] == "new" else "/proc/x")


def test_without_a_display_the_window_says_why(
    run: Run, files: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(studio.display, "why_no_window", lambda: "there is no display")
    for arguments in ((), ("room.lucarne",)):
        refused(run(*arguments), "there is no display", "lucarne demo --headless")


def test_the_offscreen_platform_shows_no_window(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("QT_QPA_PLATFORM", "offscreen")
    assert "offscreen" in studio.display.why_no_window()


# --- our own mistakes, and what comes from outside ---------------------------------------------------


def _raise(error: BaseException) -> Callable[..., None]:
    def call(*_: object, **__: object) -> None:
        raise error

    return call


def test_our_own_mistake_is_one_line_and_says_where_on_demand(
    run: Run, files: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(studio.verbs, "info", _raise(RuntimeError("first\nsecond \x1b[31m")))
    said = run("info", "room.lucarne")
    refused(said, "RuntimeError: first second", "LUCARNE_TRACEBACK=1", status=OUR_FAULT)
    assert "\x1b" not in said.err
    monkeypatch.setenv("LUCARNE_TRACEBACK", "1")
    said = run("info", "room.lucarne")
    assert said.status == OUR_FAULT
    assert "Traceback" in said.err
    assert said.err.splitlines()[-1].startswith("lucarne: ")


@pytest.mark.parametrize(
    ("error", "words", "status"),
    [
        (LucarneError("a\nb"), ("a b",), BAD_INPUT),
        (FileNotFoundError(2, "No such file", "a.obj"), ("a.obj", "no such file"), BAD_INPUT),
        (OSError(28, "No space left on device"), ("the disk is full",), BAD_INPUT),
        (OSError("strange"), ("strange",), BAD_INPUT),
        (MemoryError(), ("not enough memory",), BAD_INPUT),
        (KeyboardInterrupt(), ("stopped",), INTERRUPTED),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BaseException) else None,
)
def test_what_goes_wrong_outside_is_one_line(
    error: BaseException,
    words: tuple[str, ...],
    status: int,
    run: Run,
    files: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(studio.verbs, "info", _raise(error))
    refused(run("info", "room.lucarne"), *words, status=status)


@pytest.mark.skipif(os.name != "posix", reason="SIGINT to a child")
def test_ctrl_c_stops_a_render_and_leaves_nothing(tmp_path: Path) -> None:
    import pty

    try:
        ours, theirs = pty.openpty()  # progress is shown to a terminal only
    except OSError as error:  # a chroot without /dev/pts
        pytest.skip(f"this machine gives no terminal: {error}")
    paths = os.pathsep.join(str(ROOT / folder) for folder in (".", "ui", "plugins"))
    command = "import sys; from studio.cli import main; sys.exit(main())"
    demo = ["demo", "--headless", "-o", str(tmp_path / "x.png"), "--param", "directions=131072"]
    child = subprocess.Popen(
        [sys.executable, "-c", command, *demo],
        stdout=subprocess.PIPE,
        stderr=theirs,
        env={**os.environ, "PYTHONPATH": paths},
    )
    os.close(theirs)
    shown = b""
    while b"%" not in shown:
        shown += os.read(ours, 1000)
    child.send_signal(signal.SIGINT)
    out, _ = child.communicate(timeout=60)
    with pytest.raises(OSError):  # noqa: PT011 - Linux' word for the end of a terminal
        while True:
            shown += os.read(ours, 1000)
    os.close(ours)
    assert child.returncode == INTERRUPTED
    assert out == b""
    assert shown.decode().splitlines()[-1] == "lucarne: stopped"
    assert "Traceback" not in shown.decode()
    assert list(tmp_path.iterdir()) == []


COMMAND = "import sys; from studio.cli import main; sys.exit(main())"


@pytest.mark.skipif(os.name != "posix", reason="closes streams with a shell")
@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_closed_streams_do_no_harm(closed: str, room: Path, tmp_path: Path) -> None:
    script = f'"$0" -c "$1" render "$2" -o "$3" {" ".join(SMALL)} {closed}'
    paths = os.pathsep.join(str(ROOT / folder) for folder in (".", "ui", "plugins"))
    done = subprocess.run(
        ["sh", "-c", script, sys.executable, COMMAND, str(room), str(tmp_path / "x.png")],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": paths},
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert (tmp_path / "x.png").stat().st_size > 100


def test_a_reader_that_goes_away_is_no_accident(room: Path) -> None:
    paths = os.pathsep.join(str(ROOT / folder) for folder in (".", "ui", "plugins"))
    child = subprocess.Popen(
        [sys.executable, "-c", COMMAND, "info", str(room)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": paths},
    )
    assert child.stdout is not None
    assert child.stderr is not None
    child.stdout.close()
    assert child.stderr.read() == b""
    child.stderr.close()
    assert child.wait(60) == NOBODY_READS


def test_names_that_the_terminal_cannot_show_are_shown_escaped(tmp_path: Path) -> None:
    done = python("-c", COMMAND, "new", "kamén.lucarne", cwd=tmp_path, env={"PYTHONIOENCODING": "ascii"})
    assert done.returncode == 0
    assert done.stdout == "kam\\xe9n.lucarne: 1 nodes, 0 faces\n"
    assert (tmp_path / "kamén.lucarne").is_file()


# --- what loads ---------------------------------------------------------------------------------------


def test_no_verb_without_a_window_loads_qt(files: Path) -> None:
    shades = np.tile(np.arange(0, 256, 2, dtype=np.uint8)[None, :, None], (64, 1, 3))
    write_photograph(Photograph(shades, ShotFacts("all.jpg"), "0"), files / "all.jpg")
    (files / "script.py").write_text("import studio_core")
    (files / "strokes.json").write_text('[{"path": [[0.5, 0.5]], "size": [48, 27]}]')
    commands = [
        ["new", "made.lucarne", "--mesh", "box.obj", "--env", "sky.exr", "--floor", "3"],
        ["info", "made.lucarne"],
        ["copy", "made.lucarne", "-o", "copy.lucarne"],
        ["compact", "made.lucarne"],
        ["render", "made.lucarne", "-o", "x.png", *SMALL],
        ["frames", "made.lucarne", "--turntable", "1", "-o", "x.png", *SMALL],
        ["radiance", "made.lucarne", "-o", "x.npz", *QUICK],
        ["export", "made.lucarne", "-o", "x.glb"],
        ["export", "made.lucarne", "-o", "mitsuba"],
        ["demo", "--headless", "-o", "demo.png", *SMALL],
        ["script", "script.py"],
        ["precompute", "made.lucarne", *QUICK],
        ["strokes", "made.lucarne", "strokes.json", "-o", "painted.lucarne", *QUICK],
        ["stylise", "painted.lucarne", "-o", "painted.lucarne", *QUICK],
        ["capture", "--equirect", "all.jpg", "-o", "light.exr", "--set", "stitch.width=64"],
        ["fit-brdf", "chalk.csv", "--model", "lambert", "-o", "chalk.lucmat"],
        ["fit-material", "ball", "--size", "8", "--no-refine", "--basis", "albedo"],
        ["materials", "chalk.lucmat", "-o", "chalk.glb"],
        ["doctor"],
    ]
    (files / "ball").mkdir()
    small = Rig(size=(64, 64), ball=Ball(32, 32, 20), samples=1)
    write_shots(shoot(library()["textured"], row(), small), files / "ball")
    rows = "".join(f"{i},{o},{p},0.1,0.1,0.1\n" for i in (0, 40) for o in (10, 50) for p in (0, 90, 180))
    (files / "chalk.csv").write_text("theta_i,theta_o,phi,R,G,B\n" + rows)
    assert {command[0] for command in commands} | {"bench", "stress"} == set(VERBS)
    source = f"""
import sys
from studio.cli import main
for command in {commands}:
    assert main(command) == 0, command
    found = {{'PySide6', 'vispy', 'pyqtgraph'}} & {{name.split('.')[0] for name in sys.modules}}
    if command[0] != 'doctor':  # which asks the window's own report of the graphics card, in a child
        found |= {{'studio_ui'}} & {{name.split('.')[0] for name in sys.modules}}
    assert not found, (command, found)
"""
    done = python("-c", source, cwd=files)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "arguments", [["--help"], ["--version"], ["render", "--help"], ["info", "room.lucarne"]]
)
def test_what_should_be_quick_loads_neither_numba_nor_trimesh(arguments: list[str], files: Path) -> None:
    source = f"""
import sys
from studio.cli import main
assert main({arguments}) == 0
heavy = ('numba', 'trimesh', 'cv2', 'OpenImageIO', 'embreex', 'scipy', 'PySide6')
print(*[name for name in heavy if name in sys.modules], file=sys.stderr)
"""
    done = python("-c", source, cwd=files)
    assert (done.returncode, done.stderr.strip()) == (0, "")
    assert done.stdout


# --- what every verb gives ----------------------------------------------------------------------------


def only_json(said: Said) -> Any:
    """The one document on stdout."""
    assert said.status == 0, said.err
    return json.loads(said.out)


def test_help_and_version_are_successes(run: Run) -> None:
    assert run("--version").out.startswith("lucarne ")
    for arguments in (("--help",), *((verb, "--help") for verb in VERBS)):
        said = run(*arguments)
        assert said.status == 0
        assert said.err == ""
        assert "usage: lucarne" in said.out


def test_render_png_and_exr(files: Path, run: Run) -> None:
    said = only_json(run("render", "room.lucarne", "-o", "x.exr", *SMALL, "--json"))
    assert set(said.pop("seconds")) == {"shading", "composing"}
    assert said.pop("indirect")["method"] == "gather"
    assert said | {"counts": {}, "mean": 0, "vertices": 0, "shaded": 0} == {
        "project": "room.lucarne",
        "picture": "x.exr",
        "light": "all",
        "backend": "cuts",
        "width": 32,
        "height": 18,
        "vertices": 0,
        "shaded": 0,
        "directions": 1024,
        "finite": True,
        "mean": 0,
        "counts": {},
    }
    assert 0 < said["shaded"] <= said["vertices"]
    assert said["counts"]["rays"] > said["shaded"] * 256
    with ImageDecoder() as decoder:
        linear = decoder.read(files / "x.exr").pixels
        assert said["mean"] == pytest.approx(linear.mean(), rel=1e-5)
        plain = run("render", "room.lucarne", "-o", "x.png", *SMALL)
        assert plain.status == 0
        assert plain.out.splitlines()[-1].startswith("x.png: 32×18, ")
        assert re.fullmatch(r"Rendering: \d+\.\d s\n", plain.err)
        run("render", "room.lucarne", "-o", "dark.png", *SMALL, "--exposure", "-2", "--quiet")
        bright, dark = (decoder.read(files / name).pixels for name in ("x.png", "dark.png"))
    assert bright.shape == (18, 32, 3)
    assert dark.mean() < 0.75 * bright.mean()


def test_quiet_says_nothing_but_the_result(files: Path, run: Run) -> None:
    said = run("render", "room.lucarne", "-o", "x.png", *SMALL, "--quiet")
    assert said.err == ""
    assert said.out.count("\n") == 1


def test_a_scene_without_mesh_or_light_is_rendered_with_a_word(files: Path, run: Run) -> None:
    assert run("new", "bare.lucarne").status == 0
    said = run("render", "bare.lucarne", "-o", "x.exr", *SMALL, "--json")
    assert only_json(said)["mean"] == 0
    assert "bare.lucarne shows no mesh" in said.err
    assert "bare.lucarne has no light" in said.err
    assert only_json(run("radiance", "bare.lucarne", "-o", "x.npz", *QUICK, "--json"))["vertices"] == 0
    assert run("export", "bare.lucarne", "-o", "x.glb").status == 0
    assert run("export", "bare.lucarne", "-o", "mitsuba").status == 0
    assert only_json(run("info", "bare.lucarne", "--json"))["nodes"] == {"camera": 1}


def test_render_looks_through_the_camera_that_was_named(files: Path, run: Run) -> None:
    cameras = ("--camera", "from=3,2,3:to=0,0,0", "--camera", "from=0,5,0.01:to=0,0,0:fov=30")
    run("new", "two.lucarne", "--mesh", "box.obj", "--env", "sky.exr", *cameras)
    for name, options in (("first", ()), ("one", ("--camera", "Camera")), ("two", ("--camera", "Camera 2"))):
        assert run("render", "two.lucarne", "-o", f"{name}.exr", *SMALL, *options).status == 0
    with ImageDecoder() as decoder:
        first, one, two = (decoder.read(files / f"{name}.exr").pixels for name in ("first", "one", "two"))
    assert np.array_equal(first, one)
    assert not np.array_equal(first, two)


def test_radiance_can_be_repeated_by_somebody_else(files: Path, run: Run) -> None:
    """Irradiance by 6,000 spread directions from the origins of the file, traced by a slow oracle."""
    said = only_json(
        run(
            "radiance",
            "room.lucarne",
            "-o",
            "x.npz",
            "--directions",
            4096,
            "--param",
            "vertices=1500",
            "--indirect",
            "none",
            "--json",
        )
    )
    found = np.load(files / "x.npz")
    count = said["vertices"]
    assert said["directions"] == found["directions"] == 4096
    assert list(found["nodes"]) == ["floor", "cube"]
    assert list(found["names"]) == ["Floor", "Cube"]
    shapes = {name: found[name].shape for name in found.files}
    assert shapes == {
        **dict.fromkeys(("position", "origin", "normal", "radiance", "irradiance"), (count, 3)),
        **dict.fromkeys(("node", "area", "side", "valid"), (count,)),
        **{"nodes": (2,), "names": (2,), "directions": ()},
    }
    assert found["valid"].all()
    scene = load(files / "room.lucarne").scene
    assert np.linalg.norm(found["normal"], axis=1) == pytest.approx(np.ones(count), abs=1e-5)
    assert found["area"][found["side"] == 1].sum() == pytest.approx(16 + 6, rel=1e-3)

    i = np.arange(6000) + 0.5
    polar, around = np.arccos(1 - 2 * i / len(i)), np.pi * (1 + 5**0.5) * i
    spread = np.stack([np.sin(polar) * np.cos(around), np.cos(polar), np.sin(polar) * np.sin(around)], axis=1)
    picture = scene["sky"].image.pixels
    u, v = direction_to_uv(spread)
    height, width = picture.shape[:2]
    light = picture[
        np.minimum((v * height).astype(int), height - 1), np.minimum((u * width).astype(int), width - 1)
    ]
    solids = [
        (node.geometry.positions, node.geometry.faces, scene.world(node.id).matrix())
        for node in (scene["floor"], scene["cube"])
    ]
    for vertex in np.random.default_rng(3).choice(count, 25, replace=False):
        cosine = np.maximum(spread @ found["normal"][vertex], 0)
        up = np.flatnonzero(cosine > 0)
        start = np.broadcast_to(found["origin"][vertex].astype(np.float64), (len(up), 3))
        seen = nearest(solids, start, spread[up]).object < 0
        irradiance = (light[up] * (cosine[up] * seen)[:, None]).sum(axis=0) * 4 * np.pi / len(spread)
        assert irradiance == pytest.approx(found["irradiance"][vertex], rel=0.03, abs=0.03)
    matt = found["node"] == 0
    assert found["radiance"][matt] == pytest.approx(found["irradiance"][matt] * 0.5 / np.pi, rel=1e-4)


def test_one_thread_and_two_give_the_same_bits(files: Path, run: Run) -> None:
    for threads in (1, 2):
        said = run("radiance", "room.lucarne", "-o", f"{threads}.npz", "--threads", threads, *QUICK)
        assert said.status == 0
    one, two = (np.load(files / f"{threads}.npz") for threads in (1, 2))
    assert one["irradiance"].any()
    for name in one.files:
        assert np.array_equal(one[name], two[name]), name


def test_info_says_what_is_there(files: Path, run: Run) -> None:
    found = only_json(run("info", "room.lucarne", "--json"))
    assert found["nodes"] == {"camera": 1, "environment": 1, "mesh": 2}
    assert found["materials"] == {"lambert": 2}
    assert found["file_bytes"] == (files / "room.lucarne").stat().st_size
    assert found["opened_by"] is None
    assert [revision["label"] for revision in found["revisions"]] == ["Saved"]
    shown = run("info", "room.lucarne").out
    for text in ("room.lucarne", "1 camera, 1 environment, 2 mesh", "2 lambert", "nobody"):
        assert text in shown


def test_a_project_that_is_open_elsewhere_can_be_read(files: Path, run: Run) -> None:
    with acquire(files / "room.lucarne"):
        assert f"process {os.getpid()}" in only_json(run("info", "room.lucarne", "--json"))["opened_by"]
        assert run("export", "room.lucarne", "-o", "x.glb").status == 0
        refused(run("new", "room.lucarne"), "room.lucarne is open by", f"process {os.getpid()}")


def test_export_gives_a_file_or_a_folder(files: Path, run: Run) -> None:
    made = only_json(run("export", "room.lucarne", "-o", "x.glb", "--json"))
    assert made == {"project": "room.lucarne", "out": "x.glb", "notes": made["notes"]}
    assert (files / "x.glb").read_bytes()[:4] == b"glTF"
    (files / "by.hand").mkdir()
    for folder in ("mitsuba", "by.hand"):
        assert only_json(run("export", "room.lucarne", "-o", folder, "--json"))["out"] == folder
        assert (files / folder / "scene.xml").is_file()
    (files / "plain").write_text("a file")
    refused(run("export", "room.lucarne", "-o", "plain"), "plain", "folder")
    assert (files / "plain").read_text() == "a file"


def test_what_libraries_print_does_not_meet_the_result(
    files: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = studio.verbs.open_scene

    def chatty(path: Path) -> Any:
        print("loading…")
        return real(path)

    monkeypatch.setattr(studio.verbs, "open_scene", chatty)
    said = run("export", "room.lucarne", "-o", "x.glb", "--json")
    assert only_json(said)["out"] == "x.glb"
    assert "loading…" in said.err


def test_demo_without_a_display_says_where_the_picture_is(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(studio.display, "why_no_window", lambda: "there is no display")
    said = run("demo", *SMALL)
    assert said.status == 0
    assert str(tmp_path / "living-room.png") in said.err
    assert "there is no display" in said.err
    assert said.out.startswith("living-room.png: 32×18")
    with ImageDecoder() as decoder:
        assert decoder.read(tmp_path / "living-room.png").pixels.std() > 5


def test_demo_as_json(run: Run, tmp_path: Path) -> None:
    said = only_json(run("demo", "--headless", "-o", tmp_path / "x.png", *SMALL, "--json"))
    assert said["finite"]
    assert said["mean"] > 0.01
    assert (tmp_path / "x.png").is_file()


# --- new over what is there ---------------------------------------------------------------------------


def test_new_keeps_the_project_that_it_replaces(files: Path, run: Run) -> None:
    before = (files / "room.lucarne").read_bytes()
    said = run("new", "room.lucarne", "--floor", "2")
    assert said.status == 0
    assert "room.lucarne~" in said.err
    assert (files / "room.lucarne~").read_bytes() == before
    assert [node.name for node in load(files / "room.lucarne").scene.nodes.values()] == ["Camera", "Floor"]
    assert len(load(files / "room.lucarne").revisions) == 1
    assert run("new", "room.lucarne").status == 0
    assert len(load(files / "room.lucarne~").scene.nodes) == 2
    assert [path.name for path in files.glob(".*")] == []


def test_new_that_fails_leaves_the_project_that_was_there(files: Path, run: Run) -> None:
    before, names = (files / "room.lucarne").read_bytes(), sorted(files.iterdir())
    refused(run("new", "room.lucarne", "--mesh", "nix.obj"), "nix.obj")
    assert (files / "room.lucarne").read_bytes() == before
    assert sorted(files.iterdir()) == names


def test_new_forgets_the_autosave_of_what_it_replaces(files: Path, run: Run) -> None:
    path = files / "room.lucarne"
    RecoveryFile(recovery_path(path), path).write(little_scene(cube_size=0.5))
    assert run("new", "room.lucarne").status == 0
    assert not recovery_path(path).exists()


def test_new_fills_an_empty_file(files: Path, run: Run) -> None:
    (files / "made.lucarne").touch()
    assert run("new", "made.lucarne").status == 0
    assert not (files / "made.lucarne~").exists()


def test_new_does_not_write_over_a_folder_that_stands_where_the_old_would_be_kept(
    files: Path, run: Run
) -> None:
    (files / "room.lucarne~").mkdir()
    before = (files / "room.lucarne").read_bytes()
    refused(run("new", "room.lucarne"), "room.lucarne~")
    assert (files / "room.lucarne").read_bytes() == before


# --- scripts ------------------------------------------------------------------------------------------


def script(files: Path, text: str) -> str:
    (files / "own.py").write_text(text)
    return "own.py"


def test_a_script_sees_its_arguments_and_neighbours(files: Path, run: Run) -> None:
    (files / "neighbour.py").write_text("WORD = 'hello'")
    text = "import sys, neighbour\nprint(__name__, neighbour.WORD, sys.argv)"
    before = (list(sys.argv), list(sys.path))
    said = run("script", script(files, text), "--json", "-x", "--", "a b", "--help")
    assert (said.status, said.err) == (0, "")
    assert said.out == "__main__ hello ['own.py', '--json', '-x', '--', 'a b', '--help']\n"
    assert (sys.argv, sys.path) == before


def test_a_script_uses_the_core(files: Path, run: Run) -> None:
    text = """
import sys
from pathlib import Path
from studio_core.edits import SetFields
from studio_core.project.store import load, save
path = Path(sys.argv[1])
scene = SetFields("cube", {"name": "Box"})(load(path).scene)
save(path, scene, label="Renamed")
"""
    assert run("script", script(files, text), "room.lucarne").status == 0
    assert load(files / "room.lucarne").scene["cube"].name == "Box"


@pytest.mark.parametrize(
    ("text", "last"),
    [
        ("def inner():\n    raise ValueError('mine')\n\ninner()", "ValueError: mine"),
        ("from studio_core.errors import InputError\nraise InputError('mine')", "InputError: mine"),
        ("this is no Python", "SyntaxError"),
    ],
    ids=["raises", "raises ours", "syntax"],
)
def test_a_script_that_raises_gives_its_own_traceback(text: str, last: str, files: Path, run: Run) -> None:
    said = run("script", script(files, text))
    assert said.status == 1
    assert said.out == ""
    assert last in said.err.splitlines()[-1]
    assert "own.py" in said.err
    assert "runpy" not in said.err
    assert "verbs.py" not in said.err


def test_a_script_has_the_names_of_the_console_and_saves_when_it_says_so(files: Path, run: Run) -> None:
    path = files / "room.lucarne"
    before = path.read_bytes()
    text = "move('cube', by=(0, 1, 0))\nassert scene['cube'].transform.translation[1] == 1.5\n"
    assert run("script", "--project", path, script(files, text)).status == 0
    assert path.read_bytes() == before
    said = run("script", "--project", path, script(files, text + "save()\nsave('copy.lucarne')"))
    assert (said.status, said.err) == (0, "")
    saved = load(path)
    assert saved.scene["cube"].transform.translation[1] == 1.5
    assert saved.history is not None
    assert saved.history.steps[saved.history.position].label.startswith("Move")
    assert load(files / "copy.lucarne").history is None
    assert run("script", script(files, "print(len(scene.nodes))")).out == "0\n"
    assert "no project to save" in run("script", script(files, "save()")).err
    refused(run("script", "--project", "nix.lucarne", script(files, text)), "nix.lucarne")


def test_a_script_does_not_save_over_a_project_that_is_open(files: Path, run: Run) -> None:
    path = files / "room.lucarne"
    before = path.read_bytes()
    with acquire(path):
        said = run("script", "--project", path, script(files, "move('cube', by=(0, 1, 0))\nsave()"))
    assert said.status == 1
    assert "open" in said.err
    assert path.read_bytes() == before


def test_a_script_may_exit_and_be_stopped(files: Path, run: Run) -> None:
    with pytest.raises(SystemExit) as left:
        run("script", script(files, "import sys; sys.exit(7)"))
    assert left.value.code == 7
    refused(run("script", script(files, "raise KeyboardInterrupt")), "stopped", status=INTERRUPTED)


# --- docs/command-line.md -----------------------------------------------------------------------------


def test_the_reference_names_every_verb_and_option() -> None:
    text = (ROOT / "docs" / "command-line.md").read_text()
    sections = dict(
        re.findall(r"^## `lucarne ([\w-]+)[^\n]*\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    )
    groups = dict(re.findall(r"^## ([A-Z][\w ]*)\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL))
    (verbs,) = (action for action in parser()._actions if action.dest == "verb")
    assert isinstance(verbs.choices, dict)
    assert list(sections) == list(verbs.choices) == list(VERBS)
    everywhere = set(re.findall(r"`(--?[a-z]+(?:-[a-z]+)*)", groups["Everywhere"]))
    for name, verb in verbs.choices.items():
        there = {option for action in verb._actions for option in action.option_strings}
        told = set(re.findall(r"`(--?[a-z]+(?:-[a-z]+)*)", sections[name]))
        for title in re.findall(r"\*([A-Z][\w ]+)\*", sections[name]):
            told |= set(re.findall(r"`(--?[a-z]+(?:-[a-z]+)*)", groups[title]))
        assert told <= there, name
        assert there - everywhere - {"--out", "-h"} <= told, name
        assert everywhere - there <= {"--json"}, name


def test_render_measures_its_own_error(run: Run, room: Path) -> None:
    said = run("render", room, "-o", "x.png", "--size", "48x27", "--json", *QUICK, "--measure", 50)
    error = json.loads(said.out)["error"]
    assert error["picture"]["places"] == 50
    assert 0 < error["picture"]["relative_rmse"] < 2
    assert error["picture"]["p99"] > 0
    assert error["vertices"]["relative_rmse"] > 0
    assert len(error["layers"]) >= 1


def test_measuring_nowhere_is_refused(run: Run, room: Path) -> None:
    said = run("render", room, "-o", "x.png", "--measure", 0)
    assert said.status == 2
    assert "--measure" in said.err


# --- pictures and series of them ----------------------------------------------------------------------


def read(path: Path) -> np.ndarray:
    with ImageDecoder() as decoder:
        return np.asarray(decoder.read(path).pixels)


def test_render_with_alpha_layers_and_a_preview(files: Path, run: Run) -> None:
    more = ("--alpha", "--lights", "--bits", "16", "--dpi", "300", "--preview", "small.png")
    assert run("render", "room.lucarne", "-o", "x.exr", *SMALL, *more).status == 0
    assert read(files / "x.exr").shape == (18, 32, 4)
    assert read(files / "small.png").shape == (18, 32, 3)
    assert run("render", "room.lucarne", "-o", "x.png", *SMALL, "--alpha", "--bits", "16").status == 0
    assert read(files / "x.png").shape == (18, 32, 4)


def test_a_picture_in_bands_is_the_picture_in_one_piece(
    files: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    everywhere = ("--param", "everywhere=true", "--param", "refine=false")
    assert run("render", "room.lucarne", "-o", "one.exr", *SMALL, *everywhere).status == 0
    monkeypatch.setattr("studio_core.shading.bands.GUIDE_SAMPLES", 100)
    monkeypatch.setattr("studio_core.shading.bands.BAND_SAMPLES", 160)
    assert run("render", "room.lucarne", "-o", "bands.exr", *SMALL, *everywhere).status == 0
    assert np.array_equal(read(files / "one.exr"), read(files / "bands.exr"))


def test_a_turntable_is_a_series_that_begins_with_the_cameras_picture(files: Path, run: Run) -> None:
    said = only_json(
        run(
            "frames", "room.lucarne", "--turntable", 3, "-o", "turn.png", *SMALL, "--sheet", "s.png", "--json"
        )
    )
    assert said["frames"] == ["turn_0001.png", "turn_0002.png", "turn_0003.png"]
    assert (said["kept"], said["width"], said["finite"]) == (0, 32, True)
    run("render", "room.lucarne", "-o", "x.png", *SMALL)
    one, two, three = (read(files / name) for name in said["frames"])
    assert np.array_equal(one, read(files / "x.png"))
    assert not np.array_equal(one, two)
    assert not np.array_equal(two, three)
    sheet = read(files / "s.png")
    places = [(6, 6), (6, 44), (30, 6)]  # two in a row
    cells = [sheet[top : top + 18, left : left + 32] for top, left in places]
    assert all(np.array_equal(cell, frame) for cell, frame in zip(cells, (one, two, three), strict=True))


def test_a_series_goes_on_where_it_was_interrupted(files: Path, run: Run) -> None:
    turn = ("frames", "room.lucarne", "--relight", 3, "--degrees", 90, "-o", "light.png", *SMALL)
    assert run(*turn).status == 0
    whole = [read(files / f"light_000{n}.png") for n in (1, 2, 3)]
    (files / "light_0002.png").unlink()
    (files / "light_0003.png").write_bytes((files / "light_0003.png").read_bytes()[:80])
    before = (files / "light_0001.png").stat().st_mtime_ns
    assert only_json(run(*turn, "--resume", "--json"))["kept"] == 1
    assert (files / "light_0001.png").stat().st_mtime_ns == before
    again = [read(files / f"light_000{n}.png") for n in (1, 2, 3)]
    assert all(np.array_equal(a, b) for a, b in zip(whole, again, strict=True))
    assert not np.array_equal(whole[0], whole[1])


def test_a_path_leads_from_camera_to_camera(files: Path, run: Run) -> None:
    cameras = ("--camera", "from=3,2,3:to=0,0,0", "--camera", "from=0,5,0.01:to=0,0,0:fov=30")
    run("new", "two.lucarne", "--mesh", "box.obj", "--env", "sky.exr", *cameras)
    path = ("frames", "two.lucarne", "--path", "Camera, Camera 2", "--frames", 3, "-o", "p.exr", *SMALL)
    assert run(*path, "--ease").status == 0
    for number, name in ((1, "Camera"), (3, "Camera 2")):
        run("render", "two.lucarne", "-o", "x.exr", *SMALL, "--camera", name)
        np.testing.assert_allclose(
            read(files / f"p_000{number}.exr"), read(files / "x.exr"), rtol=1e-4, atol=1e-4
        )


def test_progress_as_json_tells_every_frame(files: Path, run: Run) -> None:
    said = run("frames", "room.lucarne", "--turntable", 2, "-o", "t.png", *SMALL, "--progress", "json")
    lines = [json.loads(line) for line in said.err.splitlines()]
    assert [line["number"] for line in lines if "frame" in line] == [1, 2]
    steps = [line for line in lines if "done" in line]
    assert steps
    assert all(0 <= line["done"] <= line["total"] for line in steps)
    assert [line["done"] for line in steps] == sorted(line["done"] for line in steps)


FRAMES = ("frames", "room.lucarne", "-o", "f.png")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (FRAMES, ("--turntable", "--path")),
        ((*FRAMES, "--turntable", "0"), ("--turntable 0", "1 to")),
        ((*FRAMES, "--turntable", "99999"), ("--turntable 99999", "10000")),
        ((*FRAMES, "--turntable", "3", "--path", "Camera"), ("--path", "--turntable")),
        ((*FRAMES, "--turntable", "3", "--frames", "3"), ("--frames",)),
        ((*FRAMES, "--path", "Camera,Camera"), ("--frames",)),
        ((*FRAMES, "--path", "Camera", "--frames", "3"), ("two cameras",)),
        ((*FRAMES, "--path", "Camera,Sofa", "--frames", "3"), ("Sofa", "Camera")),
        ((*FRAMES, "--turntable", "3", "--around", "Sofa"), ("Sofa",)),
        ((*FRAMES, "--turntable", "3", "--degrees", "nan"), ("--degrees",)),
        ((*FRAMES, "--turntable", "3", "--sheet", "s.exr"), ("s.exr", ".png")),
        ((*RENDER, "--bits", "32"), ("x.png", "8 or 16")),
        ((*RENDER, "--bits", "12"), ("--bits",)),
        ((*RENDER, "--lights"), ("x.png", ".exr")),
        ((*RENDER, "--dpi", "-1"), ("--dpi",)),
        ((*RENDER, "--preview", "no/p.png"), ("no/p.png",)),
        ((*RENDER, "--size", "16385x10"), ("--size", "16384")),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else None,
)
def test_series_that_cannot_be_are_refused(
    arguments: tuple[str, ...], words: tuple[str, ...], files: Path, run: Run
) -> None:
    before = sorted(files.rglob("*"))
    refused(run(*arguments), *words)
    assert sorted(files.rglob("*")) == before


@pytest.mark.skipif(os.name != "posix", reason="signals to a child")
@pytest.mark.parametrize("how", ["killed", "unheard"])
def test_who_stops_a_series_keeps_whole_frames_alone(how: str, room: Path, tmp_path: Path) -> None:
    turn = ["frames", str(room), "--turntable", "5000", "-o", str(tmp_path / "t.png"), *SMALL]
    paths = os.pathsep.join(str(ROOT / folder) for folder in (".", "ui", "plugins"))
    child = subprocess.Popen(
        [sys.executable, "-c", COMMAND, *turn, "--progress", "json"],
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": paths},
        text=True,
    )
    assert child.stderr is not None
    for line in child.stderr:
        if '"frame"' in line:
            break
    if how == "killed":
        child.terminate()
    else:
        child.stderr.close()
    assert child.wait(60) == INTERRUPTED
    if how == "killed":
        child.stderr.close()
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == [f"t_{n:04}.png" for n in range(1, len(names) + 1)]
    assert all(read(path).shape == (18, 32, 3) for path in tmp_path.iterdir())
