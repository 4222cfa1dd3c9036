"""A worker of a sweep on this machine: `python -m tumble.sweeps.worker BYTES`, started by `tumble.sweeps.pool`.

It reads what all runs share and then one run after another from its standard input, and writes what became of them to its
standard output. It ends when its input does, in the midst of a run, too: whoever asked for that is gone.
"""

import os
import queue
import signal
import sys
import threading
from typing import IO

from tumble.sweeps.pool import _READY, receive, send
from tumble.sweeps.task import Context, Task, perform


def main() -> None:
    """Serves until the end of the input."""
    # Ctrl-C goes to all processes of a terminal: the one that was asked ends the others.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _limit(int(sys.argv[1]))
    sink = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # What anybody prints is no answer.
    source = sys.stdin.buffer
    first = receive(source)
    if first is None:
        return
    context = Context.of(first)
    tasks: queue.SimpleQueue[Task] = queue.SimpleQueue()
    threading.Thread(target=_read, args=(source, tasks), daemon=True).start()
    send(sink, _READY)
    while True:
        send(sink, perform(context, tasks.get()).message())


def _read(source: IO[bytes], tasks: "queue.SimpleQueue[Task]") -> None:
    while (message := receive(source)) is not None:
        tasks.put(Task.of(message))
    os._exit(0)


def _limit(size: int) -> None:
    """The most memory that this process may take [bytes], where the system can limit it."""
    if size:
        try:
            import resource
        except ImportError:
            return
        resource.setrlimit(resource.RLIMIT_DATA, (size, size))


if __name__ == "__main__":
    main()
