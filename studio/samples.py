"""Where the sample projects are: in an installed wheel, or in a checkout."""

from __future__ import annotations

from pathlib import Path

from studio_core.errors import InputError

DEFAULT = "living-room"


def sample_folder() -> Path:
    """The folder of sample projects."""
    here = Path(__file__).resolve().parent
    for folder in (here / "sample_projects", here.parent / "sample_projects"):
        if folder.is_dir():
            return folder
    raise InputError("the sample projects are missing from this installation")


def sample(name: str = DEFAULT) -> Path:
    """The project file of a sample; InputError naming those that exist."""
    folder = sample_folder()
    found = folder / f"{name}.lucarne"
    if not found.is_file():
        known = ", ".join(sorted(p.stem for p in folder.glob("*.lucarne"))) or "none"
        raise InputError(f"there is no sample project {name!r}; there are: {known}")
    return found
