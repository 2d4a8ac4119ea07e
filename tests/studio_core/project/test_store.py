"""Saving, opening, history, revisions, copies."""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from project_support.samples import hot_journal, renamed, small_scene
from project_support.strategies import scenes

from studio_core.document import Document, Step
from studio_core.edits import Edit
from studio_core.errors import ProjectError
from studio_core.project import blobs
from studio_core.project.codec import scene_digest
from studio_core.project.records import History
from studio_core.project.store import (
    compact,
    info,
    load,
    load_revision,
    newest,
    save,
    save_copy_without_history,
)
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Environment, Group, MeshObject, PointLamp, Scene

SLOW = settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))


def history_of(document: Document) -> History:
    return History(document.history, document.position)


def rename(name: str) -> Edit:
    class Rename:
        label = f"Rename to {name}"

        def __call__(self, scene: Scene) -> Scene:
            return renamed(scene, name)

    return Rename()


@given(scenes(), scenes())
@SLOW
def test_any_scene_comes_back_bit_for_bit(first: Scene, second: Scene) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "été & co?#%.lucarne"
        for number, scene in enumerate((first, second, Scene(), first), 1):
            save(path, scene, label=str(number))
            loaded = load(path)
            assert scene_digest(loaded.scene) == scene_digest(scene)
            assert list(loaded.scene.nodes) == list(scene.nodes)
            assert loaded.revision.id == number
        assert [r.label for r in loaded.revisions] == ["1", "2", "3", "4"]


def test_instances_share_one_mesh_after_opening(tmp_path: Path) -> None:
    save(tmp_path / "a.lucarne", small_scene())
    scene = load(tmp_path / "a.lucarne").scene
    one, two = scene.of(MeshObject)
    assert one.geometry is two.geometry
    assert not one.geometry.positions.flags.writeable


def test_cost_of_a_save_follows_the_edit(tmp_path: Path) -> None:
    path = tmp_path / "large.lucarne"
    scene = small_scene(faces=60_000).with_nodes(*(Group(id=f"g{k}", name="G") for k in range(5000)))
    first = save(path, scene)
    assert first.whole
    assert first.bytes > 1_500_000
    size = path.stat().st_size
    edited = save(path, renamed(scene, "Moved"))
    assert not edited.whole
    assert edited.rows <= 9
    assert edited.bytes < 8000
    assert path.stat().st_size - size < 60_000
    again = save(path, renamed(scene, "Moved"))
    assert (again.rows, again.bytes, again.revision) == (0, 0, edited.revision)


def test_cost_of_saving_the_history_follows_the_edit(tmp_path: Path) -> None:
    path = tmp_path / "h.lucarne"
    document = Document(small_scene())
    for k in range(300):
        document.apply(rename(f"name {k}"))
    save(path, document.scene, history=history_of(document))
    document.apply(rename("last"))
    report = save(path, document.scene, history=history_of(document))
    assert report.rows <= 14
    assert report.bytes < 10_000


def test_undo_history_survives_reopening(tmp_path: Path) -> None:
    path = tmp_path / "h.lucarne"
    document = Document(small_scene())
    for k in range(40):
        document.apply(rename(f"name {k}"))
    for _ in range(7):
        document.undo()
    digests = [scene_digest(step.scene) for step in document.history]
    session = {"exposure": 1.5, "backend": "cuts", "view": [0.1, None, True, {"é": "\ud800"}]}
    save(path, document.scene, history=history_of(document), session=session)

    loaded = load(path)
    assert dict(loaded.session) == session
    assert loaded.history is not None
    assert loaded.history.position == document.position
    again = Document()
    again.restore(*loaded.history.opened())
    assert again.scene is loaded.scene
    assert [scene_digest(step.scene) for step in again.history] == digests
    assert [s.label for s in again.history] == [s.label for s in document.history]
    while again.undo():
        pass
    assert scene_digest(again.scene) == digests[0]
    while again.redo():
        pass
    assert scene_digest(again.scene) == digests[-1]
    report = save(path, loaded.scene, history=History(loaded.history.steps, loaded.history.position))
    assert report.rows <= 2  # a revision without the session, and which it is


def test_an_unfinished_gesture_is_saved_as_a_step(tmp_path: Path) -> None:
    path = tmp_path / "g.lucarne"
    document = Document(small_scene())
    for name in ("one", "two", "three"):
        document.apply(rename(name))
    document.undo()
    with document.gesture("Drag") as gesture:
        gesture.apply(rename("half way"))
        save(path, document.scene, history=history_of(document))
    loaded = load(path)
    assert loaded.history is not None
    assert [s.label for s in loaded.history.steps][-2:] == ["Rename to two", "Unfinished change"]
    assert loaded.history.position == 3
    assert loaded.scene["a"].name == "half way"


