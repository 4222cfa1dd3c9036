"""Disks that really are full, folders that really cannot be written, and clocks that jump: a clear error, and what was finished
stays readable. `test_disks.py` has the same with a system that only pretends."""

import ctypes
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import pytest
from conftest import Answer
from runs import OBJECT, Tree, assert_same
from test_kills import GAS

from tumble import ExportError, Run, Scene, SceneError, TumbleError, World
from tumble.run import simulate

Command = Callable[..., Answer]
SceneFile = Callable[..., Path]
PYTHON = [sys.executable, "-c", "from tumble.cli import main; main()"]

linux = pytest.mark.skipif(sys.platform != "linux", reason="the ways of another system")


def check(folder: Path, reference: Run) -> int:
    """All frames that are there can be read and are as in the reference; how many."""
    if not (folder / "run.json").is_file():
        return 0
    run = Run(folder)
    for i in range(run.n_frames):
        name = f"frames/{i:06}.npz"
        assert (folder / name).read_bytes() == (reference.folder / name).read_bytes()
    assert run.hashes == reference.hashes[: run.n_frames]
    return run.n_frames


# A disk of its own


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Callable[[int], Path]]:
    """Makes a disk of so many bytes, or another size of it."""
    place = tmp_path / "disk"
    place.mkdir()

    def mount(size: int) -> Path:
        again = "remount," if os.path.ismount(place) else ""
        command = ["mount", "-t", "tmpfs", "-o", f"{again}size={size}", "none", str(place)]
        if subprocess.run(command, capture_output=True, check=False).returncode != 0:
            pytest.skip("only root can mount a disk")
        return place

    yield mount
    if os.path.ismount(place):
        subprocess.run(["umount", "--lazy", str(place)], check=True)


