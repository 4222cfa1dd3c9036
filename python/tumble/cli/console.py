"""Console output: text that survives pipes and narrow encodings, progress as a bar or as plain lines."""

import codecs
import math
import signal
import sys
import threading
import time
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from rich.progress import Progress as Bar
    from rich.progress import TaskID

_PLAIN = {"²": "^2", "³": "^3", "×": "x", "·": "*", "°": " deg", "ω": "w", "µ": "u", "–": "-", "…": "...", "≤": "<="}


def _transliterate(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = error.object[error.start : error.end]
    return "".join(_PLAIN.get(c, "?") for c in text), error.end


def survive_narrow_streams() -> None:
    """Replaces characters that a stream cannot encode: m/s² by m/s^2."""
    codecs.register_error("tumble", _transliterate)
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="tumble")


_PLACES = 4
"""Number of further warnings whose paths are listed."""


class Terminated(KeyboardInterrupt):
    """A request to terminate: as with Ctrl-C, finished work is kept."""


def heed_termination() -> None:
    """Makes SIGTERM stop the program as Ctrl-C does."""

    def stop(*_: object) -> None:
        raise Terminated

    if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL and threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, stop)


def stopped(stop: KeyboardInterrupt) -> int:
    """The exit code after a stop."""
    return 128 + (signal.SIGTERM if isinstance(stop, Terminated) else signal.SIGINT)


def say(text: object = "", end: str = "\n") -> None:
    """A result, on stdout. (typer.echo would write UTF-8 to an ASCII stream.)"""
    print(text, end=end, flush=True)


def complain(text: str) -> None:
    """An error, on stderr."""
    _mark("error: ", "1;31", text)


def warn(code: str, text: str) -> None:
    """A warning, on stderr. docs/warnings.md lists the codes."""
    _mark(f"warning[{code}]: ", "33", text)


@contextmanager
def lost_frames_told() -> Iterator[None]:
    """Prints the warnings of `Run` like all others; those of USD files are among the warnings of their scene."""
    with warnings.catch_warnings():
        other = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *rest: Any, **more: Any) -> None:
            if category.__name__ == "LostFrames":
                warn("lost-frames", str(message))
            elif category.__name__ != "UsdWarning":
                other(message, category, *rest, **more)

        warnings.showwarning = show
        yield


def warn_of(found: Iterable[Mapping[str, str]]) -> None:
    """Prints each code once: its first warning in full, the number of the others and their paths."""
    kinds: dict[str, list[Mapping[str, str]]] = {}
    for warning in found:
        kinds.setdefault(warning["code"], []).append(warning)
    for code, (first, *others) in kinds.items():
        text = ": ".join(filter(None, (first["path"], first["message"])))
        if others:
            places = [warning["path"] for warning in others if warning["path"]]
            more = [f"{len(places) - _PLACES} others"] if len(places) > _PLACES else []
            where = f": {', '.join([*places[:_PLACES], *more])}" if places else ""
            text += f" ({len(others)} more of this kind{where})"
        warn(code, text)


def broke(error: Exception) -> None:
    """Prints the error before the search for its cause."""
    first = str(error).splitlines()[0]
    text = f"{first}\nLooking for causes, cures and a minimal failing scene; Ctrl-C ends the search."
    print(text, file=sys.stderr, flush=True)


def _mark(word: str, color: str, text: str) -> None:
    print(f"\033[{color}m{word}\033[0m{text}" if sys.stderr.isatty() else word + text, file=sys.stderr, flush=True)


def seconds(value: float) -> str:
    """A step or a limit on it, readable: `2.08e-03 s`."""
    if value == 0.0:
        return "none"
    if math.isinf(value):
        return "any"
    return f"{value:.3g} s" if value >= 0.01 else f"{value:.2e} s"


def size(n: float) -> str:
    """Bytes, readable."""
    for unit in ("B", "kB", "MB", "GB"):
        if n < 999.5:
            return f"{n:.3g} {unit}"
        n /= 1000
    return f"{n:.3g} TB"


def counted(n: int, word: str) -> str:
    """`1 frame`, `2 frames`."""
    many = f"{word[:-1]}ies" if word.endswith("dy") else f"{word}{'es' if word.endswith('s') else 's'}"
    return f"{n} {word if n == 1 else many}"


class Progress:
    """Shows progress: `with Progress("simulate") as progress: progress(done, total)`.

    A bar on a terminal; elsewhere a line at the start, then one per tenth of the whole or per five seconds.
    """

    def __init__(self, what: str) -> None:
        self.what = what
        self.bar: Bar | None = None
        self.task: TaskID | None = None
        self.said = -math.inf
        self.when = 0.0

    def __enter__(self) -> Self:
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
            from rich.progress import Progress as Bar

            columns: list[Any] = [TextColumn("{task.description:9}"), BarColumn(), MofNCompleteColumn()]
            self.bar = Bar(*columns, TimeRemainingColumn(elapsed_when_finished=True), console=Console(stderr=True))
            self.bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.bar is not None:
            self.bar.stop()

    def __call__(self, done: int, total: int) -> None:
        if self.bar is not None:
            if self.task is None:
                self.task = self.bar.add_task(self.what, total=total)
            self.bar.update(self.task, completed=done, total=total)
            return
        now = time.monotonic()
        share = done / total if total else 1.0
        if share - self.said >= 0.1 or now - self.when >= 5.0 or (done == total and share > self.said):
            self.said, self.when = share, now
            print(f"{self.what:9} {done:6} / {total}  {share:4.0%}", file=sys.stderr, flush=True)
