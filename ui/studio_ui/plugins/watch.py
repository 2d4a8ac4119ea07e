"""What happens when the backend misbehaves: the last picture stays, and another backend is offered."""

from __future__ import annotations

from PySide6.QtCore import QObject, QTimer

from studio_core.errors import LucarneError
from studio_core.session import Session
from studio_core.shading.job import Job
from studio_core.shading.scheduler import ComputeThread
from studio_ui.context import Context, Subscriptions
from studio_ui.files.notice_bar import Bar

DEFAULT = Session().backend
_EVERY_MS = 1_000
PATIENCE = 10  # looks at a cancelled job before it counts as one that never answers


class BackendBar(Bar):
    """There while the chosen backend does not work."""

    def __init__(self, context: Context) -> None:
        super().__init__("problem")
        self._context = context
        self.use = self.button("Use another", "The scene stays as it is", self.fall_back)
        assert self.close_button is not None
        self.close_button.clicked.connect(self.hide)
        self.hide()

    def offer(self, text: str) -> None:
        """Say what is wrong, with the way out where there is one."""
        context = self._context
        other = context.session.backend != DEFAULT and DEFAULT in context.host.names("backend")
        self.use.setVisible(other)
        self.use.setText(f"Use {backend_label(context, DEFAULT)}")
        self.say(text)
        self.show()

    def fall_back(self) -> None:
        """The default backend."""
        self.hide()
        self._context.session.shade_with(DEFAULT)


class BackendWatch(QObject):
    """Follows the feed; work of other people's backends that never asks whether to go on is left behind."""

    def __init__(self, context: Context, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.bar = BackendBar(context)
        self._context = context
        self._backend = context.session.backend
        self._job: Job | None = None
        self._name = self._backend  # whose job it is
        self._checkpoints = self._looks = 0
        self._subscriptions = Subscriptions()
        self._subscriptions.add(
            context.feed.failed.connect(self._failed),
            context.feed.shown.connect(lambda _: self.bar.hide()),
            context.session.changed.connect(lambda _: self._switched()),
        )
        self._timer = QTimer(self)
        self._timer.setInterval(_EVERY_MS)
        self._timer.timeout.connect(self.look)
        self._timer.start()

    def close(self) -> None:
        """Stop following."""
        self._timer.stop()
        self._subscriptions.close()

    def look(self) -> None:
        """Now and then: whether a job that was asked to stop does."""
        job = self._job
        if job is None or job.ended or not job.cancelled:
            self._job, self._looks = self._context.feed.job, 0
            self._name = self._context.session.backend
            return
        self._looks = self._looks + 1 if job.checkpoints == self._checkpoints else 0
        self._checkpoints = job.checkpoints
        if self._looks >= PATIENCE:
            self._job = None
            self._left_behind(self._name)

    def _left_behind(self, name: str) -> None:
        context = self._context
        own = name in context.host.names("backend") and context.host.bundled("backend", name)
        if own or name == DEFAULT:
            return  # it compiles or loads; it does come back
        plugin = plugin_of(context, name)
        error = TimeoutError("it never asks whether to go on")
        context.host.report(plugin, f"backend {name!r} did not stop when it was asked to", error)
        text = f"{backend_label(context, name)} (plugin {plugin}) does not answer any more."
        context.journal.write(text, "problem", str(error))
        if isinstance(context.compute, ComputeThread):
            context.compute.renew()
        if context.session.backend == name:
            self.bar.offer(f"{text} The last picture stays.")

    def _switched(self) -> None:
        if self._context.session.backend != self._backend:
            self._backend = self._context.session.backend
            self.bar.hide()

    def _failed(self, error: Exception) -> None:
        label = backend_label(self._context, self._context.session.backend)
        self.bar.offer(f"{label} could not compute the picture. The last one stays.")


def plugin_of(context: Context, backend: str) -> str:
    """The plugin that brings a backend, by its id."""
    try:
        return context.host.provider("backend", backend).id
    except LucarneError:
        return backend


def backend_label(context: Context, backend: str) -> str:
    """What a backend is called; its id until it is loaded."""
    if context.warm:
        try:
            return str(context.host.get("backend", backend).label)
        except LucarneError:
            return backend
    return backend
