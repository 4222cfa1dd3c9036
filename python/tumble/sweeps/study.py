"""A sweep from its words to its folder."""

import math
import os
import secrets
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tumble import _engine
from tumble._engine import ExportError, Scene, SceneError, TumbleError, World
from tumble.arguments import whole, wrong
from tumble.folder import plain, write_whole
from tumble.interrupts import held
from tumble.lock import alone
from tumble.recorder import machine, tier
from tumble.sweeps import design as designs
from tumble.sweeps import engines
from tumble.sweeps import measures as measuring
from tumble.sweeps import store as stores
from tumble.sweeps import task as tasks
from tumble.sweeps.against import Published, published
from tumble.sweeps.design import Design, override
from tumble.sweeps.engines import Engine, EngineWords
from tumble.sweeps.measures import Measure
from tumble.sweeps.mistakes import Mistakes
from tumble.sweeps.options import Options
from tumble.sweeps.result import Row, Sweep, status_counts
from tumble.sweeps.store import Store

CHECKED = 1000
"""Points whose scenes are checked before anything runs: all of a small design, of a large one some in which every value
occurs."""

MANY = 10_000
"""Runs of which a sweep is told beforehand how long it will take."""

LONG = 12 * 3600.0
"""Time from which on it is told, too [s]."""

TIMED = 20
"""Runs of fewer than these are started at once, however long they take."""

LAST_SEED = 2**32 - 1

MEASURES = ("ledger.energy@last",)
"""What is measured where nothing is asked for."""


@dataclass(frozen=True)
class Progress:
    """How far a sweep is."""

    done: int
    total: int
    failed: int
    running: int
    left: float
    """Estimated time that is left [s]; nan where nothing is known yet."""


@dataclass(frozen=True)
class Plan:
    """What a sweep will do, before it does it."""

    runs: int
    there: int
    """Runs that need not be computed."""
    workers: int
    seconds: float
    """Estimated time in all [s]; nan where it was not estimated."""
    notes: list[str]

    @property
    def large(self) -> bool:
        """Whether it should be asked about."""
        return self.runs - self.there >= MANY or self.seconds > LONG


@dataclass(frozen=True)
class Words:
    """What was asked for, checked."""

    scene: Scene
    """Without expectations, which are those of the scene as it stands."""
    design: Design
    seeds: list[int]
    measures: list[Measure]
    hash: str
    world: World
    """Of the first point, at its start."""
    against: Published | None = None

    @property
    def runs(self) -> int:
        return len(self.design) * len(self.seeds)

    def task(self, run: int, keep: bool) -> tasks.Task:
        """The run with a number; seeds change fastest."""
        point, k = divmod(run, len(self.seeds))
        sets = tuple(override(*item) for item in self.design.point(point).items())
        return tasks.Task(stores.key(self.hash, sets, self.seeds[k]), sets, self.seeds[k], keep)


