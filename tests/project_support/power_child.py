"""Runs inside the logging disk: a few saves after another, every change noted.

Arguments: the folder to work in, the log, the way. Prints one JSON object: inodes before the first change,
and for each save the number of changes when it was acknowledged.
"""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from typing import Any

from project_support.disk import Disk, read_log
from project_support.samples import renamed, small_scene
from studio_core.project import store
from studio_core.project.codec import scene_digest


def main() -> None:
    """Three saves over a first one."""
    folder, log = Path(sys.argv[1]), Path(sys.argv[2])
    way: Any = sys.argv[3]
    path = folder / "p.lucarne"
    scenes = [small_scene(1), renamed(small_scene(1), "Edit"), small_scene(2, faces=3000), small_scene(3)]
    store.save(path, scenes[0])
    shutil.copy(path, log.with_suffix(".start"))
    start = {str(path): path.stat().st_ino}
    disk = Disk(folder)
    disk.arm()
    disk.log(log)
    acknowledged = []
    for scene in scenes[1:]:
        store.save(path, scene, way="auto" if way == "fresh" else way, fresh=way == "fresh")
        acknowledged.append(len(read_log(log)))
    disk.log(None)
    disk.disarm()
    digests = [scene_digest(scene) for scene in scenes]
    folder_inode = folder.stat().st_ino
    facts = {"start": start, "folder": folder_inode, "acknowledged": acknowledged, "digests": digests}
    print(json.dumps(facts))


if __name__ == "__main__":
    main()
