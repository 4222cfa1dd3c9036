"""Sweeps that run: the same table whoever computes it, after kills, on full disks, after Ctrl-C."""

import csv
import io
import json
import math
import os
import pathlib
import random
import re
import signal
import subprocess
import sys
import tracemalloc
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Answer
from counts import note
from runs import Tree
from test_disks import fill_disk

from tumble import ExportError, Run, Scene, SceneError, sweep
from tumble.run import simulate
from tumble.sweeps import cluster, design, engines, measures, pool, study, task
from tumble.sweeps.result import Sweep
from tumble.sweeps.store import Store

Command = Callable[..., Answer]
SceneFile = Callable[..., Path]

FLOCK: Tree = {
    "version": 1,
    "title": "a flock",
    "seed": 3,
    "dimension": 2,
    "time": {"fps": 10, "frames": 40},
    "system": [{"method": "vicsek", "vicsek": {"side": 3.1, "radius": 1.0, "speed": 0.3, "noise": 1.0}}],
    "particles": [{"name": "p", "cloud": {"count": 40, "size": [3.1, 0, 3.1]}}],
    "expect": {"max_speed": 0.1},
    "output": {"plot": False},
}
"""Its expectation is broken: that of the scene is not that of its sweep."""

NOISE = {"system.0.vicsek.noise": [0.5, 2.0, 4.0], "particles.p.cloud.count": [40, 20]}
ORDER = ("mean probe p.velocity[order]@10..", "probe p.position[7].x@2s")
SEEDS = 4
RUNS = 6 * SEEDS


def swept(*words: Any, **more: Any) -> Sweep:
    """Without plots, which take longer than such runs."""
    return sweep(*words, **{"plots": False, **more})


LONG: Tree = {**FLOCK, "time": {"fps": 10, "frames": 1200}}
"""The same, long enough for a sweep of it to be stopped on its way, however busy the machine is."""


def flock(folder: Path, scene: Tree = FLOCK, **more: Any) -> Sweep:
    return swept(scene, NOISE, ORDER, folder, seeds=SEEDS, **more)


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Sweep:
    """By one worker, never stopped."""
    return flock(tmp_path_factory.mktemp("sweeps") / "reference", workers=1, plots=True)


@pytest.fixture(scope="module")
def long_reference(tmp_path_factory: pytest.TempPathFactory) -> Sweep:
    return flock(tmp_path_factory.mktemp("sweeps") / "long", LONG)


@pytest.fixture(scope="module")
def scheduler() -> Iterator[Any]:
    """A real cluster of two workers."""
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50, env={"RAYON_NUM_THREADS": "1"}
    ) as local:
        yield local


@dataclass
class Killer:
    """Kills workers after some answers."""

    after: list[int]
    """Counts of answers after which one is killed."""
    kill: Callable[[], None]
    seen: int = 0
    kills: int = 0
    progress: list[study.Progress] = field(default_factory=list)

    def __call__(self, at: study.Progress) -> None:
        self.progress.append(at)
        self.seen += 1
        if self.seen in self.after:
            self.kill()
            self.kills += 1


@pytest.fixture
def pools(monkeypatch: pytest.MonkeyPatch) -> list[pool.Pool]:
    """Every pool that is made."""
    made: list[pool.Pool] = []

    class Seen(pool.Pool):
        def __init__(self, *words: Any) -> None:
            super().__init__(*words)
            made.append(self)

    monkeypatch.setattr(engines, "Pool", Seen)
    return made


def kill_one(of: pool.Pool) -> None:
    with of._change:
        alive = list(of._alive)
    if alive:
        alive[0].process.send_signal(signal.SIGKILL)


# Rows and tables


def test_every_run_is_that_of_the_scene_alone(reference: Sweep, tmp_path: Path) -> None:
    assert len(reference) == reference.computed == RUNS and not reference.failed
    for k in (0, RUNS - 1):
        row = reference.rows[k]
        sets = [*(f"{path}={value}" for path, value in row.parameters.items()), f"seed={row.seed}"]
        tree = {key: value for key, value in FLOCK.items() if key != "expect"}
        run = simulate(Scene(tree).replace(*sets), tmp_path / str(k))
        assert run.hashes[-1] == row.hash and row.frame == 40
        assert run.frame(20)["p"]["position"][7, 0] == np.float32(row.values[ORDER[1]])
    assert len({row.hash for row in reference.rows}) == RUNS
    assert [row.seed for row in reference.rows[:5]] == [3, 4, 5, 6, 3]