def sweep(
    scene: Scene | Mapping[str, Any] | str | os.PathLike[str],
    design: Design | Mapping[str, Any],
    measures: str | Sequence[str] = MEASURES,
    folder: str | os.PathLike[str] | None = None,
    seeds: int | Sequence[int] = 1,
    on: str = "cores",
    workers: int | None = None,
    keep: bool = False,
    stills: bool = False,
    films: bool = False,
    plots: bool = True,
    resume: bool = False,
    overwrite: bool = False,
    memory: float | None = None,
    against: str | os.PathLike[str] | None = None,
    agree: Callable[[Plan], bool] | None = None,
    progress: Callable[[Progress], object] | None = None,
) -> Sweep:
    """Runs a scene at every point of a design and with every seed, and writes the table and its statistics into a folder,
    by default out/sweep/NAME.

    `scene` is a scene, its dict, or the name or file of one. `design` is a mapping of keys of the scene to values, taken as a
    grid ({"system.0.substeps": [10, 20], "world.gravity.2": "-9.8:-1.6:5"}), or one of `tumble.sweeps.design`: zipped,
    latin, sobol, table, product. `measures` are texts as `tumble.sweeps.measures` has them: "ledger.energy@last",
    "max ledger.stretch", "probe flag.position[260].z@3s". `seeds` is how many, counted from the scene's own, or which.

    `on` is "cores", "dask" (a LocalCluster) or the address of a Dask scheduler, tcp://HOST:PORT. `workers` are as many as
    there are cores; `memory` is the most that one may take [bytes]. With `keep` each run leaves its run folder in runs/;
    `stills` and `films` draw the runs of the first seed, `plots` each measure over each parameter. `resume` computes only
    what is not there yet, `overwrite` starts anew. `against` is a CSV file with values from elsewhere for the plots, whose head
    names parameters and measures. `agree` is asked before anything runs, and answers with the `Plan` at hand;
    `progress` is called after each run.

    Raises SceneError if anything is wrong with what was asked for, with all mistakes, before anything runs; ExportError if
    files cannot be written, with every finished row kept. Runs that fail are rows, and raise nothing.
    """
    words = prepared(scene, design, measures, seeds, against=against)
    place = Path(folder) if folder is not None else Path("out") / "sweep" / _name(scene)
    options = Options(on, workers, keep, stills, films, plots, resume, overwrite, memory)
    return carry_out(words, place, options, agree, progress)


def carry_out(
    words: Words,
    folder: Path,
    options: Options,
    agree: Callable[[Plan], bool] | None = None,
    progress: Callable[[Progress], object] | None = None,
    drawn: Callable[[str, int, int], None] | None = None,
) -> Sweep:
    """A sweep whose words are checked, as `sweep`; `drawn` is called with what is drawn, how many are done, and how many there
    are."""
    resolved = words.scene.to_dict()
    store = Store(folder)
    if options.resume and options.overwrite:
        raise wrong("resume", "keeps what is finished, and overwrite replaces it; choose one")
    store.admit(resolved, options.resume, options.overwrite)
    plan, engine = planned(words, store if options.resume else None, options)
    if agree is not None and not agree(plan):
        raise KeyboardInterrupt
    with alone(store.folder):
        store.admit(resolved, options.resume, options.overwrite)
        return _Sweeping(words, store, plan, engine, options, progress, drawn).run()


def _name(scene: object) -> str:
    return Path(scene).stem if isinstance(scene, str | os.PathLike) else "scene"


# Checking


def prepared(
    scene: Scene | Mapping[str, Any] | str | os.PathLike[str],
    design: Design | Mapping[str, Any] | None,
    measures: str | Sequence[str],
    seeds: int | Sequence[int],
    places: Mapping[str, str] | None = None,
    mistakes: Mistakes | None = None,
    against: str | os.PathLike[str] | None = None,
) -> Words:
    """Checks all that was asked for. `places` says how a parameter was typed: path -> "--vary path"; `mistakes` are those that
    were found already, maybe instead of a design. Raises SceneError with all of them."""
    mistakes = mistakes or Mistakes()
    made = _scene(scene)
    base = _without_expectations(made)
    found: Design | None = None
    with mistakes.gathered():
        found = None if design is None else designs.asked(design)
    chosen: list[int] = []
    with mistakes.gathered():
        chosen = _seeds(seeds, base, found)
    texts = [measures] if isinstance(measures, str) else list(measures)
    wanted: list[Measure] = []
    for text in dict.fromkeys(texts or MEASURES):
        with mistakes.gathered():
            wanted.append(measuring.read(text))
    world = None
    first = None if found is None else _check_points(base, found, mistakes, places or {})
    # Measures are looked for in the scene as it stands where no point of the design is right.
    with mistakes.gathered():
        world = World(first or base)
    if world is not None:
        for measure in wanted:
            with mistakes.gathered():
                measuring.check(measure, world)
    other = None
    if against is not None and found is not None:
        with mistakes.gathered():
            other = published(against, found.paths, [m.name for m in wanted])
    mistakes.tell()
    assert found is not None and world is not None
    names = [m.name for m in wanted]
    unique = [m for k, m in enumerate(wanted) if m.name not in names[:k]]
    return Words(base, found, chosen, unique, stores.scene_hash(base.to_dict()), world, other)


