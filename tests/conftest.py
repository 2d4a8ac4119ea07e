"""What all tests share: fixtures, hypothesis profiles, and a user's folders of their own."""

from __future__ import annotations

import importlib
import os
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import settings
from scenes import little_scene as make_little_scene

from studio_core.parallel import Workers
from studio_core.registry import GROUP, PluginHost
from studio_core.scene.nodes import Scene

ROOT = Path(__file__).resolve().parent.parent

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
settings.register_profile("explore", deadline=None, print_blob=True)
settings.register_profile("ci", deadline=None, print_blob=True, derandomize=True)
settings.register_profile("thorough", deadline=None, print_blob=True, max_examples=2000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci" if os.environ.get("CI") else "explore"))


@pytest.fixture(autouse=True)
def own_state(
    monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest
) -> Path:
    """A state folder for each test: recovery files, recent projects and kept materials never meet the user's.

    The cache of compiled kernels stays shared, so that they compile once.
    """
    name = "".join(c if c.isalnum() else "-" for c in request.node.name)[:60]
    state = tmp_path_factory.getbasetemp() / "state" / name
    monkeypatch.setenv("LUCARNE_STATE", str(state))
    monkeypatch.setenv("LUCARNE_MATERIALS", str(state / "materials"))
    return state


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of real models and pictures made by others."""
    folder = Path(os.environ.get("LUCARNE_TEST_DATA") or ROOT.parent / "shared" / "data")
    if not folder.is_dir():
        pytest.skip(f"there is no folder {folder} of real data (LUCARNE_TEST_DATA names another)")
    return folder


@pytest.fixture(scope="session")
def host() -> PluginHost:
    """All bundled plugins, by import: also where the project is not installed."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    found = PluginHost()
    for where in project["entry-points"][GROUP].values():
        module, _, attribute = where.partition(":")
        found.add(getattr(importlib.import_module(module), attribute))
    return found


@pytest.fixture(scope="session")
def workers() -> Iterator[Workers]:
    """Two threads for kernels."""
    with Workers(2) as made:
        yield made


@pytest.fixture
def little_scene() -> Callable[..., Scene]:
    """Makes a cube on a floor under a plain sky, seen by a camera (`scenes.little_scene`)."""
    return make_little_scene
