"""Where this user's caches and materials lie."""

from __future__ import annotations

import os
from pathlib import Path

import platformdirs


def user_cache() -> Path:
    """The folder of everything that can be computed again; `LUCARNE_CACHE` moves it."""
    moved = os.environ.get("LUCARNE_CACHE")
    return Path(moved) if moved else Path(platformdirs.user_cache_dir("lucarne", appauthor=False))


def user_materials() -> Path:
    """The folder of the materials that are kept for all projects; `LUCARNE_MATERIALS` moves it."""
    moved = os.environ.get("LUCARNE_MATERIALS")
    return (
        Path(moved) if moved else Path(platformdirs.user_data_dir("lucarne", appauthor=False)) / "materials"
    )
