"""`lucarne precompute` with a backend of the test's own: what it is given, what is told, what is refused."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from scenes import little_scene

from studio.cli import BAD_INPUT, main
from studio.headless import Headless
from studio_core.project.store import save
from studio_core.shading.stages import SurfaceParams


class Keeping:
    """Keeps a number on disk; the second time it is there."""

    id, label, Params = "cuts", "Keeping", SurfaceParams

    def __init__(self) -> None:
        self.calls: list[tuple[Any, ...]] = []
        self.kept: dict[str, int] = {}

    def precompute(
        self, scene: Any, view: Any, params: Any, services: Any, job: Any
    ) -> Mapping[str, int | float]:
        self.calls.append((scene, view, params, services, job))
        job.checkpoint(1, 2)
        vertices = self.kept.get("vertices", 0)
        self.kept["vertices"] = 1234
        return {"bytes": 3_500_000, "vertices": 1234, "vertices_cached": vertices}


@pytest.fixture
def project(tmp_path: Path) -> Path:
    path = tmp_path / "room.lucarne"
    save(path, little_scene())
    return path


@pytest.fixture
def backend(monkeypatch: pytest.MonkeyPatch) -> Keeping:
    made = Keeping()
    real = Headless.registry.func  # type: ignore[attr-defined]

    def registry(program: Headless) -> Any:
        host = real(program)
        return SimpleNamespace(
            get=lambda kind, name: made if name == "cuts" else host.get(kind, name),
            names=host.names,
            brdf=host.brdf,
        )

    monkeypatch.setattr(Headless, "registry", property(registry))
    return made


def test_the_backend_gets_scene_view_parameters_and_a_job(
    project: Path, backend: Keeping, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["precompute", str(project), "--quiet", "--param", "vertices=700"]) == 0
    ((scene, view, params, services, job),) = backend.calls
    assert sorted(scene.nodes) == sorted(little_scene().nodes)
    assert (view.width, view.height) == (960, 540)
    assert view.transform.translation == scene["camera"].transform.translation
    assert params.vertices == 700
    assert services.cache is not None
    assert (job.done, job.total) == (1, 2)
    said = capsys.readouterr()
    assert said.err == ""
    (line,) = said.out.splitlines()
    assert line.startswith(f"{project}: ")
    assert " s; bytes 3.5 MB, vertices 1,234, vertices cached 0" in line


def test_json_holds_what_the_backend_said(
    project: Path, backend: Keeping, capsys: pytest.CaptureFixture[str]
) -> None:
    for cached in (0, 1234):
        assert main(["precompute", str(project), "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        assert found.pop("seconds") >= 0
        assert found == {
            "project": str(project),
            "backend": "cuts",
            "bytes": 3_500_000,
            "vertices": 1234,
            "vertices_cached": cached,
        }


def test_ctrl_c_cancels_it(project: Path, backend: Keeping, monkeypatch: pytest.MonkeyPatch) -> None:
    def stopped(*arguments: Any) -> Mapping[str, int]:
        arguments[-1].cancel()
        arguments[-1].checkpoint()
        raise AssertionError("the checkpoint must not pass")

    monkeypatch.setattr(backend, "precompute", stopped)
    assert main(["precompute", str(project), "--quiet"]) == 130


@contextmanager
def one_line(capsys: pytest.CaptureFixture[str], *words: str) -> Iterator[None]:
    capsys.readouterr()
    yield
    said = capsys.readouterr()
    (line,) = said.err.splitlines()
    assert said.out == ""
    for word in words:
        assert word in line


def test_a_backend_that_keeps_nothing_is_refused(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with one_line(capsys, "--backend reference", "nothing to precompute"):
        assert main(["precompute", str(project), "--backend", "reference"]) == BAD_INPUT


def test_bad_input_is_named(project: Path, backend: Keeping, capsys: pytest.CaptureFixture[str]) -> None:
    with one_line(capsys, "nix.lucarne"):
        assert main(["precompute", str(project.with_name("nix.lucarne"))]) == BAD_INPUT
    with one_line(capsys, "'Nobody'", "'Camera'"):
        assert main(["precompute", str(project), "--camera", "Nobody"]) == BAD_INPUT
    with one_line(capsys, "--param", "'shine'"):
        assert main(["precompute", str(project), "--param", "shine=1"]) == BAD_INPUT
    with one_line(capsys, "backend 'cutz'"):
        assert main(["precompute", str(project), "--backend", "cutz"]) == BAD_INPUT
    assert backend.calls == []
