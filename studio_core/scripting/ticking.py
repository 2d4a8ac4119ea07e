"""Code that runs for long on the main thread: something is called every now and then, and it can be stopped.

A helper thread sends the main thread a signal every few hundredths of a second; Python then runs the
signal's handler between two steps of whatever runs. Until the first tick and between ticks that costs
nothing. A trace function (`sys.settrace`) could do the same, but makes a loop of a person's code several
times slower and does not wake `time.sleep`.
"""

from __future__ import annotations

import _thread
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

FIRST, EVERY, AGAIN = 0.3, 0.05, 0.003  # seconds
CLOSED = ("studio_ui", "studio_core.document", "studio_core.signal", "threading", "importlib._bootstrap")
"""Modules that are never left half way: a tick that finds one of them at work waits for the next."""


def leads_to(frame: FrameType | None, file: str) -> bool:
    """Whether `frame` was called from code of `file` without a module of `CLOSED` between."""
    while frame is not None:
        if frame.f_code.co_filename == file:
            return True
        if str(frame.f_globals.get("__name__", "")).startswith(CLOSED):
            return False
        frame = frame.f_back
    return False


@contextmanager
def ticking(
    tick: Callable[[], bool], open_at: Callable[[FrameType | None], bool], first: float = FIRST
) -> Iterator[None]:
    """Inside, `tick()` is called on this thread, first after `first` seconds; True raises KeyboardInterrupt.

    Nothing happens while `open_at(frame)` is False for the frame at work, and within a tick. Ctrl-C is
    as good as a tick that says True. On other threads than the main one nothing ticks at all.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    over = threading.Event()
    asked = threading.Event()  # by the helper; otherwise it was Ctrl-C
    stopping = within = False
    owed = False  # a tick that came where nothing may happen
    main = threading.get_ident()

    def send() -> None:
        wait = first
        while not over.wait(wait):
            asked.set()
            if hasattr(signal, "pthread_kill"):
                signal.pthread_kill(main, signal.SIGINT)  # wakes what sleeps, too
            else:
                _thread.interrupt_main()
            wait = AGAIN if owed else EVERY

    def handle(number: int, frame: FrameType | None) -> None:
        nonlocal stopping, within, owed
        if asked.is_set():
            asked.clear()
        else:
            stopping = True
        owed = not within and not open_at(frame)
        if over.is_set() or within or owed:
            return
        within = True
        try:
            stopping = tick() or stopping
        finally:
            within = False
        if stopping:
            raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, handle)
    helper = threading.Thread(target=send, name="ticks", daemon=True)
    helper.start()
    try:
        yield
    finally:
        over.set()
        helper.join()
        signal.signal(signal.SIGINT, before)
