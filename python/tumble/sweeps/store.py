"""The folder of a sweep: a small file for each run that is done, and the table that is made of them.

    sweep.json   what was asked for, and how it ended        rows/KEY.json   a run that is done
    sweep.csv    a row for each run, in the order of the design               runs/KEY/   its run folder, where kept
    summary.csv  mean, spread and confidence over seeds      plots/, stills/, films/, sweep.html

A run's KEY is the hash of its content: the scene, what is overridden, the seed, the version. Whatever is there under a key
need not be computed again, whichever sweep computed it.
"""

import csv
import hashlib
import io
import json
import os
import shutil
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from tumble import _engine
from tumble._engine import ExportError
from tumble.folder import cell, plain, reason, refuse, write_json, write_whole, writing
from tumble.recorder import changed
from tumble.sweeps import task as tasks

FORMAT = 1
"""Version of the folder."""

_FILES = ("sweep.csv", "summary.csv", "effects.csv", "stills.png", "films.mp4", "sweep.html", tasks.TOKEN)
_FOLDERS = ("rows", "plots", "stills", "films", tasks.UNFINISHED, tasks.RUNS)

AGAIN = (tasks.DIED, tasks.MEMORY)
"""Ends that are not those of the scene: such runs are computed again by --resume."""


def scene_hash(scene: Mapping[str, Any]) -> str:
    """Of all words of a resolved scene that change what is simulated, but for the seed."""
    kept = {k: v for k, v in scene.items() if k not in ("title", "camera", "expect", "output", "seed")}
    return _hash(json.dumps(plain(kept), sort_keys=True))


def key(scene: str, overrides: Iterable[str], seed: int, version: str = _engine.version) -> str:
    """Of the content of a run: 16 hexadecimal digits; `scene` is the `scene_hash`."""
    return _hash(json.dumps([scene, sorted(overrides), seed, version]))


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


class Store:
    """Paths, rows and tables."""

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)
        self.manifest = self.folder / "sweep.json"
        self.table = self.folder / "sweep.csv"
        self.summary = self.folder / "summary.csv"
        self._rows = self.folder / "rows"

    # What is there

    def is_sweep(self) -> bool:
        return self.manifest.is_file()

    def is_free(self) -> bool:
        """Whether a new sweep can go here: nothing is here yet, but for what one leaves that is killed before its manifest."""
        try:
            there = [path.name for path in self.folder.iterdir()]
            if self._rows.is_dir() and not any(self._rows.iterdir()):
                there.remove(self._rows.name)
        except FileNotFoundError:
            return True
        except OSError as error:
            raise refuse(self.folder, reason(error)) from None
        return set(there) <= {".lock", "sweep.json.tmp"}

    def read_manifest(self) -> dict[str, Any]:
        """sweep.json. Raises ExportError if it is damaged, SceneError if it is of another format."""
        try:
            found = json.loads(self.manifest.read_bytes())
        except (OSError, ValueError) as error:
            raise ExportError(f"{self.manifest}: is damaged ({error}); sweep again with --force") from None
        if not isinstance(found, dict) or found.get("format") != FORMAT:
            raise refuse(self.folder, "sweep.json is of another format; sweep again with --force")
        return found

    def admit(self, scene: Mapping[str, Any], resume: bool, overwrite: bool) -> None:
        """Refuses a folder in which something else is, or a sweep that another one does not go on with. Raises SceneError."""
        if self.is_free():
            return
        if not self.is_sweep():
            raise refuse(self.folder, "holds files, but no sweep; choose another folder with --out")
        if overwrite:
            return
        manifest = self.read_manifest()
        if not resume:
            done, runs = len(self.keys()), manifest.get("runs")
            text = f"holds a sweep already ({manifest.get('status')}, {done} of {runs} runs)"
            raise refuse(
                self.folder,
                f"{text}; go on with --resume, replace it with --force, or choose another folder with --out",
            )
        if manifest.get("tumble") != _engine.version:
            text = f"was swept by tumble {manifest.get('tumble')}, and this is {_engine.version}: the bits could differ"
            raise refuse(self.folder, f"{text}; start again with --force, or choose another folder with --out")
        there, now = ({**plain(one), "seed": 0} for one in (manifest["scene"], scene))
        if (difference := changed(there, now)) is not None or there["time"] != now["time"]:
            text = difference or f"time.frames was {there['time']['frames']}, is {now['time']['frames']}"
            text = f"the scene has changed since the sweep was started: {text}"
            raise refuse(self.folder, f"{text}; start again with --force, or choose another folder with --out")

    def make(self) -> None:
        """Makes the folder. Raises SceneError."""
        try:
            self._rows.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise refuse(self.folder, reason(error)) from None

    def clear(self) -> None:
        """Deletes what a sweep writes; anything else stays."""
        with writing(self.folder):
            for name in _FOLDERS:
                if (path := self.folder / name).is_dir() and not path.is_symlink():
                    shutil.rmtree(path)
            for name in (*_FILES, self.manifest.name):
                (self.folder / name).unlink(missing_ok=True)

    # Rows

    def _row(self, key: str) -> Path:
        return self._rows / key[:2] / f"{key}.json"

    def keys(self) -> set[str]:
        """Of the runs that are done."""
        return {path.stem for path in self._rows.glob("??/*.json")}

    def read(self, key: str, measures: Sequence[str] = ()) -> dict[str, Any] | None:
        """The row of a run; None where there is none that can be read and has all these measures."""
        try:
            row = json.loads(self._row(key).read_bytes())
            row["values"] = {name: float(value) for name, value in row["values"].items()}
            whole = row["key"] == key and isinstance(row["status"], str) and set(measures) <= row["values"].keys()
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            return None
        return row if whole else None

    def add(self, row: Mapping[str, Any]) -> None:
        """Writes the row of a run, whole or not at all, and the measures of an earlier one of the same content beside its own.
        Raises ExportError."""
        path = self._row(row["key"])
        before = self.read(row["key"])
        if before is not None and before["hash"] == row["hash"]:
            row = {**row, "values": {**before["values"], **row["values"]}}
        with writing(path):
            path.parent.mkdir(exist_ok=True)
        write_whole(path, (json.dumps(plain(row), allow_nan=False) + "\n").encode())

    def runs(self, key: str) -> Path:
        """The run folder of a run."""
        return tasks.run_folder(self.folder, key)

    def forget_unfinished(self) -> None:
        with suppress(OSError):
            shutil.rmtree(self.folder / tasks.UNFINISHED)

    # Tables

    def write_manifest(self, manifest: Mapping[str, Any]) -> None:
        write_json(self.manifest, manifest)


def written(rows: Iterable[Sequence[Any]]) -> bytes:
    """Rows as a CSV file; numbers as they read to the same bits."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    for row in rows:
        writer.writerow(["" if x is None else x if isinstance(x, str) else cell(x) for x in row])
    return text.getvalue().encode()


def write_csv(path: Path, rows: Iterable[Sequence[Any]]) -> None:
    """Raises ExportError."""
    write_whole(path, written(rows))


def table_hash(head: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Of all that a table says but for the seconds that runs took: 16 hexadecimal digits."""
    k = list(head).index("seconds")
    return hashlib.sha256(written([*row[:k], *row[k + 1 :]] for row in [head, *rows])).hexdigest()[:16]
