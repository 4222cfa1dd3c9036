"""Sweeps: designs, measures, statistics, and what is told about mistakes."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Answer
from runs import Tree

from tumble import Scene, SceneError, World, sweep
from tumble.run import simulate
from tumble.sweeps import design, measures
from tumble.sweeps.against import published
from tumble.sweeps.mistakes import Mistakes
from tumble.sweeps.statistics import RESAMPLES, binned, confidence, effect, spread
from tumble.sweeps.words import design as from_words

Command = Callable[..., Answer]
SceneFile = Callable[..., Path]


def points(found: design.Design) -> list[dict[str, str]]:
    return [found.point(i) for i in range(len(found))]


def typed(*vary: str, **more: Any) -> design.Design:
    mistakes = Mistakes()
    found, _ = from_words(mistakes, vary, **more)
    mistakes.tell()
    assert found is not None
    return found


# Designs


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("1,2,3", ["1", "2", "3"]),
        ("rk4, verlet", ["rk4", "verlet"]),
        ("[0, 0, -9.8],[0, 0, -1.6]", ["[0, 0, -9.8]", "[0, 0, -1.6]"]),
        ("'a,b',c", ["'a,b'", "c"]),
        ("10:40:4", ["10", "20", "30", "40"]),
        ("-9.8:-1.6:5", ["-9.8", "-7.75", "-5.7", "-3.65", "-1.6"]),
        ("1:8:4:log", ["1", "2", "4", "8"]),
        ("0:1:3", ["0.0", "0.5", "1.0"]),
        ("4:1:2", ["4", "1"]),
        ("shot.usda:/camera", ["shot.usda:/camera"]),
    ],
)
def test_values_are_lists_and_ranges(text: str, values: list[str]) -> None:
    assert design.spread("k", text) == values


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1:10", r"k: 1:10: a range without a count, expected LO:HI:N, e\.g\. 1:10:5"),
        ("1:10:log", r"without a count.*e\.g\. 1:10:5"),
        ("1:10:1", "'1' is no count.* N from 2 to 1,000,000"),
        ("1:10:2000000", "is no count"),
        ("1:10:x", "'x' is no count"),
        ("1:1:3", "two different, finite ends"),
        ("-1:4:3:log", "ends > 0"),
        ("1,,2", "empty value"),
        ("1,2,1", "1 is there twice.*--seeds"),
    ],
)
def test_ranges_that_are_none_are_told(text: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        design.spread("k", text)


def test_grids_are_products_with_the_last_axis_fastest() -> None:
    found = typed("a=1,2", "b=x,y,z")
    assert len(found) == 6 and found.paths == ("a", "b")
    assert points(found)[:4] == [{"a": "1", "b": v} for v in "xyz"] + [{"a": "2", "b": "x"}]
    assert found.values("b") == ["x", "y", "z"]
    assert points(design.grid({"a": [1, 2], "b": ["x", "y", "z"]})) == points(found)


def test_zipped_keys_change_together() -> None:
    found = typed("c=1,2", zips=("a=1:3:3", "b=x,y,z"))
    assert len(found) == 6
    assert [(p["a"], p["b"]) for p in points(found)[:3]] == [("1", "x"), ("2", "y"), ("3", "z")]
    assert points(design.zipped({"a": "1:3:3", "b": "x,y,z"})) == [
        {"a": a, "b": b} for a, b in zip("123", "xyz", strict=True)
    ]
    with pytest.raises(SceneError, match="--zip: a has 2, b has 3: expected as many"):
        typed(zips=("a=1,2", "b=1,2,3"))


def test_a_table_is_a_design(tmp_path: Path) -> None:
    file = tmp_path / "points.csv"
    file.write_text('world.gravity,seed\n"[0, 0, -1]", 3\n"[0, 0, -2]",4\n')
    assert points(design.table(file)) == [
        {"world.gravity": "[0, 0, -1]", "seed": "3"},
        {"world.gravity": "[0, 0, -2]", "seed": "4"},
    ]
    file.write_bytes(b"\xef\xbb\xbfa,b\r\n1,2\r\n\r\n , \r\n3,4\r\n")
    assert points(design.table(file)) == [{"a": "1", "b": "2"}, {"a": "3", "b": "4"}]
    for text, message in (
        ("a,b\n", "no rows"),
        ("a,a\n1,2\n", "line 1"),
        ("a,b\n1\n", "row 1: 1: expected 2 values"),
        ("a;b\n1,5;2\n", "line 1: a;b: semicolons between the columns, expected commas"),
        ("a,b\n1,2\n3,4\n1,2\n", "row 3: 1,2: is the same as row 1; leave one of both out"),
    ):
        file.write_text(text)
        with pytest.raises(SceneError, match=message):
            design.table(file)
    with pytest.raises(SceneError, match=r"none\.csv: cannot be read \(No such file"):
        design.table(tmp_path / "none.csv")


def test_a_latin_hypercube_has_a_point_in_every_part() -> None:
    found = design.latin({"a": (0.0, 1.0), "b": "1.0:100.0:log", "n": (1, 4)}, 20)
    assert len(found) == 20
    a = np.array([float(p["a"]) for p in points(found)])
    b = np.log([float(p["b"]) for p in points(found)]) / math.log(100.0)
    for x in (a, b):
        assert sorted(np.floor(20 * x).astype(int)) == list(range(20))
    # Whole numbers, each as often.
    assert sorted(p["n"] for p in points(found)) == [n for n in "1234" for _ in range(5)]
    assert points(design.latin({"a": (0.0, 1.0), "b": "1.0:100.0:log", "n": (1, 4)}, 20)) == points(found)


def test_a_sobol_design_is_more_even_than_chance() -> None:
    found = design.sobol({"a": (0.0, 1.0), "b": (0.0, 1.0)}, 64)
    cells = {(int(8 * float(p["a"])), int(8 * float(p["b"]))) for p in points(found)}
    assert len(cells) == 64  # By chance 41.


def test_a_design_without_scipy_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "scipy.stats", None)
    with pytest.raises(SceneError, match="--design latin: needs scipy: pip install scipy"):
        design.latin({"a": (0.0, 1.0)}, 4)


def test_a_million_points_take_no_memory() -> None:
    found = typed("a=0:1:1000", "b=0:1:1000", "c=0:1:1000")
    assert len(found) == 10**9
    assert found.point(10**9 - 1) == {"a": "1.0", "b": "1.0", "c": "1.0"}
    some = found.covering(50)
    assert len(some) == 50 and some[0] == 0 and some[-1] == 10**9 - 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"vary": ["a"]}, "--vary a: expected KEY=VALUES"),
        ({"vary": ["a=1", "a=2"]}, "--vary a: is varied twice"),
        ({"vary": ["a=1"], "samples": 3}, "--samples: is of --design latin or sobol"),
        ({"vary": ["a=1:2"], "kind": "latin"}, r"--design latin: says no number of points, expected --samples N"),
        ({"vary": ["a=1:2:3"], "kind": "sobol", "samples": 4}, "--vary a: 1:2:3: a count, but --samples"),
        ({"vary": ["a=1,2"], "kind": "sobol", "samples": 4}, "--vary a: 1,2: expected LO:HI"),
        ({"kind": "sobol", "samples": 4}, "--design sobol: nothing to draw"),
        ({"vary": ["a=1:2"], "kind": "sobl"}, "^--design: no design 'sobl'; did you mean sobol?$".replace("?", r"\?")),
        ({"vary": ["a=1:2"], "zips": ["b=1"], "kind": "latin", "samples": 4}, "leave --zip and --table out"),
        ({}, "nothing is varied; expected --vary"),
    ],
)
def test_words_that_make_no_design_are_told(words: dict[str, Any], message: str) -> None:
    mistakes = Mistakes()
    assert from_words(mistakes, **words)[0] is None
    with pytest.raises(SceneError, match=message):
        mistakes.tell()


# Measures


def watched(tree: Tree, names: Sequence[str], folder: Path) -> tuple[dict[str, float], Any]:
    """Measures of a run, and the run itself."""
    scene = Scene(tree)
    time = scene.to_dict()["time"]
    watch = measures.Watch([measures.read(name) for name in names], time["fps"], time["frames"])
    world = World(scene)
    watch.look(world, {})
    while world.frame_index < time["frames"]:
        watch.look(world, world.step())
    return watch.values(), simulate(tree, folder)


def test_measures_are_those_of_the_run(spring: Tree, tmp_path: Path) -> None:
    names = (
        "ledger.energy@last", "ledger.energy", "ledger.energy@first", "max ledger.speed", "min ledger.kinetic",
        "mean ledger.stretch@10..", "std ledger.kinetic@0.25s..0.75s", "sum ledger.steps", "probe p.position[1].z@0.5s",
        "probe p.velocity[1]", "max probe p.position[1].x@5..20", "probe p.position[mean].z@12", "probe p.position[count]",
        "probe p.velocity[max]@3", "p.position[min].x@last",
    )  # fmt: skip
    found, run = watched(spring, names, tmp_path / "run")
    books = run.ledger
    x, v = (run.stack("p", column)[:].astype(float) for column in ("position", "velocity"))
    expected = (
        books["energy"][-1], books["energy"][-1], books["energy"][0], books["speed"].max(), books["kinetic"].min(),
        np.nanmean(books["stretch"][10:]), books["kinetic"][6:19].std(), books["steps"].sum(), x[12, 1, 2],
        np.linalg.norm(v[-1, 1]), x[5:21, 1, 0].max(), x[12, :, 2].mean(), 2.0,
        np.linalg.norm(v[3], axis=1).max(), x[-1, :, 0].min(),
    )  # fmt: skip
    assert list(found) == [" ".join(name.split()) for name in names]
    np.testing.assert_allclose(list(found.values()), expected, rtol=1e-12)
    assert len({round(v, 9) for v in expected}) > 11  # They are not all the same.


def test_the_order_of_a_flock_is_one_where_all_go_one_way(spring: Tree) -> None:
    tree: Tree = {"version": 1, "particles": [{"name": "p", "position": [[0, 0, 0], [1, 0, 0]]}]}
    for velocity, order in (([[1, 0, 0], [3, 0, 0]], 1.0), ([[1, 0, 0], [0, 2, 0]], math.sqrt(0.5))):
        tree["particles"][0]["velocity"] = velocity
        watch = measures.Watch([measures.read("probe p.velocity[order]@first")], 24, 1)
        watch.look(World(tree), {})
        assert next(iter(watch.values().values())) == pytest.approx(order, abs=1e-7)


def test_the_stable_step_is_that_of_the_estimate(spring: Tree) -> None:
    world = World(spring | {"system": [{"integrator": "verlet", "substeps": 8}]})
    watch = measures.Watch([measures.read(f"stability.{word}") for word in ("stable", "step")], 24, 25)
    watch.look(world, {})
    while world.frame_index < 25:
        watch.look(world, world.step())
    # 2 / omega with omega = 10/s, but for single precision.
    assert list(watch.values().values()) == pytest.approx([0.2, 1 / 192], rel=2e-3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected .*ledger.COLUMN"),
        ("energy", r"'energy' is no measure; did you mean ledger\.energy\?"),
        ("maximum ledger.energy", "no value over frames 'maximum'; did you mean max"),
        ("ledger.energy@end", "@end: no moment, expected @last"),
        ("ledger.energy@1..3", r"@1\.\.3: more than one frame, expected one of max"),
        ("max ledger.energy@3", r"@3: max of one frame; expected frames such as @100\.\."),
        ("probe p.position[one].x", r"\[one\], expected the index of an element, or mean"),
        ("probe p.position[1].q", r"\.q, expected \.x"),
        ("stability.stabel", "no estimate of stability 'stabel'; did you mean stable"),
        ("max stability.stable", "is of the start alone"),
    ],
)
def test_texts_that_are_no_measure_are_told(text: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        measures.read(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("ledger.enrgy", "no column of the ledger 'enrgy'; did you mean energy"),
        ("ledger.momentum", "it has the columns momentum_x, momentum_y, momentum_z"),
        ("ledger.seconds", "is a time on the clock"),
        ("ledger.energy@26", r"frame 26, but the run ends with frame 25 \(1\.04167 s\)"),
        ("ledger.energy@3s", "frame 72, but the run ends"),
        ("mean ledger.energy@9..4", "from frame 9 to 4: the first comes after the last"),
        ("probe q.position[0].x", "no object 'q'; there are p"),
        ("probe p.positon[0].x", "no column of \"p\" 'positon'; did you mean position"),
        ("probe p.position[2].x", "2, expected < 2"),
        ("probe p.position[1].w", r"\.w, but position has 3 numbers"),
    ],
)
def test_measures_of_what_is_not_there_are_told(spring: Tree, text: str, message: str) -> None:
    with pytest.raises(SceneError, match=message):
        measures.check(measures.read(text), World(spring))


# Values from elsewhere


def test_values_from_elsewhere_stand_in_the_plots(tmp_path: Path) -> None:
    file = tmp_path / "published.csv"
    file.write_text("a,energy\n1,2.5\n2,3.5\n")
    found = published(file, ["a", "b"], ["energy"])
    assert found.name == "published" and found.beside("a", "energy") == ([1.0, 2.0], [2.5, 3.5])
    assert found.beside("b", "energy") is None
    for text, message in (
        ("a,enrgy\n1,2\n", "no parameter or measure 'enrgy'; did you mean energy"),
        ("a,b\n1,2\n", "expected a column of a parameter and one of a measure"),
        ("a,energy\n1,x\n", "energy: row 1 has no number there"),
    ):
        file.write_text(text)
        with pytest.raises(SceneError, match=rf"--against .*published\.csv: .*{message}"):
            published(file, ["a", "b"], ["energy"])


# Statistics


def test_mean_spread_and_confidence_are_those_of_numpy() -> None:
    values = np.random.default_rng(3).normal(5.0, 2.0, 40)
    found = spread([*values.tolist(), math.nan], "x")
    assert (found.n, found.mean, found.std) == (40, pytest.approx(values.mean()), pytest.approx(values.std(ddof=1)))
    assert (found.least, found.most) == (values.min(), values.max())
    # The same bootstrap with another generator: bounds differ by the noise of 2000 resamples, about 1.5/sqrt(2000 * 0.025)
    # of a standard error at the 2.5 % quantile, times 4.
    other = np.random.default_rng(4)
    means = values[other.integers(0, 40, (RESAMPLES, 40))].mean(axis=1)
    error = values.std(ddof=1) / math.sqrt(40)
    low, high = np.percentile(means, [2.5, 97.5])
    assert abs(found.low - low) < 0.85 * error * 0.25 and abs(found.high - high) < 0.85 * error * 0.25
    # Of so many the interval is nearly that of the normal distribution: 1.96 standard errors.
    assert (found.high - found.low) / error == pytest.approx(2 * 1.96, rel=0.06)
    assert confidence(values, "x") == (found.low, found.high) != confidence(values, "y")


def test_intervals_hold_the_mean_as_often_as_they_say() -> None:
    generator = np.random.default_rng(5)
    inside = 0
    for k in range(300):
        low, high = confidence(generator.normal(0.0, 1.0, 30), str(k))
        inside += low <= 0.0 <= high
    # Measured 280; percentiles of 30 values fall a little short of 285, and chance adds sqrt(300 * 0.05 * 0.95) = 3.8.
    assert 268 <= inside <= 296


def test_nothing_has_no_mean_and_one_has_no_spread() -> None:
    assert spread([math.nan], "x").n == 0 and math.isnan(spread([], "x").mean)
    one = spread([2.0, math.inf], "x")
    assert (one.n, one.mean) == (1, 2.0) and math.isnan(one.std) and math.isnan(one.low)


def test_main_effects_are_means_over_the_other_parameters() -> None:
    # y = 10 a + b on a full grid: variances 100 * 2/3 and 2/3.
    given = [(a, b) for a in "123" for b in "123"]
    values = [10.0 * int(a) + int(b) for a, b in given]
    first, second = (effect(name, [g[k] for g in given], values, "y") for k, name in enumerate("ab"))
    assert [s.mean for s in first.spreads] == [12.0, 22.0, 32.0] and first.size == 20.0
    assert [s.mean for s in second.spreads] == [21.0, 22.0, 23.0]
    assert first.share == pytest.approx(100 / 101) and second.share == pytest.approx(1 / 101)


def test_many_values_are_put_into_bins_of_equally_many() -> None:
    levels, where = binned([repr(x / 7) for x in range(80)])
    assert len(levels) == 8 and np.bincount(where).tolist() == [10] * 8
    assert levels[0] == f"{4.5 / 7:.6g}"
    assert binned(["b", "a", "b"]) == (["b", "a"], [0, 1, 0])


# Mistakes, all at once


def test_all_mistakes_are_told_before_anything_runs(spring: Tree, scene_file: SceneFile, tumble: Command) -> None:
    answer = tumble(
        "sweep", scene_file(spring), "--vary", "system.0.substep=1,2", "--vary", "time.fps=-1", "--vary", "seed=1:3",
        "--measure", "ledger.enrgy", "--measure", "probe q.position[0]", "--seeds", 2, "--keep", "all",
    )  # fmt: skip
    assert answer.code == 2 and not answer.out
    for text in (
        "--keep: 'all', expected measures or runs",
        "--vary seed: 1:3: a range without a count",
        "ledger.enrgy: no column of the ledger 'enrgy'; did you mean energy",
        "probe q.position[0]: no object 'q'; there are p",
    ):
        assert text in answer.err
    answer = tumble("sweep", scene_file(spring), "--vary", "system.0.substep=1,2", "--vary", "time.fps=-1,-2")
    assert (
        answer.err.count('--vary system.0.substep=1: system "main".substep: unknown key; did you mean "substeps"') == 1
    )
    assert "--vary time.fps=-1: time.fps: -1" in answer.err and "--vary time.fps=-2: time.fps: -2" in answer.err
    assert not Path("out").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--vary", "expect.max_speed=1,2"], "[expect] changes nothing that a sweep measures; vary another key"),
        (["--vary", "seed=1,2", "--seeds", "2"], "--seeds: the design varies seed itself"),
        (
            ["--vary", "time.fps=24", "--seeds", "2", "--set", "seed=4294967295"],
            "--seeds: the last seed would be 4294967296",
        ),
        (
            ["--vary", "particles.0.radius=1,2", "--vary", "particles.p.radius=3,4"],
            "--vary particles.p.radius: is the same key as particles.0.radius, which is varied, too",
        ),
        (
            ["--vary", "world.gravity=[0,0,-1],[0,0,-2]", "--zip", "world.gravity.2=1,2"],
            "--zip world.gravity.2: changes the same values as world.gravity, which is varied, too",
        ),
        (["--vary", "q.0.x=1"], "--vary q.0.x=1: q: unknown key"),
        (["--vary", "time.fps=24", "--on", "gpu"], "--on: 'gpu', expected cores, dask or the address"),
        (["--vary", "time.fps=24", "--on", "tcp://"], "--on: 'tcp://', expected cores, dask or the address"),
        (["--vary", "time.fps=24", "--on", "http://host:8786"], "--on: 'http://host:8786', expected cores"),
        (["--vary", "time.fps=24", "--on", "tcp://host:65536"], "--on: 'tcp://host:65536', expected cores"),
        (["--vary", "time.fps=24", "--memory", "inf"], "Invalid value for '--memory': 'inf'"),
        (["--vary", "time.fps=24", "--resume", "--force"], "choose one"),
        (["--vary", "time.fps=24", "--frames", "2", "--measure", "ledger.energy@3"], "the run ends with frame 2"),
    ],
)
def test_mistakes_name_their_option(
    spring: Tree, scene_file: SceneFile, tumble: Command, options: list[str], message: str
) -> None:
    answer = tumble("sweep", scene_file(spring), *options)
    assert answer.code == 2 and message in answer.err
    assert not Path("out").exists()


def test_a_million_runs_are_asked_about(spring: Tree, scene_file: SceneFile, tumble: Command) -> None:
    words = ["sweep", scene_file(spring), "--vary", "world.gravity.2=-9:-1:1000", "--vary", "time.fps=20:30:1000"]
    answer = tumble(*words)
    assert answer.code == 2
    assert "1,000,000 runs; about " in answer.err and "say --yes to run them, or vary less" in answer.err
    assert not Path("out").exists()


def test_python_tells_the_same(spring: Tree, tmp_path: Path) -> None:
    with pytest.raises(SceneError) as error:
        sweep(spring, {"system.0.substep": [1, 2]}, ["ledger.enrgy"], tmp_path / "s")
    assert [issue["path"] for issue in error.value.issues] == [
        'system.0.substep=1: system "main".substep',
        "ledger.enrgy",
    ]
    for memory in (math.inf, math.nan, -1.0):
        with pytest.raises(SceneError, match=r"memory: .*expected a finite number >= 1e6 bytes"):
            sweep(spring, {"time.fps": [24]}, folder=tmp_path / "s", memory=memory)
    with pytest.raises(SceneError, match="expected a mapping of keys"):
        sweep(spring, ["a"], folder=tmp_path / "s")  # type: ignore[arg-type]
    assert not (tmp_path / "s").exists()
