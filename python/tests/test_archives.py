"""Bytes that are no frames and no checkpoints: refused in one line, or read; no more memory than the file gives reason for."""

import io
import multiprocessing
import random
import struct
import time
import tracemalloc
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from counts import FACTOR, note
from nursery import status
from runs import Tree
from test_kills import SCENES
from test_soak import MIXED

from tumble import ExportError, Scene, SceneError, StepError, World
from tumble.emitters import born
from tumble.folder import LEDGER, RunFolder, read_column, read_columns, read_rows, write_columns
from tumble.run import simulate

SLOWEST = 10.0
"""Seconds that a case may take; measured: below 0.2."""


def member(header: str, data: bytes = b"", version: int = 1) -> bytes:
    """An array, as a file: magic, header, numbers."""
    text = header.encode("latin1") + b"\n"
    return b"\x93NUMPY" + bytes([version, 0]) + struct.pack("<H" if version == 1 else "<I", len(text)) + text + data


def header(shape: str, descr: str = "'<f4'") -> str:
    return f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}"


def packed(data: bytes, compression: int = zipfile.ZIP_STORED) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", compression) as file:
        file.writestr("p/x.npy", data)
    return buffer.getvalue()


def archive(path: Path, data: bytes, compression: int = zipfile.ZIP_STORED) -> Path:
    path.write_bytes(packed(data, compression))
    return path


def refused(path: Path, read: Callable[[Path], object]) -> str:
    """Why a file is refused: in one line that is not long."""
    with pytest.raises(ExportError) as error:
        read(path)
    text = str(error.value)
    assert text.startswith(f"{path}: is damaged (") and text.endswith("; --resume computes again what is lost")
    assert len(text.splitlines()) == 1 and len(text) < len(str(path)) + 300
    return text


READERS: list[Callable[[Path], object]] = [read_columns, lambda path: read_column(path, "p", "x")]

CRAFTED = {
    "more than any machine has": member(header("(100000000000000,)"), b"1234"),
    "more than 64 bits count": member(header("(10000000000, 10000000000, 10000000000)"), b"1234"),
    "too short": member(header("(3,)"), b"12345678"),
    "too long": member(header("(1,)"), b"12345678"),
    "negative": member(header("(-1, -1)"), b"1234"),
    "no number": member(header("(True,)"), b"1234"),
    "no list": member(header("None"), b"1234"),
    "no end": member("{'descr': '<f4', 'shape': ('''"),
    "no header": member(""),
    "deep": member("-" * 9000 + "1"),
    "deeper": member("(" * 9000),
    "long": member(header("(" + "1, " * 30_000 + ")"), version=2),
    "objects": member(header("(1,)", "'|O'"), b"12345678"),
    "numbers of no length": member(header("(100000000000000,)", "'|V0'")),
    "letters": member(header("(2,)", "'<U1'"), b"a\0\0\0b\0\0\0"),
    "records": member(header("(1,)", "[('a', '<f4')]"), b"1234"),
    "of no type": member(header("(1,)", "'zz'"), b"1234"),
    "another version": member(header("(1,)"), b"1234")[:6] + b"\x09\x09" + member(header("(1,)"), b"1234")[8:],
    "no array": b"1234",
    "empty": b"",
}


@pytest.mark.parametrize("read", READERS, ids=["all", "one"])
@pytest.mark.parametrize("what", CRAFTED)
def test_crafted_arrays_are_refused(what: str, read: Callable[[Path], object], tmp_path: Path) -> None:
    path = archive(tmp_path / "000000.npz", CRAFTED[what])
    tracemalloc.start()
    try:
        refused(path, read)
        assert tracemalloc.get_traced_memory()[1] < 4 << 20
    finally:
        tracemalloc.stop()


