"""Runs on a cluster, by Dask: on processes of this machine that Dask keeps, or at a scheduler that is there.

Dask carries what names a run, and a row of numbers back. Where a worker does not see the folder of the sweep, the files of
runs that are kept come back as archives. Nothing else travels: no field, no frame.
"""

import asyncio
import importlib
import logging
import math
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import lru_cache
from itertools import islice
from typing import Any

from tumble import _engine
from tumble._engine import ExportError
from tumble.arguments import wrong
from tumble.film import no_main
from tumble.sweeps.task import DIED, Answer, Context, Refused, Task, perform

PATIENCE = float(os.environ.get("TUMBLE_CLUSTER_TIMEOUT", "10"))
"""How long a scheduler may take to answer, and its first worker to come [s]."""

AHEAD = 3
"""Runs that wait at each worker, so that none is idle while the answer travels."""

PIECE = 0.4
"""Time of the runs that are sent together [s]: shorter ones would take less time than it takes to send them."""

MOST = 64
"""Runs that are sent together, at most."""

_DEAF = "import signal\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n"
"""Leaves Ctrl-C to this process: a terminal sends it to all."""

_EXTRA = "needs Dask: pip install 'tumble[cluster]'"


def compute(context: bytes, tasks: Sequence[Task]) -> list[Answer]:
    """What a worker of Dask does: some runs, one after another. Raises Refused where it is of another version, as one that
    joins later may be."""
    own = _loaded(context)
    return [perform(own, task) for task in tasks]


@lru_cache(maxsize=4)
def _loaded(context: bytes) -> Context:
    return Context.of(context)


def _dask(on: str, part: str = "") -> Any:
    """The library, which has no types. Raises SceneError where it is not installed."""
    try:
        return importlib.import_module(f"distributed{part}")
    except ImportError:
        raise wrong(f"--on {on}", _EXTRA) from None


@contextmanager
def cluster(context: Context, on: str, workers: int, threads: int, memory: float | None) -> Iterator["Cluster"]:
    """An engine: `on` is "dask" for a LocalCluster, or the address of a scheduler. Raises SceneError where there is none that
    answers, none that has workers, or one of another version."""
    distributed = _dask(on)
    with ExitStack() as stack:
        # Processes that start, also later in the place of dead ones, need no main module, and may not be able to load it.
        stack.enter_context(no_main())
        stack.enter_context(_quiet())
        if on == "dask":
            local = distributed.LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                dashboard_address=None,
                memory_limit=int(memory) if memory else "auto",
                preload=[_DEAF],
                env={"RAYON_NUM_THREADS": str(threads), "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False"},
                silence_logs=logging.CRITICAL,
            )
            stack.enter_context(local)
            client = stack.enter_context(distributed.Client(local, set_as_default=False))
        else:
            client = stack.enter_context(_connected(on))
        _wait_for_workers(client, on)
        refuse_others(on, _versions(client))
        yield Cluster(client, context)


@contextmanager
def _quiet() -> Iterator[None]:
    """Keeps the library from telling what happens to workers, which is told as it matters."""
    names = (
        "distributed",
        "distributed.nanny",
        "distributed.worker",
        "distributed.scheduler",
        "distributed.comm",
        "tornado",
    )
    former = {name: logging.getLogger(name).level for name in names}
    try:
        for name in names:
            logging.getLogger(name).setLevel(logging.CRITICAL)
        yield
    finally:
        for name, level in former.items():
            logging.getLogger(name).setLevel(level)


@contextmanager
def _connected(address: str) -> Iterator[Any]:
    if address.startswith("tls:") and _dask(address).Security().get_connection_args("client")["ssl_context"] is None:
        text = "needs certificates; name them under distributed.comm.tls in the configuration of Dask"
        raise wrong(f"--on {address}", text)
    try:
        client = _dask(address).Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        said = str(error).splitlines()
        text = f"no Dask scheduler answers within {PATIENCE:g} s{f' ({said[0]})' if said and said[0] else ''}"
        raise wrong(f"--on {address}", f"{text}; start one with `dask scheduler`, or use --on cores") from None
    with client:
        yield client


