"""Where commands are typed: several lines, history, completion, a hint of what a function takes."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QFontDatabase, QKeyEvent, QStandardItem, QStandardItemModel, QTextCursor
from PySide6.QtWidgets import QCompleter, QPlainTextEdit, QTreeView, QWidget

from studio_core.scripting import Completion, complete, indentation

MOST_LINES, MOST_HISTORY, MOST_KEPT = 10, 200, 4_000
Complete = Callable[[str], list[Completion]]


class History:
    """Commands that were run, the newest last, and a place among them while one looks back."""

    def __init__(self, commands: Iterable[object] = ()) -> None:
        self.commands = [c for c in commands if isinstance(c, str)][-MOST_HISTORY:]
        self._at = len(self.commands)
        self._draft = ""

    def add(self, command: str) -> None:
        """Put a command at the end; the same one is not kept twice in a row."""
        if command.strip() and len(command) <= MOST_KEPT and self.commands[-1:] != [command]:
            self.commands = [*self.commands, command][-MOST_HISTORY:]
        self._at, self._draft = len(self.commands), ""

    def move(self, step: int, shown: str) -> str | None:
        """The command so many places on, or None at either end; what was typed comes back at the end."""
        if self._at == len(self.commands):
            self._draft = shown
        at = self._at + step
        if not 0 <= at <= len(self.commands):
            return None
        self._at = at
        return self._draft if at == len(self.commands) else self.commands[at]


def _table(found: list[Completion], parent: QObject) -> QStandardItemModel:
    """A row a completion: its text, and what it is."""
    model = QStandardItemModel(parent)
    for one in found:
        what = QStandardItem(f"{one.signature}  {one.summary}".strip())
        model.appendRow([QStandardItem(one.text), what])
    return model


class CommandEditor(QPlainTextEdit):
    """`entered(source)` when a command is complete; `moved(text before the cursor)` while it is typed."""

    entered = Signal(str)
    moved = Signal(str)
    pointed = Signal(object)  # the completion that is highlighted, or None

    def __init__(self, history: History, find: Complete, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.history, self._find = history, find
        self._found: list[Completion] = []
        self.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
        self.setPlaceholderText("Python; Tab completes, help() lists what there is")
        self.setAccessibleName("Command")
        self.setTabChangesFocus(False)
        self.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAsNeeded)
        self.completer = QCompleter(self)
        self.completer.setWidget(self)
        self.completer.setCompletionMode(QCompleter.CompletionMode.UnfilteredPopupCompletion)
        self.completer.setMaxVisibleItems(10)
        self._list = QTreeView()
        self._list.setHeaderHidden(True)
        self._list.setRootIsDecorated(False)
        self._list.setUniformRowHeights(True)
        self._list.setTextElideMode(Qt.TextElideMode.ElideRight)
        self.completer.setPopup(self._list)
        self.completer.activated[str].connect(self._take)  # type: ignore[index]
        self.completer.highlighted[str].connect(self._point)  # type: ignore[index]
        self.textChanged.connect(self._fit)
        self.cursorPositionChanged.connect(lambda: self.moved.emit(self.before))
        self._fit()

    @property
    def before(self) -> str:
        """The text before the cursor."""
        return self.toPlainText()[: self.textCursor().position()]

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Enter runs, Tab completes, Up and Down look back."""
        key, held = event.key(), event.modifiers()
        if self.completer.popup().isVisible() and self._popup_key(event):
            return
        shift, control = Qt.KeyboardModifier.ShiftModifier, Qt.KeyboardModifier.ControlModifier
        if key in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            if held & control or (not held & shift and complete(self.toPlainText())):
                self.enter()
            else:
                self.insertPlainText("\n" + indentation(self.before))
        elif key == Qt.Key.Key_Tab and not held & control:
            self._tab()
        elif key == Qt.Key.Key_Backtab:
            self.focusPreviousChild()
        elif key == Qt.Key.Key_Space and held & control:
            self.suggest()
        elif key == Qt.Key.Key_Up and "\n" not in self.before and not held & shift:
            self._recall(-1)
        elif key == Qt.Key.Key_Down and "\n" not in self._after and not held & shift:
            self._recall(1)
        else:
            super().keyPressEvent(event)

    def enter(self) -> None:
        """Run what is typed."""
        source = self.toPlainText()
        if source.strip():
            self.history.add(source)
            self.clear()
            self.entered.emit(source)

    def suggest(self) -> None:
        """Show what could come next; a single possibility is taken at once."""
        self._found = self._find(self.before)
        if len(self._found) == 1:
            self._insert(self._found[0])
        elif self._found:
            self.completer.setModel(_table(self._found, self.completer))
            popup = self.completer.popup()
            popup.setCurrentIndex(self.completer.completionModel().index(0, 0))
            place = self.cursorRect()
            place.setWidth(self._column_widths())
            self.completer.complete(place)
            self._point(self._found[0].text)

    def _column_widths(self) -> int:
        """Make the list's columns as wide as they must be, within limits; both together."""
        name, rest = (self._list.sizeHintForColumn(column) + 12 for column in (0, 1))
        name, rest = min(name, 260), min(rest, 460)
        self._list.setColumnWidth(0, name)
        self._list.setColumnWidth(1, rest)
        return name + rest + 24

    @property
    def _after(self) -> str:
        return self.toPlainText()[self.textCursor().position() :]

    def _tab(self) -> None:
        if not self.before.split("\n")[-1].strip():
            self.insertPlainText("    ")
        else:
            self.suggest()

    def _popup_key(self, event: QKeyEvent) -> bool:
        """Keys that belong to the list while it is open; others are typed, and the list follows."""
        key = event.key()
        if key in (Qt.Key.Key_Return, Qt.Key.Key_Enter, Qt.Key.Key_Tab):
            index = self._list.currentIndex().siblingAtColumn(0)
            self.completer.popup().hide()
            self._take(str(index.data() or self._found[0].text))
            return True
        if key == Qt.Key.Key_Escape:
            self.completer.popup().hide()
            self.pointed.emit(None)
            return True
        if (event.text().isprintable() and event.text()) or key == Qt.Key.Key_Backspace:
            self.completer.popup().hide()
            super().keyPressEvent(event)
            found = self._find(self.before)
            if len(found) > 1:
                self.suggest()
            return True
        return False

    def _take(self, text: str) -> None:
        chosen = next((found for found in self._found if found.text == text), None)
        if chosen is not None:
            self._insert(chosen)

    def _insert(self, chosen: Completion) -> None:
        cursor = self.textCursor()
        cursor.movePosition(QTextCursor.MoveOperation.Left, QTextCursor.MoveMode.KeepAnchor, chosen.length)
        cursor.insertText(chosen.text)
        self.setTextCursor(cursor)
        self.pointed.emit(None)

    def _point(self, text: str) -> None:
        self.pointed.emit(next((found for found in self._found if found.text == text), None))

    def _recall(self, step: int) -> None:
        found = self.history.move(step, self.toPlainText())
        if found is not None:
            self.setPlainText(found)
            self.moveCursor(QTextCursor.MoveOperation.End)

    def _fit(self) -> None:
        """As high as its lines."""
        lines = min(MOST_LINES, max(1, self.blockCount()))
        margins = self.contentsMargins()
        around = 2 * round(self.document().documentMargin()) + margins.top() + margins.bottom() + 4
        self.setFixedHeight(lines * self.fontMetrics().lineSpacing() + around)
