"""Shared by the tests: small scenes, and the command line."""

import copy
import json
import os
import signal
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

if "PYTEST_XDIST_WORKER" in os.environ:
    # A worker keeps a core busy; threads of the engine would wait for those of the other workers.
    os.environ.setdefault("RAYON_NUM_THREADS", "1")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A shell that starts tests in the background has them and all that they start ignore Ctrl-C.
    signal.signal(signal.SIGINT, signal.default_int_handler)

from tumble import Run
from tumble.cli import main
from tumble.run import simulate

Tree = dict[str, Any]


@pytest.fixture
def spring() -> Tree:
    """A mass that hangs on a spring and starts with a push; 25 frames, a checkpoint every 10."""
    return {
        "version": 1,
        "time": {"fps": 24, "frames": 25},
        "particles": [
            {
                "name": "p",
                "position": [[0, 0, 1], [0, 0, 0.5]],
                "velocity": [[0, 0, 0], [0.5, 0, 0]],
                "pin": ["vertex 0"],
                "spring": [{"between": [0, 1], "stiffness": 100.0}],
            }
        ],
        "output": {"plot": False},
    }


@pytest.fixture
def reference(spring: Tree, tmp_path: Path) -> Run:
    """The run of `spring`, never stopped."""
    return simulate(spring, tmp_path / "reference")


@pytest.fixture
def sheet() -> Tree:
    """A small sheet that falls on a ball."""
    return {
        "version": 1,
        "time": {"fps": 24, "frames": 6},
        "sheet": [{"name": "sheet", "size": [1.0, 1.0], "resolution": [6, 6], "center": [0.0, 0.0, 0.35]}],
        "collider": [{"name": "ball", "shape": {"sphere": {"radius": 0.3}}}],
        "output": {"plot": False},
    }


@pytest.fixture
def exploding(spring: Tree) -> Tree:
    """Forward Euler on a stiff spring that starts stretched: breaks within a frame."""
    tree = copy.deepcopy(spring)
    tree["system"] = [{"name": "soft", "integrator": "forward_euler", "step": 0.004}]
    tree["particles"][0]["spring"] = [{"between": [0, 1], "stiffness": 1e6, "rest_length": 0.4}]
    return tree


@pytest.fixture
def scene_file(tmp_path: Path) -> Callable[..., Path]:
    """Writes a scene and returns its path: `scene_file(tree, "name.json")`."""

    def write(tree: Tree, name: str = "scene.json") -> Path:
        path = tmp_path / name
        path.write_text(json.dumps(tree))
        return path

    return write


@dataclass(frozen=True)
class Answer:
    """Output and exit code of a command."""

    code: int
    out: str
    err: str


@pytest.fixture
def tumble(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., Answer]:
    """Runs the command line in an empty folder: `tumble("run", "scene.json")`."""
    monkeypatch.chdir(tmp_path)

    def command(*arguments: object) -> Answer:
        with pytest.raises(SystemExit) as end:
            main([str(a) for a in arguments])
        captured = capsys.readouterr()
        code = end.value.code
        return Answer(code if isinstance(code, int) else 0, captured.out, captured.err)

    return command
