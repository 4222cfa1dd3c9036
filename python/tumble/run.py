"""A run: simulated frame by frame into a folder, and read from it."""

import json
import os
import shlex
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble import _engine, expect
from tumble._engine import ExportError, Scene, SceneError, StepError, World
from tumble.folder import (
    FORMAT,
    LEDGER,
    STATIC,
    TRIALS,
    Columns,
    RunFolder,
    marked,
    plain,
    read_columns,
    read_rows,
    reason,
    refuse,
)
from tumble.interrupts import held
from tumble.lock import alone, ask
from tumble.recorder import Recorder, Unchanging, changed
from tumble.soundness import fault_of_arrays, fault_of_columns, fault_of_manifest

Progress = Callable[[int, int], None]
"""Called with frames done and frames in all."""

Broke = Callable[[StepError], None]
"""Called with why the physics broke, before cures are tried."""


def simulate(
    scene: Scene | Mapping[str, Any],
    folder: str | os.PathLike[str],
    frames: int | None = None,
    resume: bool = False,
    threads: int | None = None,
    progress: Progress | None = None,
    overwrite: bool = False,
    cures: bool = True,
    broke: Broke | None = None,
) -> "Run":
    """Simulates a scene into a folder.

    `frames` overrides the scene's. `resume` goes on where an earlier run in the folder was stopped, to the same bits as
    if it had not been; without an earlier run it starts one. `overwrite` replaces an earlier run.
    Where the physics breaks, `cures` are tried and a minimal scene that breaks as well is looked for, which takes as long as
    many such runs; `broke` is told before.

    Raises SceneError if the scene or the folder is wrong, before anything is written; StepError if the physics breaks;
    ExportError if a file cannot be written. Whatever was finished by then can be read with `Run.open`. A bound of [expect] that
    is broken ends the run after that frame, with status "failed" and the bound and its culprit in `manifest["expectations"]`.
    """
    scene = scene if isinstance(scene, Scene) else Scene(scene)
    if frames is not None:
        scene = scene.replace(f"time.frames={frames}")
    files = RunFolder(folder)
    ask(files.path)
    admit(files, scene, resume, overwrite)
    world = World(scene, threads)
    expect.probes(world, scene.to_dict())
    with alone(files.path):
        # Another run may have come and gone meanwhile.
        earlier = admit(files, scene, resume, overwrite)
        return _simulate(files, world, threads, progress, earlier, overwrite, cures, broke)


def _simulate(
    files: RunFolder,
    world: World,
    threads: int | None,
    progress: Progress | None,
    earlier: dict[str, Any] | None,
    overwrite: bool,
    cures: bool,
    broke: Broke | None,
) -> "Run":
    unchanging = Unchanging.of(world)
    if earlier is not None and not return_to_checkpoint(world, files):
        earlier, overwrite = None, True
        world = World(world.scene, threads)
    if earlier is None and overwrite and files.is_run():
        files.clear()
    recorder = Recorder(files, world, unchanging, threads, earlier)
    return record(recorder, recorder.start if earlier is None else recorder.go_on, progress, cures, broke)


def record(
    recorder: Recorder,
    begin: Callable[[], None],
    progress: Progress | None,
    cures: bool = True,
    broke: Broke | None = None,
) -> "Run":
    """Begins to record, and simulates to the last frame. Where that fails, `broke` is told and `cures` are tried."""
    files, world = recorder.files, recorder.world
    try:
        with held():
            begin()
        _advance(world, recorder, progress)
        with held():
            recorder.finish()
        run = Run(files.path)
        recorder.judge(run)
    except StepError as error:
        if broke is not None and cures:
            broke(error)
        recorder.fail(error, cures)
        raise
    except KeyboardInterrupt:
        with held():
            recorder.stop("interrupted", "stopped by the user")
        raise
    except ExportError as error:
        recorder.stop("failed", str(error))
        raise
    finally:
        recorder.close()
    return Run(files.path)


def _advance(world: World, recorder: Recorder, progress: Progress | None) -> None:
    total = recorder.manifest["frames"]
    if progress is not None:
        progress(min(world.frame_index, total), total)
    while world.frame_index < total and not recorder.bounds.broken:
        begin = time.perf_counter()
        report = world.step()
        with held():
            recorder.frame(report, time.perf_counter() - begin)
        if progress is not None:
            progress(world.frame_index, total)