@linux
def test_a_disk_that_is_full_at_any_moment(
    spring: Tree, tmp_path: Path, reference: Run, disk: Callable[[int], Path]
) -> None:
    whole = sum(-(-f.stat().st_size // 4096) * 4096 for f in reference.folder.rglob("*") if f.is_file())
    # From next to nothing to next to all, at a random place of each twelfth.
    sizes = random.Random(3)
    edges = [3 + i * (whole // 4096 - 7) // 12 for i in range(13)]
    frames = []
    for low, high in pairwise(edges):
        place = disk(4096 * sizes.randrange(low, high)) / "run"
        with pytest.raises((ExportError, SceneError), match="no space left on the disk"):
            simulate(spring, place)
        frames.append(check(place, reference))
        if frames[-1] > 1:
            assert Run(place).frame(-1)[OBJECT]["position"].shape == (2, 3)
        # Still full, it says so again and loses nothing that it cannot compute.
        with pytest.raises((ExportError, SceneError), match="no space left on the disk"):
            simulate(spring, place, resume=True)
        check(place, reference)
        disk(4 * whole)
        assert_same(simulate(spring, place, resume=True), reference)
        shutil.rmtree(place)
    assert min(frames) < 3 and max(frames) > 15, frames


@linux
def test_a_full_disk_on_the_command_line(
    spring: Tree, scene_file: SceneFile, disk: Callable[[int], Path], tumble: Command
) -> None:
    file = scene_file(GAS | {"time": {"fps": 24, "frames": 4}, "camera": {"resolution": [64, 64]}})
    place = disk(4_000_000)
    assert tumble("run", file, "--out", place / "run").code == 0
    (place / "ballast").write_bytes(b"")
    with pytest.raises(OSError), (place / "ballast").open("wb") as ballast:
        while True:
            ballast.write(bytes(4096))
            ballast.flush()
    before = {f: f.read_bytes() for f in place.rglob("*") if f.is_file() and f.name != "ballast"}
    for words in (
        ["export", "--usd"],
        ["export", "--vdb"],
        ["export", "--npz"],
        ["plot"],
        ["render", "--frame", "2"],
        ["render", "--film"],
    ):
        answer = tumble(words[0], place / "run", *words[1:])
        assert answer.code == 1 and "no space left on the disk" in answer.err, (words, answer)
        assert "Traceback" not in answer.err
    answer = tumble("run", file, "--out", place / "other")
    assert answer.code in (1, 2) and "no space left on the disk" in answer.err
    assert {f: f.read_bytes() for f in before} == before
    left = {f for f in (place / "run").rglob("*") if f.is_file()} - set(before)
    assert not [f for f in left if f.stat().st_size], left


# Limits and rights


@linux
@pytest.mark.parametrize("limit", [0, 1500, 5000, 8000])
def test_files_that_may_not_grow(spring: Tree, tmp_path: Path, reference: Run, limit: int) -> None:
    folder = tmp_path / "run"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
    try:
        with pytest.raises(ExportError, match="File too large; what was finished before is readable"):
            simulate(spring, folder)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    check(folder, reference)
    assert_same(simulate(spring, folder, resume=True), reference)


@pytest.fixture
def bound() -> Iterator[None]:
    """Rights hold for root, too: without the capabilities that pass over them."""
    if os.geteuid() != 0:
        yield
        return
    libc = ctypes.CDLL(None, use_errno=True)
    head = (ctypes.c_uint32 * 2)(0x2008_0522, 0)
    held = (ctypes.c_uint32 * 6)()
    assert libc.capget(head, held) == 0
    fewer = (ctypes.c_uint32 * 6)(*held)
    fewer[0] &= ~0b110  # The effective ones: CAP_DAC_OVERRIDE and CAP_DAC_READ_SEARCH.
    assert libc.capset(head, fewer) == 0
    yield
    assert libc.capset(head, held) == 0


@linux
def test_a_folder_that_may_only_be_read(spring: Tree, tmp_path: Path, reference: Run, bound: None) -> None:
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o555)
    for place in (closed, closed / "run"):
        with pytest.raises(SceneError, match=r"cannot be written \(Permission denied\); choose another one with --out"):
            simulate(spring, place)
    assert not list(closed.iterdir())
    # In the midst of a run.
    folder = tmp_path / "run"

    def close(done: int, total: int) -> None:
        if done == 12:
            for place in (folder / "frames", folder):
                place.chmod(0o555)

    with pytest.raises(ExportError, match=r"000013\.npz: this place cannot be written"):
        simulate(spring, folder, progress=close)
    assert check(folder, reference) == 13
    # It can be read, and a refusal changes nothing.
    with pytest.raises(TumbleError, match="cannot be written"):
        simulate(spring, folder, resume=True)
    assert check(folder, reference) == 13
    for place in (folder, folder / "frames"):
        place.chmod(0o755)
    assert_same(simulate(spring, folder, resume=True), reference)
    closed.chmod(0o755)


def test_a_folder_that_vanishes_on_the_command_line(spring: Tree, scene_file: SceneFile, tumble: Command) -> None:
    for again in (False, True):
        file = scene_file(spring)
        command = [*PYTHON, "run", str(file), "--frames", "1000000"]
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
            assert process.stderr is not None
            while "simulate" not in process.stderr.readline():
                assert process.poll() is None
            Path("out/scene").rename("elsewhere")
            if again:
                Path("out/scene").mkdir()  # Another one in its place.
            err = process.communicate(timeout=60)[1]
        assert process.returncode == 1 and "Traceback" not in err
        assert "error: out/scene/" in err and "the folder has vanished" in err
        moved = Run("elsewhere")
        assert moved.n_frames > 0 and moved.frame(-1)[OBJECT]["position"].shape == (2, 3)
        n = moved.n_frames + 5
        assert tumble("run", file, "--frames", n, "--out", "elsewhere", "--resume", "--no-plot").code == 0
        assert tumble("run", file, "--frames", n, "--out", "whole", "--force", "--no-plot").code == 0
        assert Run("elsewhere").hashes == Run("whole").hashes
        shutil.rmtree("elsewhere")
        shutil.rmtree("out", ignore_errors=True)


def test_ctrl_c_at_any_moment_loses_no_frame(spring: Tree, scene_file: SceneFile, tumble: Command) -> None:
    moments = random.Random(4)
    file = scene_file(spring)
    world = World(Scene(spring))
    hashes = [world.hash()]
    for _ in range(3):
        command = [*PYTHON, "run", str(file), "--frames", "100000", "--resume"]
        heed = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
        command[2] = heed + command[2]
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
            assert process.stderr is not None
            while "simulate" not in process.stderr.readline():
                assert process.poll() is None
            # The moment is what is varied; there is nothing to wait for.
            time.sleep(moments.uniform(0, 0.1))
            process.send_signal(signal.SIGINT)
            err = process.communicate(timeout=60)[1]
        assert process.returncode == 130 and "Traceback" not in err
        kept = Run("out/scene")
        assert f"{kept.n_frames} frame" in err and kept.status == "interrupted"
        while len(hashes) < kept.n_frames:
            world.step()
            hashes.append(world.hash())
        assert kept.hashes == hashes[: kept.n_frames]
        assert kept.frame(-1).keys() == world.frame.keys()


# Clocks


def test_clocks_that_jump_change_nothing(
    spring: Tree, tmp_path: Path, reference: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    jumps = random.Random(5)
    moment = 0.0

    def jump() -> float:
        nonlocal moment
        moment += jumps.choice([0.0, 1e-9, 3.0, 1e6, -1e6])
        return moment

    with monkeypatch.context() as patch:
        for clock in ("time", "perf_counter", "monotonic"):
            patch.setattr(time, clock, jump)
        run = simulate(spring, tmp_path / "run", frames=13)
        # Files from the future, from before all time, and all of one moment.
        for file in sorted(run.folder.rglob("*")):
            os.utime(file, times=(moment, jumps.choice([0.0, 1.0, 4e9])))
        resumed = simulate(spring, run.folder, resume=True)
    assert_same(resumed, reference)
    assert abs(run.ledger["seconds"]).max() > 1e5