def test_the_folder_holds_tables_plots_and_a_page(reference: Sweep) -> None:
    folder = reference.folder
    with (folder / "sweep.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == reference.head and len(rows) == RUNS
    assert [float(r[ORDER[0]]) for r in rows] == [row.values[ORDER[0]] for row in reference.rows]
    assert {r["version"] for r in rows} == {__import__("tumble").__version__}
    manifest = json.loads((folder / "sweep.json").read_text())
    assert manifest["hash"] == reference.hash and manifest["status"] == "finished"
    assert manifest["ends"] == {"finished": RUNS} and manifest["seeds"] == [3, 4, 5, 6]
    with (folder / "summary.csv").open(newline="") as file:
        summary = list(csv.DictReader(file))
    assert len(summary) == 12
    for line in summary:
        own = [
            row.values[line["measure"]]
            for row in reference.rows
            if all(row.parameters[path] == line[path] for path in NOISE)
        ]
        assert len(own) == SEEDS
        assert float(line["mean"]) == pytest.approx(np.mean(own)) and float(line["std"]) == pytest.approx(
            np.std(own, ddof=1)
        )
        assert (
            float(line["min"]) <= float(line["low"]) <= float(line["mean"]) <= float(line["high"]) <= float(line["max"])
        )
    page = (folder / "sweep.html").read_text()
    pictures = re.findall(r'<img src="([^"]+)"', page)
    assert len(pictures) == 6 and all((folder / name).is_file() for name in pictures)
    # Noise takes order away.
    means = [reference.spreads[p, ORDER[0]].mean for p in (0, 2, 4)]
    assert means[0] > 0.95 > means[1] > 0.7 > 0.6 > means[2]
    assert not {"token", "unfinished", ".lock"} & {path.name for path in folder.iterdir()}


def test_tables_for_python(reference: Sweep, monkeypatch: pytest.MonkeyPatch) -> None:
    table = reference.table
    assert table["system.0.vicsek.noise"].tolist()[:5] == [0.5] * 5 and table.attrs["units"][ORDER[1]] == "m"
    assert reference.column(ORDER[1]).tolist() == table[ORDER[1]].tolist()
    monkeypatch.setitem(sys.modules, "pandas", None)
    assert reference.table == reference.records() and reference.table[0]["seed"] == 3


def test_rows_of_many_runs_take_little_memory(tmp_path: Path) -> None:
    words = study.prepared(FLOCK, NOISE, ORDER, 500)
    store = Store(tmp_path / "s")
    store.make()
    for i in range(words.runs):
        one = words.task(i, False)
        store.add(task.Answer(one.key, "finished", frame=40, hash=one.key, values=dict.fromkeys(ORDER, float(i))).row())
    tracemalloc.start()
    try:
        found = study.collected(words, store)
        # Not the table of all names in this process, which grows now and then.
        names = tracemalloc.Filter(False, pathlib.__file__)
        size = sum(trace.size for trace in tracemalloc.take_snapshot().filter_traces([names]).traces)
    finally:
        tracemalloc.stop()
    assert len(found) == 3000 and found.rows[-1].values[ORDER[0]] == 2999.0
    # Measured 620.
    assert 200 < size / 3000 < 1000


# Whoever computes


def test_two_workers_of_which_two_are_killed_make_the_same_table(
    reference: Sweep, tmp_path: Path, pools: list[pool.Pool]
) -> None:
    killer = Killer([4, 11], lambda: kill_one(pools[0]))
    found = flock(tmp_path / "s", workers=2, progress=killer)
    assert killer.kills == 2 and pools[0].deaths >= 1
    assert found.hash == reference.hash and found.computed == RUNS
    assert [at.done for at in killer.progress] == list(range(RUNS + 1))
    assert max(at.running for at in killer.progress) == 2


def test_a_cluster_with_kills_makes_the_same_table(reference: Sweep, tmp_path: Path, scheduler: Any) -> None:
    def kill() -> None:
        os.kill(next(iter(processes.values())), signal.SIGKILL)
        killed.append(1)

    killed: list[int] = []
    distributed = pytest.importorskip("distributed")
    with distributed.Client(scheduler, set_as_default=False) as client:
        client.wait_for_workers(2)
        processes = client.run(os.getpid)
        found = flock(tmp_path / "s", on=scheduler.scheduler_address, progress=Killer([3], kill))
    assert killed == [1]
    assert found.hash == reference.hash and found.computed == RUNS and found.manifest["transferred"] == 0


def test_a_cluster_without_a_shared_folder_sends_archives(
    tmp_path: Path, scheduler: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = swept(FLOCK, {"time.frames": [3, 5]}, ORDER[0].replace("@10..", ""), tmp_path / "here", keep=True)
    # The workers look for another file, and see no folder of this sweep.
    monkeypatch.setattr(task, "TOKEN", "elsewhere")
    words: dict[str, Any] = {"keep": True, "on": scheduler.scheduler_address}
    far = swept(FLOCK, {"time.frames": [3, 5]}, ORDER[0].replace("@10..", ""), tmp_path / "far", **words)
    assert far.hash == here.hash
    size = 0
    for row in far.rows:
        one, other = (Run(Store(found.folder).runs(row.key)) for found in (here, far))
        assert one.hashes == other.hashes and len(one.hashes) == row.frame + 1
        size += sum(path.stat().st_size for path in other.folder.rglob("*") if path.is_file())
    assert size < far.manifest["transferred"] < 1.5 * size and here.manifest["transferred"] == 0


@pytest.mark.long
@pytest.mark.parametrize("on", ["cores", "dask"])
def test_eight_workers_and_twenty_kills_make_the_same_table(
    on: str, tmp_path: Path, pools: list[pool.Pool], monkeypatch: pytest.MonkeyPatch
) -> None:
    seeds, moments = 20, random.Random(8)
    whole = swept(FLOCK, NOISE, ORDER, tmp_path / "whole", seeds=seeds, workers=1)
    made: list[Any] = []
    original = cluster.Cluster

    def seen(client: Any, context: Any) -> Any:
        made.append(client)
        return original(client, context)

    monkeypatch.setattr(cluster, "Cluster", seen)

    def kill() -> None:
        if on == "cores":
            kill_one(pools[-1])
        elif there := list(made[0].run(os.getpid, on_error="ignore").values()):
            os.kill(moments.choice(there), signal.SIGKILL)

    killer = Killer(sorted(moments.sample(range(2, 6 * seeds - 10), 20)), kill)
    found = swept(FLOCK, NOISE, ORDER, tmp_path / "s", seeds=seeds, on=on, workers=8, progress=killer)
    note("kills of a sweep", on, cases=killer.kills)
    assert killer.kills == 20 and found.hash == whole.hash and found.computed == 6 * seeds


# Runs that fail


@pytest.fixture
def stiff(spring: Tree) -> Tree:
    spring["system"] = [{"integrator": "forward_euler", "step": 0.004}]
    spring["particles"][0]["spring"][0]["rest_length"] = 0.4
    return spring


def test_a_run_that_explodes_is_a_row(stiff: Tree, tmp_path: Path) -> None:
    key = "particles.p.spring.0.stiffness"
    names = ("ledger.energy@last", "stability.step", "max ledger.speed@..3")
    found = swept(
        stiff, {key: [100.0, 1e6], "particles.p.pin": ['["vertex 0"]', '["vertex 7"]']}, names, tmp_path / "s"
    )
    assert [row.status for row in found.rows] == ["finished", "invalid", "exploded", "invalid"]
    good, odd, bad = found.rows[:3]
    assert np.isfinite(list(good.values.values())).all()
    # What was seen until then is measured, and nothing else.
    assert bad.frame == 0 and np.isnan(bad.values["ledger.energy@last"]) and np.isnan(bad.values[names[2]])
    assert bad.values["stability.step"] == pytest.approx(1 / 24 / 11)  # The exchange interval in whole steps.
    assert bad.reason.startswith("energy exploded") and "\n" not in bad.reason
    assert bad.report["integrator"] == "forward_euler" and bad.report["object"] == "p"
    assert "vertex 7" in odd.reason
    assert found.manifest["ends"] == {"finished": 1, "invalid": 2, "exploded": 1}
    assert "energy exploded" in (tmp_path / "s" / "sweep.html").read_text()


def test_kept_runs_are_run_folders_with_the_same_numbers(stiff: Tree, tmp_path: Path) -> None:
    words: tuple[Any, ...] = (
        {"particles.p.spring.0.stiffness": [100.0, 1e6]},
        ("max ledger.energy", "sum ledger.steps"),
    )
    kept, plain = (swept(stiff, *words, tmp_path / str(k), keep=k) for k in (True, False))
    assert kept.hash == plain.hash
    good, bad = (Run(Store(kept.folder).runs(row.key)) for row in kept.rows)
    assert good.status == "finished" and good.ledger["energy"].max() == kept.rows[0].values["max ledger.energy"]
    assert good.ledger["steps"].sum() == kept.rows[0].values["sum ledger.steps"] > 100
    assert bad.status == "failed" and bad.manifest["failure"]["report"]["kind"] == "exploded"
    assert not (plain.folder / "runs").exists()
    # Kept runs that are missing are computed again, others are not.
    again = swept(stiff, *words, plain.folder, keep=True, resume=True)
    assert again.computed == 2 and again.hash == kept.hash
    assert swept(stiff, *words, plain.folder, keep=True, resume=True).computed == 0


def test_a_worker_that_dies_by_itself_is_one_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = pool.Worker.ask
    asked: dict[str, int] = {}

    def die(self: pool.Worker, one: task.Task) -> task.Answer:
        if "particles.p.cloud.count=20" in one.overrides:
            asked[one.key] = asked.get(one.key, 0) + 1
            self.process.send_signal(how)
        return made(self, one)

    monkeypatch.setattr(pool.Worker, "ask", die)
    for how, tries, words in ((signal.SIGKILL, 6, "signal 9, SIGKILL"), (signal.SIGABRT, 2, "signal 6, SIGABRT")):
        asked.clear()
        found = swept(FLOCK, {"particles.p.cloud.count": [40, 20, 30]}, folder=tmp_path / how.name, workers=2)
        assert [row.status for row in found.rows] == ["finished", "died", "finished"]
        assert list(asked.values()) == [tries] and words in found.rows[1].reason
    monkeypatch.undo()
    # That was no fault of the scene: such runs are tried again.
    again = swept(FLOCK, {"particles.p.cloud.count": [40, 20, 30]}, folder=tmp_path / "SIGABRT", resume=True)
    assert again.computed == 1 and not again.failed


def test_a_run_without_memory_is_a_row_with_the_number(tmp_path: Path) -> None:
    tree = FLOCK | {
        "time": {"fps": 10, "frames": 1},
        "dimension": 3,
        "system": [],
        "particles": [{"name": "p", "cloud": {"count": 40, "size": [9, 9, 9]}}],
    }
    found = swept(tree, {"particles.p.cloud.count": [40, 4_000_000]}, folder=tmp_path / "s", memory=0.3e9, workers=1)
    assert found.rows[0].status == "finished"
    assert found.rows[1].status == "out of memory"
    assert re.fullmatch(r"memory allocation of \d{7,9} bytes failed", found.rows[1].reason)


def test_a_worker_that_cannot_start_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pool.sys, "executable", str(tmp_path / "nothing"))
    with pytest.raises(ExportError, match="a worker of the sweep did not start"):
        flock(tmp_path / "s")


def test_memory_that_is_too_little_for_a_worker_is_told(tmp_path: Path) -> None:
    with pytest.raises(ExportError, match=r"a worker of the sweep did not start .*; --memory 0\.01 may be too little"):
        flock(tmp_path / "s", memory=0.01e9)


# Stops


def stopped(
    how: signal.Signals, folder: Path, scene_file: SceneFile
) -> tuple[subprocess.Popen[str], str, dict[Path, int]]:
    """A sweep that gets a signal after three runs: what it said, and which rows it left, with their times."""
    words = ["sweep", str(scene_file(LONG)), "--no-plots", "--seeds", str(SEEDS), "--out", str(folder)]
    words += ["--vary", "system.0.vicsek.noise=0.5,2.0,4.0", "--vary", "particles.p.cloud.count=40,20"]
    words += ["--workers", "2", *(word for name in ORDER for word in ("--measure", name))]
    pipes: dict[str, Any] = {"stderr": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    process = subprocess.Popen([sys.executable, "-m", "tumble", *words], start_new_session=True, **pipes)
    assert process.stderr is not None
    for line in process.stderr:
        match = re.match(r"sweep +([0-9]+) /", line)
        if match and int(match[1]) >= 3:
            # As a terminal sends Ctrl-C: to workers, too.
            os.killpg(process.pid, how) if how == signal.SIGINT else process.send_signal(how)
            break
    _, err = process.communicate()
    return process, err, {path: path.stat().st_mtime_ns for path in folder.glob("rows/*/*.json")}


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.long)])
def test_a_sweep_that_is_stopped_goes_on(
    how: signal.Signals, long_reference: Sweep, tmp_path: Path, scene_file: SceneFile
) -> None:
    folder = tmp_path / "s"
    process, err, done = stopped(how, folder, scene_file)
    assert 3 <= len(done) < RUNS
    if how == signal.SIGKILL:
        assert process.returncode == -how
        (folder / "rows" / "00").mkdir(exist_ok=True)
        (folder / "rows" / "00" / "half.json.tmp").write_text("{")
    else:
        assert process.returncode == 128 + how
        assert f"{len(done)} runs in {folder} can be read" in err and "--resume" in err and "Traceback" not in err
        assert json.loads((folder / "sweep.json").read_text())["status"] == "interrupted"
        assert len((folder / "sweep.csv").read_text().splitlines()) == len(done) + 1
    with pytest.raises(SceneError, match=rf"holds a sweep already.*{len(done)} of {RUNS} runs.*--resume.*--force"):
        flock(folder, LONG)
    found = flock(folder, LONG, resume=True)
    assert found.computed == RUNS - len(done) and found.hash == long_reference.hash
    assert all(path.stat().st_mtime_ns == when for path, when in done.items())
    assert flock(folder, LONG, resume=True).computed == 0


