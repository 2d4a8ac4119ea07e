"""Console: a Python prompt over the open project; scripts are run from here and saved from here."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtGui import QFontDatabase, QGuiApplication
from PySide6.QtWidgets import QApplication, QCheckBox, QDockWidget, QHBoxLayout, QLabel, QVBoxLayout

from studio_core.contract import Services
from studio_core.edits import Edit
from studio_core.errors import InputError, LucarneError
from studio_core.scripting import (
    Completion,
    Interpreter,
    Names,
    Outcome,
    completions,
    hint,
    spelled,
)
from studio_ui.ask import Ask, Filter
from studio_ui.console.editor import CommandEditor, History
from studio_ui.console.running import Running
from studio_ui.console.transcript import Transcript
from studio_ui.context import Context
from studio_ui.look.theme import Theme
from studio_ui.panels.panel import Panel
from studio_ui.settings import Settings

SCRIPTS = Filter("Python scripts", (".py",))
_HISTORY, _TELLING = "console_history", "console_telling"
_HEAD = '"""Made in the console; lucarne script --project PROJECT FILE runs it on another project."""\n'
_WELCOME = (
    "Python over the open project. help() lists what there is; Tab completes; Shift+Enter starts a line."
)


class ConsolePanel(Panel):
    """One command is one entry of the history; a failed or stopped one changes nothing."""

    id = "console"
    title = "Console"

    def __init__(
        self, context: Context, ask: Ask, settings: Settings, save: Callable[[], object] = lambda: None
    ) -> None:
        super().__init__(context)
        self._ask, self._settings, self._save = ask, settings, save
        self._busy = self._save_wanted = False
        self._detail = ""
        self.script: list[str] = []  # what was done since the console was cleared
        self.transcript = Transcript()
        self.running = Running(self, self.transcript.flush, context.compute)
        self.names = Names(
            context.document,
            context.session,
            context.host,
            self._services,
            run=self.running.heavily,
            save=self._keep,
        )
        self.interpreter = Interpreter(
            context.document,
            self.names.namespace,
            lambda text, error: self.transcript.add(text, "error" if error else "output"),
            self.running.tick,
        )
        self.editor = CommandEditor(History(settings.get(_HISTORY, [])), self._complete)
        self._lay_out()
        self.editor.entered.connect(self.run)
        self.editor.moved.connect(self._hint)
        self.editor.pointed.connect(self._describe)
        self.subscriptions.add(
            context.editing.done.connect(self._told), context.editing.stepped.connect(self._stepped)
        )
        self.transcript.line(_WELCOME, "note")
        self.transcript.flush()

    def _lay_out(self) -> None:
        mono = QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont)
        prompt = QLabel(">>>")
        prompt.setFont(mono)
        prompt.setProperty("role", "dim")
        prompt.setContentsMargins(0, 5, 0, 0)
        self.hint = QLabel()
        self.hint.setFont(mono)
        self.hint.setProperty("role", "dim")
        self.hint.setTextFormat(Qt.TextFormat.PlainText)
        self.hint.setMinimumWidth(1)
        self.telling = QCheckBox("Show what the window does")
        self.telling.setToolTip("Each change made with the mouse or a panel, as the line of a script")
        self.telling.setChecked(self._settings.get(_TELLING, False))
        self.telling.toggled.connect(lambda on: self._settings.set(_TELLING, on))
        buttons = [
            ("open", "Run a script…", self.run_script),
            ("save", "Save what was done as a script…", self.save_script),
            ("duplicate", "Copy all text", self.copy),
            ("delete", "Clear the console", self.clear),
        ]
        tools = []
        for name, tip, action in buttons:
            button = self.tool(name, tip)
            button.clicked.connect(lambda checked=False, act=action: act())
            tools.append(button)
        self.traceback = self.tool("eye", "Show the whole traceback of the last error")
        self.traceback.clicked.connect(self.show_traceback)
        self.traceback.setEnabled(False)
        strip = QVBoxLayout()
        strip.setSpacing(2)
        for tool in (*tools, self.traceback):
            strip.addWidget(tool)
        strip.addStretch(1)
        line, below, right = QHBoxLayout(), QHBoxLayout(), QVBoxLayout()
        for layout in (line, below, right):
            layout.setSpacing(4)
        line.addWidget(prompt, 0, Qt.AlignmentFlag.AlignTop)
        line.addWidget(self.editor, 1)
        below.addWidget(self.hint, 1)
        below.addWidget(self.telling)
        right.addWidget(self.transcript, 1)
        right.addLayout(line)
        right.addLayout(below)
        whole = QHBoxLayout()
        whole.setSpacing(4)
        whole.addLayout(strip)
        whole.addLayout(right, 1)
        self.column.addLayout(whole, 1)
        self.setFocusProxy(self.editor)

    # running

    def run(self, source: str) -> None:
        """Run a command and show what comes of it."""
        shown = source.rstrip().replace("\n", "\n... ")
        self.transcript.line(f">>> {shown}", "command")
        if self._held(lambda: self.interpreter.run(source)):
            self.script.append(source.rstrip())
        self._settings.set(_HISTORY, self.editor.history.commands)

    def run_script(self, path: Path | None = None) -> None:
        """Ask for a file unless given, and run it."""
        if path is None:
            chosen = self._ask.open_files("Run a script", [SCRIPTS])
            path = chosen[0] if chosen else None
        if path is not None:
            file = path
            self.transcript.line(f"# {path}", "command")
            self._held(lambda: self.interpreter.run_file(file))

    def _held(self, work: Callable[[], Outcome]) -> bool:
        """Run something while nothing else is done to the document; whether it came to its end."""
        if self._busy:
            return False
        self._busy = True
        self.context.editing.finish()
        self.running.begin()
        try:
            with self.context.quiet():
                outcome = work()
        except InputError as error:
            outcome = Outcome(error=str(error))
        finally:
            self.running.end()
            self._busy = False
        self._detail = outcome.detail
        self.traceback.setEnabled(bool(outcome.detail) and not outcome.stopped)
        if not outcome.ok:
            self.transcript.line(outcome.error, "error")
        if outcome.taken_back:
            self.transcript.line("What it had changed was taken back.", "note")
        self.transcript.flush()
        self.editor.setFocus()
        if self._save_wanted:
            self._save_wanted = False
            self._save()
        return outcome.ok

    def _services(self) -> Services:
        if self.context.services is None:
            raise LucarneError("nothing can be rendered here")
        return self.context.services

    def _keep(self, path: Path | None) -> None:
        """The project when the command is over; a copy now."""
        if path is None:
            self._save_wanted = True
            return
        from studio_core.project.store import save

        save(path, self.context.document.scene, label="Copy", fresh=True)

    # what is typed

    def _complete(self, before: str) -> list[Completion]:
        return completions(before, self.names.namespace, self.context.document.scene)

    def _hint(self, before: str) -> None:
        self._say(hint(before, self.names.namespace))

    def _describe(self, chosen: Completion | None) -> None:
        if chosen is None:
            self._hint(self.editor.before)
        else:
            self._say(f"{chosen.text}{chosen.signature}  {chosen.summary}".rstrip())

    def _say(self, text: str) -> None:
        self.hint.setText(text)
        self.hint.setToolTip(text)

    # what the window does

    def _told(self, edit: Edit) -> None:
        if not self.telling.isChecked() or self._busy:
            return
        line = spelled(edit)
        self._note(line if line is not None else f"# {edit.label}: not a single line of a script")

    def _stepped(self, steps: int) -> None:
        if self.telling.isChecked() and not self._busy and steps:
            call = "undo" if steps < 0 else "redo"
            self._note(f"{call}({abs(steps) if abs(steps) > 1 else ''})")

    def _note(self, line: str) -> None:
        self.script.append(line)
        self.transcript.line(line, "note")
        self.transcript.flush()

    # tools

    def save_script(self) -> None:
        """Ask for a file, and write what was done into it."""
        if not self.script:
            self.transcript.line("Nothing was done yet that could be saved.", "note")
            self.transcript.flush()
            return
        path = self._ask.save_file("Save as script", Path.home() / "script.py", [SCRIPTS])
        if path is None:
            return
        if path.suffix.lower() != ".py":
            path = path.with_name(path.name + ".py")
        try:
            path.write_text(_HEAD + "\n" + "\n".join(self.script) + "\n", "utf-8")
        except OSError as error:
            self.context.journal.problem("Saving the script", InputError(f"{path.name}: {error.strerror}"))
            return
        self.context.journal.write(f"Saved {path.name}.")

    def show_traceback(self) -> None:
        """All of the last error."""
        self.transcript.line(self._detail, "error")
        self.transcript.flush()

    def copy(self) -> None:
        """All text to the clipboard."""
        QGuiApplication.clipboard().setText(self.transcript.toPlainText())

    def clear(self) -> None:
        """Forget the text, and what would be saved as a script."""
        self.script.clear()
        self.transcript.forget()

    def set_theme(self, theme: Theme) -> None:
        """Text in the theme's colours."""
        super().set_theme(theme)
        self.transcript.set_theme(theme)

    def close_panel(self) -> None:
        """Let go of the document."""
        self.names.close()
        super().close_panel()


class ConsoleDoor:
    """The action that leads to the console."""

    def __init__(self, panel: Panel, dock: QDockWidget) -> None:
        self._panel, self._dock = panel, dock

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        return {"window.console": self.toggle}

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """None."""
        return {}

    def toggle(self) -> None:
        """Show the console ready for typing; hide it when that is where one is."""
        inside = QApplication.focusWidget()
        if self._dock.isVisible() and inside is not None and self._panel.isAncestorOf(inside):
            self._dock.hide()
            return
        self._dock.show()
        self._dock.raise_()
        self._panel.setFocus(Qt.FocusReason.ShortcutFocusReason)
