"""Bottlenecks of plans: the ranking, what a wider door saves, drawings, and the command line."""

import csv
import json
import math
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from tumble import Scene, SceneError
from tumble.bottlenecks import passages, report, study
from tumble.bottlenecks.walls import widened
from tumble.cli import application

WALLS = [[[6, 2.4], [6, 4], [0, 4], [0, 0], [6, 0], [6, 1.6]], [[6, 4], [9, 4], [9, 3]], [[6, 0], [9, 0], [9, 1]]]


def tree(people: int = 40) -> dict[str, Any]:
    """A room with a door of 0.8 m, and an exit of 2 m behind."""
    return {
        "version": 1,
        "dimension": 2,
        "plane": "xy",
        "time": {"fps": 20},
        "plan": [
            {
                "name": "floor",
                "walls": WALLS,
                "door": [{"name": "door", "from": [6, 1.6], "to": [6, 2.4]}],
                "exit": [{"name": "out", "from": [9, 1], "to": [9, 3]}],
            }
        ],
        "crowd": [{"name": "people", "area": [[0.5, 0.5], [5, 3.5]], "count": people}],
    }


def test_the_narrow_door_costs_the_most_and_a_wider_one_saves() -> None:
    found = study(Scene(tree()), seeds=3, widen=0.4, first=1)
    first, second = found.rows
    assert (first.gate, second.gate) == ("door", "out")
    assert first.lost.mean > 10.0 * second.lost.mean and first.share > 0.9
    assert first.crossed == 40 and first.width == pytest.approx(0.8)
    # As measured: 1.86 persons a second and metre, within 15 %; here a short queue, from its first to its last.
    assert first.flow.mean / 0.8 == pytest.approx(1.86, rel=0.2)
    assert sum(p.lost for p in found.outcomes[0].passages) == pytest.approx(found.outcomes[0].lost, rel=1e-6)
    assert len({run.lost for run in found.outcomes}) == 3 and not found.stuck
    (changed,) = found.widened
    assert changed.gate == "door" and 0.15 < changed.saved.mean / found.lost.mean < 0.7 and changed.earlier.mean > 3.0


