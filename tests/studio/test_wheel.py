"""The wheel in a clean virtual environment, away from the checkout: it holds all of the program, and runs."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import numpy as np
import pytest

from studio_core.imaging.io import ImageDecoder

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = {
    "studio": ROOT / "studio",
    "studio_core": ROOT / "studio_core",
    "studio_ui": ROOT / "ui" / "studio_ui",
    "studio_plugins": ROOT / "plugins" / "studio_plugins",
    "studio/sample_projects": ROOT / "sample_projects",
}
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built without a network."""
    folder = tmp_path_factory.mktemp("wheel")
    command = ["-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(ROOT)]
    subprocess.run([sys.executable, *command], check=True, capture_output=True)
    (made,) = folder.glob("*.whl")
    return made


@pytest.fixture(scope="module")
def scripts(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the commands of a virtual environment are that has the wheel and, lent, what it depends on.

    A .pth file names the site-packages of these tests: a fresh download would take a network and minutes.
    Their own .pth files, an editable install's among them, are not followed.
    """
    home = tmp_path_factory.mktemp("clean") / "venv"
    venv.create(home, with_pip=False, symlinks=os.name != "nt")
    folder = home / ("Scripts" if os.name == "nt" else "bin")
    paths = sysconfig.get_paths("venv", vars={"base": str(home), "platbase": str(home)})
    Path(paths["purelib"], "lent.pth").write_text(sysconfig.get_path("purelib") + "\n")
    pip = ["-m", "pip", "--disable-pip-version-check", "--python", str(folder / "python")]
    install = [*pip, "install", "--quiet", "--no-deps", "--no-index", "--ignore-installed", str(wheel)]
    subprocess.run([sys.executable, *install], check=True, capture_output=True)
    return folder


def call(scripts: Path, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """A command of the clean environment, run elsewhere; nothing leads back to the checkout."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    return subprocess.run(
        [str(scripts / arguments[0]), *arguments[1:]],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


def test_the_wheel_holds_every_source_and_sample(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
    for package, folder in PACKAGES.items():
        wanted = {
            f"{package}/{path.relative_to(folder).as_posix()}"
            for path in folder.rglob("*")
            if path.suffix in (".py", ".lucarne") and "__pycache__" not in path.parts
        }
        assert wanted
        assert wanted - names == set()
    assert {name.split("/")[0] for name in names} == {"studio", "studio_core", "studio_ui", "studio_plugins"}


def test_a_clean_environment_renders_the_sample(scripts: Path, tmp_path: Path) -> None:
    where = call(scripts, tmp_path, "python", "-c", "import studio, studio_ui; print(studio.__file__)")
    assert Path(where.stdout.strip()).is_relative_to(scripts.parent), where.stderr
    options = ("--size", "160x90", "--param", "directions=1024")
    made = call(scripts, tmp_path, "lucarne", "demo", "--headless", "-o", "x.png", *options, "--json")
    assert made.returncode == 0, made.stderr
    said = json.loads(made.stdout)
    assert said["finite"]
    assert Path(said["project"]).is_relative_to(scripts.parent)
    with ImageDecoder() as decoder:
        pixels = decoder.read(tmp_path / "x.png").pixels
    assert pixels.shape == (90, 160, 3)
    assert pixels.mean() > 40
    assert pixels.std() > 20
    assert len(np.unique(pixels.reshape(-1, 3), axis=0)) > 1000


def test_a_clean_environment_passes_the_doctor(scripts: Path, tmp_path: Path) -> None:
    made = call(scripts, tmp_path, "lucarne", "doctor", "--json")
    assert made.returncode == 0, made.stdout
    states = {row["check"]: row["state"] for row in json.loads(made.stdout)}
    assert states["sample room"] == states["plugins"] == states["kernels"] == "ok"
