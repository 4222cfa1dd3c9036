"""`tumble diff`: the first frame, object, column and element at which two runs part."""

import copy
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import Answer
from runs import Tree, repack

from tumble import Run, SceneError
from tumble.compare import compare
from tumble.folder import STATIC, marked, read_columns, write_columns
from tumble.run import simulate

Command = Callable[..., Answer]


@pytest.fixture
def pair(sheet: Tree, tmp_path: Path) -> tuple[Run, Run]:
    """The same run twice, on one core and on two."""
    return simulate(sheet, tmp_path / "a", threads=1), simulate(sheet, tmp_path / "b", threads=2)


def change(run: Run, frame: int, column: str, index: tuple[int, ...], ulps: int) -> tuple[float, float]:
    """Moves one number of a frame's file by so many ulps; returns what it was and is."""
    path = run.folder / f"frames/{frame:06}.npz"
    columns = run.frame(frame)
    array = columns["sheet"][column]
    old = array[index]
    new = old
    for _ in range(ulps):
        new = np.nextafter(new, np.float32(np.inf))
    array[index] = new
    write_columns(path, columns, run.mark(frame))
    return float(old), float(new)


def test_the_same_scene_gives_the_same_bits(pair: tuple[Run, Run], tumble: Command) -> None:
    found = compare(*pair, deep=True)
    assert found.same
    assert (found.frame, found.columns, found.compared, found.unlike) == (None, [], 7, [])
    answer = tumble("diff", *[run.folder for run in pair])
    assert answer.code == 0
    assert "the same bits in 7 frames" in answer.out


def test_one_number_of_one_frame_is_found(pair: tuple[Run, Run], tumble: Command) -> None:
    a, b = pair
    was, now = change(b, 4, "velocity", (17, 1), 3)
    change(b, 4, "velocity", (20, 2), 1)
    change(b, 5, "position", (3, 0), 1)
    # The states' hashes are the same: only who reads the files can tell.
    assert compare(a, b).same
    found = compare(a, b, deep=True)
    assert (found.frame, found.seen, found.hashes) == (4, 4, None)
    (column,) = found.columns
    assert (column.object, column.column, column.unit) == ("sheet", "velocity", "m/s")
    assert (column.index, column.values, column.ulps) == ((17, 1), (was, now), 3)
    assert (column.count, column.size) == (2, 108)
    assert found.time == pytest.approx(4 / 24)
    assert compare(a, b, until=3, deep=True).same
    answer = tumble("diff", "--deep", a.folder, b.folder)
    assert answer.code == 1
    for word in ("frame 4", 'velocity of "sheet", element 17, y', repr(was), repr(now), "3 ulps", "2 of 108"):
        assert word in answer.out, word
    assert tumble("diff", "--deep", a.folder, b.folder, "--until", 3).code == 0


def test_hashes_alone_lead_to_the_frame(pair: tuple[Run, Run], sheet: Tree, tmp_path: Path, tumble: Command) -> None:
    """A gravity that differs by one part in 10^7 shows in the state at once, in single precision a little later."""
    sheet["world"] = {"gravity": [0.0, 0.0, -9.800001]}
    other = simulate(sheet, tmp_path / "other")
    found = compare(pair[0], other)
    deep = compare(pair[0], other, deep=True)
    assert (found.frame, found.seen) == (deep.frame, deep.seen)
    assert found.frame is not None and found.seen is not None and found.seen >= found.frame
    assert found.hashes == (pair[0].hashes[found.frame], other.hashes[found.frame])
    # By hand: the first frame and column in which any bit differs.
    by_hand = next(
        (i, column)
        for i in range(7)
        for column in ("position", "velocity")
        if pair[0].frame(i)["sheet"][column].tobytes() != other.frame(i)["sheet"][column].tobytes()
    )
    assert (found.seen, found.seen_columns[0].column) == by_hand
    answer = tumble("diff", pair[0].folder, other.folder)
    assert answer.code == 1
    assert "world.gravity.2 was -9.8, is -9.800001" in answer.out
    assert 'by frame 6  position of "sheet"' in answer.out


