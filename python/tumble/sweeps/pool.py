"""Runs on the cores of this machine: worker processes of our own, each with its share of the threads.

A thread here for each worker hands it one run after another and waits. A worker that dies is replaced, and its run is tried
again: what became of a run does not depend on how often that was.
"""

import math
import os
import queue
import signal
import struct
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterable, Iterator
from contextlib import suppress
from typing import IO

from tumble._engine import ExportError
from tumble.sweeps.task import DIED, MEMORY, Answer, Context, Task

KILLS, DEATHS = 6, 2
"""How often a run is tried whose worker was killed from outside, which may have had nothing to do with it, and of one that died
otherwise."""

ALONE = 3
"""From which try on a run has the machine for itself: it may be that it needs the memory of all."""

_READY = b"ready"

_NO_MEMORY = "memory allocation of"
"""What the engine says last where there is none: how many bytes it wanted."""


class Died(Exception):
    """The end of a worker."""

    def __init__(self, code: int, words: str) -> None:
        self.code, self.words = code, words

    @property
    def killed(self) -> bool:
        return hasattr(signal, "SIGKILL") and self.code == -signal.SIGKILL

    def __str__(self) -> str:
        how = f"exit code {self.code}"
        if self.code < 0:
            with suppress(ValueError):
                how = f"signal {-self.code}, {signal.Signals(-self.code).name}"
        return f"{how}{f': {self.words}' if self.words else ''}"