def changed(path: Path, at: int, values: bytes) -> Path:
    data = bytearray(path.read_bytes())
    data[at : at + len(values)] = values
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("read", READERS, ids=["all", "one"])
def test_crafted_archives_are_refused(read: Callable[[Path], object], tmp_path: Path) -> None:
    path, good = tmp_path / "000000.npz", member(header("(2,)"), b"12345678")
    read(archive(path, good))
    central = path.read_bytes().index(b"PK\x01\x02")
    # Compression that nobody knows; encrypted; a version that is still to come.
    for place, values in ((10, b"\x55"), (8, b"\x01"), (6, b"\xff")):
        refused(changed(archive(path, good), central + place, values), read)
    # Sizes that are not there; streams that are none.
    for size in (0xFFFFFFF0, 1 << 20, 3):
        refused(changed(archive(path, good), central + 20, struct.pack("<II", size, size)), read)
    refused(changed(archive(path, good), path.read_bytes().index(b"1234"), b"\xff"), read)
    data = zlib.compress(bytes(range(256)) * 4)
    path.write_bytes(archive(path, data).read_bytes().replace(b"\x14\0\0\0\0\0", b"\x14\0\0\0\x08\0"))
    refused(path, read)
    # 64 MiB of zeros in 64 KiB.
    zeros = member(header("(16777216,)"), bytes(64 << 20))
    tracemalloc.start()
    try:
        refused(archive(path, zeros, zipfile.ZIP_DEFLATED), read)
        assert path.stat().st_size < 1 << 17 and tracemalloc.get_traced_memory()[1] < 4 << 20
    finally:
        tracemalloc.stop()


def test_what_is_missing_is_told_as_such(tmp_path: Path) -> None:
    for read in READERS:
        with pytest.raises(ExportError, match=r"gone\.npz: is missing; --resume"):
            read(tmp_path / "gone.npz")
    path = tmp_path / "000000.npz"
    write_columns(path, {"p": {"x": np.zeros((2, 3))}})
    assert read_column(path, "p", "y") is None and np.asarray(read_column(path, "p", "x")).shape == (2, 3)


def test_the_sum_is_over_all_of_a_large_frame(tmp_path: Path) -> None:
    path = tmp_path / "f.npz"
    numbers = np.arange(1 << 19, dtype=np.float64)
    write_columns(path, {"p": {"x": numbers}}, "large")
    np.testing.assert_array_equal(read_columns(path, "large")["p"]["x"], numbers)
    data = bytearray(path.read_bytes())
    data[-300] ^= 1
    path.write_bytes(data)
    with pytest.raises(ExportError, match="its bytes are not those that were written"):
        read_columns(path, "large")


def test_frames_that_cannot_be_opened_are_computed_again(spring: Tree, tmp_path: Path) -> None:
    """An archive of a version that is still to come is no error of the system, nor one of the archive."""
    run = simulate(spring | {"output": {"plot": False, "checkpoint": 2}}, tmp_path / "run", frames=6)
    path = run.folder / "frames/000005.npz"
    whole = path.read_bytes()
    changed(path, whole.index(b"PK\x01\x02") + 6, b"\xff")
    files = RunFolder(run.folder)
    assert files.intact(read_rows(files.ledger, LEDGER)) == 5
    assert simulate(spring, run.folder, frames=6, resume=True).manifest["resumed"] == 1
    assert path.read_bytes() == whole


@pytest.mark.parametrize("ids", [np.array(3), np.array([np.nan]), np.zeros((2, 2), "u4")])
def test_ids_that_count_nothing_are_damage(ids: np.ndarray[Any, Any], tmp_path: Path) -> None:
    run = simulate(SCENES["particles"], tmp_path / "run", frames=2)
    write_columns(run.folder / "frames/000001.npz", {"spray": run.frame(1)["spray"] | {"id": ids}}, run.mark(1))
    for read in (born, lambda run: run.frame(1)):
        with pytest.raises(ExportError, match=r"000001\.npz: is damaged"):
            read(run)


# At random


