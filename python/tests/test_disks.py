"""Obstacles to a run: foreign folders, full disks, failing physics, damaged files."""

import errno
import shutil
from pathlib import Path
from typing import IO, Any

import numpy as np
import pytest
from runs import OBJECT, N, Tree, assert_same, half

from tumble import ExportError, Run, SceneError, StepError
from tumble.folder import read_rows
from tumble.run import simulate

# Folders in the way


def test_a_run_is_replaced_only_when_asked(spring: Tree, tmp_path: Path, reference: Run) -> None:
    folder = simulate(spring, tmp_path / "run", frames=14).folder
    (folder / "notes.txt").write_text("mine")
    (folder / "frames" / "notes.txt").write_text("mine")
    before = (folder / "run.json").read_bytes()
    with pytest.raises(SceneError, match=r"finished, 14 of 14 frames.*--resume.*--force.*--out"):
        simulate(spring, folder)
    assert (folder / "run.json").read_bytes() == before
    assert_same(simulate(spring, folder, overwrite=True), reference)
    assert (folder / "notes.txt").read_text() == (folder / "frames" / "notes.txt").read_text() == "mine"


def test_a_wrong_scene_leaves_the_old_run_alone(spring: Tree, tmp_path: Path) -> None:
    folder = simulate(spring, tmp_path / "run", frames=3).folder
    spring["particles"][0]["pin"] = ["vertex 7"]
    with pytest.raises(SceneError):
        simulate(spring, folder, overwrite=True)
    assert Run(folder).n_frames == 4


@pytest.mark.parametrize("how", [{}, {"overwrite": True}, {"resume": True}])
def test_a_folder_of_someone_else_is_left_alone(spring: Tree, tmp_path: Path, how: dict[str, bool]) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(SceneError, match=r"no run.*--out"):
        simulate(spring, tmp_path, **how)
    assert [f.name for f in tmp_path.iterdir()] == ["notes.txt"]


