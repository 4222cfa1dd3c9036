"""Flow, density and speed at gates: against closed forms, and against PedPy on the files that it reads."""

import csv
import json
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_bottlenecks import tree
from typer.testing import CliRunner

from tumble import Scene, SceneError
from tumble.bottlenecks import measures, paths
from tumble.bottlenecks.paths import Walk
from tumble.cli import application

# A room, and a corridor of 1 m behind its mouth.
WALLS = [[14, 2], [8, 2], [8, 0], [0, 0], [0, 5], [8, 5], [8, 3], [14, 3]]
MOUTH = np.array([[8.0, 2.0], [8.0, 3.0]])
AREA = np.array([[6.8, 2.0], [7.8, 2.0], [7.8, 3.0], [6.8, 3.0]])


def room(people: int) -> Scene:
    plan = {
        "name": "floor",
        "walls": [WALLS],
        "door": [{"name": "mouth", "from": [8, 2], "to": [8, 3]}],
        "exit": [{"name": "out", "from": [14, 2], "to": [14, 3]}],
    }
    crowd = {"name": "people", "area": [[0.5, 0.5], [6, 4.5]], "count": people}
    return Scene({**tree(1), "time": {"fps": 16}, "plan": [plan], "crowd": [crowd]})


def walk(rows: Any, fps: float = 10.0) -> Walk:
    """Of rows of person, frame, x, y."""
    table = np.array(sorted(map(tuple, rows)), float).reshape(-1, 4)
    ids = table[:, :2].astype(np.int64)
    return Walk(fps, ids[:, 0], ids[:, 1], table[:, 2:], ())


def test_persons_in_single_file_have_the_flow_of_their_speed_and_spacing() -> None:
    # 0.8 m/s, 0.5 m apart: 1.6 persons a second; one turns back behind the line, and counts once.
    rows = [(i, f, -0.5 * i - 0.25 + 0.08 * f, 0.0) for i in range(20) for f in range(160)]
    rows += [(99, f, -1.0 + 0.1 * min(f, 30 - f), 0.2) for f in range(31)]
    line = np.array([[0.0, -0.5], [0.0, 0.5]])
    file = walk(rows[: 20 * 160])
    assert measures.flow(file, line) == pytest.approx(1.6, rel=0.02)
    assert measures.n_t(file, line)[[0, 4, 159]].tolist() == [0, 1, 20]
    assert len(measures.crossings(walk(rows), line)) == 21
    # Beside the line nobody crosses it.
    assert len(measures.crossings(walk(rows), line + np.array([0.0, 2.0]))) == 0
    assert measures.speeds(file) == pytest.approx(np.full(20 * 160, 0.8))


def test_a_lattice_has_the_density_of_its_cells() -> None:
    """Squares of 0.5 m: 4 persons on a square metre, wherever the area is, up to a wall, which nobody's cell goes through."""
    x, y = np.meshgrid(0.25 + 0.5 * np.arange(16), 0.25 + 0.5 * np.arange(8))
    people = [
        (k, f, px + 0.06 * f, py) for k, (px, py) in enumerate(zip(x.ravel(), y.ravel(), strict=True)) for f in range(3)
    ]
    walls = [np.array([[0.0, 0.0], [9.0, 0.0], [9.0, 4.0], [0.0, 4.0], [0.0, 0.0]])]
    area = np.array([[3.0, 1.5], [4.0, 1.5], [4.0, 2.5], [3.0, 2.5]])
    density, speed = measures.voronoi(walk(people), walls, area, [0, 1])
    assert density == pytest.approx([4.0, 4.0], rel=0.02) and speed == pytest.approx([0.6, 0.6], rel=1e-6)
    # One person alone behind a wall has the room behind it, though others are nearer to most of it.
    wall = np.array([[5.0, 0.0], [5.0, 4.0]])
    alone = walk([(0, 0, 4.9, 2.0), (1, 0, 5.5, 2.0)])
    density, _ = measures.voronoi(
        alone, [*walls, wall], np.array([[5.1, 1.9], [5.3, 1.9], [5.3, 2.1], [5.1, 2.1]]), [0]
    )
    # Half the area is nearer to the one before the wall, and is nobody's: the cell of the other one has 5.2 < x < 7.5.
    assert 0.5 / 9.0 < density[0] < 0.5 / 6.0


def test_files_hold_the_ways(tmp_path: Path) -> None:
    found = paths.walked(room(6), 60.0)
    assert set(found.person) == set(range(6)) and found.fps == 16.0
    # All leave by the exit, which their last step crosses.
    assert len(measures.crossings(found, np.array([[14.0, 2.0], [14.0, 3.0]]))) == 6
    assert len(found.floor) == 1 and len(found.floor[0]) == 9
    text = paths.write(found, tmp_path / "a.txt").read_text().splitlines()
    assert text[0] == "# framerate: 16 fps" and len(text) == 2 + len(found.x)
    with closing(sqlite3.connect(paths.write(found, tmp_path / "a.sqlite"))) as base:
        assert base.execute("SELECT COUNT(*) FROM trajectory_data").fetchone() == (len(found.x),)
        assert base.execute("SELECT wkt FROM geometry").fetchone()[0].startswith("POLYGON ((")
        lengths = base.execute("SELECT ori_x * ori_x + ori_y * ori_y FROM trajectory_data").fetchall()
        assert all(abs(length - 1.0) < 1e-9 or length == 0.0 for (length,) in lengths)
    with pytest.raises(SceneError, match=r"expected \.txt, \.sqlite"):
        paths.form(Path("a.csv"))