def byte(data: bytearray, dice: random.Random, end: int = 0) -> None:
    """Another byte somewhere, or before `end`."""
    data[dice.randrange(end or len(data))] = dice.choice([dice.randrange(256), 0, 1, 127, 128, 255])


def spoiled(whole: bytes, dice: random.Random, end: int) -> bytes:
    """A file with up to three bytes changed, half of the time before `end`; in places with a part lost or repeated."""
    data = bytearray(whole)
    for _ in range(dice.choice([1, 1, 2, 3])):
        byte(data, dice, end if dice.random() < 0.5 else 0)
    if dice.random() < 0.1:
        at = dice.randrange(len(data))
        data[at : at + dice.randrange(12)] = dice.choice([b"", data[at : at + 40], b"\0" * 8, b"\xff" * 8])
    return bytes(data[: dice.randrange(len(data) + 1)] if dice.random() < 0.05 else data)


def crafted(dice: random.Random) -> bytes:
    """An archive that is sound, around an array that may be none: what is in its header is believed as far as can be."""
    shape = [dice.choice(["0", "1", "2", "-1", "True", "None", "10**9", "99999999999999", "1.5", "()", "'''", "2"])]
    shape *= dice.choice([1, 1, 2, 33, 70])
    descr = dice.choice(
        ["'<f4'", "'<f4'", "'>f8'", "'|O'", "'<U0'", "'|V0'", "'?'", "[('a', '<f4', (9, 9))]", "1", "''"]
    )
    data = bytearray(member(header(f"({', '.join(shape)},)", descr), bytes(dice.choice([0, 4, 8, 16]))))
    for _ in range(dice.choice([0, 0, 1, 2])):
        byte(data, dice)
    return packed(bytes(data))


def overwrite(path: Path, data: bytes) -> None:
    """Without making the file anew, which takes longer than reading it."""
    with path.open("r+b") as file:
        file.write(data)
        file.truncate()


def looked_at(path: Path, length: int) -> str:
    """Outcome of reading an .npz."""
    end = "refused"
    for read in READERS:
        try:
            found = read(path)
        except ExportError as error:
            assert len(str(error).splitlines()) == 1 and len(str(error)) < len(str(path)) + 300
            continue
        tables: Any = found.values() if isinstance(found, dict) else [{"x": found}]
        arrays = [array for table in tables for array in table.values() if array is not None]
        assert all(array.dtype.kind in "biuf" and array.nbytes <= length for array in arrays)
        end = "read" if read is read_columns else end
    return end


def test_changed_frames_are_read_or_refused(tmp_path: Path) -> None:
    """A failure names the seed."""
    path = tmp_path / "000000.npz"
    numbers = np.arange(12, dtype="f4").reshape(4, 3)
    write_columns(path, {"p": {"x": numbers, "id": np.arange(4, dtype="u4")}, "air": {"density": np.zeros((4, 4))}})
    whole, ends, most, slowest, failures = path.read_bytes(), Counter[str](), 0.0, 0.0, []
    for seed in range(max(round(3000 * FACTOR), 1)):
        dice = random.Random(seed)
        data = crafted(dice) if seed % 4 == 0 else spoiled(whole, dice, 400)
        overwrite(path, data)
        if weighed := seed % 7 == 0:  # Weighing takes longer than reading.
            tracemalloc.start()
        begin = time.perf_counter()
        try:
            ends[looked_at(path, len(data))] += 1
        except Exception as error:
            failures.append(f"seed {seed}: {type(error).__name__}: {error}")
        slowest = max(slowest, time.perf_counter() - begin)
        if weighed:
            most = max(most, tracemalloc.get_traced_memory()[1] / 1024)
            tracemalloc.stop()
    cases = ends.total()
    print(f"\nframes, changed: {cases} cases, {dict(ends)}, slowest {slowest:.2f} s, memory at most {most:.0f} KiB")
    note("random cases", "frames, changed", cases=cases, **ends, slowest=f"{slowest:.2f} s")
    assert not failures, "\n".join(failures[:20])
    assert ends["read"] > cases / 50 and ends["refused"] > cases / 5
    # Memory of Python for archives, headers and errors, independent of length: measured, 200 KiB.
    assert most < 2 * len(whole) / 1024 + 512 and slowest < SLOWEST