def _wait_for_workers(client: Any, on: str) -> None:
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError:
        text = f"the scheduler has no workers after {PATIENCE:g} s; start some with `dask worker {on}`"
        raise wrong(f"--on {on}", text) from None


def _versions(client: Any) -> dict[str, str]:
    """Address -> version of tumble of each worker, empty where it has none."""

    # A function inside another one travels by value: this module may not be there.
    def version() -> str:
        try:
            from tumble._engine import version as found
        except ImportError:
            return ""
        return found

    answers: dict[str, str] = client.run(version)
    return answers


def refuse_others(on: str, versions: dict[str, str]) -> None:
    """Raises SceneError where workers have another version than this, or none."""
    wrong_ones = {where: v for where, v in sorted(versions.items()) if v != _engine.version}
    if wrong_ones:
        where, found = next(iter(wrong_ones.items()))
        has = f"tumble {found}" if found else "no tumble"
        text = f"{len(wrong_ones)} of {len(versions)} workers are of another version: {where} has {has}, and this is"
        raise wrong(f"--on {on}", f"{text} {_engine.version}; install that version there: the bits could differ")


class Cluster:
    """An engine: computes runs at the workers of a scheduler."""

    def __init__(self, client: Any, context: Context) -> None:
        self.client = client
        # With each run, for what is kept at a worker dies with it.
        self.context = context.message()
        self.workers = max(1, len(client.ncores()))
        self.deaths = 0
        self._open: dict[Any, list[Task]] = {}
        self._each = math.inf
        """Time of the last run [s]."""

    @property
    def running(self) -> int:
        """Runs that are being computed."""
        return min(len(self._open), self._threads())

    def _threads(self) -> int:
        return max(1, sum(map(int, self.client.ncores().values())))

    def run(self, tasks: Iterable[Task]) -> Iterator[Answer]:
        """Computes runs; answers come as they end. Runs whose workers died again and again are tried once more at the end, by
        themselves: others may have been the cause. Raises SceneError for workers of another version, ExportError where the
        scheduler is lost."""
        suspects: list[Task] = []
        try:
            yield from self._all(iter(tasks), AHEAD * self._threads(), suspects, "")
            last: list[Task] = []
            self._each = math.inf
            yield from self._all(iter(list(suspects)), 1, last, "-alone")
            for task in last:
                text = (
                    "its worker died again and again, also when it ran alone; it may need more memory than a worker has"
                )
                yield Answer(task.key, DIED, text, seconds=math.nan)
        finally:
            if self._open:
                with suppress(Exception):
                    self.client.cancel(list(self._open))
                self._open.clear()

    def _all(self, todo: Iterator[Task], most: int, suspects: list[Task], mark: str) -> Iterator[Answer]:
        """Keeps so many runs at the scheduler; those whose workers died become suspects."""
        killed = _dask("", ".scheduler").KilledWorker
        done = _dask("").as_completed(loop=self.client.loop)
        while True:
            while len(self._open) < most and (tasks := self._together(todo)):
                key = f"tumble-{tasks[0].key}{mark}-{id(self):x}"
                future = self.client.submit(compute, self.context, tasks, key=key, pure=False)
                self._open[future] = tasks
                done.add(future)
            if not self._open:
                return
            future = next(done)
            tasks = self._open.pop(future)
            try:
                # What a worker computed that died in the meantime is computed again, and waited for.
                answers: list[Answer] = future.result()
            except killed:
                self.deaths += 1
                suspects += tasks
            except Refused as error:
                raise wrong("--on", str(error)) from None
            except (Exception, asyncio.CancelledError) as error:
                words = "the scheduler was lost" if future.status in ("cancelled", "lost") else str(error)
                text = f"the cluster stopped: {words}; every finished row is kept, continue with --resume"
                raise ExportError(text) from error
            else:
                self._each = answers[-1].seconds if not mark else math.inf
                yield from answers

    def _together(self, todo: Iterator[Task]) -> list[Task]:
        """The next runs to send: one, or some where they are short and leave no files."""
        tasks = list(islice(todo, 1))
        if tasks and not tasks[0].keep:
            tasks += islice(todo, max(0, min(int(PIECE / max(self._each, 1e-6)), MOST) - 1))
        return tasks
