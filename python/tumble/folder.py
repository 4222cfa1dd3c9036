"""The files of a run folder, written so that a stop at any moment leaves what was finished readable.

Whole files are written under a temporary name and renamed; tables grow by whole lines, and a line that was cut off is
not read.
"""

import errno
import io
import json
import math
import os
import textwrap
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from tumble import measures
from tumble._engine import ExportError, SceneError, World
from tumble.interrupts import held

Columns = dict[str, dict[str, npt.NDArray[Any]]]
"""Object name -> column name -> array."""

FORMAT = 3
"""Version of the run folder."""

LEDGER = ["frame", *measures.OF_COLUMN, "seconds", "hash"]
"""Columns of ledger.csv, one row per frame: SI units, nan for what nothing measured; `seconds` is the time that computing the
frame took, `tried` counts its rows of trials.csv. They are read by name."""

TRIALS = ["time", "step", "error", "accepted", "frame"]
"""Columns of trials.csv, one row per step that an adaptive integrator tried on the way to `frame`, the first 65536 of each."""

_WHOLE = {
    column: measure.optional for column, measure in measures.OF_COLUMN.items() if measure.shape in ("whole", "trials")
}

COUNTS = {"frame", "accepted", *_WHOLE}
"""Columns of tables that hold whole numbers; those of `frame` in the ledger count its rows."""

STATIC = "static"
"""Header of the archive of constant columns."""

LOCK = ".lock"
"""Says who writes here, while somebody does."""

_WRITTEN = """
checkpoints/*.safetensors frames/*.npz ledger.csv trials.csv static.npz columns.json
film.mp4 .film.mp4.part energy.png ledger.png stills/*.png columns.npz
scene.usda blender.py usd/frame.*.usdc usd/manifest.usda usd/objects.usdc ply/*.ply
volumes/*.vdb slices/*.png
minimal.toml
run.json
"""
"""Files that a run writes and --force deletes, in this order: a stop on the way leaves frames that can be read, and
the manifest goes last, because a folder without it is not taken for a run."""

_FOLDERS = ("frames", "checkpoints", "stills", "usd", "ply", "volumes", "slices")
"""Subfolders of a run."""


class DamageError(ExportError):
    """A file of a run that is lost, or is not what was written."""


