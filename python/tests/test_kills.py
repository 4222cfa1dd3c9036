"""Runs that are killed at any moment: every finished frame can be read, and they go on to the same bits."""

import multiprocessing
import random
import shutil
import signal
from collections import Counter
from pathlib import Path

import pytest
from counts import note
from runs import Killed, Tree, assert_same, killed

from tumble import Run, Scene, SceneError, World
from tumble.run import simulate

FRAMES = 40

SPRAY: Tree = {
    "version": 1,
    "time": {"fps": 24, "frames": FRAMES},
    "emitter": [
        {
            "name": "spray",
            "rate": 4000,
            "jitter": 1,
            "speed": 3,
            "cone": 20,
            "lifetime": 0.5,
            "lifetime_spread": 0.5,
            "from": {"disk": {"radius": 0.1}},
        }
    ],
    # An adaptive scheme, so that trials.csv grows, too.
    "system": [{"integrator": "dormand_prince", "adaptive": {"tolerance": 1e-4}}],
    "force": [{"kind": "drag", "rate": 0.3}],
    "collider": [{"name": "floor", "shape": {"floor": {"height": -0.2}}}],
    "output": {"plot": False, "checkpoint": 5},
}
SHEET: Tree = {
    "version": 1,
    "time": {"fps": 24, "frames": FRAMES},
    "system": [{"method": "position_based", "substeps": 8}],
    "sheet": [{"name": "sheet", "size": [1, 1], "resolution": [24, 24], "center": [0.02, 0.01, 0.35]}],
    "collider": [{"name": "ball", "shape": {"sphere": {"radius": 0.3}}}],
    "output": {"plot": False, "checkpoint": 5},
}
GAS: Tree = {
    "version": 1,
    "dimension": 2,
    "time": {"fps": 24, "frames": FRAMES},
    "gas": [
        {
            "name": "air",
            "box": {"size": [1, 1, 1], "resolution": 40},
            "smoke": {"weight": 0},
            "temperature": {"ambient": 300},
            "source": [
                {"shape": {"sphere": {"center": [0, 0, -0.3], "radius": 0.1}}, "density": 1, "temperature": 400}
            ],
        }
    ],
    "output": {"plot": False, "checkpoint": 5, "columns": ["density", "velocity_x", "velocity_z"]},
}
SCENES = {"particles": SPRAY, "sheets": SHEET, "grids": GAS}


def readable(folder: Path, reference: Run) -> str:
    """Checks that all that is there can be read and is as in the reference; says how far it came."""
    if not (folder / "run.json").is_file():
        return "before the manifest"
    run = Run(folder)
    for i in range(run.n_frames):
        name = f"frames/{i:06}.npz"
        assert (run.folder / name).read_bytes() == (reference.folder / name).read_bytes(), name
        assert run.frame(i).keys() == reference.frame(i).keys()
    assert run.hashes == reference.hashes[: run.n_frames]
    assert len(list(folder.glob("frames/*.npz"))) - run.n_frames in (0, 1), "the frame of the kill has no line yet"
    if run.n_frames > FRAMES:
        return "after the last frame"
    return "before the first checkpoint" if run.n_frames <= 5 else "between checkpoints"


def killed_often(kind: str, kills: int, seed: int, folder: Path) -> Counter[str]:
    """Kills runs until there were so many kills, each at a moment drawn by a seed, and goes on after each."""
    scene = SCENES[kind]
    reference = simulate(scene, folder / "reference", threads=1)
    took = reference.manifest["timings"]["total"]
    moments = random.Random(seed)
    # A new process each time, without the time that Python takes to load.
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["tumble.run"])
    where: Counter[str] = Counter()
    resumed = 0
    while where.total() < kills:
        place = folder / "run"
        process = context.Process(target=simulate, args=(scene, place), kwargs={"resume": True, "threads": 2})
        process.start()
        process.join(timeout=moments.uniform(0, took))
        process.kill()
        process.join()
        if process.exitcode == -signal.SIGKILL:
            where[readable(place, reference)] += 1
        else:
            assert process.exitcode == 0
            resumed += Run(place).manifest["resumed"] > 0
            assert_same(Run(place), reference)
            shutil.rmtree(place)
    assert_same(simulate(scene, place, resume=True), reference)
    note("kills", kind, cases=where.total(), **where)
    where["runs that went on to their end"] = resumed + 1
    return where


# Found by such kills.


@pytest.mark.parametrize("more", [{}, {"resume": True}, {"overwrite": True}])
def test_a_run_killed_before_its_manifest_is_in_nobodys_way(
    spring: Tree, tmp_path: Path, more: dict[str, bool]
) -> None:
    folder = tmp_path / "run"
    for name in ("frames", "checkpoints", "volumes"):
        (folder / name).mkdir(parents=True)
    (folder / ".lock").write_text("1")
    (folder / "run.json.tmp").write_text("{")
    assert simulate(spring, folder, frames=3, **more).n_frames == 4
    # Files that do not belong to a run are never taken over.
    other = tmp_path / "other"
    (other / "frames").mkdir(parents=True)
    (other / "frames" / "mine.txt").touch()
    with pytest.raises(SceneError, match="holds files, but no run"):
        simulate(spring, other, frames=3, **more)
    assert [f.name for f in other.rglob("*")] == ["frames", "mine.txt"]


def test_a_run_killed_while_it_goes_back_has_no_gap(
    spring: Tree, tmp_path: Path, reference: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = killed(spring, tmp_path / "run", 18)
    unlink = Path.unlink
    gone: list[str] = []

    def die(path: Path, missing_ok: bool = False) -> None:
        if path.suffix == ".npz":
            if len(gone) == 3:
                raise Killed
            gone.append(path.name)
        unlink(path, missing_ok)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", die)
        with pytest.raises(Killed):
            simulate(spring, folder, resume=True)
    assert len(gone) == 3
    readable(folder, reference)
    assert Run(folder).n_frames == 16
    assert_same(simulate(spring, folder, resume=True), reference)


def test_adaptive_steps_of_newborn_particles_go_on_to_the_same_bits(tmp_path: Path) -> None:
    whole = simulate(SPRAY, tmp_path / "whole", frames=9)
    stopped = killed({**SPRAY, "time": {"fps": 24, "frames": 9}}, tmp_path / "run", 7)
    resumed = simulate(SPRAY, stopped, frames=9, resume=True)
    assert_same(resumed, whole)
    assert resumed.manifest["resumed"] == 1 and resumed.manifest["stability"] == whole.manifest["stability"]


def test_an_estimate_of_stability_changes_no_state() -> None:
    one, other = World(Scene(SPRAY)), World(Scene(SPRAY))
    for world in (one, other):
        world.step(5)
    assert one.stability()
    for world in (one, other):
        world.step()
    assert one.hash() == other.hash()


# Kills at any moment.


@pytest.mark.parametrize("kind", SCENES)
def test_killed_runs_go_on_to_the_same_bits(kind: str, tmp_path: Path) -> None:
    print(kind, dict(killed_often(kind, 4, 1, tmp_path)))


@pytest.mark.long
@pytest.mark.parametrize("kind", SCENES)
def test_200_killed_runs_go_on_to_the_same_bits(kind: str, tmp_path: Path) -> None:
    where = killed_often(kind, 67, 2, tmp_path)
    print(kind, dict(where))
    assert where["between checkpoints"] > 10 and where["before the first checkpoint"] > 0