def test_an_empty_folder_will_do(spring: Tree, tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    assert simulate(spring, tmp_path / "run", frames=1).n_frames == 2


# Disks


class FullDisk:
    """A file on a disk that is full."""

    def __init__(self, file: IO[Any]) -> None:
        self.file = file

    def __enter__(self) -> "FullDisk":
        return self

    def __exit__(self, *_: object) -> None:
        self.file.close()

    def write(self, data: Any) -> int:
        self.file.write(data[: len(data) // 2])
        raise OSError(errno.ENOSPC, "No space left on device")

    def close(self) -> None:
        self.file.close()


def fill_disk(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """From the first opening of a file whose name contains `name` on, no file can be written."""
    full = False
    original = Path.open

    def open_(self: Path, mode: str = "r", *rest: Any, **named: Any) -> Any:
        nonlocal full
        file = original(self, mode, *rest, **named)
        full = full or name in self.name
        return FullDisk(file) if full and ("w" in mode or "a" in mode) else file

    monkeypatch.setattr(Path, "open", open_)


@pytest.mark.parametrize(("name", "readable"), [("000012.npz", 12), ("000020.npz", 20)])
def test_a_full_disk_is_a_clear_error_and_frames_stay(
    spring: Tree, tmp_path: Path, reference: Run, monkeypatch: pytest.MonkeyPatch, name: str, readable: int
) -> None:
    with monkeypatch.context() as patch:
        fill_disk(patch, name)
        with pytest.raises(ExportError, match=rf"{name}.*no space left.*--resume"):
            simulate(spring, tmp_path / "run")
    stopped = Run(tmp_path / "run")
    assert stopped.n_frames == readable
    assert stopped.hashes == reference.hashes[:readable]
    assert stopped.frame(-1)[OBJECT]["position"].shape == (2, 3)
    assert not list((tmp_path / "run").rglob("*.tmp"))
    assert_same(simulate(spring, tmp_path / "run", resume=True), reference)


def test_a_full_disk_in_the_ledger_is_survived(
    spring: Tree, tmp_path: Path, reference: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run_out(done: int, total: int) -> None:
        if done == 12:
            monkeypatch.setattr("tumble.folder.Table.add", add)

    def add(self: Any, rows: Any) -> None:
        self.file.write("12,0.5,1.")
        self.file.flush()
        monkeypatch.undo()
        raise ExportError("no space left")

    with pytest.raises(ExportError, match="no space left"):
        simulate(spring, tmp_path / "run", progress=run_out)
    assert (Run(tmp_path / "run").n_frames, Run(tmp_path / "run").status) == (13, "failed")
    assert_same(simulate(spring, tmp_path / "run", resume=True), reference)


def test_a_full_disk_at_a_checkpoint_is_a_clear_error(
    spring: Tree, tmp_path: Path, reference: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    original = Path.replace

    def replace(self: Path, target: Path) -> Path:
        if self.name == "000010.safetensors.tmp":
            raise OSError(errno.ENOSPC, "No space left on device")
        return original(self, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", replace)
        with pytest.raises(ExportError, match="no space left"):
            simulate(spring, tmp_path / "run")
    assert Run(tmp_path / "run").n_frames == 11
    assert_same(simulate(spring, tmp_path / "run", resume=True), reference)


def test_an_unwritable_folder_is_a_clear_error(spring: Tree, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def mkdir(self: Path, *_: Any, **__: Any) -> None:
        raise PermissionError(errno.EACCES, "Permission denied", str(self))

    monkeypatch.setattr(Path, "mkdir", mkdir)
    with pytest.raises(SceneError, match=r"cannot be written \(Permission denied\).*--out"):
        simulate(spring, tmp_path / "run")


def test_a_file_in_the_way_of_the_folder_is_a_clear_error(spring: Tree, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    with pytest.raises(SceneError, match=r"file where a folder should be.*--out"):
        simulate(spring, tmp_path / "file" / "run")
    with pytest.raises(SceneError, match=r"is a file.*--out"):
        simulate(spring, tmp_path / "file")


def test_a_folder_that_vanishes_is_a_clear_error(spring: Tree, tmp_path: Path) -> None:
    def vanish(done: int, total: int) -> None:
        if done == 5:
            shutil.rmtree(tmp_path / "run")

    with pytest.raises(ExportError, match="vanished"):
        simulate(spring, tmp_path / "run", progress=vanish)


# Physics that breaks


def test_a_failed_run_keeps_frames_report_and_cures(exploding: Tree, tmp_path: Path) -> None:
    with pytest.raises(StepError) as failure:
        simulate(exploding, tmp_path / "run")
    run = Run(tmp_path / "run")
    assert run.status == "failed"
    kept = run.manifest["failure"]
    assert kept["message"] == str(failure.value)
    assert kept["frame"] == run.n_frames - 1
    assert {key: kept["report"][key] for key in ("system", "integrator", "object")} == {
        "system": "soft",
        "integrator": "forward_euler",
        "object": OBJECT,
    }
    assert any(cure["survived"] for cure in kept["cures"])
    assert np.isfinite(run.frame(-1)[OBJECT]["position"]).all()


# Reading


def test_what_is_no_run_says_so(tmp_path: Path, reference: Run) -> None:
    with pytest.raises(SceneError, match=r"no such folder.*tumble run"):
        Run.open(tmp_path / "nothing")
    with pytest.raises(SceneError, match=r"no run\.json"):
        Run.open(tmp_path)
    half(reference.folder / "run.json")
    with pytest.raises(ExportError, match=r"run\.json: is damaged"):
        Run.open(reference.folder)
    (reference.folder / "run.json").write_text("[]")
    with pytest.raises(SceneError, match="not that of a run"):
        Run.open(reference.folder)
    (reference.folder / "run.json").write_text('{"format": 99, "scene": {}}')
    with pytest.raises(SceneError, match="format 99"):
        Run.open(reference.folder)


def test_frames_out_of_range_and_damaged_frames(reference: Run) -> None:
    for i in (N + 1, -N - 2):
        with pytest.raises(IndexError, match=f"{i} of a run with {N + 1}"):
            reference.frame(i)
    half(reference.folder / "frames/000004.npz")
    with pytest.raises(ExportError, match=r"000004\.npz: is damaged.*--resume"):
        reference.frame(4)
    (reference.folder / "frames/000005.npz").unlink()
    with pytest.raises(ExportError, match="is missing"):
        reference.frame(5)
    assert reference.frame(6)[OBJECT]["position"].shape == (2, 3)


def test_rows_that_are_not_whole_are_not_read(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    for text, rows in [
        ("a,b\n1,2\n3,4\n", 2),
        ("a,b\n1,2\n3,4", 1),
        ("a,b\n1,2\n3\n5,6\n", 2),
        ("a,b\n1,x\n3,4\n", 1),
        ("a,c\n1,2\n", 0),
        ("", 0),
    ]:
        path.write_text(text)
        assert len(read_rows(path, ["a", "b"])) == rows, text
    assert read_rows(tmp_path / "none.csv", ["a", "b"]) == []
