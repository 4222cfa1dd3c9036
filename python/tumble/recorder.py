"""Writes a run while it happens."""

import os
import platform
import shlex
import sys
import time
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from tumble import _engine, causes, cures, doubts, energy, expect, measures, minimal
from tumble._engine import ExportError, StepError, TumbleError, World
from tumble.folder import (
    FORMAT,
    LEDGER,
    STATIC,
    TRIALS,
    Columns,
    RunFolder,
    Table,
    marked,
    read_rows,
    share,
    write_checkpoint,
    write_columns,
    write_json,
)
from tumble.reader import Run

MANIFEST_INTERVAL = 5.0
"""Seconds between updates of run.json while a run goes on; more where the list of hashes is so long that writing takes
more than a hundredth of it."""

KEPT_CHECKPOINTS = 2

IMPLICIT = ("implicit_euler", "implicit_midpoint", "bdf2")
"""Integrators that solve linear systems."""

_NOTHING: dict[str, measures.Cell] = {
    column: np.nan if measure.optional else 0 for measure in measures.REPORT for column in measure.columns
}
"""What the start took, in the columns of the ledger."""


class Unchanging(NamedTuple):
    """Data written once, of a world at its start: later masses and links may be others, where cloth has torn."""

    static: Columns
    described: dict[str, dict[str, Any]]

    @classmethod
    def of(cls, world: World) -> "Unchanging":
        topology = world.topology
        return cls(topology, describe(world.units, topology, world.frame))


