"""Help ▸ Plugins: what was found, where it comes from, whether it loaded, and why not."""

from __future__ import annotations

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QFontDatabase, QGuiApplication
from PySide6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QHeaderView,
    QLabel,
    QPlainTextEdit,
    QPushButton,
    QSplitter,
    QTreeWidget,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from studio_core.contract import KINDS
from studio_core.errors import PluginError
from studio_core.registry import Listed, Origin, PluginHost
from studio_core.shading.job import Job
from studio_ui.panels.panel import note
from studio_ui.settings import Settings
from studio_ui.tasks import Tasks

OFF = "plugins_off"
"""The setting that holds which plugins of other people are switched off, by `Origin.key`."""
_HEADINGS = ("Plugin", "State", "Provides", "Version", "From")
_ROW = 24  # pixels
_ENTRY = Qt.ItemDataRole.UserRole
_PLURALS = {"brdf": "materials", "importer": "reads", "exporter": "writes", "backend": "backends"}
_LOADING = "Loading all plugins"


class PluginsDialog(QDialog):
    """Plugins of other people can be switched off, for the next start; the program's own cannot."""

    def __init__(self, parent: QWidget | None, host: PluginHost, settings: Settings, tasks: Tasks) -> None:
        super().__init__(parent)
        self._host, self._settings, self._tasks = host, settings, tasks
        self._off_at_start = set(self._off)
        self._gone = False
        self.setWindowTitle("Plugins")
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.resize(820, 520)
        self.summary = QLabel()
        self.summary.setWordWrap(True)
        self.tree = QTreeWidget()
        self.tree.setAccessibleName("Plugins")
        self.tree.setHeaderLabels(list(_HEADINGS))
        self.tree.setRootIsDecorated(False)
        self.detail = QPlainTextEdit()
        self.detail.setReadOnly(True)
        self.detail.setAccessibleName("Details of the chosen plugin")
        self.detail.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
        self.restart = note("Takes effect when the program is started again.")
        self.restart.hide()
        split = QSplitter(Qt.Orientation.Vertical)
        split.addWidget(self.tree)
        split.addWidget(self.detail)
        split.setSizes([300, 160])
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        self.load = QPushButton("Load everything now")
        self.load.setToolTip("Loads what is otherwise loaded when it is first needed, and shows what fails")
        self.copy = QPushButton("Copy details")
        self.copy.setToolTip("Everything that is shown here, as text")
        for button in (self.load, self.copy):
            buttons.addButton(button, QDialogButtonBox.ButtonRole.ActionRole)
            button.setAutoDefault(False)
        column = QVBoxLayout(self)
        column.setSpacing(8)
        for widget in (self.summary, split, self.restart, buttons):
            column.addWidget(widget, 1 if widget is split else 0)
        self.load.clicked.connect(self.load_all)
        self.copy.clicked.connect(lambda: QGuiApplication.clipboard().setText(self.text()))
        buttons.rejected.connect(self.reject)
        self.tree.currentItemChanged.connect(lambda item, _: self._describe(item))
        self.refresh()
        self.tree.itemChanged.connect(self._switched)

    @property
    def _off(self) -> list[str]:
        return [key for key in self._settings.get(OFF, []) if isinstance(key, str)]

    def refresh(self) -> None:
        """Show how everything is now."""
        chosen = self.tree.currentItem().text(0) if self.tree.currentItem() is not None else ""
        self.tree.blockSignals(True)
        self.tree.clear()
        listed = sorted(self._host.listed(), key=lambda entry: entry.state != "failed")
        for entry in listed:
            self.tree.addTopLevelItem(self._row(entry))
        self.tree.blockSignals(False)
        header = self.tree.header()
        for column in (0, 1, 3, 4):
            header.setSectionResizeMode(column, QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(2, QHeaderView.ResizeMode.Stretch)
        header.setStretchLastSection(False)
        failed = sum(entry.state == "failed" for entry in listed)
        waiting = sum(entry.state == "not needed yet" for entry in listed)
        self.summary.setText(_summary(failed, waiting))
        again = [i for i in range(len(listed)) if self.tree.topLevelItem(i).text(0) == chosen]
        if listed:
            self.tree.setCurrentItem(self.tree.topLevelItem(again[0] if again else 0))
        self._describe(self.tree.currentItem())

    def load_all(self) -> None:
        """Load everything that is provided, away from the window's thread."""
        self.load.setEnabled(False)

        def done(_: object) -> None:
            if not self._gone:
                self.load.setEnabled(True)
                self.refresh()

        self._tasks.run(_LOADING, lambda job: load_everything(self._host, job), done, done)

    def done(self, result: int) -> None:
        """Closed: what comes later is not shown."""
        self._gone = True
        super().done(result)

    def text(self) -> str:
        """All of it, for whoever helps."""
        return "\n\n".join(_told(entry) for entry in self._host.listed())

    def _row(self, entry: Listed) -> QTreeWidgetItem:
        origin = entry.origin
        bundled = origin is None or origin.bundled
        kept = (
            ["Part of the program" if bundled else origin.distribution or "other people"] if origin else [""]
        )
        version = origin.version if origin is not None else ""
        item = QTreeWidgetItem([entry.name, entry.state.capitalize(), _provides(entry), version, *kept])
        item.setData(0, _ENTRY, entry)
        item.setToolTip(2, _provides(entry))
        item.setSizeHint(0, QSize(0, _ROW))
        if origin is not None and not origin.bundled:
            item.setFlags(item.flags() | Qt.ItemFlag.ItemIsUserCheckable)
            on = origin.key not in self._off
            item.setCheckState(0, Qt.CheckState.Checked if on else Qt.CheckState.Unchecked)
            item.setToolTip(0, "Switched on at the next start")
        return item

    def _switched(self, item: QTreeWidgetItem, column: int) -> None:
        entry: Listed = item.data(0, _ENTRY)
        if column or entry.origin is None:
            return
        others = [key for key in self._off if key != entry.origin.key]
        on = item.checkState(0) is Qt.CheckState.Checked
        self._settings.set(OFF, others if on else [*others, entry.origin.key])
        self.restart.setVisible(set(self._off) != self._off_at_start)

    def _describe(self, item: QTreeWidgetItem | None) -> None:
        self.detail.setPlainText(_told(item.data(0, _ENTRY)) if item is not None else "")


def load_everything(host: PluginHost, job: Job) -> None:
    """Ask for everything that plugins provide; what fails is among the host's failures."""
    wanted = [(kind, name) for kind in KINDS for name in host.names(kind)]
    for index, (kind, name) in enumerate(wanted):
        job.checkpoint(index, len(wanted))
        try:
            host.get(kind, name)
        except PluginError:
            continue


def _summary(failed: int, waiting: int) -> str:
    if failed:
        one = "One plugin" if failed == 1 else f"{failed} plugins"
        return f"{one} did not work; the rest of the program does."
    if waiting:
        return "All plugins that were needed so far have loaded."
    return "All plugins have loaded."


def _provides(entry: Listed) -> str:
    if entry.plugin is None:
        return ""
    said = []
    for kind, names in entry.plugin.provides.items():
        said.append(f"{_PLURALS.get(kind, kind.replace('_', ' '))}: {', '.join(names)}")
    return "; ".join(said)


def _from(origin: Origin | None) -> str:
    if origin is None:
        return ""
    return "Part of the program" if origin.bundled else origin.distribution or "Other people"


def _told(entry: Listed) -> str:
    origin = entry.origin
    lines = [f"{entry.name}: {entry.state}"]
    if origin is not None:
        lines.append(f"{origin.distribution} {origin.version}, entry point {origin.point} = {origin.where}")
    if entry.plugin is not None:
        lines += [
            f"{kind} {name}: {where}"
            for kind, names in entry.plugin.provides.items()
            for name, where in names.items()
        ]
    for failure in entry.failures:
        lines += ["", failure.what, failure.traceback.rstrip()]
    return "\n".join(lines)
