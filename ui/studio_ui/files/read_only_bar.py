"""Says over the picture why the project cannot be saved, and what can be done instead."""

from __future__ import annotations

import time

from studio_ui.context import Subscriptions
from studio_ui.files.notice_bar import Bar
from studio_ui.files.opening import ReadOnly
from studio_ui.files.project_files import ProjectFiles
from studio_ui.files.recent import when


class ReadOnlyBar(Bar):
    """There as long as the project is read-only."""

    def __init__(self, files: ProjectFiles) -> None:
        super().__init__("warning", closable=False)
        self._files = files
        self.again = self.button("Try again", "Open it for saving, if that can be done now", files.try_again)
        self.over = self.button(
            "Open for saving…", "If the other machine does not have it open any more", files.take_over
        )
        self.copy = self.button(
            "Save a copy…", "Go on in a file of your own; this one stays as it is", files.save_as
        )
        self._subscriptions = Subscriptions()
        self._subscriptions.add(files.changed.connect(self.refresh))
        self.refresh()

    def refresh(self) -> None:
        """Follow the files."""
        why = self._files.locked_out
        if why is not None:
            self.say(sentence(self._files.name, why))
            self.over.setVisible(why.foreign)
        self.setVisible(why is not None and self.parent() is not None)

    def close_panel(self) -> None:
        """Stop listening."""
        self._subscriptions.close()


def sentence(name: str, why: ReadOnly) -> str:
    """Why a project is read-only, in a designer's words."""
    if why.holder is not None:
        who = why.holder.user or "Somebody"
        since = when(why.holder.since, time.time())
        return (
            f"Read-only: {who} on {why.holder.host} has had {name} open since {since}. "
            "Changes cannot be saved here."
        )
    if why.problem:
        return f"Read-only: {why.problem}. Changes cannot be saved here."
    return f"{name} was opened read-only. Changes cannot be saved here."