def test_a_sweep_grows_by_values_seeds_and_measures(reference: Sweep, tmp_path: Path) -> None:
    folder = tmp_path / "s"
    key = "system.0.vicsek.noise"
    few = swept(FLOCK, {key: [0.5]}, ORDER[0], folder, seeds=2)
    more = swept(FLOCK, {key: [0.5, 2.0]}, ORDER[0], folder, seeds=3, resume=True)
    assert (few.computed, more.computed) == (2, 4)
    assert [row.values for row in more.rows[:2]] == [row.values for row in few.rows]
    # Another measure needs the runs again; what was measured stays.
    other = swept(FLOCK, {key: [0.5, 2.0]}, ORDER[1], folder, seeds=3, resume=True)
    assert other.computed == 6
    assert swept(FLOCK, {key: [0.5, 2.0]}, ORDER, folder, seeds=3, resume=True).computed == 0
    with pytest.raises(SceneError, match=r"the scene has changed.*dimension|radius was 1\.0, is 0\.5.*--force"):
        changed = Scene(FLOCK).replace("system.0.vicsek.radius=0.5")
        swept(changed, {key: [0.5]}, ORDER[0], folder, resume=True)
    with pytest.raises(SceneError, match=r"time\.frames was 40, is 41"):
        swept(Scene(FLOCK).replace("time.frames=41"), {key: [0.5]}, ORDER[0], folder, resume=True)