def _scene(scene: Scene | Mapping[str, Any] | str | os.PathLike[str]) -> Scene:
    if isinstance(scene, Scene):
        return scene
    return Scene.load(scene) if isinstance(scene, str | os.PathLike) else Scene(scene)


def _without_expectations(scene: Scene) -> Scene:
    tree = {key: value for key, value in scene.to_dict().items() if key != "expect"}
    return Scene(tree, scene.folder or None)


def _seeds(seeds: int | Sequence[int], scene: Scene, design: Design | None) -> list[int]:
    first = int(scene.to_dict()["seed"])
    if isinstance(seeds, Sequence) and not isinstance(seeds, str):
        chosen = [whole(seed, "seeds", 0) for seed in seeds]
        if not chosen or len(set(chosen)) < len(chosen):
            raise wrong("seeds", f"{list(seeds)}, expected different seeds")
    else:
        chosen = [first + k for k in range(whole(seeds, "--seeds", 1))]
    if (last := max(chosen)) > LAST_SEED:
        raise wrong("--seeds", f"the last seed would be {last}, expected at most {LAST_SEED}; set a smaller seed")
    if design is not None and "seed" in design.paths and len(chosen) > 1:
        raise wrong("--seeds", "the design varies seed itself; leave one of both out")
    return chosen


def _check_points(scene: Scene, design: Design, mistakes: Mistakes, places: Mapping[str, str]) -> Scene | None:
    """Checks the scenes of a design; the first that is right."""
    first: Scene | None = None
    for path in design.paths:
        root = path.split(".")[0]
        if root in ("expect", "output", "camera", "title", "version"):
            mistakes.add(places.get(path, path), f"[{root}] changes nothing that a sweep measures; vary another key")
    tree = scene.to_dict()
    keys: dict[tuple[str | int, ...], str] = {}
    for path in design.paths:
        key = designs.located(tree, path)
        for other, typed in keys.items():
            if key[: len(other)] == other or other[: len(key)] == key:
                text = f"is the same key as {typed}" if key == other else f"changes the same values as {typed}"
                mistakes.add(places.get(path, path), f"{text}, which is varied, too; leave one of both out")
        keys[key] = path
    for i in design.covering(CHECKED):
        sets = {override(path, v): f"{places.get(path, path)}={v}" for path, v in design.point(i).items()}
        try:
            found = scene.replace(*sets)
            first = first or found
        except SceneError as error:
            mistakes.take(error, sets)
    return first


# Planning


def planned(words: Words, store: Store | None, options: Options) -> tuple[Plan, EngineWords]:
    """Looks at what is there, and estimates how long the rest will take. Raises SceneError."""
    engine, notes = engines.chosen(options.on, options.workers, words.runs, float(words.scene.memory), options.memory)
    done = 0
    if store is not None:
        keys = store.keys()
        done = sum(words.task(i, False).key in keys for i in range(words.runs)) if keys else 0
    seconds = math.nan
    left = words.runs - done
    if left >= TIMED:
        seconds = _estimate(words) * left / engine.workers
    return Plan(words.runs, done, engine.workers, seconds, notes), engine


def _estimate(words: Words) -> float:
    """Time of one run [s], from its first frames."""
    frames = int(words.world.scene.to_dict()["time"]["frames"])
    begin = time.perf_counter()
    taken = 0
    with suppress(TumbleError, TimeoutError):
        while taken < frames and time.perf_counter() - begin < 0.2:
            words.world.step(patience=5.0)
            taken += 1
    return (time.perf_counter() - begin) * frames / max(taken, 1)


# Running


