"""Ctrl-C, and a signal to terminate, held back while something is done that must be whole."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def held() -> Iterator[None]:
    """Completes the enclosed block before acting on a signal that came meanwhile. Where it raises, its error is
    told."""
    # Others than Python's own handlers stop nothing in the midst of a file, and only the main thread is stopped by those.
    former = {s: h for s in (signal.SIGTERM, signal.SIGINT) if callable(h := signal.getsignal(s))}
    if threading.current_thread() is not threading.main_thread():
        former = {}
    came: list[int] = []
    holding = True

    def later(number: int, frame: FrameType | None) -> None:
        # One that comes while handlers are being put back leaves those that are not: they must not swallow what comes later.
        if holding:
            came.append(number)
        else:
            former[signal.Signals(number)](number, frame)

    try:
        for number in former:
            signal.signal(number, later)
        yield
    finally:
        holding = False
        for number, handler in former.items():
            signal.signal(number, handler)
    if came:
        signal.raise_signal(came[0])
