"""`tumble refine`: orders that are known, limits that are known, and what is refined."""

import copy
import csv
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import Answer
from runs import Tree

from tumble import Run, Scene, SceneError
from tumble.plots import convergence
from tumble.refine import Measure, Study, plan, study, value

Command = Callable[..., Answer]
SceneFile = Callable[..., Path]

G, OMEGA, T = 9.8, 10.0, 25 / 24
"""Of the oscillator: gravity, sqrt(100 N/m / 1 kg), and when it ends."""

HEIGHT = 0.5 - G / OMEGA**2 * (1.0 - math.cos(OMEGA * T))
"""It is let go from rest at 0.5, where its spring is slack (oscillator.2)."""

KINETIC = 0.5 * (G / OMEGA * math.sin(OMEGA * T)) ** 2


@pytest.fixture
def oscillator(spring: Tree) -> Tree:
    """A mass on a spring that is let go at rest, in double precision."""
    spring["precision"] = "double"
    spring["particles"][0]["velocity"] = [[0, 0, 0], [0, 0, 0]]
    return spring


def measured(found: Study) -> dict[str, Measure]:
    return {m.name: m for m in found.measures}


# Orders and limits


@pytest.mark.parametrize(
    ("integrator", "substeps", "order", "kinetic"),
    [("symplectic_euler", 16, 1, 2), ("velocity_verlet", 8, 2, 2), ("rk4", 4, 4, 4), ("implicit_euler", 64, 1, 1)],
)
def test_the_order_and_the_limit_of_an_oscillator(
    oscillator: Tree, tmp_path: Path, integrator: str, substeps: int, order: int, kinetic: int
) -> None:
    oscillator["system"] = [{"integrator": integrator, "substeps": substeps}]
    found = study(Scene(oscillator), tmp_path, 4, measures=["p.position.z@1", "kinetic"])
    assert [w.values for w in found.refined] == [[substeps * 2**k for k in range(4)]]
    for name, exact, expected in (("p.position.z@1", HEIGHT, order), ("kinetic", KINETIC, kinetic)):
        measure = measured(found)[name]
        # Measured: within 0.05 of theory.
        assert measure.order == pytest.approx(expected, abs=0.2)
        assert len(measure.orders) == 2
        assert measure.verdict == "converges"
        # The estimate is the error, up to the next order: within a tenth, measured 0.017.
        actual = measure.values[-1] - exact
        assert abs(actual) > 1e-12
        assert measure.error == pytest.approx(abs(actual), rel=0.1)
        assert abs(measure.limit - exact) < 0.1 * abs(actual)


def test_a_lattice_halves_its_distances(tmp_path: Path) -> None:
    """A sheet that hangs from one edge and a rope of as many pieces each keep the places of the coarser one."""
    tree: Tree = {
        "version": 1,
        "time": {"fps": 24, "frames": 1},
        "sheet": [{"name": "s", "size": [1, 1], "resolution": [3, 4]}],
        "rope": [{"name": "r", "from": [0, 0, 2], "to": [1, 0, 2], "segments": 5}],
        "system": [{"integrator": "implicit_euler", "substeps": 3}],
        "output": {"plot": False},
    }
    found = study(Scene(tree), tmp_path, 3, measures=["energy"])
    assert {w.path: w.values for w in found.refined} == {
        "rope.0.segments": [5, 10, 20],
        "sheet.0.resolution": [[3, 4], [5, 7], [9, 13]],
        "system.0.substeps": [3, 6, 12],
    }
    coarse, fine = (found.runs[k].frame(0) for k in (0, 2))  # type: ignore[union-attr]
    np.testing.assert_allclose(fine["r"]["position"][::4], coarse["r"]["position"], atol=1e-6)
    grids = [f["s"]["position"].reshape(n, m, 3) for f, (m, n) in ((coarse, (3, 4)), (fine, (9, 13)))]
    np.testing.assert_allclose(grids[1][::4, ::4], grids[0], atol=1e-6)
    assert [run.ledger["steps"][-1] for run in found.runs if run] == [3, 6, 12]


def judged(values: list[float], ulp: float = 2e-16) -> Measure:
    measure = Measure("m", values)
    measure.judge(ulp)
    return measure