def admit(
    files: RunFolder, scene: Scene, resume: bool, overwrite: bool, descent: Sequence[Mapping[str, Any]] = ()
) -> dict[str, Any] | None:
    """The manifest of the run to go on with, if any; refuses a folder in which something else is. `descent` is that of the
    branch to be."""
    try:
        if files.is_free():
            return None
    except OSError as error:
        raise refuse(files.path, reason(error)) from error
    if not files.is_run():
        what = "holds files, but no run" if files.path.is_dir() else "is a file"
        raise refuse(files.path, f"{what}; choose another folder with --out")
    if overwrite and not resume:
        return None
    manifest = read_manifest(files)
    if not resume:
        done = max(len(read_rows(files.ledger, LEDGER)) - 1, 0)
        state = f"{manifest.get('status')}, {done} of {manifest.get('frames')} frames"
        cure = "go on with --resume, replace it with --force, or choose another folder with --out"
        raise refuse(files.path, f"holds a run already ({state}); {cure}")
    if manifest.get("tumble") != _engine.version:
        text = f"was simulated by tumble {manifest.get('tumble')}, and this is {_engine.version}: the bits could differ"
        raise refuse(files.path, f"{text}; start again with --force, or choose another folder with --out")
    if (found := manifest.get("descent", [])) != json.loads(json.dumps(plain(descent))):
        what = "is no branch; go on with `tumble run SCENE --resume`"
        if found:
            parent = os.path.normpath(files.path / found[-1]["run"])
            what = f"is a branch of {parent} at frame {found[-1]['frame']}; go on with `{go_on(files.path, manifest)}`"
        raise refuse(files.path, f"{what}, replace it with --force, or choose another folder with --out")
    # Both scenes as JSON has them, so that 1 and 1.0, lists and tuples compare as equal.
    difference = changed(manifest["scene"], json.loads(json.dumps(plain(scene.to_dict()))))
    if difference is not None:
        text = f"the scene has changed since the run was started: {difference}"
        raise refuse(files.path, f"{text}; start again with --force, or choose another folder with --out")
    return manifest


def return_to_checkpoint(world: World, files: RunFolder) -> bool:
    """Goes to the newest checkpoint that is sound and before which every frame can be read."""
    rows = read_rows(files.ledger, LEDGER)
    intact = files.intact(rows)
    for frame in reversed([k for k in files.checkpoints() if k < intact]):
        try:
            world.load(files.checkpoint(frame))
        except (SceneError, OSError):
            continue
        if world.frame_index == frame and world.hash() == rows[frame][-1]:
            return True
    return False


def go_on(path: Path, manifest: Mapping[str, Any]) -> str:
    """The command that goes on with a branch."""
    last = manifest["descent"][-1]
    parent = os.path.normpath(path / last["run"])
    sets = [word for text in last["set"] for word in ("--set", text)]
    frames = ["--frames", str(manifest["frames"] - last["frame"])]
    return shlex.join(["tumble", "branch", f"{parent}@{last['frame']}", *sets, *frames, "--out", str(path), "--resume"])