def test_the_command_line_writes_ways_and_measures(tmp_path: Path) -> None:
    (tmp_path / "room.json").write_text(json.dumps(room(12).to_dict()))
    command = ["bottlenecks", str(tmp_path / "room.json"), "--seeds", "1", "--out", str(tmp_path / "out")]
    said = CliRunner().invoke(application(), [*command, "--trajectories", str(tmp_path / "a.txt")])
    assert said.exit_code == 0, said.output
    with (tmp_path / "out/gates.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["gate"] for row in rows} == {"mouth", "out"}
    assert [row["crossed"] for row in rows][-1] == "12" and max(float(row["density [1/m2]"]) for row in rows) > 0.5
    wrong = CliRunner().invoke(application(), [*command, "--trajectories", "a.csv"])
    assert wrong.exit_code == 2 and "expected .txt, .sqlite" in wrong.output


@pytest.mark.long
def test_pedpy_measures_the_same_on_our_files(tmp_path: Path) -> None:
    pedpy = pytest.importorskip("pedpy")
    shapely = pytest.importorskip("shapely")
    from pedpy.methods.method_utils import SpeedCalculation

    found = paths.walked(room(60), 300.0)
    load = {
        "a.txt": lambda file: pedpy.load_trajectory_from_txt(trajectory_file=file),
        "a.sqlite": lambda file: pedpy.load_trajectory_from_jupedsim_sqlite(trajectory_file=file),
        "a.h5": lambda file: pedpy.load_trajectory_from_ped_data_archive_hdf5(trajectory_file=file),
    }
    read = {name: own(paths.write(found, tmp_path / name)) for name, own in load.items()}
    assert all(t.frame_rate == 16.0 and len(t.data) == len(found.x) for t in read.values())
    floor = pedpy.load_walkable_area_from_jupedsim_sqlite(trajectory_file=tmp_path / "a.sqlite")
    other = pedpy.load_walkable_area_from_ped_data_archive_hdf5(trajectory_file=tmp_path / "a.h5")
    assert floor.polygon.equals(other.polygon) and floor.polygon.area == pytest.approx(46.0)
    for table in read.values():
        counted, crossed = pedpy.compute_n_t(traj_data=table, measurement_line=pedpy.MeasurementLine(MOUTH.tolist()))
        assert counted.cumulative_pedestrians.tolist() == measures.n_t(found, MOUTH).tolist()
        span = crossed.frame.max() - crossed.frame.min()
        assert measures.flow(found, MOUTH) == pytest.approx((len(crossed) - 1) / span * 16.0, rel=1e-9)

    table = read["a.sqlite"]
    speed = pedpy.compute_individual_speed(
        traj_data=table, frame_step=measures.STEP, speed_calculation=SpeedCalculation.BORDER_ADAPTIVE
    )
    own = dict(zip(zip(found.person.tolist(), found.frame.tolist(), strict=True), measures.speeds(found), strict=True))
    assert max(abs(v - own[i, f]) for i, f, v in zip(speed.id, speed.frame, speed.speed, strict=True)) < 1e-9

    frames = list(range(16, int(found.frame.max()), 8))
    inside = table.data[table.data.frame.isin(frames) & shapely.within(table.data.point, floor.polygon)]
    cells = pedpy.compute_individual_voronoi_polygons(
        traj_data=pedpy.TrajectoryData(inside.drop(columns=["point"]), frame_rate=16.0),
        walkable_area=floor,
        cut_off=pedpy.Cutoff(radius=measures.REACH, quad_segments=32),
    )
    for area in (AREA, measures.before(MOUTH) + np.array([0.5, 0.0])):
        place = pedpy.MeasurementArea(area.tolist())
        density, parts = pedpy.compute_voronoi_density(individual_voronoi_data=cells, measurement_area=place)
        voronoi = pedpy.compute_voronoi_speed(
            traj_data=table, individual_speed=speed, individual_voronoi_intersection=parts, measurement_area=place
        )
        theirs = [
            t.set_index("frame")[name].reindex(frames).fillna(0.0).to_numpy()
            for t, name in ((density, "density"), (voronoi, "speed"))
        ]
        ours = measures.voronoi(found, [np.array(WALLS, float)], area, frames)
        for a, b in zip(ours, theirs, strict=True):
            assert b.mean() > 0.2 and a.mean() == pytest.approx(b.mean(), rel=0.02)
            # Seen: 0.05 % of the mean density; in single frames up to 7.5 % of the largest, where a cell is cut in two.
            assert np.abs(a - b).max() < 0.1 * b.max()
