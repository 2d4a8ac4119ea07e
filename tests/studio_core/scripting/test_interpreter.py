"""The prompt: one command is one step, failures leave nothing behind, and whatever runs can be stopped."""

from __future__ import annotations

import _thread
import signal
import sys
import threading
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import little_scene

from studio_core.contract import Services
from studio_core.document import Document
from studio_core.errors import InputError
from studio_core.registry import PluginHost
from studio_core.scripting import Interpreter, Names, complete, indentation
from studio_core.scripting.output import LINE, MOST, Limited
from studio_core.session import Session


class Prompt:
    """An interpreter over a cube, with what it printed."""

    def __init__(self) -> None:
        self.document = Document(little_scene())
        self.said: list[tuple[str, bool]] = []
        self.ticks = 0
        self.stop_at = 10**9
        names = Names(self.document, Session(), PluginHost(), lambda: pytest.fail("nothing is rendered"))
        self.interpreter = Interpreter(
            self.document, names.namespace, lambda text, bad: self.said.append((text, bad)), self._tick, 0.01
        )
        self.run = self.interpreter.run

    def _tick(self) -> bool:
        self.ticks += 1
        return self.ticks >= self.stop_at

    @property
    def out(self) -> str:
        return "".join(text for text, _ in self.said)

    @property
    def labels(self) -> list[str]:
        return [step.label for step in self.document.history]


@pytest.fixture
def prompt() -> Prompt:
    return Prompt()


def test_the_last_value_is_shown_and_kept(prompt: Prompt) -> None:
    assert prompt.run("a = 6\nb = 7\na * b").value == 42
    assert prompt.run("_ + 1").value == 43
    prompt.run("None")
    assert prompt.run("_").value == 43
    assert prompt.out == "42\n43\n43\n"
    assert prompt.run("# nothing").ok
    assert prompt.run("").ok


def test_one_command_is_one_step(prompt: Prompt) -> None:
    before = prompt.document.scene
    assert prompt.run("for i in range(3):\n    copy('cube', by=(i + 1, 0, 0))\n").ok
    assert prompt.labels == ["Open", "Console: for i in range(3):"]
    assert prompt.run("move('cube', by=(0, 1, 0))").ok
    assert prompt.labels[-1] == "Move Cube"
    prompt.run("undo(2)")
    assert prompt.document.scene is before


def test_a_failing_command_leaves_nothing_behind(prompt: Prompt) -> None:
    before = prompt.document.scene
    outcome = prompt.run("x = 1\nmove('cube', by=(0, 1, 0))\nmove('cbue', by=(0, 1, 0))")
    assert outcome.taken_back
    assert prompt.document.scene is before
    assert prompt.labels == ["Open"]
    assert "line 3" in outcome.error
    assert outcome.error.endswith("there is no node named 'cbue'; did you mean 'Cube'?")
    assert "EditError" in outcome.detail
    assert prompt.run("x").value == 1
    assert not prompt.run("1/0").taken_back


def test_errors_show_the_persons_own_lines(prompt: Prompt) -> None:
    assert prompt.run("1/0").error == "ZeroDivisionError: division by zero"
    prompt.run("def thirds(n):\n    return n / (n - n)\n")
    outcome = prompt.run("np.sqrt(4)\nthirds(3)")
    assert "thirds(3)" in outcome.error
    assert "return n / (n - n)" in outcome.error
    assert "interpreter.py" not in outcome.error
    assert "interpreter.py" in outcome.detail
    wrong = prompt.run("a = (1,\nb = 2")
    assert "SyntaxError" in wrong.error
    assert "line 1" in wrong.error


@pytest.mark.parametrize(
    ("source", "why"),
    [
        ("import sys\nsys.exit(3)", "cannot leave the program"),
        ("exit()", "cannot leave the program"),
        ("input('name? ')", "Nobody can answer input()"),
        ("raise BaseException('whatever')", "BaseException: whatever"),
        ("raise GeneratorExit", "GeneratorExit"),
        ("def f(): f()\nf()", "RecursionError"),
        ("raise KeyboardInterrupt", "Stopped"),
        ("x = 'a\0b'", "null bytes"),
        ("document.begin('x')\nmove('cube', by=(1, 0, 0))", "finish the gesture first"),
    ],
)
def test_nothing_that_is_raised_gets_out(prompt: Prompt, source: str, why: str) -> None:
    stdin, handler = sys.stdin, signal.getsignal(signal.SIGINT)
    outcome = prompt.run(source)
    assert not outcome.ok
    assert why in outcome.error
    assert not prompt.document.in_gesture
    assert (sys.stdin, signal.getsignal(signal.SIGINT)) == (stdin, handler)
    assert prompt.run("1 + 1").value == 2


@pytest.mark.parametrize(
    "source",
    [
        "while True: pass",
        "import time\ntime.sleep(1000)",
        "while True: print('x')",
        "while True: move('cube', by=(0.1, 0, 0))",
        "try:\n    while True: pass\nexcept Exception: pass",
        "for i in iter(int, 1): np.ones(10)",
    ],
)
def test_what_never_ends_can_be_stopped(prompt: Prompt, source: str) -> None:
    prompt.stop_at = 3
    before = prompt.document.scene
    outcome = prompt.run(source)
    assert outcome.stopped
    assert outcome.error == "Stopped."
    assert prompt.ticks >= 3
    assert prompt.document.scene is before