def test_zeros_of_two_signs_and_nan(pair: tuple[Run, Run]) -> None:
    a, b = pair
    for run, value in ((a, 0.0), (b, -0.0)):
        path = run.folder / "frames/000002.npz"
        columns = run.frame(2)
        columns["sheet"]["position"][0, 0] = value
        columns["sheet"]["velocity"][:] = np.nan
        write_columns(path, columns, run.mark(2))
    (column,) = compare(a, b, deep=True).columns
    # Not a number with the same bits is the same; a zero of another sign is not, though no number lies between.
    assert (column.column, column.index, column.ulps, column.count) == ("position", (0, 0), 0, 1)


@pytest.mark.parametrize(
    ("a", "b", "ulps"), [(1.0, 1.0000001, 1), (-1e-45, 1e-45, 2), (1.0, 2.0, 2**23), (1.0, np.inf, np.inf)]
)
def test_ulps_count_numbers_across_zero(a: float, b: float, ulps: float) -> None:
    from tumble.compare import _ulps

    assert _ulps(np.float32(a), np.float32(b)) == _ulps(np.float32(b), np.float32(a)) == ulps


def test_a_longer_run_is_not_the_same(pair: tuple[Run, Run], sheet: Tree, tmp_path: Path, tumble: Command) -> None:
    short = simulate(sheet, tmp_path / "short", frames=4)
    found = compare(pair[0], short)
    assert (found.frame, found.longer, found.same) == (None, True, False)
    answer = tumble("diff", short.folder, pair[0].folder)
    assert answer.code == 1
    assert f"{pair[0].folder} has 2 frames more" in answer.out
    assert tumble("diff", short.folder, pair[0].folder, "--until", 4).code == 0


def test_books_are_compared(pair: tuple[Run, Run], tumble: Command) -> None:
    a, b = pair
    lines = (b.folder / "ledger.csv").read_text().splitlines()
    fields = lines[4].split(",")
    fields[8 + 1] = "0.125"
    lines[4] = ",".join(fields)
    (b.folder / "ledger.csv").write_text("\n".join(lines) + "\n")
    found = compare(a, Run(b.folder))
    assert (found.frame, found.seen) == (3, None)
    assert [(c.object, c.column, c.values[1]) for c in found.columns] == [("ledger", "kinetic", 0.125)]
    answer = tumble("diff", a.folder, b.folder)
    assert answer.code == 1
    assert "kinetic" in answer.out and "0.125" in answer.out


def test_static_columns_are_compared(pair: tuple[Run, Run]) -> None:
    a, b = pair
    static = read_columns(b.folder / "static.npz", STATIC)
    static["sheet"]["mass"][5] *= 2
    write_columns(b.folder / "static.npz", static, STATIC)
    found = compare(a, Run(b.folder))
    assert (found.frame, found.columns[0].column, found.columns[0].index) == (0, "mass", (5,))


def test_two_precisions_are_compared_in_the_lower_one(pair: tuple[Run, Run], sheet: Tree, tmp_path: Path) -> None:
    sheet["precision"] = "double"
    double = simulate(sheet, tmp_path / "double")
    found = compare(pair[0], double)
    # At the start the same numbers, rounded; then the arithmetic differs.
    assert found.frame is not None and found.frame >= 1 and not found.same
    assert found.hashes is None
    assert 1 <= found.seen_columns[0].ulps < 100


def test_particles_that_come_and_go(tmp_path: Path) -> None:
    tree: Tree = {
        "version": 1,
        "time": {"fps": 24, "frames": 6},
        "emitter": [{"name": "e", "from": {"point": {"at": [0, 0, 0]}}, "rate": 60.0, "speed": 1.0, "lifetime": 2.0}],
        "output": {"plot": False},
    }
    other = copy.deepcopy(tree)
    other["emitter"][0]["rate"] = 90.0
    runs = simulate(tree, tmp_path / "a"), simulate(other, tmp_path / "b")
    found = compare(*runs)
    # 2.5 and 3.75 births by the first frame.
    assert found.seen == 1 and [len(run.frame(1)["e"]["position"]) for run in runs] == [2, 3]
    assert {c.column: c.lengths for c in found.seen_columns} == dict.fromkeys(
        ("position", "velocity", "id", "age"), (2, 3)
    )
    # Both are born from 0 on, at the same place: what differs is when.
    assert all(c.count > 0 and c.largest > 0.0 for c in found.seen_columns if c.column != "id")