def test_earlier_revisions_can_be_opened(tmp_path: Path) -> None:
    path = tmp_path / "r.lucarne"
    made = [renamed(small_scene(), f"n{k}") for k in range(5)]
    for k, scene in enumerate(made):
        save(path, scene, label=f"v{k}", time=1000.0 + k, session={"k": k})
    for k, revision in enumerate(load(path).revisions):
        assert (revision.label, revision.time, revision.parent) == (f"v{k}", 1000.0 + k, k or None)
        old = load_revision(path, revision.id)
        assert scene_digest(old.scene) == scene_digest(made[k]) == revision.scene
        assert old.session == {"k": k}
    assert newest(path).label == "v4"
    with pytest.raises(ProjectError, match=r"r\.lucarne.*no revision 77"):
        load_revision(path, 77)


def test_compact_keeps_the_newest_with_its_history(tmp_path: Path) -> None:
    path = tmp_path / "c.lucarne"
    save(path, small_scene(1, faces=30_000))
    document = Document(small_scene(2))
    document.apply(rename("kept"))
    save(path, document.scene, label="Newest", history=history_of(document), session={"a": 1}, time=5.0)
    before = load(path)
    freed = compact(path)
    assert freed > 300_000
    after = load(path)
    assert scene_digest(after.scene) == scene_digest(before.scene)
    assert (after.revision.label, after.revision.time, after.session) == ("Newest", 5.0, {"a": 1})
    assert after.history is not None
    assert before.history is not None
    assert [s.digest for s in after.history.steps] == [s.digest for s in before.history.steps]
    assert [scene_digest(s.scene) for s in after.history.steps] == [s.digest for s in before.history.steps]
    assert len(after.revisions) == 1
    assert compact(path) == 0
    save(path, renamed(after.scene, "more"))
    assert load(path).scene["a"].name == "more"


def test_a_copy_without_history_has_nothing_discarded(tmp_path: Path) -> None:
    path, copy = tmp_path / "p.lucarne", tmp_path / "client.lucarne"
    document = Document(renamed(small_scene(), "Discarded idea"))
    document.apply(rename("Shown"))
    save(path, document.scene, label="Secret label", history=history_of(document), session={"s": "Hidden"})
    for source in (path, document.scene):
        save_copy_without_history(source, copy)
        data = copy.read_bytes()
        assert b"Shown" in data
        assert not any(word in data for word in (b"Discarded", b"Secret", b"Hidden"))
        loaded = load(copy)
        assert (loaded.history, dict(loaded.session), len(loaded.revisions)) == (None, {}, 1)
        assert scene_digest(loaded.scene) == scene_digest(document.scene)


def test_info_counts_without_opening_arrays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "i.lucarne"
    scene = small_scene()
    save(path, scene, label="One", history=History((Step("Open", scene),), 0))
    monkeypatch.setattr(blobs, "unpack", None)
    found = info(path)
    assert found.nodes == {"camera": 1, "environment": 1, "group": 1, "mesh": 2}
    assert found.materials == {"ggx": 1, "lambert": 1}
    assert (found.format, found.steps, len(found.revisions), found.opened_by) == (1, 1, 1, None)
    assert found.program.startswith("Lucarne ")
    assert found.file_bytes == path.stat().st_size
    assert found.arrays == 6
    raw = sum(a.nbytes for _, a in next(scene.of(MeshObject)).geometry.parts())
    assert raw < found.array_bytes <= raw + 16 * 16 * 3 + 16 * 32 * 3 * 4


@pytest.mark.parametrize("way", ["in place", "whole"])
def test_either_way_keeps_revisions(tmp_path: Path, way: str) -> None:
    path = tmp_path / "w.lucarne"
    save(path, small_scene(1))
    os.chmod(path, 0o640)  # noqa: PTH101
    report = save(path, small_scene(2), way=way)  # type: ignore[arg-type]
    assert report.whole is (way == "whole")
    assert len(load(path).revisions) == 2
    assert path.stat().st_mode & 0o777 == 0o640
    assert [p.name for p in tmp_path.iterdir()] == ["w.lucarne"]


def test_fresh_replaces_any_file(tmp_path: Path) -> None:
    path = tmp_path / "f.lucarne"
    path.write_bytes(b"something else entirely" * 100)
    with pytest.raises(ProjectError, match=r"f\.lucarne is not a Lucarne project"):
        save(path, small_scene())
    assert path.read_bytes().startswith(b"something")
    save(path, small_scene(), fresh=True)
    save(path, small_scene(3), fresh=True)
    loaded = load(path)
    assert scene_digest(loaded.scene) == scene_digest(small_scene(3))
    assert len(loaded.revisions) == 1


