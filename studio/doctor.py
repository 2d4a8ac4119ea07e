"""`lucarne doctor`: what this installation can do, what is missing and what that costs."""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import platform
from collections.abc import Callable

from studio.display import why_no_window
from studio.headless import Headless
from studio_core import __version__
from studio_ui.canvas.gl_report import ask

NEEDED = ("numpy", "numba", "embreex", "trimesh", "OpenImageIO", "opencv-contrib-python-headless")
WINDOW = ("PySide6-Essentials", "pyqtgraph", "vispy")
OPTIONAL = {"mitsuba": "checks against Mitsuba 3 are left out"}


def doctor(options: argparse.Namespace, program: Headless) -> int:
    """Print one line a check; status 1 when something needed is missing."""
    checks: list[tuple[str, str, str]] = []

    def note(what: str, state: str, detail: str = "") -> None:
        checks.append((what, state, detail))

    note("lucarne", "ok", __version__)
    note("python", "ok", f"{platform.python_version()} on {platform.system()} {platform.machine()}")
    for name in (*NEEDED, *WINDOW):
        version = _version(name)
        note(name, "ok" if version else "missing", version or "reinstall Lucarne with pip")
    for name, cost in OPTIONAL.items():
        version = _version(name)
        note(name, "ok" if version else "absent", version or cost)
    _try(note, "kernels", _kernels)
    _try(note, "ray tracer", _tracer)
    _try(note, "sample room", _sample)
    reason = why_no_window()
    note("window", "absent" if reason else "ok", reason)
    if not reason:
        canvas = ask()
        note("graphics card", "ok" if canvas.hardware else "absent", canvas.renderer or canvas.reason)
    host = program.registry
    for kind in ("brdf", "backend", "importer", "exporter"):
        found = host.available(kind)
        note(f"{kind}s", "ok" if found else "missing", ", ".join(found) or "reinstall Lucarne with pip")
    note("plugins", "failed" if host.failures else "ok", ", ".join(plugin.id for plugin in host.plugins))
    for failure in host.failures:
        note(f"plugin {failure.plugin}", "failed", failure.what)
    if options.json:
        rows = [dict(zip(("check", "state", "detail"), check, strict=True)) for check in checks]
        program.result(json.dumps(rows, indent=1))
    else:
        width = max(len(what) for what, _, _ in checks)
        for what, state, detail in checks:
            program.result(f"{what:<{width}}  {state:<8}{detail}".rstrip())
    return int(any(state in ("missing", "failed") for _, state, _ in checks))


def _version(name: str) -> str:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return ""


def _try(note: Callable[[str, str, str], None], what: str, check: Callable[[], str]) -> None:
    try:
        note(what, "ok", check())
    except Exception as error:  # a doctor reports whatever is wrong
        note(what, "failed", f"{type(error).__name__}: {error}")


def _kernels() -> str:
    import numpy as np

    from studio_core import jit
    from studio_core.kernels.compose import texel

    found = np.zeros(9, np.float32)
    texel(np.full((1, 9), 0.5, np.float32), 0, 1, 1, 0.3, 0.3, found)
    if not (found == 0.5).all():
        raise RuntimeError(f"a kernel computed {found[0]} for 0.5")
    return f"compiled code is kept in {jit.CACHE_FOLDER}" if jit.CACHE_FOLDER else "compiled at every start"


def _tracer() -> str:
    import numpy as np

    from studio_core.kernels.raycast import CasterObject, RayCaster
    from studio_core.parallel import Workers

    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    item = CasterObject(corners, np.array([[0, 1, 2]], np.uint32), "triangle", np.eye(4), None)
    with RayCaster([item]) as caster, Workers(1) as workers:
        rays = np.array([[0.2, 0.2, 1], [0.9, 0.9, 1]]), np.array([[0, 0, -1.0], [0, 0, -1]])
        found = caster.closest(*rays, 0.0, np.inf, workers)
        if not (found.t[0] == 1 and found.object[1] == -1):
            raise RuntimeError("a triangle is not where it should be")
        return f"{caster.backend} {caster.reason}".strip()


def _sample() -> str:
    from studio.samples import sample
    from studio_core.project.store import info

    return str(info(sample()).path)