class Recorder:
    """The open run folder of a world that is being simulated."""

    def __init__(
        self,
        files: RunFolder,
        world: World,
        unchanging: Unchanging,
        threads: int | None,
        earlier: Mapping[str, Any] | None,
        descent: Sequence[Mapping[str, Any]] = (),
        frames: int | None = None,
        whole: int | None = None,
        altered: bool = False,
    ) -> None:
        """`earlier` is the manifest of the run that goes on; `descent` are the runs that this one branches off from, the
        oldest first. `frames` are simulated instead of the scene's, of which expectations at the end are meant for the one
        after `whole`. Of a world with an `altered` start its scene alone makes no other."""
        self.files = files
        self.world = world
        self.unchanging = unchanging
        self.scene = world.scene.to_dict()
        if frames is not None:
            self.scene["time"]["frames"] = frames
        self.hashes: list[str] = []
        self.tables: list[Table] = []
        self.written = -1
        """The last frame that is on disk."""
        self.bounds = expect.Bounds(self.scene["expect"])
        self.began = time.perf_counter()
        self.update_due = self.began + MANIFEST_INTERVAL
        timings = dict((earlier or {}).get("timings", {}))
        self.timings = {key: float(timings.get(key, 0.0)) for key in ("simulate", "write", "total")}
        self.total_before = self.timings["total"]
        self.manifest: dict[str, Any] = {
            "format": FORMAT,
            "tumble": _engine.version,
            "commit": _engine.commit,
            "name": files.path.resolve().name,
            "status": "running",
            "failure": None,
            "frames": self.scene["time"]["frames"],
            "whole_frames": world.scene.whole_frames if whole is None else whole,
            "fps": self.scene["time"]["fps"],
            "seed": self.scene["seed"],
            "precision": self.scene["precision"],
            "bits": tier(self.scene),
            "resumed": int((earlier or {}).get("resumed", -1)) + 1,
            "machine": machine(threads),
            "timings": self.timings,
            "custom": world.custom,
            "altered": altered,
            "warnings": world.warnings,
            # Of the state that the run began with.
            "stability": world.stability() if earlier is None else earlier.get("stability", []),
            "expectations": [],
            "probes": [],
            "descent": list(descent),
            "folder": os.path.relpath(world.scene.folder or ".", files.path),
            "scene": self.scene,
            "hashes": self.hashes,
        }

    def start(self) -> None:
        """Opens a new folder and writes the start, frame 0."""
        self._make()
        self._open([], [])
        self._record(self.world.frame, {}, 0.0)
        if self.manifest["altered"]:
            self.checkpoint()

    def branch_off(self, parent: "Run") -> None:
        """Opens a new folder that begins with the frames of another run, up to the one at which the world stands."""
        files, frame = RunFolder(parent.folder), self.world.frame_index
        rows = read_rows(files.ledger, LEDGER)[: frame + 1]
        self._make()
        for i in range(frame):
            share(files.frame(i), self.files.frame(i))
        self._open(rows[:frame], _until(frame, files))
        self.hashes.extend(r[-1] for r in rows[:frame])
        for row in rows[:frame]:
            self.bounds.add(expect.numbers(row))
        # The books of this frame are kept by the changed scene; the way to it was the parent's.
        way = dict(zip(LEDGER, rows[frame], strict=True))
        self._record(self.world.frame, {column: way[column] for column in _NOTHING}, way["seconds"])
        self.checkpoint()

    def _make(self) -> None:
        self.files.make()
        self._write_manifest()
        self._describe()

    def _describe(self) -> None:
        write_columns(self.files.static, self.unchanging.static, STATIC)
        write_json(self.files.columns, self.unchanging.described)

    def go_on(self) -> None:
        """Opens the folder of a stopped run at the frame of the world; later frames are dropped."""
        frame = self.world.frame_index
        rows = read_rows(self.files.ledger, LEDGER)[: frame + 1]
        trials = _until(frame, self.files)
        self.hashes.extend(r[-1] for r in rows)
        self.written = frame
        for row in rows:
            self.bounds.add(expect.numbers(row))
        # First, so that it counts no frames that are being dropped.
        self._write_manifest()
        self.files.drop_after(frame)
        self._open(rows, trials)
        self._describe()

    def _open(self, rows: list[list[str]], trials: list[list[str]]) -> None:
        self.ledger = Table(self.files.ledger, LEDGER, rows)
        self.tables.append(self.ledger)
        self.trials: Table | None = None
        # A branch without adaptive steps may have a parent with them.
        if trials or any(system["integrator"] in energy.ADAPTIVE for system in self.scene["system"]):
            self.trials = Table(self.files.trials, TRIALS, trials)
            self.tables.append(self.trials)

    def frame(self, report: Mapping[str, Any], seconds: float) -> None:
        """Writes the frame at which the world is; `report` says what it took."""
        self.timings["simulate"] += seconds
        begin = time.perf_counter()
        self._record(self.world.frame, measures.cells(measures.REPORT, report), seconds, report["trials"])
        if self.written % self.scene["output"]["checkpoint"] == 0 or self.written == self.manifest["frames"]:
            self.checkpoint()
        self.timings["write"] += time.perf_counter() - begin
        if time.perf_counter() > self.update_due:
            self._write_manifest()

    def _record(
        self,
        columns: Columns,
        took: Mapping[str, measures.Cell],
        seconds: float | str,
        trials: Sequence[Mapping[str, Any]] = (),
    ) -> None:
        """The frame first and its line of the ledger last: a frame with a line is complete."""
        index = self.world.frame_index
        state = self.world.hash()
        write_columns(self.files.frame(index), columns, marked(index, state))
        if self.trials is not None:
            self.trials.add([t["time"], t["step"], t["error"], int(t["accepted"]), index] for t in trials)
            took = {"tried": len(trials), **took}
        row = ledger_row(index, self.world.ledger, took, seconds, state)
        self.ledger.add([row])
        self.hashes.append(state)
        self.written = index
        self.bounds.add(dict(zip(LEDGER, row, strict=True)))

    def checkpoint(self) -> None:
        """Saves the state, so that the run can go on from here, and drops old ones but for that of a branch's start."""
        if self.world.frame_index != self.written:
            return  # Stopped between the step and the frame's file.
        path = self.files.checkpoint(self.written)
        if not path.exists():
            write_checkpoint(self.world, path)
        descent = self.manifest["descent"]
        start = descent[-1]["frame"] if descent else 0 if self.manifest["altered"] else None
        for old in self.files.checkpoints()[:-KEPT_CHECKPOINTS]:
            if old == start:
                continue
            with suppress(OSError):
                self.files.checkpoint(old).unlink()

    def finish(self) -> None:
        """Closes a run that went on to its last frame, or ends one of which a bound is broken."""
        whole = self.written >= self.manifest["frames"]
        self.manifest["status"] = "finished" if whole else "failed"
        ends = whole and expect.ends_as_meant(self.manifest)
        self.manifest["probes"] = expect.probes(self.world, self.scene) if ends else []
        self.checkpoint()
        self._write_manifest()

    def judge(self, run: Run) -> None:
        """Notes what is doubtful about the books of this run, the expectations that were broken, and who broke those on
        curves, which the world is still at."""
        found = [expect.blamed(b, self.world) for b in expect.check(run)]
        self._doubt(run)
        self.manifest["expectations"] = [b.to_dict() for b in found]
        self._write_manifest()

    def _doubt(self, run: Run) -> None:
        # The books know of all frames, the world of those that it has stepped.
        own = [warning for warning in self.world.warnings if warning["code"] != "unconverged"]
        self.manifest["warnings"] = [*own, *doubts.of_books(run)]

    def _doubt_so_far(self) -> None:
        # Frames that have just been dropped may be counted still.
        with suppress(Exception), warnings.catch_warnings(action="ignore"):
            self._doubt(Run(self.files.path))

    def fail(self, error: StepError, explain: bool = True) -> None:
        """Notes why the physics broke, then, if asked to `explain` it, tries what would have helped, and looks for a minimal
        scene that breaks in the same way; not of a world that is more than its scene, which no trial would be like."""
        self.stop("failed", str(error), getattr(error, "report", {}))
        if not explain:
            return
        failure = self.manifest["failure"]
        # The failure is worth more than its cures, and both more than a smaller scene.
        with suppress(KeyboardInterrupt):
            self._explain(failure)
            if not (self.manifest["custom"] or self.manifest["altered"]):
                self._cure(failure)
        self.stop("failed")

    def _cure(self, failure: dict[str, Any]) -> None:
        """Tries changes of the scene, and looks for a smaller one."""
        failure["cures"] = cures.cures(self.world, self.scene, failure["report"])
        with suppress(TumbleError, OSError):
            self._soften(failure)
        self._explain(failure)
        self.stop("failed")
        with suppress(Exception):
            self._minimize(failure)

    def _explain(self, failure: dict[str, Any]) -> None:
        """Notes the likely causes."""
        with suppress(Exception):
            run = Run(self.files.path)
            failure["causes"] = causes.likely(self.world, self.scene, failure["report"], run, failure.get("near", ()))

    def _minimize(self, failure: dict[str, Any]) -> None:
        path = self.files.path / minimal.FILE
        with suppress(OSError):
            path.unlink()
        found = minimal.minimize(
            self.world.scene,
            failure["report"],
            self.written + 1,
            float(Run(self.files.path).ledger["steps"].sum()),
            # A branch has another past.
            sure=not self.manifest["descent"],
            threads=self.manifest["machine"]["threads"],
        )
        if found is not None:
            minimal.write(found, path, shlex.join(["tumble", "run", minimal.FILE]))
            failure["minimal"] = minimal.FILE
            failure["smaller"] = found.text

    def _soften(self, failure: dict[str, Any]) -> None:
        """Tries to soften what came too near for the steps, and puts that before the other cures."""
        report = failure["report"]
        names = [system["name"] for system in self.scene["system"]]
        interval = 1.0 / self.scene["time"]["fps"] / self.scene["time"]["exchanges"]
        system = names.index(report["system"]) if report.get("system") in names else 0
        adaptive = bool(names) and self.scene["system"][system]["integrator"] in energy.ADAPTIVE
        step = interval if adaptive else float(report.get("step") or interval)
        if not energy.unsoftened(self.scene):
            return
        met = energy.encounters(Run(self.files.path), range(self.written - 1, self.written + 1), step)
        failure["near"] = [energy.told(one) for one in met]
        shortest = min((one.step or step for one in met), default=0.0)
        # No dearer than the other trials.
        if met and interval / shortest < 50.0 * interval / step + 20_000.0:
            sets = energy.changes(self.scene, met, system)
            cure = energy.attempt(self.world.scene, sets, self.written + 3)
            failure["cures"] = [cure, *failure["cures"]]

    def stop(self, status: str, message: str | None = None, report: Mapping[str, Any] | None = None) -> None:
        """Notes, as far as the disk allows, that the run ended early and why."""
        self.manifest["status"] = status
        if message is not None:
            self.manifest["failure"] = {"message": message, "report": report or {}, "frame": self.written, "cures": []}
        for write in (self.checkpoint, self._doubt_so_far, self._write_manifest):
            with suppress(ExportError, OSError):
                write()

    def close(self) -> None:
        for table in self.tables:
            table.close()

    def _write_manifest(self) -> None:
        begin = time.perf_counter()
        self.timings["total"] = self.total_before + begin - self.began
        write_json(self.files.manifest, self.manifest)
        end = time.perf_counter()
        self.update_due = end + max(MANIFEST_INTERVAL, 100 * (end - begin))