def test_richardson_on_what_is_exactly_of_one_order() -> None:
    for p in (0.5, 1.0, 2.0, 3.0):
        measure = judged([7.0 + 3.0 * 2.0 ** (-p * k) for k in range(5)])
        assert measure.orders == pytest.approx([p] * 3)
        assert (measure.order, measure.limit) == (pytest.approx(p), pytest.approx(7.0))
        assert measure.error == pytest.approx(3.0 * 2.0 ** (-p * 4))
        assert measure.verdict == "converges"


@pytest.mark.parametrize(
    ("values", "verdict"),
    [
        ([1.0, 2.0, 1.5, 1.75], "goes to and fro"),
        ([1.0, 2.0, 3.0, 4.0], "does not converge"),
        ([1.0, 2.0, 4.0, 8.0], "does not converge"),
        ([3.0, 3.0, 3.0], "the same at every level"),
        ([1.0, 1.5, 1.75], "one order only"),
        ([1.0, 1.5, 1.6, 1.68], "has not settled"),
        ([1.0, 1.5, 1.5 + 1e-15], "round-off"),
        ([1.0, math.nan, 1.5, 1.75], "fewer than three"),
    ],
)
def test_what_does_not_converge_is_not_called_so(values: list[float], verdict: str) -> None:
    measure = judged(values)
    assert verdict in measure.verdict
    if verdict.startswith(("goes", "does", "fewer")):
        assert math.isnan(measure.limit) and math.isnan(measure.error)


def test_levels_that_broke_are_left_out() -> None:
    assert judged([2.0, 1.5, 1.25, math.nan]).limit == pytest.approx(1.0)
    assert judged([2.0, 1.5, 1.25, math.nan, 9.0]).limit == pytest.approx(1.0)
    assert judged([9.0, 7.0, 8.0, math.nan, 2.0, 1.5, 1.25]).limit == pytest.approx(1.0)
    assert judged([math.nan, 2.0, 1.5, 1.25, 1.125]).limit == pytest.approx(1.0)


def test_single_precision_ends_in_round_off() -> None:
    measure = judged([0.1, 0.2, 0.2 + 1e-7], 1.2e-7)
    assert "precision=double" in measure.verdict


# Refined keys and measures


def test_paths_by_name_and_by_index(tmp_path: Path) -> None:
    tree: Tree = {
        "version": 1,
        "time": {"fps": 24, "frames": 1},
        "system": [{"name": "soft", "step": 0.004}, {"name": "hard", "method": "position_based"}],
        "cloth": [
            {
                "name": "c",
                "system": "soft",
                "panels": [{"name": "p", "outline": [[0, 0], [1, 0], [1, 1], [0, 1]]}],
                "resolution": 0.2,
            }
        ],
    }
    scene = Scene(tree)
    refined, notes = plan(scene, 3)
    assert {w.path: w.values for w in refined} == {
        "cloth.0.resolution": [0.2, 0.1, 0.05],
        "system.0.step": [0.004, 0.002, 0.001],
    }
    (note,) = notes
    assert (note["code"], note["path"]) == ("unrefined-steps", 'system "hard"')
    assert "--what system.1.substeps" in note["message"]
    (word,), notes = plan(scene, 3, ["system.hard.position_based.iterations"])
    assert (word.path, word.values, notes) == ("system.1.position_based.iterations", [1, 2, 4], [])
    assert word.at(2) == "system.1.position_based.iterations=4"
    assert plan(scene, 3, ["time.exchanges"])[0][0].values == [1, 2, 4]
    words, _ = plan(scene, 3, ["time.exchanges*4", "system.soft.step/4"])
    assert [w.values for w in words] == [[1, 4, 16], [0.004, 0.001, 0.00025]]


def test_adaptive_steps_are_refined_by_their_tolerance(oscillator: Tree, tmp_path: Path) -> None:
    oscillator["system"] = [{"integrator": "dormand_prince"}]
    with pytest.raises(SceneError, match=r"--what system\.0\.adaptive\.tolerance refines it"):
        plan(Scene(oscillator), 3)
    found = study(Scene(oscillator), tmp_path, 3, ["system.0.adaptive.tolerance/100"], ["p.position.z@1"])
    errors = [abs(v - HEIGHT) for v in found.measures[0].values]
    assert errors[0] > errors[1] > errors[2] > 0.0