class _Sweeping:
    """A sweep that goes on."""

    def __init__(
        self,
        words: Words,
        store: Store,
        plan: Plan,
        engine: EngineWords,
        options: Options,
        progress: Callable[[Progress], object] | None,
        drawn: Callable[[str, int, int], None] | None,
    ) -> None:
        self.drawn = drawn
        self.words, self.store, self.plan, self.options = words, store, plan, options
        self.progress = progress
        self.engine_words = engine
        self.token = secrets.token_hex(16)
        self.computed = self.failed = self.done = self.bytes = 0
        self.busy = 0.0
        """Time that runs took, all workers together [s]."""
        self.began = time.perf_counter()
        scene = words.scene.to_dict()
        self.manifest: dict[str, Any] = {
            "format": stores.FORMAT,
            "tumble": _engine.version,
            "commit": _engine.commit,
            "name": store.folder.resolve().name,
            "status": "running",
            "failure": None,
            "title": scene.get("title") or "",
            "runs": words.runs,
            "done": 0,
            "ends": {},
            "hash": "",
            "scene_hash": words.hash,
            "seeds": words.seeds,
            "measures": [{"name": m.name, "unit": m.unit or "1"} for m in words.measures],
            "keep": options.keep,
            "on": engine.on,
            "workers": engine.workers,
            "threads": engine.threads,
            "bits": tier(scene),
            "machine": machine(engine.threads),
            "notes": plan.notes,
            "design": words.design.to_dict() if words.runs <= MANY else {"kind": words.design.kind},
            "scene": scene,
        }

    def run(self) -> Sweep:
        """Computes what is missing, and writes what is made of it."""
        todo = self._todo()
        with ExitStack() as stack:
            # Before anything is written or deleted: a scheduler that does not answer leaves the folder as it was.
            engine = None if todo is None else stack.enter_context(self._engine())
            self._begin()
            opened = stack.pop_all()
        try:
            with opened:
                if todo is not None and engine is not None:
                    self._compute(todo, engine)
        except KeyboardInterrupt:
            with held():
                self._end("interrupted", "stopped by the user")
            raise
        except TumbleError as error:
            self._end("failed", str(error))
            raise
        finally:
            self.store.forget_unfinished()
            with suppress(OSError):
                (self.store.folder / tasks.TOKEN).unlink()
        found = self._end("finished")
        options = self.options
        from tumble.sweeps import outputs  # Loads what draws, which takes a second: mistakes are told before.

        outputs.write(found, self.store, options, self.words.against, self.drawn)
        return found

    def _begin(self) -> None:
        with held():
            if self.options.overwrite and self.store.is_sweep():
                self.store.clear()
            self.store.make()
            self.store.write_manifest(self.manifest)
            write_whole(self.store.folder / tasks.TOKEN, self.token.encode())

    def _todo(self) -> Iterator[tasks.Task] | None:
        """The runs that are missing; None where there are none."""
        there = set() if self.options.overwrite else self.store.keys()
        repeats = self.words.design.repeats
        names = [m.name for m in self.words.measures]

        def missing() -> Iterator[tasks.Task]:
            asked = set()
            for i in range(self.words.runs):
                task = self.words.task(i, self._kept(i))
                if task.key in asked or (task.key in there and self._is_done(task, names)):
                    continue
                if repeats:
                    asked.add(task.key)
                yield task

        return self._counted(missing(), repeats or len(there) > 0)

    def _compute(self, todo: Iterator[tasks.Task], engine: Engine) -> None:
        with closing(engine.run(todo)) as answers:  # type: ignore[type-var]
            self._tell(engine)
            for answer in answers:
                with held():
                    self._take(answer)
                self._tell(engine)
            self.manifest["deaths"] = engine.deaths

    def _counted(self, missing: Iterator[tasks.Task], some: bool) -> Iterator[tasks.Task] | None:
        """The tasks, once those that are there are counted; None where there are none."""
        if not some:
            return missing
        todo = list(missing)
        self.done = self.words.runs - len(todo)
        if self.progress is not None and not todo:
            self.progress(Progress(self.done, self.words.runs, 0, 0, 0.0))
        return iter(todo) if todo else None

    def _kept(self, run: int) -> bool:
        """Whether a run leaves its folder: all, or those that are drawn."""
        drawn = self.options.stills or self.options.films
        return self.options.keep or (drawn and run % len(self.words.seeds) == 0)

    def _is_done(self, task: tasks.Task, names: Sequence[str]) -> bool:
        row = self.store.read(task.key, names)
        if row is None or row["status"] in stores.AGAIN:
            return False
        if task.keep and row["status"] != tasks.INVALID and not (self.store.runs(task.key) / "run.json").is_file():
            return False
        self.failed += row["status"] != tasks.FINISHED
        return True

    def _engine(self) -> AbstractContextManager[Engine]:
        context = tasks.Context(
            self.words.scene, tuple(self.words.measures), str(self.store.folder.resolve()), self.token
        )
        return engines.opened(context, self.engine_words, self.options.memory)

    def _take(self, answer: tasks.Answer) -> None:
        """Keeps an answer. Raises ExportError where it cannot."""
        if answer.full:
            raise ExportError(answer.full)
        if answer.archive:
            self.bytes += len(answer.archive)
            self._unpack(answer)
        answer.values = measuring.nothing(self.words.measures) | answer.values
        self.store.add(answer.row())
        self.computed += 1
        self.done += 1
        self.failed += answer.status != tasks.FINISHED
        self.busy += 0.0 if math.isnan(answer.seconds) else answer.seconds

    def _unpack(self, answer: tasks.Answer) -> None:
        from tumble.folder import writing

        work = self.store.folder / tasks.UNFINISHED / answer.key
        with writing(work):
            tasks.unpack(answer.archive, work)
            tasks.put(work, self.store.runs(answer.key))

    def _tell(self, engine: Engine) -> None:
        if self.progress is None:
            return
        left = math.nan
        if self.computed:
            each = (time.perf_counter() - self.began) / self.computed
            left = each * (self.words.runs - self.done)
        self.progress(Progress(self.done, self.words.runs, self.failed, engine.running, left))

    def _end(self, status: str, message: str | None = None) -> Sweep:
        """Writes the tables of what is done."""
        found = collected(self.words, self.store)
        found.computed = self.computed
        wall = time.perf_counter() - self.began
        self.manifest |= {
            "status": status,
            "failure": message,
            "done": len(found.rows),
            "ends": status_counts(found.rows),
            "hash": found.hash,
            "transferred": self.bytes,
            "timings": {"wall": wall, "runs": self.busy, "computed": self.computed},
        }
        found.manifest = self.manifest
        writes: list[Callable[[], None]] = [
            lambda: stores.write_csv(self.store.table, [found.head, *found.lines()]),
            lambda: self.store.write_manifest(self.manifest),
        ]
        for write in writes:
            if status == "finished":
                write()
            else:
                with suppress(ExportError, OSError):
                    write()
        return found


