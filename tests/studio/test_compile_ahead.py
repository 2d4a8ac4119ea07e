"""Compiling ahead: nothing is left to compile for the edits of the window, and it is done once."""

import dataclasses
import sys

import pytest

from studio import compile_ahead
from studio.bench.cuts_cases import CASES, State
from studio.bench.cuts_measure import Editor
from studio.headless import Headless
from studio.samples import sample
from studio_core import jit
from studio_core.project.store import load
from studio_core.shading.offline import backend_params, scene_view


@pytest.fixture
def program():
    program = Headless(quiet=True, threads=2, out=None)
    yield program
    program.close()


def compiled():
    """All machine code of the project's kernels, by module, name and signature."""
    found = set()
    for name, module in list(sys.modules.items()):
        if name.startswith(("studio_core.", "studio_plugins.")):
            for kernel in vars(module).values():
                for signature in getattr(kernel, "nopython_signatures", None) or ():
                    found.add((kernel.__module__, kernel.__name__, str(signature)))
    return found


def test_edits_find_their_kernels(program):
    compile_ahead.work(program)
    before = compiled()
    scene = load(sample()).scene
    backend = program.registry.get("backend", "cuts")
    view = scene_view(scene, None, 80, 45)
    params = backend_params(backend, {"vertices": 2000, "directions": "2048"})
    editor = Editor(backend, dataclasses.replace(program.services, cache=None))
    base = State(scene, view)
    editor.go(base, params, False)
    for case in CASES:
        if case.name in ("brdf", "camera", "light-glossy", "move-preview"):
            for state in case.path(base, 3, "glossy"):
                moving = dataclasses.replace(state, view=dataclasses.replace(state.view, antialias=1))
                editor.go(moving, params, True)
            editor.go(base, params, False)
    assert any(module.endswith("cuts.glimpse") for module, _, _ in before)
    assert {"add_relief", "add_tilts", "lay"} <= {name for _, name, _ in before}
    assert compiled() - before == set()


def test_it_is_done_once_for_each_state_of_the_sources(tmp_path, monkeypatch):
    monkeypatch.setattr(jit, "CACHE_FOLDER", tmp_path)
    done = []
    monkeypatch.setattr(compile_ahead, "work", done.append)
    monkeypatch.setattr(compile_ahead, "LOW", 0)
    assert compile_ahead.main() == 0
    assert compile_ahead.main() == 0
    assert len(done) == 1
    assert compile_ahead.start() is None
    monkeypatch.setattr(jit, "CACHE_FOLDER", None)
    assert compile_ahead.mark() is None
    assert compile_ahead.main() == 0
    assert len(done) == 1


def test_work_that_fails_is_tried_again(tmp_path, monkeypatch):
    monkeypatch.setattr(jit, "CACHE_FOLDER", tmp_path)
    monkeypatch.setattr(compile_ahead, "LOW", 0)

    def fail(program):
        raise RuntimeError("no memory")

    monkeypatch.setattr(compile_ahead, "work", fail)
    with pytest.raises(RuntimeError):
        compile_ahead.main()
    assert not list(tmp_path.iterdir())