def test_rocks_cost_people_and_time_and_the_report_says_whom_they_hit_when(tmp_path: Path) -> None:
    scene = tree(12) | {"dimension": 3}
    del scene["plane"]
    rock = {"name": "rock", "shape": {"sphere": {"radius": 0.3}}, "mass": 200, "rolling_friction": 0.3}
    # Two stones fall into the room, far from the door: who lies in a door closes it.
    places = [[2.2, 2.0, 4.0], [1.4, 2.0, 5.0]]
    scene["body"] = [rock | {"position": places}]
    scene["collider"] = [{"name": "ground", "shape": {"floor": {}}}]
    scene["crowd"] = [{"name": "people", "area": [[0.9, 1.2], [2.9, 2.8]], "count": 12}]
    found = study(Scene(scene), seeds=2)
    assert not found.stuck and len(found.without) == 2
    last, lost, injured = (found.bodies[what] for what in ("last_out", "lost", "injured"))
    assert injured[0].mean >= 1.0 and injured[1].mean == 0.0
    assert lost[0].mean > lost[1].mean and last[0].n == last[1].n == 2
    for run in found.outcomes:
        assert run.left + run.injured == run.people == 12
        times, states = run.hits[:, 0], run.hits[:, 3]
        # A fall from 1.95 m lasts 0.63 s; samples are 0.5 s apart.
        assert 0.5 <= times.min() <= 1.0 and (states == 2).sum() == run.injured
        assert passages.unpacked(passages.packed(run)).hits.tolist() == run.hits.tolist()
    report.write(found, tmp_path)
    with (tmp_path / "hits.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == sum(len(run.hits) for run in found.outcomes)
    assert "people are injured" in (tmp_path / "bottlenecks.html").read_text(encoding="utf-8")
    quiet = study(Scene(tree(4)), seeds=1)
    assert quiet.without == () and quiet.bodies == {} and quiet.outcomes[0].injured == 0


def test_numbers_do_not_depend_on_the_workers() -> None:
    one, two = (study(Scene(tree(20)), seeds=2, widen=0.2, first=1, workers=workers) for workers in (1, 2))
    assert one.rows == two.rows and one.widened == two.widened
    assert [run.last_out for run in one.outcomes] == [run.last_out for run in two.outcomes]


def test_numbers_are_those_of_a_run_here_and_of_a_cluster() -> None:
    scene = Scene(tree(10))
    here = passages.run(scene, 1800.0)
    for on in ("cores", "dask"):
        (there,) = study(scene, seeds=1, on=on, workers=1).outcomes
        assert (
            passages.packed(there) == passages.packed(here) == passages.packed(passages.unpacked(passages.packed(here)))
        )


def test_a_run_that_cannot_be_computed_is_an_error() -> None:
    with pytest.raises(SceneError, match="expected cores, dask"):
        study(Scene(tree(5)), seeds=1, on="nowhere")


def test_walls_that_end_at_a_door_move_with_its_jambs() -> None:
    plan = Scene(tree()).to_dict()["plan"][0]
    wider = widened(plan, "door", 0.4)
    assert wider is not None
    assert [wider["walls"][0][0], wider["walls"][0][-1]] == [pytest.approx([6, 2.6]), pytest.approx([6, 1.4])]
    assert wider["walls"][1:] == plan["walls"][1:]
    assert wider["door"][0]["from"] == pytest.approx([6, 1.4])
    # A door that no wall ends at cannot be made wider.
    assert widened({**plan, "walls": [[[0, 0], [9, 0]]]}, "door", 0.4) is None


def test_gates_that_cannot_be_made_wider_are_named(tmp_path: Path) -> None:
    plan = tree(5)
    # Set back from the walls that end before it.
    plan["plan"][0]["exit"][0] |= {"from": [8.9, 1], "to": [8.9, 3]}
    (tmp_path / "plan.json").write_text(json.dumps(plan))
    command = ["bottlenecks", str(tmp_path / "plan.json"), "--seeds", "1", "--widen", "0.2", "--out", str(tmp_path)]
    said = CliRunner().invoke(application(), command)
    assert said.exit_code == 0, said.output
    assert (
        "door wider by 0.2 m" in said.output
        and "out was not made wider: no wall ends at both of its jambs" in said.output
    )
    assert "out was not made wider" in (tmp_path / "bottlenecks.html").read_text()


def test_reports_hold_the_ranking(tmp_path: Path) -> None:
    found = study(Scene(tree(20)), seeds=2)
    written = report.write(found, tmp_path)
    assert all(path.stat().st_size > 200 for path in written)
    with (tmp_path / "bottlenecks.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["gate"] for row in rows] == ["door", "out"]
    assert float(rows[0]["lost_mean [s]"]) == found.rows[0].lost.mean
    assert "<b>door</b> costs the most" in (tmp_path / "bottlenecks.html").read_text()


def test_the_command_line_ranks_and_tells_who_is_left(tmp_path: Path) -> None:
    (tmp_path / "plan.json").write_text(json.dumps(tree(20)))
    command = ["bottlenecks", str(tmp_path / "plan.json"), "--seeds", "2", "--out", str(tmp_path / "report")]
    said = CliRunner().invoke(application(), command)
    assert said.exit_code == 0 and said.output.index(" door ") < said.output.index(" out ")
    assert (tmp_path / "report" / "bottlenecks.html").is_file()
    early = CliRunner().invoke(application(), [*command, "--limit", "5", "--json"])
    found = json.loads(early.stdout)
    assert early.exit_code == 1 and found["stuck"] == [0, 1] and found["last_out"]["mean"] in ("nan", None, math.nan)