def cores() -> int:
    """Processor cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Worker:
    """A process that computes runs."""

    def __init__(self, context: bytes, threads: int, memory: float | None) -> None:
        self.said = tempfile.TemporaryFile()  # noqa: SIM115
        # What this process can import, the worker can: it may be embedded in another program.
        paths = os.pathsep.join(path for path in sys.path if path)
        environment = {**os.environ, "RAYON_NUM_THREADS": str(threads), "PYTHONPATH": paths, "RUST_BACKTRACE": "0"}
        command = [sys.executable, "-P", "-m", "tumble.sweeps.worker", str(int(memory or 0))]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self.said, env=environment
        )
        assert self.process.stdin is not None and self.process.stdout is not None
        self.sink: IO[bytes] = self.process.stdin
        self.source: IO[bytes] = self.process.stdout
        try:
            send(self.sink, context)
        except OSError:
            raise self.end() from None
        if self._receive() != _READY:
            raise self.end()

    def ask(self, task: Task) -> Answer:
        """Has a run computed. Raises Died."""
        try:
            send(self.sink, task.message())
        except OSError:
            raise self.end() from None
        return Answer.of(self._receive())

    def _receive(self) -> bytes:
        found = receive(self.source)
        if found is None:
            raise self.end()
        return found

    def end(self) -> Died:
        """How it ended: it takes or gives nothing more."""
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(10.0)
        self.kill()
        self.said.seek(0)
        return Died(self.process.returncode, _last_words(self.said.read().decode(errors="replace")))

    def kill(self) -> None:
        """Ends it."""
        self.process.kill()
        self.process.wait()
        for stream in (self.sink, self.source):
            with suppress(OSError):
                stream.close()


def _last_words(said: str) -> str:
    """The line that says why, of what a process wrote before it died."""
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    telling = [line for line in lines if _NO_MEMORY in line]
    return (telling or lines or [""])[-1]


def send(sink: IO[bytes], data: bytes) -> None:
    """Writes a message."""
    sink.write(struct.pack("<Q", len(data)))
    sink.write(data)
    sink.flush()


def receive(source: IO[bytes]) -> bytes | None:
    """Reads a message; None at the end."""
    head = source.read(8)
    if len(head) < 8:
        return None
    (size,) = struct.unpack("<Q", head)
    data = source.read(size)
    return data if len(data) == size else None


class Pool:
    """An engine: computes runs in processes."""

    def __init__(self, context: Context, workers: int, threads: int, memory: float | None = None) -> None:
        """`memory` is the most that a worker may take [bytes]."""
        self.context = context.message()
        self.workers, self.threads, self.memory = workers, threads, memory
        self.deaths = 0
        """Workers that died."""
        self._busy = 0
        self._alone = False
        self._stopping = False
        self._change = threading.Condition()
        self._alive: set[Worker] = set()
        self._answers: queue.SimpleQueue[Answer | BaseException | None] = queue.SimpleQueue()

    @property
    def running(self) -> int:
        """Runs that are being computed."""
        return self._busy

    def run(self, tasks: Iterable[Task]) -> Iterator[Answer]:
        """Computes runs; answers come as they end. To close it stops the workers. Raises ExportError where none can start."""
        todo = iter(tasks)
        threads = [threading.Thread(target=self._serve, args=(todo,), daemon=True) for _ in range(self.workers)]
        for thread in threads:
            thread.start()
        left = len(threads)
        try:
            while left:
                answer = self._answers.get()
                if answer is None:
                    left -= 1
                elif isinstance(answer, BaseException):
                    raise answer
                else:
                    yield answer
        finally:
            self._stop()
            for thread in threads:
                thread.join()

    def _stop(self) -> None:
        with self._change:
            self._stopping = True
            alive = list(self._alive)
            self._change.notify_all()
        for worker in alive:
            worker.process.kill()

    def _serve(self, todo: Iterator[Task]) -> None:
        """Has runs computed by one worker, and by its successors."""
        worker: Worker | None = None
        try:
            while (task := self._next(todo)) is not None:
                deaths: list[Died] = []
                while True:
                    self._enter(len(deaths) + 1 >= ALONE)
                    try:
                        worker = worker or self._hire()
                        self._answers.put(worker.ask(task))
                        break
                    except Died as death:
                        self._dismiss(worker)
                        worker = None
                        deaths.append(death)
                        self.deaths += not self._stopping
                        if self._stopping:
                            return
                        if len(deaths) >= KILLS or sum(not d.killed for d in deaths) >= DEATHS:
                            self._answers.put(died(task, deaths))
                            break
                    finally:
                        self._leave()
        except BaseException as error:
            self._answers.put(error)
        finally:
            self._dismiss(worker)
            self._answers.put(None)

    def _next(self, todo: Iterator[Task]) -> Task | None:
        with self._change:
            return None if self._stopping else next(todo, None)

    def _hire(self) -> Worker:
        try:
            worker = Worker(self.context, self.threads, self.memory)
        except Died as death:
            if self._stopping or death.killed:
                raise
            cure = f"; --memory {self.memory / 1e9:g} may be too little" if self.memory else ""
            raise ExportError(f"a worker of the sweep did not start ({death}){cure}") from None
        except OSError as error:
            raise ExportError(f"a worker of the sweep did not start ({error.strerror or error})") from None
        with self._change:
            self._alive.add(worker)
            if self._stopping:
                worker.process.kill()
        return worker

    def _dismiss(self, worker: Worker | None) -> None:
        if worker is not None:
            with self._change:
                self._alive.discard(worker)
            worker.kill()

    def _enter(self, alone: bool) -> None:
        """Waits until a run may begin: for one that is to be alone until no other goes on, for others until that is over."""
        with self._change:
            while not self._stopping and (self._alone or (alone and self._busy)):
                self._change.wait()
            self._busy += 1
            self._alone = self._alone or alone

    def _leave(self) -> None:
        with self._change:
            self._busy -= 1
            if not self._busy:
                self._alone = False
            self._change.notify_all()


def died(task: Task, deaths: Iterable[Died]) -> Answer:
    """The answer to a run whose workers died."""
    found = list(deaths)
    if _NO_MEMORY in found[-1].words:
        return Answer(task.key, MEMORY, found[-1].words, {"deaths": [str(one) for one in found]}, seconds=math.nan)
    times = "twice" if len(found) == 2 else f"{len(found)} times"
    text = f"its worker died {times} ({found[-1]})"
    if found[-1].killed:
        text += "; the system kills what takes too much memory"
    return Answer(task.key, DIED, text, {"deaths": [str(one) for one in found]}, values={}, seconds=math.nan)