def _until(frame: int, files: RunFolder) -> list[list[str]]:
    """The rows of trials.csv up to a frame."""
    return [row for row in read_rows(files.trials, TRIALS) if int(row[-1]) <= frame]


def ledger_row(
    index: int, books: Mapping[str, Any], took: Mapping[str, measures.Cell], seconds: float | str, state: str
) -> list[measures.Cell]:
    """A row of ledger.csv; `took` has columns of what the frame took."""
    values: dict[str, measures.Cell] = {"frame": index, "seconds": seconds, "hash": state}
    values |= measures.cells(measures.LEDGER, books) | _NOTHING | dict(took)
    return [values[name] for name in LEDGER]


def describe(units: Mapping[str, Mapping[str, str]], *tables: Columns) -> dict[str, dict[str, Any]]:
    """Object -> column -> unit, shape and type. Where particles come and go, or a liquid's surface is another one in each
    frame, the first length is None."""
    described: dict[str, dict[str, Any]] = {}
    kept = tables[0]
    for place, columns in zip(("static", "frames"), tables, strict=True):
        for name, table in columns.items():
            for column, array in table.items():
                unit = units.get(name, {}).get(column, "1")
                anew = "triangles" in table and "triangles" not in kept.get(name, {})
                varies = place == "frames" and ("id" in table or anew)
                shape = (None, *array.shape[1:]) if varies else array.shape
                entry = {"unit": unit, "shape": shape, "dtype": array.dtype.name, "in": place}
                described.setdefault(name, {})[column] = entry
    return described


