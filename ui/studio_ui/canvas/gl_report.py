"""What OpenGL can do here, asked in a child process: a bad driver ends that one alone.

`python -m studio_ui.canvas.gl_report` prints one line of JSON.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import asdict, dataclass

MODULE = "studio_ui.canvas.gl_report"
SECONDS = 20.0
SOFTWARE = ("llvmpipe", "softpipe", "swrast", "swiftshader", "software", "basic render", "gdi generic")
"""Parts of the names of renderers that are no graphics card."""


@dataclass(frozen=True)
class GlReport:
    """Whether the GPU canvas works here (`reason`: why not), and what draws it."""

    usable: bool
    renderer: str = ""
    version: str = ""
    reason: str = ""

    @property
    def hardware(self) -> bool:
        """Whether a graphics card draws."""
        return self.usable and not any(name in self.renderer.lower() for name in SOFTWARE)


def command() -> tuple[list[str], dict[str, str]]:
    """What to run for a report, and its environment."""
    return [sys.executable, "-m", MODULE], {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}


def parse(status: int, output: str, complaints: str) -> GlReport:
    """The report of a child that ended with a status (negative: a signal) and has written so much."""
    for line in reversed(output.splitlines()):
        try:
            return GlReport(**json.loads(line))
        except (ValueError, TypeError):
            continue
    if status < 0 or status > 128:
        return GlReport(False, reason="OpenGL ends the program here")
    last = [line for line in complaints.splitlines() if line.strip()]
    return GlReport(False, reason=last[-1].strip() if last else "OpenGL does not answer")


def ask() -> GlReport:
    """Wait for a child's report."""
    arguments, environment = command()
    try:
        tried = subprocess.run(
            arguments,
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=SECONDS,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return GlReport(False, reason="OpenGL does not answer")
    return parse(tried.returncode, tried.stdout, tried.stderr)


def look() -> GlReport:
    """In the child: make a context as the window does, and draw a triangle in floating point."""
    from PySide6.QtGui import QGuiApplication, QOffscreenSurface, QOpenGLContext

    from studio_ui.canvas.gl_context import surface_format

    application = QGuiApplication(sys.argv[:1])
    surface, context = QOffscreenSurface(), QOpenGLContext()
    for part in (surface, context):
        part.setFormat(surface_format())
    surface.create()
    if not context.create() or not surface.isValid() or not context.makeCurrent(surface):
        return GlReport(False, reason=f"Qt's {application.platformName()} platform has no OpenGL")
    from studio_ui.canvas.gl_context import names, try_out

    renderer, version = names()
    reason = try_out()
    context.doneCurrent()
    return GlReport(not reason, renderer, version, reason)


if __name__ == "__main__":
    try:
        found = look()
    except Exception as error:  # whatever is wrong, it is told
        found = GlReport(False, reason=f"{type(error).__name__}: {error}")
    print(json.dumps(asdict(found)), flush=True)
    os._exit(0)  # a driver that fails on its way out has answered all the same