def collected(words: Words, store: Store) -> Sweep:
    """The rows of a design that are there, in its order."""
    rows: list[Row] = []
    there = store.keys()
    # Not one for each run: there may be a million.
    names = {m.name: m.name for m in words.measures}
    for i in range(words.runs):
        task = words.task(i, False)
        row = store.read(task.key) if task.key in there else None
        if row is None:
            continue
        point = i // len(words.seeds)
        parameters = rows[-1].parameters if rows and rows[-1].point == point else words.design.point(point)
        values = {names[name]: value for name, value in row["values"].items() if name in names}
        kept = (sys.intern(row["status"]), row["reason"], row["report"], int(row["frame"]), row["hash"], values)
        rows.append(Row(i, point, parameters, task.seed, task.key, *kept, seconds=float(row["seconds"])))
    title = str(words.scene.to_dict().get("title") or "")
    return Sweep(store.folder, title, words.design, words.seeds, words.measures, rows)


def as_tree(found: Sweep) -> dict[str, Any]:
    """The result for programs."""
    keys = ("status", "runs", "done", "ends", "hash", "on", "workers", "timings", "measures", "transferred", "notes")
    head, lines = found.summary()
    return {
        "ok": not found.failed,
        "folder": str(found.folder),
        **{key: plain(found.manifest.get(key)) for key in keys},
        "failed": [
            {"run": r.run, "parameters": r.parameters, "seed": r.seed, "reason": r.reason} for r in found.failed
        ],
        "summary": [dict(zip(head, line, strict=True)) for line in lines],
    }