class RunFolder:
    """Paths of all files."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self.manifest = self.path / "run.json"
        self.static = self.path / "static.npz"
        self.columns = self.path / "columns.json"
        self.ledger = self.path / "ledger.csv"
        self.trials = self.path / "trials.csv"

    def frame(self, i: int) -> Path:
        return self.path / "frames" / f"{i:06}.npz"

    def checkpoint(self, i: int) -> Path:
        return self.path / "checkpoints" / f"{i:06}.safetensors"

    def _numbers(self, folder: str, ending: str) -> list[int]:
        files = (self.path / folder).glob(f"*{ending}")
        return sorted(int(f.stem) for f in files if f.stem.isascii() and f.stem.isdigit())

    def checkpoints(self) -> list[int]:
        """Frames of which there is a checkpoint."""
        return self._numbers("checkpoints", ".safetensors")

    def is_run(self) -> bool:
        return self.manifest.is_file()

    def is_free(self) -> bool:
        """Whether a new run can go here: nothing is here yet, but for what a run leaves that is killed before it has written
        its manifest, or after --force has deleted the one of another."""
        if not os.path.lexists(self.path):
            return True

        def nothing(file: Path) -> bool:
            if file.name in _FOLDERS and file.is_dir() and not file.is_symlink():
                return not any(file.iterdir())
            return file.name in (LOCK, self.manifest.name + ".tmp")

        return self.path.is_dir() and all(map(nothing, self.path.iterdir()))

    def make(self) -> None:
        for folder in ("frames", "checkpoints"):
            with writing(self.path / folder):
                (self.path / folder).mkdir(parents=True, exist_ok=True)

    def clear(self) -> None:
        """Deletes what a run writes; anything else stays."""
        with writing(self.path):
            for pattern in _WRITTEN.split():
                # The last frame first, so that no gap is left.
                for file in sorted([*self.path.glob(pattern), *self.path.glob(pattern + ".tmp")], reverse=True):
                    file.unlink()
            for folder in _FOLDERS:
                with suppress(OSError):
                    (self.path / folder).rmdir()

    def drop_after(self, frame: int) -> None:
        """Deletes the frames and checkpoints after a frame, the last one first: a stop on the way leaves no gap."""
        with writing(self.path):
            late = [self.frame(i) for i in reversed(self._numbers("frames", ".npz")) if i > frame]
            late += [self.checkpoint(i) for i in self.checkpoints() if i > frame]
            for file in [*late, *self.path.glob("frames/*.tmp"), *self.path.glob("checkpoints/*.tmp")]:
                file.unlink()

    def check(self, i: int, state: str) -> None:
        """Raises DamageError unless the file of this frame, which had this hash, is whole to the last bit; ExportError where it
        cannot be read."""
        # An archive that is half opened complains when it is collected.
        with held(), _opened(self.frame(i), marked(i, state), whole=True):
            pass

    def intact(self, rows: Sequence[Sequence[str]]) -> int:
        """How many frames of these rows of the ledger, counted from the start, are whole."""
        for i, row in enumerate(rows):
            try:
                self.check(i, row[-1])
            except DamageError:
                return i
        return len(rows)

    def tried(self, rows: Sequence[Sequence[str]]) -> list[list[str]]:
        """The rows of trials.csv. Raises ExportError where the rows of the ledger count others."""
        trials = read_rows(self.trials, TRIALS)
        found = Counter(int(row[-1]) for row in trials)
        column = LEDGER.index("tried")
        if (lost := next((i for i, row in enumerate(rows) if found[i] != int(row[column])), None)) is not None:
            text = f"is damaged (of frame {lost} it has {found[lost]} rows, and the ledger counts {rows[lost][column]})"
            raise DamageError(f"{self.trials}: {text}; simulate again with --force where they are needed")
        return trials


def refuse(path: Path, text: str) -> SceneError:
    """The error for a folder that does not fit."""
    error = SceneError(f"{path}: {text}")
    error.issues = [{"path": str(path), "line": None, "message": text}]
    return error


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turns the system's refusals into an ExportError that says what to do."""
    try:
        yield
    except OSError as error:
        raise _explain(path, error) from error


def _explain(path: Path, error: OSError) -> ExportError:
    return ExportError(f"{path}: {reason(error)}")


def reason(error: OSError) -> str:
    """Why something cannot be written, and what to do."""
    kept = "; what was finished before is readable"
    match error.errno:
        case errno.ENOSPC | errno.EDQUOT:
            text = f"no space left on the disk{kept}: free some, then continue with --resume"
        case errno.EACCES | errno.EPERM | errno.EROFS:
            text = f"this place cannot be written ({error.strerror}); choose another one with --out"
        case errno.ENAMETOOLONG | errno.ELOOP | errno.EINVAL:
            text = f"this location cannot hold a folder ({error.strerror}); choose another one with --out"
        case errno.ENOENT:
            text = "the folder has vanished, or cannot be made; choose another one with --out"
        case errno.ENOTDIR | errno.EEXIST:
            text = f"there is a file where a folder should be ({error.strerror}); choose another one with --out"
        case _:
            text = f"cannot be written: {error.strerror or error}{kept}"
    return text


def write_whole(path: Path, data: bytes | memoryview) -> None:
    """Writes a file that is there either completely or not at all."""
    temporary = path.with_name(path.name + ".tmp")
    with writing(path):
        try:
            with temporary.open("wb") as file:
                file.write(data)
            temporary.replace(path)
        except OSError:
            with suppress(OSError):
                temporary.unlink()
            raise