def test_points_that_are_the_same_are_computed_once(spring: Tree, tmp_path: Path) -> None:
    pytest.importorskip("scipy")
    seen: list[study.Progress] = []
    drawn = design.latin({"system.0.substeps": (1, 2)}, 8)
    found = swept(spring, drawn, folder=tmp_path / "s", keep=True, progress=seen.append)
    assert len(found) == 8 and found.computed == 2 == len(list((tmp_path / "s" / "runs").iterdir()))
    assert (seen[-1].done, seen[-1].total) == (8, 8) and not found.failed


def test_a_folder_of_someone_else_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    for how in ({}, {"resume": True}, {"overwrite": True}):
        with pytest.raises(SceneError, match=r"holds files, but no sweep.*--out"):
            flock(tmp_path, **how)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]
    folder = swept(FLOCK, {}, ORDER[0], tmp_path / "s", seeds=2).folder
    (folder / "mine.txt").write_text("mine")
    assert swept(FLOCK, {}, ORDER[0], folder, seeds=3, overwrite=True).computed == 3
    assert (folder / "mine.txt").read_text() == "mine"


# Disks


def test_a_full_disk_stops_the_sweep_and_keeps_every_row(
    reference: Sweep, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "s"
    with monkeypatch.context() as patch:
        fill_disk(patch, reference.rows[5].key)
        with pytest.raises(ExportError, match=rf"{reference.rows[5].key}.*no space left.*--resume"):
            flock(folder, workers=1)
    rows = list(folder.glob("rows/*/*.json"))
    assert {path.stem for path in rows} == {row.key for row in reference.rows[:5]}
    assert not list(folder.rglob("*.tmp"))
    found = flock(folder, resume=True)
    assert found.computed == RUNS - 5 and found.hash == reference.hash


def test_a_full_disk_where_runs_are_kept_stops_the_sweep(
    spring: Tree, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / task.TOKEN).write_text("t")
    context = task.Context(Scene(spring), (), str(tmp_path), "t")
    with monkeypatch.context() as patch:
        fill_disk(patch, "000012.npz")
        answer = task.perform(context, task.Task("k", (), 0, keep=True))
    assert re.search(r"000012\.npz: no space left", answer.full)

    def full(self: pool.Worker, one: task.Task) -> task.Answer:
        return answer

    monkeypatch.setattr(pool.Worker, "ask", full)
    with pytest.raises(ExportError, match="no space left"):
        flock(tmp_path / "s", keep=True)
    assert json.loads((tmp_path / "s" / "sweep.json").read_text())["status"] == "failed"


# Clusters that are not as they should be


def test_a_scheduler_that_does_not_answer_is_told(
    spring: Tree, scene_file: SceneFile, tumble: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr(cluster, "PATIENCE", 0.5)
    answer = tumble("sweep", scene_file(spring), "--vary", "time.fps=24,25", "--on", "tcp://127.0.0.1:9")
    assert answer.code == 2
    assert "--on tcp://127.0.0.1:9: no Dask scheduler answers within 0.5 s" in answer.err and "--on cores" in answer.err
    with pytest.raises(SceneError, match=r"--on tls://127\.0\.0\.1:9: needs certificates; name them under distributed"):
        swept(spring, {"time.fps": [24]}, on="tls://127.0.0.1:9")
    assert not Path("out").exists()
    # A sweep that was to be replaced is still there.
    before = swept(spring, {"time.fps": [24]}, folder="s")
    with pytest.raises(SceneError, match="no Dask scheduler answers"):
        swept(spring, {"time.fps": [25]}, folder="s", overwrite=True, on="tcp://127.0.0.1:9")
    assert swept(spring, {"time.fps": [24]}, folder="s", resume=True).hash == before.hash


def test_workers_of_another_version_are_refused(
    tmp_path: Path, scheduler: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    address = scheduler.scheduler_address
    monkeypatch.setattr(cluster._engine, "version", "9.9.9")
    with pytest.raises(
        SceneError, match=r"2 of 2 workers are of another version: tcp://\S+ has tumble \S+, and this is 9\.9\.9"
    ):
        flock(tmp_path / "s", on=address)
    assert not (tmp_path / "s" / "rows").exists() or not list((tmp_path / "s" / "rows").iterdir())
    with pytest.raises(SceneError, match=r"a has no tumble, and this is"):
        cluster.refuse_others("tcp://x:1", {"a": "", "b": "9.9.9"})


def test_a_worker_that_joins_later_refuses_itself() -> None:
    with pytest.raises(task.Refused, match=r"a worker has tumble \S+, and this is 9\.9\.9"):
        cluster.compute(json.dumps({"version": "9.9.9", "scene": "of another kind"}).encode(), [task.Task("k", (), 0)])


def test_messages_between_processes_come_back_as_they_were(tmp_path: Path) -> None:
    """As JSON, to the bit: what another machine sends is read, and never run."""
    given = task.Context(Scene(FLOCK | {"seed": 2**32 - 1}), (measures.read(ORDER[0]),), str(tmp_path), "t")
    found = task.Context.of(given.message())
    assert found.scene.to_dict() == given.scene.to_dict() and found.scene.folder == given.scene.folder
    assert (found.measures, found.folder, found.token) == (given.measures, given.folder, given.token)
    asked = task.Context.of(task.Context(Scene(FLOCK), (), "", "", study="bottlenecks", words={"limit": 0.1}).message())
    assert (asked.study, asked.words) == ("bottlenecks", {"limit": 0.1}) and not found.study
    one = task.Task("k", ("particles.p.name=Stäbe", "time.fps=0.1"), 7, True)
    assert task.Task.of(one.message()) == one
    values = {"a": 0.1 + 0.2, "b": -math.inf, "c": 5e-324}
    answer = task.Answer("k", "finished", "1\n2", {"at": [1, 2]}, 3, "ff", values, 1.5, b"\n\0PK\n", "full")
    assert task.Answer.of(answer.message()) == answer


@pytest.mark.parametrize("name", ["../evil", "/tmp/tumble-evil", "a/../../evil", "a\\..\\..\\evil", "C:evil"])
def test_files_that_a_worker_sends_stay_in_the_folder_of_their_run(name: str, tmp_path: Path) -> None:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("good", b"1")
        archive.writestr(name, b"2")
    with pytest.raises(OSError, match="leads out of the folder of its run"):
        task.unpack(buffer.getvalue(), tmp_path / "a" / "run")
    assert [path.name for path in tmp_path.rglob("*") if path.is_file()] == ["good"]
    assert not Path("/tmp/tumble-evil").exists()
    with pytest.raises(OSError, match="a worker sent a damaged archive"):
        task.unpack(b"PK", tmp_path / "b")


def test_dask_that_is_not_there_is_told(spring: Tree, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(SceneError, match=r"--on dask: needs Dask: pip install 'tumble\[cluster\]'"):
        swept(spring, {"time.fps": [24, 25]}, folder=tmp_path / "s", on="dask")


SCHEDULER, WORKER = "dask scheduler --port 8786", "--nthreads 1 --nworkers 1 --no-dashboard"


def test_the_guide_starts_clusters_that_there_are() -> None:
    import yaml

    guide = (Path(__file__).parents[2] / "docs" / "sweeps.md").read_text(encoding="utf-8")
    assert f"{SCHEDULER} &" in guide and f'dask worker "tcp://$(hostname):8786" {WORKER} &' in guide
    pods = yaml.safe_load_all(re.findall(r"```yaml\n(.*?)```", guide, re.S)[0])
    kinds = {one["metadata"]["name"] + " " + one["kind"]: one["spec"] for one in pods}
    assert set(kinds) == {"tumble-scheduler Deployment", "tumble-scheduler Service", "tumble-worker Deployment"}
    (one,) = kinds["tumble-scheduler Deployment"]["template"]["spec"]["containers"]
    assert one["command"] == SCHEDULER.split()
    (one,) = kinds["tumble-worker Deployment"]["template"]["spec"]["containers"]
    assert one["command"][:3] == ["dask", "worker", "tcp://tumble-scheduler:8786"]
    known = subprocess.run(
        [sys.executable, "-m", "dask", "worker", "--help"], capture_output=True, text=True, check=True
    )
    for word in [*one["command"], *WORKER.split()]:
        assert not word.startswith("--") or word in known.stdout or word.replace("no-", "") in known.stdout


@pytest.mark.long
def test_the_commands_of_the_guide_make_a_cluster(reference: Sweep, tmp_path: Path) -> None:
    import socket

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    words = [sys.executable, "-m", "dask"]
    environment = {**os.environ, "RAYON_NUM_THREADS": "1"}
    commands = [[*words, *SCHEDULER.replace("8786", str(port)).split()[1:], "--no-dashboard"]]
    commands += [[*words, "worker", f"tcp://127.0.0.1:{port}", *WORKER.split()]] * 2
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": tmp_path}
    processes = [subprocess.Popen(command, env=environment, **quiet) for command in commands]
    try:
        found = flock(tmp_path / "s", on=f"tcp://127.0.0.1:{port}")
    finally:
        for process in processes:
            process.terminate()
        for process in processes:
            process.wait()
    assert found.hash == reference.hash


# The command


def test_the_command_tells_what_it_found(stiff: Tree, scene_file: SceneFile, tumble: Command) -> None:
    words = [
        "sweep",
        scene_file(stiff),
        "--vary",
        "particles.p.spring.0.stiffness=100.0,1e6",
        "--measure",
        "max ledger.energy",
    ]
    answer = tumble(*words)
    assert answer.code == 0
    assert "out/sweep/scene: 2 runs (1 finished, 1 exploded)" in answer.out
    assert "exploded, the first of 1: run 1 (particles.p.spring.0.stiffness=1e6, seed=0): energy exploded" in answer.out
    assert "sweep          2 / 2  100%  1 failed" in answer.err
    again = tumble(*words, "--resume", "--json")
    tree = json.loads(again.out)
    assert tree["ok"] is False and tree["ends"] == {"finished": 1, "exploded": 1} and tree["timings"]["computed"] == 0
    assert tree["hash"] in answer.out and [line["runs"] for line in tree["summary"]] == [1, 1]
    nothing = tumble(
        *[word if "1e6" not in str(word) else "particles.p.spring.0.stiffness=1e6" for word in words], "--force"
    )
    assert nothing.code == 1 and "no run reached its end: energy exploded" in nothing.err


def test_stills_and_films_stand_side_by_side(
    sheet: Tree, scene_file: SceneFile, tumble: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    from matplotlib.image import imread

    monkeypatch.setattr("tumble.film._cores", lambda: 1)  # Processes take longer to start than such films.
    sheet["time"]["frames"] = 2
    sheet["camera"] = {"resolution": [64, 48]}
    words = ["--vary", "sheet.sheet.center=[0,0,0.35],[0.2,0,0.5]", "--seeds", "2", "--renderer", "matplotlib"]
    answer = tumble("sweep", scene_file(sheet), *words, "--stills", "--films", "--no-plots")
    assert answer.code == 0, answer.err
    folder = Path("out/sweep/scene")
    assert len(list(folder.glob("stills/*.png"))) == len(list(folder.glob("films/*.mp4"))) == 2
    picture = imread(folder / "stills.png")
    assert picture.shape[1] == 2 * 328 + 8 and picture[..., :3].std() > 0.05
    page = (folder / "sweep.html").read_text()
    assert 'src="stills.png"' in page and 'src="films.mp4"' in page and (folder / "films.mp4").stat().st_size > 1000
    # Another camera draws the same runs anew.
    sheet["camera"] = {"resolution": [64, 48], "look": "night"}
    again = tumble("sweep", scene_file(sheet), *words, "--stills", "--no-plots", "--resume", "--json")
    assert again.code == 0 and json.loads(again.out)["timings"]["computed"] == 0, again.err
    night = imread(folder / "stills.png")
    assert len(list(folder.glob("stills/*.png"))) == 4 and np.abs(night - picture).max() > 0.5


def test_a_film_needs_two_frames_and_the_page_says_so(sheet: Tree, scene_file: SceneFile, tumble: Command) -> None:
    sheet["time"]["frames"] = 2
    sheet["camera"] = {"resolution": [64, 48]}
    words = ["--vary", "sheet.sheet.links.structural=500,1e25", "--renderer", "matplotlib", "--films", "--no-plots"]
    answer = tumble("sweep", scene_file(sheet), *words)
    assert answer.code == 0, answer.err
    folder = Path("out/sweep/scene")
    page = (folder / "sweep.html").read_text()
    ends = [row["status"] for row in csv.DictReader((folder / "sweep.csv").open())]
    assert "finished" in ends and len(set(ends)) == 2, ends
    (film,) = folder.glob("films/*.mp4")
    assert f'src="films/{film.name}"' in page
    words[1] = "sheet.sheet.links.structural=1e25"
    assert tumble("sweep", scene_file(sheet), *words, "--force").code == 1
    assert "No run has the two frames of a film." in (folder / "sweep.html").read_text()