STATES: dict[str, Tree] = {
    # With steps of their own, the adaptive ones would be as small as a speed of 1e30 m/s asks for.
    "particles": SCENES["particles"] | {"system": [{"integrator": "symplectic_euler", "substeps": 2}]},
    "sheets": SCENES["sheets"],
    "grids": SCENES["grids"],
    "all": MIXED,
}


def load_changed(tree: Tree, cases: int, folder: Path) -> tuple[Counter[str], float, int, int, list[str]]:
    """Loads checkpoints with changed bytes: what became of them, the slowest [s of the processor], bytes taken, bytes of the
    largest frame, failures."""
    world, path = World(Scene(tree), threads=1), folder / "state.safetensors"
    world.step(4)
    world.save(path)
    whole, begun = path.read_bytes(), world.hash()
    end_of_header = 8 + int.from_bytes(whole[:8], "little")
    ends, slowest, largest, failures = Counter[str](), 0.0, 0, []
    world.step()
    after, before = world.hash(), status("VmRSS:")
    for seed in range(cases):
        dice = random.Random(seed)
        overwrite(path, spoiled(whole, dice, end_of_header) if seed % 100 else whole)
        begin, was = time.process_time(), world.hash()
        end = "refused"
        try:
            world.load(path)
            end = "read"
            world.step()
        except StepError as error:
            end = "broke"
            assert str(error)
        except SceneError as error:
            if end == "read" or world.hash() != was or len(str(error).splitlines()) != 1:
                failures.append(f"seed {seed}: {error}")
        except Exception as error:
            failures.append(f"seed {seed}: {type(error).__name__}: {error}")
        # A failure rolls back to the loaded state, whatever it was.
        arrays = [a for table in world.frame.values() for a in table.values()]
        largest = max(largest, sum(a.nbytes for a in arrays))
        found = [a for a in arrays if a.dtype.kind == "f"]
        if end == "read" and not all(np.isfinite(array).all() for array in found):
            failures.append(f"seed {seed}: a frame that is not finite")
        # Nothing of what came before is left behind.
        if seed % 100 == 0 and world.hash() != after:
            failures.append(f"seed {seed}: the whole checkpoint of {begun} leads to another state")
        ends[end] += 1
        slowest = max(slowest, time.process_time() - begin)
    return ends, slowest, status("VmHWM:") - before, largest, failures


@pytest.mark.parametrize("kind", STATES)
def test_changed_checkpoints_are_loaded_or_refused(kind: str, tmp_path: Path) -> None:
    """A failure names the seed."""
    # In a process of its own, whose memory nothing else has taken.
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        work = pool.submit(load_changed, STATES[kind], max(round(500 * FACTOR), 1), tmp_path)
        ends, slowest, taken, largest, failures = work.result()
    length = (tmp_path / "state.safetensors").stat().st_size
    cases = ends.total()
    print(f"\ncheckpoints, {kind}: {cases} cases, {dict(ends)}, slowest {slowest:.2f} s, {taken / 2**20:.1f} MiB")
    note("random cases", f"checkpoints, {kind}", cases=cases, **ends, slowest=f"{slowest:.2f} s")
    assert not failures, "\n".join(failures[:20])
    assert ends["read"] > cases / 10 and ends["refused"] > cases / 10
    # A file of 60 KB at most, its parts, and the state that it becomes: measured, 1 MiB. One with a later time has
    # what emitters owe until then.
    assert taken < 2 * length + 4 * largest + (8 << 20) and slowest < SLOWEST
