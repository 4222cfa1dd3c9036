"""Reads a run from its folder."""

import json
import os
import warnings
from collections.abc import Iterable
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble import _engine, notebook, tables
from tumble._engine import ExportError, SceneError
from tumble.arguments import whole
from tumble.folder import (
    FORMAT,
    LEDGER,
    STATIC,
    TRIALS,
    Columns,
    RunFolder,
    marked,
    read_columns,
    read_rows,
    refuse,
)
from tumble.looks import Looks
from tumble.looks import of as looks_of
from tumble.soundness import fault_of_arrays, fault_of_columns, fault_of_manifest
from tumble.tables import Stack


def read_manifest(files: RunFolder) -> dict[str, Any]:
    """run.json, if it can be understood."""
    try:
        manifest: dict[str, Any] = json.loads(files.manifest.read_bytes())
    except OSError as error:
        raise ExportError(f"{files.manifest}: cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise ExportError(f"{files.manifest}: is damaged ({_unread(error)}); simulate again with --force") from error
    if not isinstance(manifest, dict) or not isinstance(manifest.get("scene"), dict):
        raise refuse(files.path, "run.json is not that of a run")
    if manifest.get("format") != FORMAT:
        text = f"is a run of format {manifest.get('format')}, by tumble {manifest.get('tumble')}, and this one reads {FORMAT}"
        raise refuse(files.path, f"{text}: simulate again with --force, or read it with the other")
    if fault := fault_of_manifest(manifest):
        raise ExportError(f"{files.manifest}: is damaged ({fault}); simulate again with --force")
    return manifest


def _unread(error: Exception) -> str:
    """Why a file of JSON cannot be read, in words for people."""
    if isinstance(error, OSError):
        return str(error.strerror or error)
    line = f" from line {error.lineno} on" if isinstance(error, json.JSONDecodeError) else ""
    return f"it is no JSON{line}"


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

    @cached_property
    def looks(self) -> Looks:
        """How its objects are drawn. Raises SceneError where the words of its scene are those of another version."""
        # What is bounded and written out changes no picture.
        drawn = {key: value for key, value in self.scene.items() if key not in ("expect", "output")}
        try:
            return looks_of(drawn)
        except SceneError as error:
            made = self.manifest.get("tumble")
            if made == _engine.version:
                raise
            text = (
                f"a run of tumble {made}, whose scene this version cannot read ({error}); draw it with that version, or "
                "simulate it again"
            )
            raise refuse(self.folder, text) from None

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
            raise ExportError(f"{self._files.columns}: cannot be read ({_unread(error)})") from error
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

    def stack(self, thing: str, column: str) -> Stack:
        """A column of an object over all frames, shape (frames, ...), of which a frame is read when it is looked at:
        `run.stack("rope", "position")[:, -1]`. Raises ExportError for names that are not there, and for particles that come and
        go."""
        return tables.stack(self, thing, column)

    def to_pandas(self, thing: str | None = None, columns: Iterable[str] | None = None) -> Any:
        """A pandas.DataFrame of the ledger by frame and time, or of an object by frame, time and element, or id; units are in
        `attrs["units"]`. Raises ExportError, also where pandas is not installed."""
        return tables.to_pandas(self, thing, columns)

    def to_xarray(self, things: Iterable[str] | None = None, columns: Iterable[str] | None = None) -> Any:
        """An xarray.Dataset of the ledger (`energy`) and the columns of objects (`rope.position`) over time, with units. Raises
        ExportError, also where xarray is not installed."""
        return tables.to_xarray(self, things, columns)

    def _repr_html_(self) -> str:
        """What notebooks show."""
        return notebook.page(self)

    def mark(self, i: int) -> str:
        """Header of the file of a frame."""
        return marked(self._index(i), self._rows[i][-1])

    def time(self, i: int) -> float:
        """Simulated time of a frame [s]."""
        return float(self._rows[self._index(i)][LEDGER.index("time")])

    def _index(self, i: int) -> int:
        if not -self.n_frames <= whole(i, "frame") < self.n_frames:
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