def share(source: Path, path: Path) -> None:
    """The same file at a second place, where the system can do that; else a copy. Files of runs are replaced, never changed, so
    that neither place notices what becomes of the other."""
    with writing(path):
        with suppress(FileNotFoundError):
            path.unlink()
        try:
            os.link(source, path)
        except OSError:
            try:
                data = source.read_bytes()
            except OSError as error:
                raise ExportError(f"{source}: cannot be read ({error.strerror})") from error
            write_whole(path, data)


def marked(frame: int, state: str) -> str:
    """Header of the archive of a frame."""
    return f"frame {frame}, state {state}"


def write_columns(path: Path, columns: Columns, mark: str = "") -> None:
    """Columns as an uncompressed .npz with keys `object/column`, and a mark by which it is known."""
    arrays = {f"{name}/{column}": array for name, table in columns.items() for column, array in table.items()}
    if any("\0" in key for key in arrays):
        raise ExportError(f"{path}: the name of an object contains a NUL, which ends names in archives; rename it")
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # type: ignore[arg-type]
    seal(buffer, mark)
    write_whole(path, buffer.getbuffer())


def seal(archive: io.BytesIO, mark: str) -> None:
    """Gives an archive without a comment one: its mark, and a sum over all bytes before."""
    start = f"{mark}, sum ".encode()
    with archive.getbuffer() as data:
        data[-2:] = (len(start) + 8).to_bytes(2, "little")
        total = zlib.crc32(data)
    archive.seek(0, io.SEEK_END)
    archive.write(start + f"{total:08x}".encode())


def read_columns(path: Path, mark: str = "") -> Columns:
    """The columns of an .npz, which must have the mark."""
    columns: Columns = {}
    with _opened(path, mark, whole=True) as archive:
        for key in archive.namelist():
            name, _, column = key.removesuffix(".npy").rpartition("/")
            columns.setdefault(name, {})[column] = _array(archive, key)
    return columns


def read_column(path: Path, name: str, column: str, mark: str = "") -> npt.NDArray[Any] | None:
    """One column of an .npz, without reading the others; None where it is not."""
    key = f"{name}/{column}.npy"
    with _opened(path, mark) as archive:
        return _array(archive, key) if key in archive.namelist() else None


@contextmanager
def _opened(path: Path, mark: str, whole: bool = False) -> Iterator[zipfile.ZipFile]:
    """An .npz for reading; whatever is wrong with it is a DamageError, but what the system refuses an ExportError. Where a mark
    is given it must have that, and be `whole` by its sum."""
    try:
        with path.open("rb") as file, zipfile.ZipFile(file) as archive:
            size = path.stat().st_size
            # Members of ours are not compressed: others could take any amount of memory.
            if sum(member.file_size for member in archive.infolist()) > size:
                raise ValueError("it contains less than it declares")
            if mark:
                found, _, total = archive.comment.decode(errors="replace").rpartition(", sum ")
                if found != mark:
                    raise ValueError(f"it should be {mark}")
                if whole and total != f"{_sum(file, size - len(archive.comment)):08x}":
                    raise ValueError("its bytes are not those that were written")
            yield archive
    except FileNotFoundError:
        raise DamageError(f"{path}: is missing; --resume computes again what is lost") from None
    except Exception as error:  # Neither zipfile nor NumPy says what it may raise.
        if isinstance(error, OSError) and error.errno not in _OF_DAMAGE:
            raise ExportError(f"{path}: cannot be read ({error.strerror or error})") from error
        why = textwrap.shorten(str(error), 200) or type(error).__name__
        raise DamageError(f"{path}: is damaged ({why}); --resume computes again what is lost") from error


_OF_DAMAGE = (None, errno.EINVAL, errno.EISDIR, errno.ENOTDIR)
"""Errors of the system for archives that point to missing or wrong positions."""


def _sum(file: IO[bytes], size: int) -> int:
    """Over the first bytes of a file."""
    total = 0
    file.seek(0)
    while size > 0 and (piece := file.read(min(size, 1 << 20))):
        total, size = zlib.crc32(piece, total), size - len(piece)
    return total


