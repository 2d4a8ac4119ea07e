"""One start of the window, timed from the process: `python -m studio.bench.start_probe`.

Prints JSON: seconds from the start of the process until the window has been painted, and until it shows the
sample room's first picture (2^10 directions).
"""

from __future__ import annotations

import time

_STARTED = time.time()  # imports are part of the start

import json  # noqa: E402
import os  # noqa: E402
import sys  # noqa: E402
import tempfile  # noqa: E402
from pathlib import Path  # noqa: E402


def process_start() -> float:
    """When this process began, in seconds since 1970: by /proc, or else when this module began."""
    try:
        fields = Path("/proc/self/stat").read_text().rsplit(")", 1)[1].split()
        ticks = int(fields[19]) / os.sysconf("SC_CLK_TCK")
        uptime = float(Path("/proc/uptime").read_text().split()[0])
    except (OSError, ValueError, IndexError):
        return _STARTED
    return time.time() - (uptime - ticks)


def main() -> int:
    """Open, wait for the first picture, print, close."""
    began = process_start()
    os.environ["LUCARNE_STATE"] = tempfile.mkdtemp(prefix="lucarne-start-")
    from PySide6.QtCore import QTimer
    from PySide6.QtWidgets import QApplication

    from studio.app import assemble
    from studio.samples import sample

    application = QApplication(sys.argv[:1])
    studio = assemble()
    found: dict[str, float] = {}

    def pictured(_: object) -> None:
        if studio.context.document.scene.nodes and "first_picture_s" not in found:
            found["first_picture_s"] = time.time() - began
            QTimer.singleShot(0, application.quit)

    def painted() -> None:
        found["window_s"] = time.time() - began
        studio.window.files.open_copy(sample())

    studio.context.feed.shown.connect(pictured)
    studio.window.resize(1280, 800)
    studio.window.show()
    studio.window.repaint()
    QTimer.singleShot(0, painted)
    QTimer.singleShot(120_000, application.quit)
    application.exec()
    studio.close()
    print(json.dumps(found))
    return 0 if "first_picture_s" in found else 1


if __name__ == "__main__":
    sys.exit(main())
