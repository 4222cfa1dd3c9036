"""Operations of tests on runs: kill, damage, compare."""

import io
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble import Run
from tumble.folder import seal
from tumble.run import simulate

Tree = dict[str, Any]

OBJECT = "p"
"""The object of the scene `spring`."""

N = 25
"""Its frames after the start."""


class Killed(Exception):
    """Stands for a kill: nothing of the run catches it."""


def kill_at(frame: int) -> Callable[[int, int], None]:
    def progress(done: int, total: int) -> None:
        if done == frame:
            raise Killed

    return progress


def killed(scene: Tree, folder: Path, frame: int) -> Path:
    with pytest.raises(Killed):
        simulate(scene, folder, progress=kill_at(frame))
    return folder


def assert_same(run: Run, reference: Run) -> None:
    """The same bits: states, frames, and books but for the clock on the wall."""
    assert run.hashes == reference.hashes
    assert run.manifest["hashes"] == reference.hashes
    for i in range(reference.n_frames):
        assert (run.folder / f"frames/{i:06}.npz").read_bytes() == (
            reference.folder / f"frames/{i:06}.npz"
        ).read_bytes()
    for name in reference.ledger:
        if name != "seconds":
            np.testing.assert_array_equal(run.ledger[name], reference.ledger[name], err_msg=name)
    assert run.status == reference.status == "finished"


def truncate(path: Path, size: int) -> None:
    path.write_bytes(path.read_bytes()[:size])


def repack(path: Path, arrays: Mapping[str, Any]) -> None:
    """Other arrays in an .npz, which goes on saying whose it is."""
    with zipfile.ZipFile(path) as archive:
        mark = archive.comment.decode().rpartition(", sum ")[0]
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    seal(buffer, mark)
    path.write_bytes(buffer.getvalue())


def half(path: Path) -> None:
    truncate(path, path.stat().st_size // 2)
