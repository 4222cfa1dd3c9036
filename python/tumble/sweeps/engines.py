"""Where runs are computed: on the cores of this machine, on processes that Dask keeps, or at a scheduler that is there."""

import math
import os
import re
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Protocol

from tumble.arguments import whole, wrong
from tumble.sweeps.pool import Pool, cores
from tumble.sweeps.task import Answer, Context, Task

_ADDRESS = re.compile(r"(?:tcp|tls)://(?:[^\s/:\[\]]+|\[[0-9a-fA-F:.]+\]):([0-9]{1,5})")


class Engine(Protocol):
    """Where runs are computed."""

    workers: int
    deaths: int
    """Workers that died."""

    @property
    def running(self) -> int:
        """Runs that are being computed."""

    def run(self, tasks: Iterable[Task]) -> Iterator[Answer]:
        """Computes runs; answers come as they end."""


@dataclass(frozen=True)
class EngineWords:
    """Where and how runs are computed."""

    on: str
    workers: int
    threads: int


def chosen(on: str, workers: int | None, runs: int, need: float, memory: float | None) -> tuple[EngineWords, list[str]]:
    """Where so many runs are computed that take up to `need` bytes each, and notes on it; `memory` is the most that a worker
    may take [bytes]. Raises SceneError."""
    address = _ADDRESS.fullmatch(on)
    if on not in ("cores", "dask") and (address is None or int(address[1]) > 65535):
        raise wrong("--on", f"{on!r}, expected cores, dask or the address of a Dask scheduler such as tcp://host:8786")
    if memory is not None and not (math.isfinite(memory) and memory >= 1e6):
        raise wrong("memory", f"{memory!r}, expected a finite number >= 1e6 bytes")
    n = cores()
    found = n if workers is None else whole(workers, "--workers", 1)
    found = max(1, min(found, runs))
    notes, there = [], _memory()
    if on == "cores" and need * found > 0.8 * there and workers is None:
        fewer = max(1, int(0.8 * there / need))
        if fewer < found:
            notes.append(f"a run takes up to {need / 1e9:.3g} GB of {there / 1e9:.3g} GB: {fewer} of {found} workers")
            found = fewer
    return EngineWords(on, found, max(1, n // found)), notes


def opened(context: Context, words: EngineWords, memory: float | None = None) -> AbstractContextManager[Engine]:
    """An engine. Raises SceneError where there is none that answers."""
    if words.on == "cores":
        return nullcontext(Pool(context, words.workers, words.threads, memory))
    from tumble.sweeps.cluster import cluster

    return cluster(context, words.on, words.workers, words.threads, memory)


def _memory() -> float:
    """Bytes that this machine has; inf where that is not known."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return math.inf
