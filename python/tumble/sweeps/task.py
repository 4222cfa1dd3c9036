"""One run of a sweep, where it is computed: in a worker on this machine, or on another."""

import errno
import importlib
import io
import json
import re
import shutil
import tempfile
import time
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

from tumble import _engine
from tumble._engine import ExportError, Scene, SceneError, StepError, World
from tumble.folder import RunFolder, plain
from tumble.recorder import Recorder, Unchanging
from tumble.run import record
from tumble.sweeps import measures

TOKEN, RUNS, UNFINISHED = "token", "runs", "unfinished"
"""Names in the folder of a sweep."""

FINISHED, EXPLODED, FAILED, INVALID, MEMORY, DIED = (
    "finished",
    "exploded",
    "failed",
    "invalid",
    "out of memory",
    "died",
)
"""How runs end: to the last frame; energy beyond all bounds or numbers that are none; any other failure of a step; a scene
that cannot be built; more memory than there is; a worker that died of it."""


STUDIES = {"bottlenecks": "tumble.bottlenecks.passages"}
"""Modules that look at runs in their own way: each has a function `outcome` of a scene and of words, which gives bytes. A
message names one of these, never a module."""


@dataclass(frozen=True)
class Context:
    """What all runs of a sweep share; each worker gets it once."""

    scene: Scene
    measures: tuple[measures.Measure, ...]
    folder: str
    """Of the sweep."""
    token: str
    """In the file `token` of that folder, by which a worker knows whether it sees it."""
    version: str = _engine.version
    study: str = ""
    """Which of STUDIES looks at the runs, with `words` of its own; none: only measures do."""
    words: Mapping[str, float] = field(default_factory=dict)

    def message(self) -> bytes:
        """For a worker, as JSON: what comes from another machine is read, never run."""
        tree = {
            "version": self.version,
            "scene": self.scene.to_dict(),
            "home": self.scene.folder,
            "measures": [measure.name for measure in self.measures],
            "folder": self.folder,
            "token": self.token,
            "study": self.study,
            "words": dict(self.words),
        }
        return json.dumps(tree).encode()

    @staticmethod
    def of(message: bytes) -> "Context":
        """Raises Refused where it is of another version, whose scenes may not be readable here."""
        tree = json.loads(message)
        if tree["version"] != _engine.version:
            text = f"a worker has tumble {_engine.version}, and this is {tree['version']}"
            raise Refused(f"{text}; install that version there")
        scene = Scene(tree["scene"], tree["home"] or None)
        found = tuple(map(measures.read, tree["measures"]))
        return Context(scene, found, tree["folder"], tree["token"], study=tree["study"], words=tree["words"])


class Refused(Exception):
    """A worker of another version."""


@dataclass(frozen=True)
class Task:
    """One run."""

    key: str
    """Of its content: names its files."""
    overrides: tuple[str, ...]
    seed: int
    keep: bool = False
    """Whether it leaves a run folder."""

    @property
    def sets(self) -> tuple[str, ...]:
        return (*self.overrides, f"seed={self.seed}")

    def message(self) -> bytes:
        """For a worker."""
        return json.dumps(asdict(self)).encode()

    @staticmethod
    def of(message: bytes) -> "Task":
        tree = json.loads(message)
        return Task(**{**tree, "overrides": tuple(tree["overrides"])})


@dataclass
class Answer:
    """What became of a run."""

    key: str
    status: str
    reason: str = ""
    report: dict[str, Any] = field(default_factory=dict)
    frame: int = 0
    """The last frame."""
    hash: str = ""
    """Of the state there."""
    values: dict[str, float] = field(default_factory=dict)
    seconds: float = 0.0
    """That computing it took."""
    archive: bytes = b""
    """Its files, where the folder of the sweep is not seen; or what a study found."""
    full: str = ""
    """Why its files could not be written: that ends the sweep."""

    def row(self) -> dict[str, Any]:
        """For the file of its row."""
        kept = ("key", "status", "reason", "report", "frame", "hash", "values", "seconds")
        return {name: plain(getattr(self, name)) for name in kept}

    def message(self) -> bytes:
        """From a worker: a line, and the archive."""
        return json.dumps({**self.row(), "values": self.values, "full": self.full}).encode() + b"\n" + self.archive

    @staticmethod
    def of(message: bytes) -> "Answer":
        line, _, archive = message.partition(b"\n")
        return Answer(**json.loads(line), archive=archive)


