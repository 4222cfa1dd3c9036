"""Ctrl-C, and a signal to terminate, held back while something is done that must be whole."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def held() -> Iterator[None]:
    """What is within is done to its end, and only then stopped by a signal that came meanwhile; an error within goes first."""
    # Others than Python's own handlers stop nothing in the midst of a file, and only the main thread is stopped by those.
    stops = [s for s in (signal.SIGTERM, signal.SIGINT) if callable(signal.getsignal(s))]
    if threading.current_thread() is not threading.main_thread():
        stops = []
    came: list[int] = []
    former = {s: signal.signal(s, lambda number, _: came.append(number)) for s in stops}
    try:
        yield
    finally:
        for number, handler in former.items():
            signal.signal(number, handler)
    if came:
        signal.raise_signal(came[0])
