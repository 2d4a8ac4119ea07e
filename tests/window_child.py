"""A window in a process of its own, to be killed: `python -m window_child WHAT STATE PROJECT`.

Prints one JSON line when it has come to what was asked of it, then waits.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication
from ui_support import Answers, Fake, room

from studio.app import assemble
from studio.crash_log import crash_log
from studio_core.document import Step
from studio_core.edits import Remove, SetFields
from studio_core.project.codec import scene_digest
from studio_core.registry import PluginHost
from studio_plugins.brdfs import plugin as brdfs
from studio_ui.settings import Settings


def main(what: str, state: Path, project: Path) -> int:
    """WHAT is work (edits, autosave), unsaved (no file), recover, look (open) or ask (what is offered)."""
    application = QApplication([])
    answers = Answers()
    with crash_log(state) as crashed:
        studio = assemble(
            settings=Settings(state),
            host=PluginHost([brdfs]),
            shading=Fake(),
            ask=answers,
            threads=1,
            thumbnails=state / "thumbnails",
        )
        window, context = studio.window, studio.context
        window.show()
        files, document = window.files, context.document

        def tell(**more: object) -> None:
            found = {"digest": scene_digest(document.scene), "asked": answers.asked, "crashed": crashed}
            print(json.dumps({**found, "labels": [s.label for s in document.history], **more}), flush=True)

        def when(condition: Callable[[], bool], then: Callable[[], object]) -> None:
            if condition():
                then()
            else:
                QTimer.singleShot(10, window, lambda: when(condition, then))

        def edit() -> None:
            document.apply(SetFields("stool", {"name": "Taboret"}, "Rename"))
            document.apply(Remove(("back",), "Delete Back"))
            when(lambda: files.keeper.kept.where == "autosaved", lambda: tell(path=str(files.keeper.path)))

        def told() -> None:
            left = answers.left[0] if answers.left else None
            versions = [left.recovered.objects, left.saved.objects if left.saved else None] if left else []
            tell(versions=versions, modified=document.modified, read_only=files.read_only)
            if what == "recover":
                answers.target = project
                files.save(lambda: (tell(saved=True), application.quit()))

        if what == "work":
            files.open(project)
            when(lambda: files.path is not None, edit)
        elif what == "unsaved":
            document.restore((Step("New", room()),), 0)
            edit()
        elif what == "ask":
            files.offer_unsaved()
            context.tasks.run("Tell", lambda job: None, lambda _: tell())
        else:
            files.open(project) if project.exists() else files.offer_unsaved()
            when(lambda: bool(document.scene.nodes), told)
        status = application.exec()
        studio.close()
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])))