def perform(context: Context, task: Task) -> Answer:
    """Computes a run."""
    begin = time.perf_counter()
    answer = Answer(task.key, FINISHED, values=measures.nothing(context.measures))
    try:
        _simulate(context, task, answer)
    except SceneError as error:
        answer.status, answer.reason = INVALID, "; ".join(str(error).splitlines())
    except StepError as error:
        report = getattr(error, "report", {})
        broke = report.get("kind") in ("exploded", "not_finite")
        answer.status, answer.reason = EXPLODED if broke else FAILED, str(error).splitlines()[0]
        answer.report = {"message": str(error), **report}
    except MemoryError as error:
        answer.status, answer.reason = MEMORY, str(error) or "no memory left for this run"
    except (ExportError, OSError) as error:
        answer.full = str(error)
    answer.seconds = time.perf_counter() - begin
    return answer


def _simulate(context: Context, task: Task, answer: Answer) -> None:
    scene = context.scene.replace(*task.sets)
    if context.study:
        answer.archive = importlib.import_module(STUDIES[context.study]).outcome(scene, context.words)
        return
    moment = scene.to_dict()["time"]
    frames = int(moment["frames"])
    watch = measures.Watch(context.measures, float(moment["fps"]), frames)
    world = World(scene)
    try:
        if task.keep:
            _recorded(context, task, answer, world, watch)
        else:
            watch.look(world, {})
            while world.frame_index < frames:
                watch.look(world, world.step())
    finally:
        answer.frame, answer.hash, answer.values = world.frame_index, world.hash(), watch.values()


class _Watched(Recorder):
    """Writes a run, and shows every frame to the measures."""

    def __init__(self, folder: Path, world: World, watch: measures.Watch) -> None:
        super().__init__(RunFolder(folder), world, Unchanging.of(world), None, None)
        self.watch = watch

    def start(self) -> None:
        super().start()
        self.watch.look(self.world, {})

    def frame(self, report: Mapping[str, Any], seconds: float) -> None:
        super().frame(report, seconds)
        self.watch.look(self.world, report)


def _recorded(context: Context, task: Task, answer: Answer, world: World, watch: measures.Watch) -> None:
    """The same with its run folder: in the folder of the sweep, or packed into the answer where that is not seen."""
    seen = sees(context)
    root = Path(context.folder) if seen else Path(tempfile.mkdtemp(prefix="tumble-sweep-"))
    # What is unfinished is where nobody takes it for a run that is whole.
    work = root / UNFINISHED / task.key
    try:
        shutil.rmtree(work, ignore_errors=True)
        recorder = _Watched(work, world, watch)
        record(recorder, recorder.start, None, cures=False)
    finally:
        if (work / "run.json").is_file():
            if seen:
                put(work, run_folder(root, task.key))
            else:
                answer.archive = pack(work)
        shutil.rmtree(work if seen else root, ignore_errors=True)


# Files


def run_folder(folder: Path, key: str) -> Path:
    """Where a run of a sweep is kept."""
    return folder / RUNS / key


def sees(context: Context) -> bool:
    """Whether the folder of the sweep is here, and not another of the same name."""
    try:
        return (Path(context.folder) / TOKEN).read_text(encoding="utf-8") == context.token
    except (OSError, UnicodeDecodeError):
        return False


def put(source: Path, goal: Path) -> None:
    """Puts a folder in the place of another."""
    goal.parent.mkdir(parents=True, exist_ok=True)
    shutil.rmtree(goal, ignore_errors=True)
    source.replace(goal)


def pack(folder: Path) -> bytes:
    """The files of a folder, as they are: frames are compressed already."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for path in sorted(folder.rglob("*")):
            archive.write(path, path.relative_to(folder).as_posix())
    return buffer.getvalue()


def unpack(archive: bytes, folder: Path) -> None:
    """Writes the files of `pack`. Raises OSError, also where a name leads out of the folder."""
    try:
        with zipfile.ZipFile(io.BytesIO(archive)) as packed:
            for name in packed.namelist():
                goal = folder / _inside(name)
                if name.endswith("/"):
                    goal.mkdir(parents=True, exist_ok=True)
                else:
                    goal.parent.mkdir(parents=True, exist_ok=True)
                    goal.write_bytes(packed.read(name))
    except (zipfile.BadZipFile, zlib.error) as error:
        raise OSError(errno.EIO, f"a worker sent a damaged archive ({error})") from None


def _inside(name: str) -> str:
    """A name of an archive, which is that of a file below a folder."""
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or re.search(r"[\\:\0]", name):
        raise OSError(errno.EIO, f"a worker sent a file {name!r}, which leads out of the folder of its run")
    return name