def tier(scene: Mapping[str, Any]) -> str:
    """How far the bits hold: "portable" everywhere, "native" where the instructions are the same, "machine" on this one alone,
    which goes for the sparse factorization of a library."""
    factored = any(s["integrator"] in IMPLICIT and s["solver"]["linear"] == "cholesky" for s in scene["system"])
    return "machine" if factored else str(scene["bits"])


def machine(threads: int | None) -> dict[str, Any]:
    return {
        "cpus": os.cpu_count(),
        "threads": threads,
        "platform": platform.platform(),
        "processor": platform.machine(),
        "instructions": _engine.instructions,
        "python": sys.version.split()[0],
        "numpy": np.__version__,
    }


def changed(old: Mapping[str, Any], new: Mapping[str, Any]) -> str | None:
    """The first difference between two resolved scenes that changes what is simulated or kept, in words."""

    def physical(scene: Mapping[str, Any]) -> dict[str, Any]:
        kept = {k: v for k, v in scene.items() if k not in ("title", "camera", "expect", "output", "time")}
        kept["time"] = {k: v for k, v in scene["time"].items() if k != "frames"}
        kept["output"] = {"columns": scene["output"]["columns"]}
        return kept

    return _difference("", physical(old), physical(new))


def _difference(path: str, old: Any, new: Any) -> str | None:
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        pairs = [(key, old.get(key), new.get(key)) for key in dict.fromkeys([*old, *new])]
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        pairs = [(str(i), a, b) for i, (a, b) in enumerate(zip(old, new, strict=True))]
    else:
        return None if old == new else f"{path[1:]} was {_short(old)}, is {_short(new)}"
    found = (_difference(f"{path}.{key}", a, b) for key, a, b in pairs)
    return next((f for f in found if f is not None), None)


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."