def test_sub_steps_that_a_system_chose_are_where_it_begins(oscillator: Tree) -> None:
    oscillator["particles"][0]["spring"][0]["stiffness"] = 1e4
    (word,), notes = plan(Scene(oscillator), 3)
    # w = 100 rad/s: usable up to 0.02 s (oscillator), 0.7 of that is 0.014 s: three to a frame of 1/24 s.
    assert (word.path, word.values, notes) == ("system.0.substeps", [3, 6, 12], [])


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("system.0.foo", "'foo'; there are name, method"),
        ("sytem.0.substeps", "'sytem'; did you mean system"),
        ("particles.q.radius", "no particles 'q'"),
        ("particles.p.name", "expected a count"),
        ("particles.p.mass", "expected a count"),
        ("world.gravity", "expected a count"),
        ("title.x", "there is nothing in it"),
        ("time.exchanges*1.5", "1.5 is none"),
        ("time.exchanges*1", "expected more than 1"),
        ("time.exchanges*1.2.3", "expected more than 1"),
        ("particles.p.mass*2", "expected a number"),
    ],
)
def test_paths_that_cannot_be_refined(
    oscillator: Tree, scene_file: SceneFile, tumble: Command, path: str, words: str
) -> None:
    with pytest.raises(SceneError, match=words):
        plan(Scene(oscillator), 3, [path])
    answer = tumble("refine", scene_file(oscillator), "--what", path)
    assert answer.code == 2
    assert path in answer.err and words in answer.err and "Traceback" not in answer.err
    assert not Path("out").exists()


@pytest.mark.parametrize(
    ("measure", "words"),
    [
        ("enrgy", "'enrgy'; did you mean energy"),
        ("energy@last", "there are end, max, min, mean"),
        ("q.position", "there are p"),
        ("p.color", 'no kept column of "p"'),
        ("p.position.w", '"w" is no part of position'),
        ("p.position.z@2", "expected < 2"),
        ("p.position.z@median", "or the index"),
    ],
)
def test_measures_that_are_not_there_are_told_before_anything_runs(
    oscillator: Tree, scene_file: SceneFile, tumble: Command, measure: str, words: str
) -> None:
    answer = tumble("refine", scene_file(oscillator), "--measure", measure)
    assert answer.code == 2
    assert measure in answer.err and words in answer.err and "Traceback" not in answer.err
    assert not Path("out").exists()


def test_an_index_of_what_is_refined_is_refused(tmp_path: Path) -> None:
    rope: Tree = {"name": "r", "from": [0, 0, 0], "to": [1, 0, 0], "segments": 4}
    scene: Tree = {"version": 1, "time": {"frames": 1}, "rope": [rope]}
    with pytest.raises(SceneError, match="another place at each level"):
        study(Scene(scene), tmp_path / "study", 3, measures=["r.position.z@2"])
    only_steps = study(Scene(scene), tmp_path / "study", 3, ["system.0.substeps"], ["r.position.z@2"])
    assert all(np.isfinite(m.values).all() for m in only_steps.measures)


def test_all_levels_must_be_possible_before_the_first_runs(tmp_path: Path) -> None:
    sheet: Tree = {"name": "s", "size": [1, 1], "resolution": [20, 20]}
    scene: Tree = {"version": 1, "time": {"frames": 1}, "world": {"memory_limit": 0.01}, "sheet": [sheet]}
    with pytest.raises(SceneError, match=r"level [123]: .*memory"):
        study(Scene(scene), tmp_path / "study", 4)
    assert not (tmp_path / "study").exists()


def test_levels_of_an_earlier_study_that_went_further_are_dropped(oscillator: Tree, tmp_path: Path) -> None:
    study(Scene(oscillator), tmp_path / "study", 4)
    (tmp_path / "study" / "level-9").mkdir()
    (tmp_path / "study" / "level-9" / "mine.txt").write_text("mine")
    study(Scene(oscillator), tmp_path / "study", 3, overwrite=True)
    assert sorted(p.name for p in (tmp_path / "study").glob("level-*/*") if p.name in ("run.json", "mine.txt")) == [
        "mine.txt",
        "run.json",
        "run.json",
        "run.json",
    ]


