"""Python commands over a document: one command is one step of the history, or none when it fails."""

from __future__ import annotations

import ast
import codeop
import contextlib
import io
import linecache
import sys
import tokenize
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import CodeType
from typing import Any

from studio_core.document import Document
from studio_core.errors import Cancelled, InputError, LucarneError
from studio_core.scripting.output import Limited
from studio_core.scripting.shown import shown
from studio_core.scripting.ticking import FIRST, open_frame, ticking

_LABEL = 44  # characters of a command in the history


@dataclass(frozen=True)
class Outcome:
    """How a command ended. `error` names the person's own lines, `detail` is the whole traceback.

    `taken_back` tells that the command had changed the scene before it failed.
    """

    value: Any = None
    error: str = ""
    detail: str = ""
    stopped: bool = False
    taken_back: bool = False

    @property
    def ok(self) -> bool:
        """Whether it ran to its end."""
        return not self.error


def complete(source: str) -> bool:
    """Whether Enter should run it: not while a bracket, a string or a block is open."""
    try:
        if codeop.compile_command(source, "<input>", "exec") is None:
            return False
    except (SyntaxError, ValueError, OverflowError):
        return True  # running it says what is wrong
    lines = source.split("\n")
    return len(lines) == 1 or not lines[-1].strip() or not lines[-1][0].isspace()


def indentation(source: str) -> str:
    """The spaces that the next line of an incomplete source starts with."""
    last = source.split("\n")[-1]
    spaces = last[: len(last) - len(last.lstrip())]
    return spaces + "    " if last.rstrip().endswith(":") else spaces


class Interpreter:
    """Runs commands in `namespace`.

    `write(text, error)` gets what they print. `tick` is called now and then while one runs; True stops it.
    """

    def __init__(
        self,
        document: Document,
        namespace: dict[str, Any],
        write: Callable[[str, bool], object],
        tick: Callable[[], bool] = lambda: False,
        first_tick: float = FIRST,
    ) -> None:
        self.namespace = namespace
        self._document, self._write, self._tick, self._first = document, write, tick, first_tick
        self._serial = 0
        self.namespace.setdefault("__name__", "__console__")

    def run(self, source: str) -> Outcome:
        """Run a command; its last expression's value is shown and kept as `_`."""
        self._serial += 1
        file = f"<console {self._serial}>"
        linecache.cache[file] = (len(source), None, source.splitlines(keepends=True), file)
        first = source.strip().split("\n")[0]
        label = first if len(first) <= _LABEL else f"{first[:_LABEL].rstrip()}…"
        return self._run(source, file, f"Console: {label}")

    def run_file(self, path: Path) -> Outcome:
        """Run a script file with the same names. InputError when it cannot be read."""
        try:
            with tokenize.open(path) as file:
                source = file.read()
        except (OSError, SyntaxError, UnicodeDecodeError) as error:
            raise InputError(f"{path.name} cannot be run: {error}") from None
        linecache.checkcache(str(path))
        before = self.namespace.get("__file__")
        self.namespace["__file__"] = str(path)
        try:
            return self._run(source, str(path), f"Script {path.stem}")
        finally:
            self.namespace["__file__"] = before

    def _run(self, source: str, file: str, label: str) -> Outcome:
        before, changed = self._document.scene, False
        try:
            body, last = _compiled(source, file)
            with self._streams(), self._document.grouped(label):
                try:
                    with ticking(self._tick, lambda frame: open_frame(frame, file), self._first):
                        exec(body, self.namespace)
                        value = eval(last, self.namespace) if last is not None else None
                        if value is not None:
                            self.namespace["_"] = value
                            print(shown(value))
                except BaseException:
                    changed = self._document.scene is not before
                    raise
            return Outcome(value)
        except BaseException as error:  # a command must not take the program down, whatever it raises
            return _failed(error, file, changed)

    @contextlib.contextmanager
    def _streams(self) -> Iterator[None]:
        """What is printed comes here; nobody is there to answer `input()`."""
        out: Any = Limited(lambda text: self._write(text, False), sys.stdout)
        err: Any = Limited(lambda text: self._write(text, True), sys.stderr)
        stdin, sys.stdin = sys.stdin, io.StringIO()
        try:
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                yield
        finally:
            sys.stdin = stdin
            dropped = out.dropped + err.dropped
            if dropped:
                self._write(f"\n… {dropped:,} more characters are not shown\n", False)


def _compiled(source: str, file: str) -> tuple[CodeType, CodeType | None]:
    """All statements, and the last one by itself where it is an expression."""
    tree = ast.parse(source, file)
    last: CodeType | None = None
    if tree.body and isinstance(tree.body[-1], ast.Expr):
        expression = tree.body.pop()
        assert isinstance(expression, ast.Expr)
        last = compile(ast.Expression(expression.value), file, "eval", dont_inherit=True)
    return compile(tree, file, "exec", dont_inherit=True), last


def _failed(error: BaseException, file: str, changed: bool) -> Outcome:
    detail = "".join(traceback.format_exception(error))
    if isinstance(error, KeyboardInterrupt | Cancelled):
        return Outcome(error="Stopped.", detail=detail, stopped=True, taken_back=changed)
    if isinstance(error, SystemExit):
        return Outcome(error="A command cannot leave the program; File ▸ Quit does.", taken_back=changed)
    if isinstance(error, EOFError):
        return Outcome(error="Nobody can answer input() here.", detail=detail, taken_back=changed)
    return Outcome(error=own_lines(error, file), detail=detail, taken_back=changed)


def own_lines(error: BaseException, file: str) -> str:
    """The error with those lines of the traceback that the person wrote."""
    frames = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if frame.filename == file or frame.filename.startswith("<console ")
    ]
    said = [f"{error}\n"] if isinstance(error, LucarneError) else traceback.format_exception_only(error)
    if not frames or (len(frames) == 1 and frames[0].line and "\n" not in _text(file)):
        return "".join(said).rstrip("\n")  # the one line is there to be seen
    return "".join([*traceback.format_list(frames), *said]).rstrip("\n")


def _text(file: str) -> str:
    return "".join(linecache.getlines(file)).rstrip("\n")