def test_runs_of_other_things_are_refused(pair: tuple[Run, Run], sheet: Tree, tmp_path: Path, tumble: Command) -> None:
    a = pair[0]
    named, finer, faster = (copy.deepcopy(sheet) for _ in range(3))
    named["sheet"][0]["name"] = "flag"
    finer["sheet"][0]["resolution"] = [6, 7]
    faster["time"]["fps"] = 30
    for tree, name, word in (
        (named, "named", '"sheet"'),
        (finer, "finer", "resolution"),
        (faster, "faster", "frames per second"),
    ):
        other = simulate(tree, tmp_path / name, frames=1)
        with pytest.raises(SceneError, match=word):
            compare(a, other)
        answer = tumble("diff", a.folder, other.folder)
        assert answer.code == 2
        assert word in answer.err and "Traceback" not in answer.err
    answer = tumble("diff", a.folder, tmp_path / "nowhere")
    assert answer.code == 2 and "no such run" in answer.err


def test_columns_that_one_run_alone_keeps_are_named(
    pair: tuple[Run, Run], sheet: Tree, tmp_path: Path, tumble: Command
) -> None:
    sheet["output"]["columns"] = ["position"]
    less = simulate(sheet, tmp_path / "less")
    found = compare(pair[0], less)
    assert found.frame is None
    assert found.unlike == [f'velocity of "sheet" is stored only in {pair[0].folder}']
    answer = tumble("diff", pair[0].folder, less.folder)
    assert answer.code == 0 and "velocity" in answer.out


def test_damage_is_told_and_ends_with_1(pair: tuple[Run, Run], tumble: Command) -> None:
    a, b = pair
    path = b.folder / "frames/000003.npz"
    path.write_bytes(path.read_bytes()[:200])
    answer = tumble("diff", "--deep", a.folder, b.folder)
    assert answer.code == 1
    assert str(path) in answer.err and "--resume" in answer.err


def test_a_column_that_a_frame_has_lost_is_damage(pair: tuple[Run, Run], tumble: Command) -> None:
    one, other = pair
    path = other.folder / "frames" / sorted(p.name for p in (other.folder / "frames").iterdir())[2]
    with np.load(path) as file:
        whole = dict(file)
    lost = next(name for name in whole if name.endswith("velocity"))
    repack(path, {name: array for name, array in whole.items() if name != lost})
    answer = tumble("diff", str(one.folder), str(other.folder), "--deep")
    assert answer.code == 1 and 'sheet/velocity" is missing' in answer.err
    repack(path, whole | {lost: whole[lost][:, :2]})
    answer = tumble("diff", str(one.folder), str(other.folder), "--deep")
    assert answer.code == 1 and "is damaged" in answer.err


def test_the_manifest_has_the_hash_of_every_frame(pair: tuple[Run, Run]) -> None:
    manifest = json.loads((pair[0].folder / "run.json").read_text())
    assert manifest["hashes"] == pair[0].hashes
    assert len(set(manifest["hashes"])) == 7
    shutil.rmtree(pair[1].folder)


def test_a_state_of_which_nothing_shows(pair: tuple[Run, Run], tumble: Command) -> None:
    a, b = pair
    columns, path = b.frame(4), b.folder / "ledger.csv"
    path.write_text(path.read_text().replace(a.hashes[4], "0123456789abcdef"))
    write_columns(b.folder / "frames/000004.npz", columns, marked(4, "0123456789abcdef"))
    found = compare(a, Run(b.folder))
    assert (found.frame, found.seen, found.columns) == (4, None, [])
    assert found.hashes == (a.hashes[4], "0123456789abcdef")
    answer = tumble("diff", a.folder, b.folder)
    assert answer.code == 1
    assert "frame 4" in answer.out and "output.columns" in answer.out


def test_reading_all_frames_finds_the_same_as_their_hashes(pair: tuple[Run, Run], sheet: Tree, tmp_path: Path) -> None:
    sheet["sheet"][0]["center"] = [0.0, 0.0, 0.3500001]
    other = simulate(sheet, tmp_path / "other")
    found = compare(pair[0], other)
    assert found == compare(pair[0], other, deep=True)
    assert (found.frame, found.columns[0].column) == (0, "position")


def test_one_element_more_is_a_difference() -> None:
    from tumble.compare import _differ

    one, more = np.arange(3.0), np.arange(4.0)
    assert _differ("e", "age", "s", one, one, None) is None
    found = _differ("e", "age", "s", one, more, None)
    assert found is not None
    assert (found.count, found.lengths, found.index) == (0, (3, 4), ())
