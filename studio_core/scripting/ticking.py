"""Code that runs for long on the main thread: something is called every now and then, and it can be stopped.

A helper thread sends the main thread a signal every few hundredths of a second; Python then runs the
signal's handler between two steps of whatever runs. Until the first tick and between ticks that costs
nothing. A trace function (`sys.settrace`) alone could do the same, but makes a loop of a person's code
several times slower and does not wake `time.sleep`; here it is set for one step, where a signal came at a
bad moment.
"""

from __future__ import annotations

import _thread
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

FIRST, EVERY = 0.3, 0.05  # seconds
CLOSED = (
    *("studio_ui", "studio_core.document", "studio_core.signal", "studio_core.scripting.output"),
    *("threading", "importlib._bootstrap"),
)
"""Modules that are never left half way: a tick that finds one of them at work waits until it is done."""


def open_frame(frame: FrameType | None, file: str) -> FrameType | None:
    """The innermost frame under code of `file` that has nothing of `CLOSED` above it; None outside of it."""
    found = None
    while frame is not None and frame.f_code.co_filename != file:
        if str(frame.f_globals.get("__name__", "")).startswith(CLOSED):
            found = None
        elif found is None:
            found = frame
        frame = frame.f_back
    return (found or frame) if frame is not None else None


@contextmanager
def ticking(
    tick: Callable[[], bool], place: Callable[[FrameType | None], FrameType | None], first: float = FIRST
) -> Iterator[None]:
    """Inside, `tick()` is called on this thread, first after `first` seconds; True raises KeyboardInterrupt.

    `place(frame)` says where from the frame at work outwards that may happen: there (None: not now). No
    tick comes within a tick. Ctrl-C is as good as a tick that says True. On other threads than the main
    one nothing ticks at all.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    over, asked = threading.Event(), threading.Event()  # asked by the helper; otherwise it was Ctrl-C
    stopping = within = False
    main = threading.get_ident()

    def send() -> None:
        wait = first
        while not over.wait(wait):
            wait = EVERY
            if asked.is_set():  # the last one is still on its way; a second would look like Ctrl-C
                continue
            asked.set()
            if hasattr(signal, "pthread_kill"):
                signal.pthread_kill(main, signal.SIGINT)  # wakes what sleeps, too
            else:
                _thread.interrupt_main()

    def handle(number: int, frame: FrameType | None) -> None:
        nonlocal stopping
        if asked.is_set():
            asked.clear()
        else:
            stopping = True
        here = None if within or over.is_set() else place(frame)
        if here is None:
            return
        if here is frame:
            serve()
        elif sys.gettrace() is None:
            here.f_trace = at_next_step
            sys.settrace(lambda frame, event, argument: None)

    def at_next_step(frame: FrameType, event: str, argument: object) -> Any:
        sys.settrace(None)
        frame.f_trace = None
        if not over.is_set():
            serve()

    def serve() -> None:
        nonlocal stopping, within
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
