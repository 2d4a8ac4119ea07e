"""`lucarne doctor`: what this installation can do, what is missing and what that costs."""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import platform
from collections.abc import Callable

from studio.display import why_no_window
from studio_core import __version__
from studio_core.registry import PluginHost

NEEDED = ("numpy", "numba", "embreex", "trimesh", "OpenImageIO", "opencv-contrib-python-headless")
WINDOW = ("PySide6-Essentials", "pyqtgraph", "vispy")
OPTIONAL = {"mitsuba": "checks against Mitsuba 3 are left out"}


def doctor(options: argparse.Namespace) -> int:
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
    host = PluginHost.discover()
    note("plugins", "ok" if not host.failures else "failed", ", ".join(p.id for p in host.plugins))
    for failure in host.failures:
        note(f"plugin {failure.plugin}", "failed", failure.what)
    if options.json:
        print(json.dumps([dict(zip(("check", "state", "detail"), c, strict=True)) for c in checks], indent=1))
    else:
        width = max(len(what) for what, _, _ in checks)
        for what, state, detail in checks:
            print(f"{what:<{width}}  {state:<8}{detail}".rstrip())
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
    from studio_core import jit

    return f"compiled code is kept in {jit.CACHE_FOLDER}" if jit.CACHE_FOLDER else "compiled at every start"


def _tracer() -> str:
    import numpy as np

    from studio_core.kernels.raycast import CasterObject, RayCaster

    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    item = CasterObject(corners, np.array([[0, 1, 2]], np.uint32), "triangle", np.eye(4), None)
    with RayCaster([item]) as caster:
        return f"{caster.backend} {caster.reason}".strip()


def _sample() -> str:
    from studio.samples import sample

    return str(sample())
