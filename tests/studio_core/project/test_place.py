"""Where a project lies, and putting a whole file in place."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest
from project_support.samples import small_scene

from studio_core.project import place, store
from studio_core.project.codec import scene_digest

MOUNTS = r"""/dev/sda1 / ext4 rw 0 0
server:/export /mnt/studio nfs4 rw 0 0
//nas/share /mnt/my\040share cifs rw 0 0
anna@host:/ /home/anna/far fuse.sshfs rw 0 0
portal /run/user/1/doc fuse.portal rw 0 0
/dev/sdb1 /mnt/studio/local ext4 rw 0 0
"""


@pytest.mark.parametrize(
    ("folder", "kind"),
    [
        ("/home/anna/projects", "local"),
        ("/mnt/studio/rooms", "network"),
        ("/mnt/studio", "network"),
        ("/mnt/studio2", "local"),
        ("/mnt/studio/local/x", "local"),
        ("/mnt/my share/x", "network"),
        ("/home/anna/far/x", "network"),
        ("/run/user/1/doc/x", "local"),
        ("/home/anna/Dropbox/rooms", "synced"),
        ("/Users/anna/OneDrive - Studio GmbH/rooms", "synced"),
        ("/Users/anna/Library/Mobile Documents/x", "synced"),
        ("/home/anna/Dropboxes", "local"),
    ],
)
def test_kinds_of_folders(folder: str, kind: str) -> None:
    assert place.folder_kind(Path(folder), MOUNTS) == kind


def test_marks_of_synchronising_programs(tmp_path: Path) -> None:
    inner = tmp_path / "a" / "b"
    inner.mkdir(parents=True)
    assert place.folder_kind(inner, MOUNTS) == "local"
    (tmp_path / ".stfolder").mkdir()
    assert place.folder_kind(inner, MOUNTS) == "synced"


def test_synced_folders_get_whole_files_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "Dropbox"
    folder.mkdir()
    path = folder / "p.lucarne"
    seen: set[str] = set()
    plain = os.fsync

    def watch(handle: int) -> None:
        seen.update(entry.name for entry in folder.iterdir())
        plain(handle)

    monkeypatch.setattr(os, "fsync", watch)
    assert store.save(path, small_scene(1)).whole
    report = store.save(path, small_scene(2))
    assert report.whole
    assert report.revision == 2
    assert scene_digest(store.load(path).scene) == scene_digest(small_scene(2))
    assert store.compact(path) > 0
    assert [entry.name for entry in folder.iterdir()] == ["p.lucarne"]
    assert all(name == "p.lucarne" or name.endswith(".new") for name in seen)


def test_an_interrupted_replacement_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "p.lucarne"
    path.write_bytes(b"old")

    def fail(target: Path) -> None:
        target.write_bytes(b"half")
        raise OSError(28, "full")

    for scratch in (None, tmp_path):
        with pytest.raises(OSError, match="full"):
            place.replace_whole(path, fail, scratch=scratch)
    assert path.read_bytes() == b"old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["p.lucarne"]


def test_leftovers_of_the_killed_are_swept_when_they_are_old(tmp_path: Path) -> None:
    path = tmp_path / "p.lucarne"
    old, fresh, other = (
        tmp_path / name for name in (".p.lucarne.1.new", ".p.lucarne.2.new", ".q.lucarne.1.new")
    )
    for leftover in (old, fresh, other):
        leftover.write_bytes(b"half")
    long_ago = time.time() - 90_000
    for leftover in (old, other):
        os.utime(leftover, (long_ago, long_ago))
    place.replace_whole(path, lambda target: target.write_bytes(b"new") and None)
    assert {entry.name for entry in tmp_path.iterdir()} == {"p.lucarne", fresh.name, other.name}
    assert path.read_bytes() == b"new"
