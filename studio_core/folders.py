"""Where this user's caches lie."""

from __future__ import annotations

import os
from pathlib import Path

import platformdirs


def user_cache() -> Path:
    """The folder of everything that can be computed again; `LUCARNE_CACHE` moves it."""
    moved = os.environ.get("LUCARNE_CACHE")
    return Path(moved) if moved else Path(platformdirs.user_cache_dir("lucarne", appauthor=False))