def _array(archive: zipfile.ZipFile, key: str) -> npt.NDArray[Any]:
    """An array of numbers, for which no room is made before it is known to be there."""
    with archive.open(key) as file:
        header = np.lib.format.read_array_header_1_0
        if np.lib.format.read_magic(file) != (1, 0):
            header = np.lib.format.read_array_header_2_0
        shape, _, dtype = header(file)
        if (
            dtype.kind not in "biuf"
            or dtype.itemsize * math.prod(shape) != archive.getinfo(key).file_size - file.tell()
        ):
            raise ValueError(f"{key!r} is no array of {shape} numbers")
    with archive.open(key) as file:  # After seeking back in a member, newer Pythons no longer check its sum.
        return np.asarray(np.lib.format.read_array(file))


def write_checkpoint(world: World, path: Path) -> None:
    temporary = path.with_name(path.name + ".tmp")
    with writing(path):
        try:
            world.save(temporary)
            temporary.replace(path)
        except ExportError as error:
            raise error.__cause__ if isinstance(error.__cause__, OSError) else error from None
        finally:
            with suppress(OSError):
                temporary.unlink()


def write_json(path: Path, tree: Mapping[str, Any]) -> None:
    write_whole(path, (json.dumps(plain(tree), indent=1, allow_nan=False, ensure_ascii=False) + "\n").encode())


def plain(value: Any) -> Any:
    """A value in the words of JSON; infinities and nan, for which it has none, become "inf", "-inf" and "nan"."""
    match value:
        case Mapping():
            return {str(key): plain(item) for key, item in value.items()}
        case bool() | int() | str() | None:
            return value
        case float():
            return value if math.isfinite(value) else str(value)
        case np.ndarray() | np.generic():
            return plain(value.tolist())
        case Iterable():
            return [plain(item) for item in value]
        case _:
            return str(value)


def cell(value: str | int | float) -> str:
    """A field of a table; reading a number gives the same bits."""
    if isinstance(value, str):
        return value
    return str(int(value)) if isinstance(value, bool | int | np.integer | np.bool) else repr(float(value))


def read_rows(path: Path, header: Sequence[str]) -> list[list[str]]:
    """The complete rows of a table. Only the ledger's `hash` is no number, and its frames count its rows: it ends at the first
    that is not whole. What an earlier version had no column for was not measured."""
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines(keepends=True)
    except OSError:
        return []
    found = lines[0].rstrip("\n").split(",") if lines else []
    if (
        not found
        or [found[0], found[-1]] != [header[0], header[-1]]
        or found != [name for name in header if name in found]
    ):
        return []
    rows: list[list[str]] = []
    for line in lines[1:]:
        fields = line.rstrip("\n").split(",")
        sound = line.endswith("\n") and len(fields) == len(found) and all(map(_fits, found, fields))
        if header[0] == "frame" and not (sound and fields[0] == str(len(rows))):
            break
        if sound:
            there = dict(zip(found, fields, strict=True))
            rows.append([there.get(name, "nan") for name in header] if found != header else fields)
    return rows


def _fits(column: str, text: str) -> bool:
    if _WHOLE.get(column) and text == "nan":
        return True
    if column in COUNTS:
        return text.isascii() and text.isdigit() and len(text) < 19
    try:
        float("0" if column == "hash" else text)
    except ValueError:
        return False
    return True


class Table:
    """A .csv file that grows by whole lines."""

    def __init__(self, path: Path, header: Sequence[str], rows: Iterable[Sequence[str]] = ()) -> None:
        """Starts with the rows given, as they were read."""
        self.path = path
        write_whole(path, "".join(",".join(line) + "\n" for line in [header, *rows]).encode())
        with writing(path):
            self.file: IO[str] = path.open("a", encoding="utf-8", newline="\n")

    def add(self, rows: Iterable[Iterable[str | int | float]]) -> None:
        with writing(self.path):
            self.file.write("".join(",".join(map(cell, row)) + "\n" for row in rows))
            self.file.flush()

    def close(self) -> None:
        with suppress(OSError):
            self.file.close()