def test_measures_are_what_they_say(reference: Run) -> None:
    ledger, last = reference.ledger, reference.frame(-1)["p"]["position"].astype(float)
    assert value(reference, "kinetic") == value(reference, "kinetic@end") == ledger["kinetic"][-1]
    assert (
        value(reference, "kinetic@max")
        == ledger["kinetic"].max()
        > value(reference, "kinetic@min")
        == ledger["kinetic"].min()
    )
    assert value(reference, "kinetic@mean") == pytest.approx(ledger["kinetic"].mean())
    assert value(reference, "p.position.x@1") == last[1, 0]
    assert value(reference, "p.position.z@max") == last[:, 2].max() > value(reference, "p.position.z@min")
    assert value(reference, "p.position.z") == value(reference, "p.position.z@mean") == last[:, 2].mean()
    assert value(reference, "p.position@1") == pytest.approx(np.linalg.norm(last[1]))


# The command line


def test_the_command_writes_table_picture_and_runs(oscillator: Tree, scene_file: SceneFile, tumble: Command) -> None:
    file = scene_file(oscillator)
    arguments = ["refine", file, "--levels", 3, "--set", "system.0.substeps=16", "--measure", "p.position.z@1"]
    answer = tumble(*arguments, "--frames", 12)
    assert answer.code == 0, answer.err
    for word in ("system.0.substeps", "level 2", "order", "limit", "p.position.z@1: one order only"):
        assert word in answer.out, word
    folder = Path("out/refine/scene")
    assert [Run(folder / f"level-{k}").n_frames for k in range(3)] == [13] * 3
    with (folder / "convergence.csv").open() as table:
        (row,) = csv.DictReader(table)
    values = [Run(folder / f"level-{k}").frame(-1)["p"]["position"][1, 2] for k in range(3)]
    assert [float(row[f"level_{k}"]) for k in range(3)] == values
    assert float(row["order"]) == pytest.approx(1.0, abs=0.2)
    assert (folder / "convergence.png").stat().st_size > 10_000
    again = tumble(*arguments, "--frames", 12)
    assert again.code == 2 and "--force" in again.err
    assert tumble(*arguments, "--frames", 12, "--resume").code == 0
    assert tumble(*arguments, "--frames", 6, "--force").code == 0
    assert Run(folder / "level-2").n_frames == 7
    assert tumble(*arguments, "--force", "--resume").code == 2


def test_a_level_that_breaks_is_named_and_the_others_are_kept(
    oscillator: Tree, scene_file: SceneFile, tumble: Command, tmp_path: Path
) -> None:
    # Symplectic Euler breaks beyond h w = 2: here it is 1000/(24 * 16) = 2.6 at level 0, 1.3 at level 1.
    oscillator["particles"][0]["spring"][0]["stiffness"] = 1e6
    oscillator["system"] = [{"integrator": "symplectic_euler", "substeps": 16}]
    answer = tumble("refine", scene_file(oscillator), "--levels", 4, "--measure", "p.position.z@1")
    assert answer.code == 1
    # Told before, and without the trials of cures, which would take far longer than the study.
    assert answer.err.index("level 0: system") < answer.err.index("level 0 failed")
    assert "level 1: system" not in answer.err
    assert Run("out/refine/scene/level-0").manifest["failure"]["cures"] == []
    assert "level 0 failed" in answer.err and "--set system.0.substeps=16" in answer.err
    assert "level 1 failed" not in answer.err
    assert "p.position.z@1" in answer.out
    assert Path("out/refine/scene/convergence.png").is_file()


def test_the_picture_shows_every_measure(oscillator: Tree, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = study(Scene(copy.deepcopy(oscillator)), tmp_path, 3, measures=["elastic", "p.position.z@1"])
    drawn = []
    monkeypatch.setattr("tumble.plots.save", lambda figure, path: drawn.append(figure) or path)
    convergence(found, tmp_path / "convergence.png")
    above, below = drawn[0].axes
    assert len(above.lines) == 3
    np.testing.assert_array_equal(above.lines[2].get_ydata(), found.runs[2].ledger["elastic"])  # type: ignore[union-attr]
    assert {"elastic", "p.position.z@1", "order 1", "order 2", "order 4"} == {t.get_text() for t in below.texts}
    a, b, c = measured(found)["elastic"].values
    np.testing.assert_allclose(below.lines[0].get_ydata(), np.abs([b - a, c - b]) / max(map(abs, (a, b, c))))