def test_an_interrupted_save_is_rolled_back_on_opening(tmp_path: Path) -> None:
    path = tmp_path / "j.lucarne"
    save(path, small_scene(1))
    for act in (load, info, newest):
        hot_journal(path)
        act(path)
        assert not path.with_name("j.lucarne-journal").exists()
        assert scene_digest(load(path).scene) == scene_digest(small_scene(1))


def test_a_stale_journal_never_reaches_a_new_file(tmp_path: Path) -> None:
    path = tmp_path / "j.lucarne"
    save(path, small_scene(1))
    journal = hot_journal(path)
    save(path, small_scene(2), fresh=True)
    assert scene_digest(load(path).scene) == scene_digest(small_scene(2))
    path.unlink()
    path.with_name("j.lucarne-journal").write_bytes(journal)
    save(path, small_scene(4))
    assert scene_digest(load(path).scene) == scene_digest(small_scene(4))


def test_a_symlink_is_followed(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    real, link = tmp_path / "real" / "a.lucarne", tmp_path / "link.lucarne"
    link.symlink_to(real)
    save(link, small_scene(1))
    save(link, small_scene(2), way="whole")
    assert link.is_symlink()
    assert scene_digest(load(real).scene) == scene_digest(load(link).scene)


def test_what_cannot_be_read_back_is_not_saved(tmp_path: Path) -> None:
    path = tmp_path / "n.lucarne"
    good = small_scene()
    save(path, good)
    data = path.read_bytes()
    bad = [
        good.with_nodes(PointLamp(id="l", name="Sun", intensity=math.inf)),
        good.with_nodes(Group(id="g", parent="nobody")),
        good.with_nodes(Group(id="g", parent="g")),
    ]
    for scene in bad:
        for fresh in (False, True):
            with pytest.raises(ProjectError, match=r"n\.lucarne could not be saved"):
                save(path, scene, fresh=fresh)
    sessions: list[dict[str, object]] = [{"x": float("nan")}, {"x": 10**30}, {"x": object()}, {"x": 1 + 2j}]
    for session in sessions:
        with pytest.raises(ProjectError, match="the session"):
            save(path, good, session=session)
    assert path.read_bytes() == data
    assert [p.name for p in tmp_path.iterdir()] == ["n.lucarne"]


@given(st.text())
@settings(max_examples=20, deadline=None)
def test_labels_of_any_text_can_be_saved(label: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "l.lucarne"
        save(path, Scene(), label=label, history=History((Step(label, Scene()),), 0))
        loaded = load(path)
        assert loaded.revision.label == label[:1000]
        assert loaded.history is not None
        assert loaded.history.steps[0].label == label[:1000]


def test_arrays_over_one_part_come_back(tmp_path: Path) -> None:
    path = tmp_path / "big.lucarne"
    rng = np.random.default_rng(1)
    pixels = np.zeros((4200, 5400, 3), np.uint8)
    pixels[::7, ::5] = rng.integers(0, 256, (600, 1080, 3))
    assert pixels.nbytes > blobs.PART_BYTES
    image = Image(pixels, "srgb")
    save(path, Scene().with_nodes(Environment(id="e", image=image)))
    again = next(load(path).scene.of(Environment)).image
    assert np.array_equal(again.pixels, pixels)


@pytest.mark.parametrize("make", [lambda p: None, lambda p: p.mkdir(), lambda p: p.write_bytes(b"")])
def test_nothing_to_open_is_said(tmp_path: Path, make: Callable[[Path], object]) -> None:
    path = tmp_path / "gone.lucarne"
    make(path)
    for act in (load, info, newest, compact):
        with pytest.raises(ProjectError, match=r"gone\.lucarne"):
            act(path)


def test_a_missing_folder_is_said(tmp_path: Path) -> None:
    with pytest.raises(ProjectError, match=r"a\.lucarne could not be saved: .*(no such|cannot be opened)"):
        save(tmp_path / "nowhere" / "a.lucarne", Scene())


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_a_read_only_folder_is_said(tmp_path: Path) -> None:
    path = tmp_path / "ro.lucarne"
    save(path, small_scene(1))
    path.chmod(0o444)
    tmp_path.chmod(0o555)
    try:
        for fresh in (False, True):
            with pytest.raises(
                ProjectError, match=r"ro\.lucarne.*(cannot be written|denied|cannot be opened)"
            ):
                save(path, small_scene(2), fresh=fresh)
        assert scene_digest(load(path).scene) == scene_digest(small_scene(1))
    finally:
        tmp_path.chmod(0o755)


def test_two_projects_do_not_know_each_other(tmp_path: Path) -> None:
    one, two = tmp_path / "1.lucarne", tmp_path / "2.lucarne"
    scene = small_scene()
    save(one, scene)
    save(two, renamed(scene, "Other"))
    save(one, renamed(scene, "Third"))
    assert load(two).scene["a"].name == "Other"
    assert load(one).scene["a"].name == "Third"
