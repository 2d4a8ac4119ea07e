"""Files that are dropped on the window."""

from __future__ import annotations

from pathlib import Path

from studio_ui.project_files import SUFFIX, ProjectFiles
from studio_ui.transfer import ENVIRONMENTS, Transfer


def take_files(paths: list[Path], files: ProjectFiles, transfer: Transfer) -> None:
    """Projects open, pictures light the scene, anything else is imported."""
    models = []
    for path in paths:
        if path.suffix.lower() == SUFFIX:
            files.open(path)
            return
        if path.suffix.lower() in ENVIRONMENTS.extensions:
            transfer.load_environment(path)
        else:
            models.append(path)
    if models:
        transfer.import_models(models)