def read_manifest(files: RunFolder) -> dict[str, Any]:
    """run.json, if it can be understood."""
    try:
        manifest: dict[str, Any] = json.loads(files.manifest.read_bytes())
    except OSError as error:
        raise ExportError(f"{files.manifest}: cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise ExportError(f"{files.manifest}: is damaged ({error}); simulate again with --force") from error
    if not isinstance(manifest, dict) or not isinstance(manifest.get("scene"), dict):
        raise refuse(files.path, "run.json is not that of a run")
    if manifest.get("format") != FORMAT:
        text = f"is a run of format {manifest.get('format')}, by tumble {manifest.get('tumble')}, and this one reads {FORMAT}"
        raise refuse(files.path, f"{text}: simulate again with --force, or read it with the other")
    if fault := fault_of_manifest(manifest):
        raise ExportError(f"{files.manifest}: is damaged ({fault}); simulate again with --force")
    return manifest


class LostFrames(UserWarning):
    """Frames of a run were there, and cannot be read."""


class Run:
    """A run folder, to be read. Frames that were finished can be read whatever happened after them."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Raises SceneError if there is no run at `path`; warns of LostFrames where some were there that are not."""
        files = RunFolder(path)
        if not files.is_run():
            what = "there is no such folder" if not files.path.exists() else "there is no run.json in it"
            raise refuse(files.path, f"is not a run: {what}; `tumble run SCENE --out {files.path}` makes one")
        self._files = files
        self.folder: Path = files.path
        self.manifest: dict[str, Any] = read_manifest(files)
        self.scene: dict[str, Any] = self.manifest["scene"]
        """The resolved scene."""
        self._rows = read_rows(files.ledger, LEDGER)
        lost, what = files.ledger, "has lost lines"
        while self._rows and not files.frame(len(self._rows) - 1).is_file():
            lost, what = files.frame(len(self._rows) - 1), "is missing"
            self._rows.pop()
        if self.n_frames < (n := len(self.manifest.get("hashes", []))):
            same = self.manifest.get("tumble") == _engine.version
            cure = "--resume computes again what is lost" if same else "--force simulates it again"
            text = f"{lost}: {what}: {self.n_frames} of {n} frames can be read; {cure}"
            warnings.warn(text, LostFrames, stacklevel=2)

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> "Run":
        """The run in a folder. Raises SceneError if there is none."""
        return cls(path)

    def __repr__(self) -> str:
        return f"Run({str(self.folder)!r}: {self.n_frames} frames, {self.status})"

    def __len__(self) -> int:
        return self.n_frames

    @property
    def status(self) -> str:
        """running (or killed), finished, failed or interrupted."""
        return str(self.manifest["status"])

    @property
    def n_frames(self) -> int:
        """Frames that can be read; frame 0 is the start."""
        return len(self._rows)

    @property
    def descent(self) -> list[dict[str, Any]]:
        """The runs that this one branches off from, the oldest first: `run` (its folder, seen from here), `name`, `frame`,
        `time` [s], `hash` of the state there, and what was `set`. Empty for a run that began at its start."""
        return list(self.manifest.get("descent", []))

    @property
    def fps(self) -> float:
        """Frames per second."""
        return float(self.scene["time"]["fps"])

    @cached_property
    def static(self) -> Columns:
        """Constant columns: masses, links, triangles, colliders; see `World.topology`."""
        return self._sound(read_columns(self._files.static, STATIC), "static", self._files.static)

    @cached_property
    def columns(self) -> dict[str, dict[str, dict[str, Any]]]:
        """Object -> column -> unit, shape, dtype, and the file it is `in`: frames or static. Of particles that come and
        go the first length is None; their column `id` says which is which."""
        try:
            described: dict[str, dict[str, dict[str, Any]]] = json.loads(self._files.columns.read_bytes())
        except (OSError, ValueError) as error:
            raise ExportError(f"{self._files.columns}: cannot be read ({error})") from error
        if fault := fault_of_columns(described):
            raise ExportError(f"{self._files.columns}: is damaged ({fault}); simulate again with --force")
        return described

    def _sound(self, columns: Columns, place: str, path: Path) -> Columns:
        """The columns of a file, if they are as described; where the description is lost, as they are."""
        try:
            described = self.columns
        except ExportError:
            return columns
        if fault := fault_of_arrays(columns, described, place):
            raise ExportError(f"{path}: is damaged ({fault}); simulate again with --force")
        return columns

    def frame(self, i: int) -> Columns:
        """The columns of a frame, by object; -1 is the last. Raises IndexError, or ExportError if a file is damaged."""
        path = self._files.frame(self._index(i))
        return self._sound(read_columns(path, self.mark(i)), "frames", path)

    def mark(self, i: int) -> str:
        """Header of the file of a frame."""
        return marked(self._index(i), self._rows[i][-1])

    def time(self, i: int) -> float:
        """Simulated time of a frame [s]."""
        return float(self._rows[self._index(i)][LEDGER.index("time")])

    def _index(self, i: int) -> int:
        if not -self.n_frames <= i < self.n_frames:
            raise IndexError(f"frame {i} of a run with {self.n_frames} frames")
        return i % self.n_frames

    @cached_property
    def ledger(self) -> dict[str, npt.NDArray[np.float64]]:
        """The books, one number per frame: the columns of ledger.csv."""
        return _numbers([row[:-1] for row in self._rows], LEDGER[:-1])

    @property
    def hashes(self) -> list[str]:
        """Hash of the state at each frame."""
        return [row[-1] for row in self._rows]

    @cached_property
    def trials(self) -> dict[str, npt.NDArray[np.float64]]:
        """The steps that adaptive integrators tried: time [s], step [s], error over tolerance, accepted, frame; the first
        65536 of each frame. Raises ExportError where some are lost."""
        return _numbers(self._files.tried(self._rows), TRIALS)


def _numbers(rows: list[list[str]], header: list[str]) -> dict[str, npt.NDArray[np.float64]]:
    table = np.array(rows, dtype=np.float64).reshape(len(rows), len(header))
    return dict(zip(header, table.T, strict=True))
