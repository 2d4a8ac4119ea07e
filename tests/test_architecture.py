"""The house: who may import whom, what loads when, how long a module gets, and what a wheel holds."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
import zipfile
from itertools import chain
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
SOURCES = [
    path
    for folder in ("studio", "studio_core", "ui", "plugins", "sample_projects", "tools")
    for path in sorted((ROOT / folder).rglob("*.py"))
]
INSIDE_MITSUBA = re.compile(r'^\S.*(import_module\("mitsuba"\)|import mitsuba)', re.MULTILINE)
HEAVY = {
    *("PySide6", "vispy", "pyqtgraph", "numba", "trimesh", "cv2", "OpenImageIO", "embreex"),
    *("mitsuba", "scipy", "PIL", "matplotlib", "pytest"),
}


def python(source: str, **environment: str) -> str:
    """What a fresh interpreter prints; its complaints are part of a failure."""
    paths = os.pathsep.join(str(ROOT / folder) for folder in (".", "ui", "plugins"))
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", source],
        capture_output=True,
        text=True,
        check=False,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": paths, **environment},
    )
    assert done.returncode == 0, f"exit status {done.returncode}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def loaded_by(modules: str) -> set[str]:
    """Top-level names in `sys.modules` after importing some modules."""
    return set(python(f"import sys, {modules}; print(*{{m.split('.')[0] for m in sys.modules}})").split())


def test_every_decision_is_in_the_index() -> None:
    folder = ROOT / "docs" / "decisions"
    index = (folder / "README.md").read_text()
    numbered = sorted(path.name for path in folder.glob("[0-9]*.md"))
    assert numbered
    assert [name for name in numbered if f"({name})" not in index] == []
    assert [name[:4] for name in numbered] == [f"{i:04}" for i in range(1, len(numbered) + 1)]


def test_every_dependency_has_its_reason() -> None:
    project = PROJECT["project"]
    wanted = list(chain(project["dependencies"], *project["optional-dependencies"].values()))
    names = {re.split(r"[\[<>=;]", line)[0] for line in wanted} - {"lucarne"}
    reasons = (ROOT / "docs" / "dependencies.md").read_text()
    assert {name for name in names if name not in reasons} == set()


def test_pages_and_pictures_that_the_docs_point_to_exist() -> None:
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")]
    for page in pages:
        for target in re.findall(r"\]\((?!https?:)([^)#]+)", page.read_text()):
            assert (page.parent / target).exists(), f"{page.name} points to {target}"


def test_import_contracts_are_kept() -> None:
    python(
        "import sys; from importlinter.cli import lint_imports; sys.exit(lint_imports(no_cache=True))",
        PYTHONIOENCODING="utf-8",
    )


def test_every_plugin_is_under_contract_and_has_its_door() -> None:
    folders = {path.parent.name for path in (ROOT / "plugins" / "studio_plugins").glob("*/__init__.py")}
    contracts = PROJECT["tool"]["importlinter"]["contracts"]
    (independence,) = (c for c in contracts if c["type"] == "independence")
    assert {f"studio_plugins.{name}" for name in folders} == set(independence["modules"])
    doors = PROJECT["project"]["entry-points"]["studio.plugins"]
    assert doors == {name: f"studio_plugins.{name}:plugin" for name in folders}


def test_no_contract_has_exceptions() -> None:
    for contract in PROJECT["tool"]["importlinter"]["contracts"]:
        assert not any(key.startswith(("ignore", "unmatched")) for key in contract)


@pytest.mark.parametrize(
    "modules",
    [
        "studio_core.document, studio_core.session, studio_core.registry, studio_core.contract",
        "studio_core.edits, studio_core.scene.diff, studio_core.shading.scheduler",
        "studio_core.project.store, studio_core.project.recovery",
        "studio_plugins.brdfs, studio_plugins.meshes, studio_plugins.export, studio_plugins.reference",
        "studio.cli",
    ],
)
def test_what_everybody_imports_loads_nothing_heavy(modules: str) -> None:
    assert loaded_by(modules) & HEAVY == set()


def test_finding_plugins_loads_nothing_heavy() -> None:
    assert loaded_by("studio_core.registry as r; r.PluginHost.discover()") & HEAVY == set()


def test_core_and_plugins_run_without_qt_installed() -> None:
    """Imports every module below the window with Qt, vispy and pyqtgraph made unfindable.

    What runs inside Mitsuba, and what runs as a program of its own, is left out.
    """
    names = [
        ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")
        for root, top in ((ROOT, "studio_core"), (ROOT / "plugins", "studio_plugins"))
        for path in sorted((root / top).rglob("*.py"))
        if not path.stem.endswith("_child") and not INSIDE_MITSUBA.search(path.read_text())
    ]
    assert "studio_core.document" in names
    python(
        "import importlib, sys\n"
        "sys.modules.update(dict.fromkeys(['PySide6', 'vispy', 'pyqtgraph']))\n"
        f"for name in {names}: importlib.import_module(name)"
    )


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_a_module_is_read_at_one_sitting(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= 450


def test_two_hundred_thousand_void_calls_into_qt() -> None:
    """PySide6 6.12.0 on Python before 3.12 aborts here (docs/dependencies.md)."""
    source = """
from PySide6.QtCore import QObject
from PySide6.QtWidgets import QApplication, QWidget
app = QApplication([])
thing, widget = QObject(), QWidget()
for _ in range(100_000):
    thing.setObjectName("a")
    widget.setEnabled(True)
print("alive")
"""
    assert python(source, QT_QPA_PLATFORM="offscreen").strip() == "alive"


def test_a_wheel_holds_the_four_packages_and_nothing_else(tmp_path: Path) -> None:
    subprocess.run(
        [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(tmp_path), str(ROOT)],
        check=True,
        capture_output=True,
    )
    (wheel,) = tmp_path.glob("lucarne-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        (info,) = {name.split("/")[0] for name in names if ".dist-info/" in name}
        points = archive.read(f"{info}/entry_points.txt").decode()
    packages = {"studio", "studio_core", "studio_ui", "studio_plugins"}
    assert {name.split("/")[0] for name in names} == {*packages, info}
    assert all(f"{package}/__init__.py" in names for package in packages)
    assert f"{info}/licenses/LICENSE" in names
    assert "lucarne = studio.cli:main" in points
    assert "reference = studio_plugins.reference:plugin" in points
    assert any(name.startswith("studio/sample_projects/") for name in names)
    assert not [name for name in names if "__pycache__" in name or name.endswith(".pyc")]


def test_set_up_takes_the_pythons_that_the_package_takes() -> None:
    source = "import set_up; print(*set_up.OLDEST, set_up.NEWEST[0], set_up.NEWEST[1] + 1)"
    done = subprocess.run(
        [sys.executable, "-c", source], capture_output=True, text=True, check=True, cwd=ROOT / "tools"
    )
    assert PROJECT["project"]["requires-python"] == ">={}.{},<{}.{}".format(*done.stdout.split())
