"""Run folders that somebody has changed: they are read, or refused in words; no command ends in a traceback."""

import json
import random
import shutil
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from conftest import Answer
from counts import FACTOR, note
from runs import Tree, repack

from tumble import Run, TumbleError, World
from tumble.run import simulate

FILES = [
    "run.json",
    "run.json",
    "ledger.csv",
    "columns.json",
    "static.npz",
    "trials.csv",
    "frames/000003.npz",
    "checkpoints/000005.safetensors",
]
TOKENS = [
    b"",
    b"-",
    b"0",
    b"9" * 30,
    b"9" * 5000,
    b"1e999",
    b"nan",
    b"\n",
    b"\0",
    b'"',
    b"[",
    b"}",
    b"null",
    b",",
    b"\xff",
    b"../../evil",
]


def spoil_bytes(path: Path, dice: random.Random) -> None:
    data = bytearray(path.read_bytes())
    for _ in range(dice.choice([1, 1, 3])):
        at = dice.randrange(len(data) + 1)
        data[at : at + dice.randrange(12)] = dice.choice(TOKENS)
    path.write_bytes(data[: dice.randrange(len(data) + 1)] if dice.random() < 0.15 else data)


def spoil_json(path: Path, dice: random.Random) -> None:
    """Something else at a place of the tree."""
    tree = json.loads(path.read_bytes())
    holder: Any = tree
    while True:
        if not (keys := list(holder) if isinstance(holder, dict) else list(range(len(holder)))):
            return
        key = dice.choice(keys)
        if not isinstance(holder[key], dict | list) or not holder[key] or dice.random() < 0.35:
            break
        holder = holder[key]
    if dice.random() < 0.3:
        del holder[key]
    else:
        holder[key] = dice.choice([None, True, -1, 0, 10**30, 1.5, "", "x", "inf", [], {}, [1], {"a": 1}, "../../evil"])
    path.write_text(json.dumps(tree))


def spoil_arrays(path: Path, dice: random.Random) -> None:
    """An archive that is sound, with arrays of other shapes, types and names."""
    with np.load(path) as archive:
        arrays = {key: archive[key] for key in archive.files}
    key = dice.choice(list(arrays))
    array = arrays.pop(key)
    match dice.randrange(8):
        case 0:
            pass
        case 1:
            arrays[key] = array[:-1]
        case 2:
            arrays[key] = array.ravel()
        case 3:
            arrays[key] = array.astype(dice.choice(["complex64", "int8", "U3", "bool", "float64"]))
        case 4:
            arrays[key] = np.zeros((0,))
        case 5:
            arrays[key.replace("/", "")] = array
        case 6:
            arrays[key] = np.full(array.shape, np.nan) if array.dtype.kind == "f" else array + 100
        case _:
            arrays[key] = np.array(3.0)
    repack(path, arrays)


def spoil(folder: Path, dice: random.Random) -> str:
    name = dice.choice(FILES)
    path = folder / name
    means = [spoil_bytes]
    means += [spoil_json] * 3 if path.suffix == ".json" else [spoil_arrays] * 2 if path.suffix == ".npz" else []
    dice.choice(means)(path, dice)
    return name


def test_damaged_runs_are_read_or_refused(spring: Tree, tmp_path: Path, tumble: Callable[..., Answer]) -> None:
    """A failure names the seed."""
    spring["output"] = {"plot": False, "checkpoint": 5}
    spring["system"] = [{"integrator": "dormand_prince"}]
    whole = simulate(spring, tmp_path / "whole", frames=8).folder
    scene = tmp_path / "spring.json"
    scene.write_text(json.dumps(spring | {"time": {"fps": 24, "frames": 8}}))
    commands: list[Callable[[Path], Answer]] = [
        lambda run: tumble("diff", whole, run),
        lambda run: tumble("diff", run, whole),
        lambda run: tumble("plot", run, "--out", tmp_path / "plot.png"),
        lambda run: tumble("export", run, "--usd"),
        lambda run: tumble("export", run, "--npz"),
        lambda run: tumble("run", scene, "--out", run, "--resume"),
        lambda run: tumble("branch", f"{run}@5", "--frames", 1, "--out", tmp_path / "branch", "--force"),
    ]
    ends: Counter[str] = Counter()
    failures, begin = [], time.perf_counter()
    for seed in range(max(round(60 * FACTOR), 1)):
        dice = random.Random(seed)
        folder = tmp_path / "damaged"
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(whole, folder)
        name = spoil(folder, dice)
        try:
            try:
                run = Run(folder)
                _ = (
                    [run.frame(i) for i in range(run.n_frames)],
                    run.ledger,
                    run.hashes,
                    run.trials,
                    run.static,
                    run.columns,
                )
                World.restore(folder / "checkpoints/000005.safetensors")
                ends["read"] += 1
            except TumbleError as error:
                assert str(error)
                ends["refused"] += 1
            answer = dice.choice(commands)(folder)
            if answer.code not in (0, 1, 2) or (answer.code and not answer.err + answer.out):
                failures.append(f"seed {seed}, {name}: {answer}")
        except Exception as error:
            failures.append(f"seed {seed}, {name}: {type(error).__name__}: {error}")
    print(
        f"\nruns, damaged: {sum(ends.values())} cases, {ends['refused']} refused, {ends['read']} read,"
        f" {time.perf_counter() - begin:.0f} s"
    )
    note("random cases", "runs, damaged", cases=ends.total(), **ends)
    assert not failures, "\n".join(failures)
    assert not list(tmp_path.rglob("evil*"))
