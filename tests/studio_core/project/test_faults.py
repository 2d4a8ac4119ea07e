"""Failing disks, full disks and power cuts: the old content or the new, and a clear sentence."""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from project_support import disk
from project_support.samples import hot_journal, small_scene

from studio_core.errors import ProjectError
from studio_core.project.codec import scene_digest
from studio_core.project.lock import acquire
from studio_core.project.store import load, save
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Environment

needs_compiler = pytest.mark.skipif(disk.compiler() is None, reason="no C compiler for the failing disk")


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return disk.build(tmp_path_factory.mktemp("disk"))


def child(module: str, library: Path, *arguments: str) -> dict[str, object]:
    command = [sys.executable, "-W", "error", "-m", f"project_support.{module}", *arguments]
    environment = disk.environment(LD_PRELOAD=str(library))
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    found: dict[str, object] = json.loads(done.stdout)
    return found


@needs_compiler
@pytest.mark.parametrize("way", ["in place", "whole", "new", "recovery", "first recovery"])
def test_every_failing_change_leaves_old_or_new(tmp_path: Path, library: Path, way: str) -> None:
    found = child("fault_child", library, str(tmp_path), way)
    outcomes = found["outcomes"]
    assert isinstance(outcomes, dict)
    print(way, found)
    kept = "nothing" if way in ("new", "first recovery") else "failed, old"
    assert outcomes[kept] > 20
    assert outcomes["saved, new"] >= 6  # each series ends with a save that nothing touched


@needs_compiler
@pytest.mark.parametrize("way", ["in place", "whole", "fresh"])
def test_a_power_cut_loses_nothing_that_was_acknowledged(tmp_path: Path, library: Path, way: str) -> None:
    work, cut = tmp_path / "work", tmp_path / "cut"
    work.mkdir()
    cut.mkdir()
    log = tmp_path / "log"
    facts = child("power_child", library, str(work), str(log), way)
    changes = disk.read_log(log)
    start = {Path(name): inode for name, inode in facts["start"].items()}  # type: ignore[attr-defined]
    first = log.with_suffix(".start").read_bytes()
    machine = disk.PowerCut(start, dict.fromkeys(start.values(), first), int(facts["folder"]))  # type: ignore[call-overload]
    acknowledged, digests = facts["acknowledged"], facts["digests"]
    assert isinstance(acknowledged, list)
    assert isinstance(digests, list)
    assert acknowledged[-1] == len(changes)
    rng = random.Random(20)
    seen: set[str] = set()
    for moment in disk.cuts(changes):
        for _ in range(6):
            for entry in cut.iterdir():
                entry.unlink()
            for name, content in machine.after(changes, moment, rng).items():
                (cut / name.name).write_bytes(content)
            found = scene_digest(load(cut / "p.lucarne").scene)
            kept = sum(count <= moment for count in acknowledged)
            assert found in digests[kept : kept + 2], f"cut after change {moment} of {len(changes)}"
            seen.add(found)
    assert seen == set(digests)


def mounted(folder: Path, options: str) -> bool:
    command = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)]
    try:
        return subprocess.run(command, capture_output=True, timeout=30, check=False).returncode == 0
    except OSError:
        return False


@pytest.fixture
def tiny_disk(tmp_path: Path) -> Iterator[Path]:
    folder = tmp_path / "small"
    folder.mkdir()
    if not hasattr(os, "geteuid") or os.geteuid() != 0 or not mounted(folder, "size=2m"):
        pytest.skip("a 2 MB disk can only be mounted by root")
    yield folder
    subprocess.run(["umount", str(folder)], check=True, timeout=30)


def test_a_disk_that_is_really_full(tiny_disk: Path) -> None:
    path = tiny_disk / "p.lucarne"
    save(path, small_scene(1))
    noise = np.random.default_rng(0).integers(0, 256, (1000, 1000, 3), dtype=np.uint8)
    too_much = small_scene(2).with_nodes(Environment(id="n", image=Image(noise)))
    for way in ("in place", "whole"):
        with pytest.raises(ProjectError, match=r"p\.lucarne could not be saved: the disk is full"):
            save(path, too_much, way=way)  # type: ignore[arg-type]
        assert scene_digest(load(path).scene) == scene_digest(small_scene(1))
        assert [entry.name for entry in tiny_disk.iterdir()] == ["p.lucarne"]
    with pytest.raises(ProjectError, match="the disk is full"):
        save(tiny_disk / "other.lucarne", too_much)
    assert not (tiny_disk / "other.lucarne").exists()
    save(path, small_scene(3))
    assert scene_digest(load(path).scene) == scene_digest(small_scene(3))


def test_a_disk_that_is_read_only(tiny_disk: Path) -> None:
    path, cut = tiny_disk / "p.lucarne", tiny_disk / "cut.lucarne"
    save(path, small_scene(1))
    save(cut, small_scene(1))
    hot_journal(cut)
    subprocess.run(["mount", "-o", "remount,ro", str(tiny_disk)], check=True, timeout=30)
    for fresh in (False, True):
        with pytest.raises(ProjectError, match=r"p\.lucarne could not be saved: .*(read-only|cannot be)"):
            save(path, small_scene(2), fresh=fresh)
    with pytest.raises(ProjectError, match=r"p\.lucarne could not be opened .*: the disk is read-only"):
        acquire(path)
    assert scene_digest(load(path).scene) == scene_digest(small_scene(1))
    with pytest.raises(ProjectError, match=r"cut\.lucarne was interrupted .* read-only: copy it"):
        load(cut)