@pytest.mark.skipif(not hasattr(signal, "pthread_kill"), reason="signals come another way")
def test_a_tick_that_comes_late_is_no_stop(prompt: Prompt, monkeypatch: pytest.MonkeyPatch) -> None:
    send = signal.pthread_kill

    def late(thread: int, number: int) -> None:
        time.sleep(0.01)  # the one before is served meanwhile
        send(thread, number)

    monkeypatch.setattr(signal, "pthread_kill", late)
    monkeypatch.setattr("studio_core.scripting.ticking.EVERY", 0.002)
    prompt.stop_at = 50
    assert prompt.run("a = np.ones((500, 500))\nwhile True: a @ a").stopped
    assert prompt.ticks >= 50


def test_nobody_is_stopped_while_the_document_tells_of_a_change(prompt: Prompt) -> None:
    heard: list[str] = []
    prompt.document.changed.connect(lambda *_: (time.sleep(0.002), heard.append("first")))
    prompt.document.changed.connect(lambda *_: heard.append("last"))
    prompt.stop_at = 2
    assert prompt.run("while True: move('cube', by=(0.1, 0, 0))").stopped
    assert heard.count("first") == heard.count("last") > 0


def test_ctrl_c_is_a_stop(prompt: Prompt) -> None:
    threading.Timer(0.05, _thread.interrupt_main).start()
    assert prompt.run("while True: pass").stopped


def test_quick_commands_are_not_ticked(prompt: Prompt) -> None:
    for i in range(50):
        assert prompt.run(f"{i} + 1").value == i + 1
    assert threading.active_count() < 20


def test_on_other_threads_nothing_ticks(prompt: Prompt) -> None:
    made: list[object] = []

    def work() -> None:
        document = Document(little_scene())
        run = Interpreter(document, {}, lambda *_: None, lambda: True, 0.0).run
        made.append(run("import time\ntime.sleep(0.02)\n5").value)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert made == [5]


def test_a_flood_of_output_is_cut(prompt: Prompt) -> None:
    assert prompt.run("for i in range(10**5): print('0123456789')").ok
    assert len(prompt.out) < MOST + 200
    assert "more characters are not shown" in prompt.out
    prompt.said.clear()
    prompt.run(f"print('x' * {LINE * 2})\nprint('y')")
    assert prompt.out == "x" * LINE + " …\ny\n"


@given(st.lists(st.text(alphabet="ab\n", max_size=30), max_size=20))
def test_what_is_printed_within_the_limits_comes_through(parts: list[str]) -> None:
    got: list[str] = []
    stream = Limited(got.append, None)
    for part in parts:
        assert stream.write(part) == len(part)
    assert "".join(got) == "".join(parts)
    assert stream.dropped == 0


def test_errors_that_are_printed_are_told_apart(prompt: Prompt) -> None:
    prompt.run("import sys\nprint('a')\nprint('b', file=sys.stderr)")
    assert [(text, bad) for text, bad in prompt.said if text.strip()] == [("a", False), ("b", True)]


def test_long_values_are_cut(prompt: Prompt) -> None:
    prompt.run("list(range(10**6))")
    assert "(1,000,000 long)" in prompt.out
    prompt.run("scene")
    assert "nodes" in prompt.out
    prompt.run("'x' * 10**6")
    assert len(prompt.out) < 20_000


def test_a_script_file_runs_with_the_same_names(prompt: Prompt, tmp_path: Path) -> None:
    file = tmp_path / "own.py"
    file.write_text(
        "def lift(height):\n    move('cube', by=(0, height, 0))\n\nlift(1)\nlift(2)\nwhere = __file__\n"
    )
    assert prompt.interpreter.run_file(file).ok
    assert prompt.labels == ["Open", "Script own"]
    assert prompt.run("where").value == str(file)
    file.write_text("x = 1\nraise ValueError('mine')\n")
    outcome = prompt.interpreter.run_file(file)
    assert outcome.error.startswith(f'  File "{file}", line 2')
    with pytest.raises(InputError, match=r"nix\.py cannot be run"):
        prompt.interpreter.run_file(tmp_path / "nix.py")
    file.write_bytes(b"x = '\xff\xfe'")
    with pytest.raises(InputError, match="cannot be run"):
        prompt.interpreter.run_file(file)


@pytest.mark.parametrize(
    ("source", "ends"),
    [
        ("1 + 1", True),
        ("for i in range(3):", False),
        ("for i in range(3):\n    print(i)", False),
        ("for i in range(3):\n    print(i)\n", True),
        ("if a:\n    b\nelse:", False),
        ("copy('a',", False),
        ("copy('a',\n     by=(1, 0, 0))", False),
        ("copy('a',\nby=(1, 0, 0))", True),
        ("'''text", False),
        ("1 +* 2", True),
        ("a = '", True),
        ("@decorator", False),
        ("", True),
    ],
)
def test_enter_runs_what_is_complete(source: str, ends: bool) -> None:
    assert complete(source) is ends


def test_indentation_follows_the_block() -> None:
    assert indentation("for i in x:") == "    "
    assert indentation("for i in x:\n    if i:") == "        "
    assert indentation("for i in x:\n    print(i)") == "    "
    assert indentation("copy('a',") == ""


def test_two_prompts_do_not_meet() -> None:
    one, other = Prompt(), Prompt()
    one.run("x = 1\nmove('cube', by=(1, 0, 0))")
    assert "NameError" in other.run("x").error
    assert other.labels == ["Open"]


def test_services_are_asked_for_only_to_render() -> None:
    asked: list[Services] = []
    Names(Document(), Session(), PluginHost(), lambda: asked.append(None))  # type: ignore[arg-type]
    assert asked == []
