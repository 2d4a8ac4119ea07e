"""Whether a window can be opened. Asked in a child process: without a display Qt ends the process."""

from __future__ import annotations

import os
import subprocess
import sys

OFFSCREEN = ("offscreen", "minimal")  # Qt platforms whose windows nobody sees


def why_no_window() -> str:
    """Empty when a window can be opened, else the reason."""
    if sys.platform.startswith("linux"):
        platform = os.environ.get("QT_QPA_PLATFORM", "")
        if platform.partition(":")[0] in OFFSCREEN:
            return f"QT_QPA_PLATFORM is {platform}"
        if not platform and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            return "there is no display"
    probe = "from PySide6.QtGui import QGuiApplication; QGuiApplication([])"
    try:
        tried = subprocess.run(
            [sys.executable, "-c", probe],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=30,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return "the display does not answer"
    if tried.returncode == 0:
        return ""
    lines = [line for line in tried.stderr.splitlines() if line.strip()]
    for line in lines:
        if line.startswith("qt.qpa."):  # the first says most; a list of platforms comes last
            return line.partition(": ")[2].rstrip(".")
    return lines[-1] if lines else "Qt cannot open the display"
