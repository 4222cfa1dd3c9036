"""The tables of measures: what is generated from them, what reaches the ledger, and what is not measured."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tumble import Scene, World, expect, measures
from tumble.columns import BOUND, COLUMNS, GRIDS, KINDS, OBJECTS
from tumble.folder import COUNTS, LEDGER, read_rows
from tumble.reader import Run
from tumble.run import simulate

ROOT = Path(__file__).parents[2]
ROPE = {"name": "rope", "from": [0, 0, 1], "to": [1, 0, 1], "segments": 4, "density": 1.0}
GAS = {"name": "gas", "box": {"size": [1.0, 1.0, 1.0], "resolution": 8}}


@pytest.fixture(scope="module")
def projected(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A rope, projected in 2 sub-steps of 3 sweeps a frame."""
    system = {"name": "main", "method": "position_based", "substeps": 2, "position_based": {"iterations": 3}}
    scene = {"version": 1, "time": {"frames": 4}, "system": [system], "rope": [ROPE], "output": {"plot": False}}
    return simulate(scene, tmp_path_factory.mktemp("measures") / "run")


def test_what_is_generated_is_up_to_date() -> None:
    for path, text in measures.generated(ROOT).items():
        assert path.read_text(encoding="utf-8") == text, f"{path}: python -m tumble.measures"


def test_sweeps_reach_the_ledger(projected: Run) -> None:
    assert projected.ledger["steps"].tolist() == [0, 2, 2, 2, 2]
    assert projected.ledger["sweeps"].tolist() == [0, 6, 6, 6, 6]
    world = World(projected.scene)
    assert world.step(2)["sweeps"] == 12
    assert "sweeps: number;" in measures.types() and "sweeps: a.sweeps + b.sweeps," in measures.types()


def test_what_is_not_measured_is_not_zero(projected: Run) -> None:
    books = World(projected.scene).ledger
    assert books["stretch"] == pytest.approx(1.0) and books["broken"] == 0 and books["energy"] != 0.0
    for name in ("penetration", "contacts", "intersections", "heat", "volume", "divergence"):
        assert books[name] is None, name  # type: ignore[literal-required]
        assert np.isnan(projected.ledger[name]).all(), name
    gas = World({"version": 1, "gas": [GAS]}).ledger
    assert gas["divergence"] == 0.0 and gas["speed"] == 0.0
    assert gas["stretch"] is None and gas["angular_momentum"] is None
    # Nothing in the way: the frame at the start took no solver.
    assert np.isnan(projected.ledger["residual"]).all() and not projected.ledger["newton"].any()


def test_systems_together_have_what_each_of_them_has() -> None:
    world = World({"version": 1, "gas": [GAS], "rope": [ROPE]})
    world.step()
    books, systems = world.ledger, dict(world.account()["systems"])
    assert len(systems) == 2
    for measure in measures.LEDGER:
        known = [own[measure.name] for own in systems.values() if own[measure.name] is not None]
        merged = {"sum": np.sum, "max": np.max, "last": lambda all, axis: all[-1]}[measure.systems]
        found = books[measure.name]  # type: ignore[literal-required]
        assert (found is None) == (not known), measure.name
        if known:
            np.testing.assert_allclose(found, merged(known, axis=0), rtol=1e-12, atol=1e-300)
    assert books["stretch"] is not None and books["divergence"] is not None and books["mass"] > 0.5


def test_every_column_of_the_ledger_is_described(projected: Run) -> None:
    assert ["frame", *measures.OF_COLUMN, "seconds", "hash"] == LEDGER
    assert len(set(LEDGER)) == len(LEDGER)
    whole = {name for name in LEDGER[:-1] if np.all(np.mod(np.nan_to_num(projected.ledger[name]), 1.0) == 0.0)}
    assert whole >= COUNTS - {"accepted"}
    assert {"kg", "kg m/s", "kg m²/s", "J", "m", "m/s", "m³", "1/s", "s", "1"} == {
        measure.unit for measure in measures.OF_COLUMN.values()
    }


def test_a_ledger_of_an_earlier_version_is_read(projected: Run, tmp_path: Path) -> None:
    now = read_rows(projected.folder / "ledger.csv", LEDGER)
    at = LEDGER.index("sweeps")
    table = [LEDGER, *now]
    older = tmp_path / "ledger.csv"
    older.write_text("".join(",".join([*line[:at], *line[at + 1 :]]) + "\n" for line in table))
    rows = read_rows(older, LEDGER)
    assert len(rows) == len(now) == 5
    assert all(
        row[at] == "nan" and [*row[:at], *row[at + 1 :]] == [*new[:at], *new[at + 1 :]]
        for row, new in zip(rows, now, strict=True)
    )
    # A name that is none is damage, and so is another order.
    for wrong in ({"mass": "mess"}, {"kinetic": "elastic", "elastic": "kinetic"}):
        header = ",".join(wrong.get(name, name) for name in LEDGER)
        older.write_text("".join(line + "\n" for line in [header, *map(",".join, now)]))
        assert read_rows(older, LEDGER) == []


def test_a_bound_that_a_run_never_measured_is_broken(projected: Run) -> None:
    bounds = expect.Bounds({"max_stretch": 2.0, "max_divergence": 1.0})
    for row in read_rows(projected.folder / "ledger.csv", LEDGER):
        bounds.add(expect.numbers(row))
    assert not bounds.broken
    (idle,) = bounds.idle
    assert idle.text == "max_divergence bounds nothing here: divergence was not measured" and math.isnan(idle.value)


def test_units_of_expectations_are_those_of_the_schema() -> None:
    words = Scene.schema()["$defs"]["Expect"]["properties"]
    assert {bound.name: bound.unit for bound in measures.BOUNDS} == {
        name: word.get("x-unit", "1") for name, word in words.items() if name != "probe"
    }


def test_every_column_is_described() -> None:
    ball = {"name": "ball", "shape": {"sphere": {"radius": 0.1}}, "motion": {"velocity": [0, 0, -1]}}
    emitter = {
        "name": "spray",
        "from": {"point": {"at": [0, 0, 2]}},
        "rate": 200.0,
        "radius_spread": 0.5,
        "mass_spread": 0.5,
    }
    hot = {
        "name": "plate",
        "box": GAS["box"],
        "conductivity": 1.0,
        "density": 1e3,
        "heat_capacity": 1e3,
        "temperature": 300.0,
    }
    scenes: list[dict[str, Any]] = [
        {
            "rope": [ROPE | {"pin": ["start"], "rod": {"stretch": 10.0, "bend": 0.1, "twist": 0.1}}],
            "collider": [ball],
            "emitter": [],
        },
        {"emitter": [emitter], "sheet": [{"name": "sheet", "size": [1, 1], "resolution": [3, 3]}]},
        {"gas": [GAS | {"fire": {}, "temperature": {}}]},
        {"body": [{"name": "box", "shape": {"box": {"size": [1, 1, 1]}}}]},
        {"heat": [hot]},
        {"liquid": [{"name": "water", "box": GAS["box"], "fill": [{"shape": {"sphere": {"radius": 0.3}}}]}]},
        {"compressible": [GAS | {"sound_speed": 300.0, "density": 1.0}]},
        {
            "plan": [
                {
                    "name": "hall",
                    "walls": [[[0, 0], [4, 0]], [[0, 2], [4, 2]]],
                    "exit": [{"name": "out", "from": [4, 0], "to": [4, 2]}],
                }
            ],
            "crowd": [{"name": "people", "position": [[1, 1]]}],
            "body": [{"name": "stone", "shape": {"sphere": {"radius": 0.2}}, "position": [[3, 1, 0.5]]}],
        },
    ]
    found: dict[str, set[str]] = {"static": set(), "frames": set()}
    for words in scenes:
        world = World(
            {"version": 1, "output": {"columns": [column.name for column in COLUMNS.values() if column.asked]}} | words
        )
        world.step()
        units = world.units
        for place, table in (("static", world.topology), ("frames", world.frame)):
            for thing, columns in table.items():
                for name in columns:
                    assert units[thing][name] == COLUMNS[name].unit, (thing, name)
                    found[place].add(name)
    assert found["frames"] >= {name for name, column in COLUMNS.items() if column.in_frames} - {"force", "color"}
    assert found["static"] >= {name for name, column in COLUMNS.items() if not column.in_frames} - {
        "texture",
        "curve_points",
    }


def test_every_kind_is_described() -> None:
    scene = Scene({"version": 1, "rope": [ROPE]}).to_dict()
    definitions = Scene.schema()
    for kind in KINDS.values():
        assert isinstance(scene[kind.name], list)
        name = definitions["properties"][kind.name]["items"]["$ref"].rpartition("/")[2]
        words = definitions["$defs"][name]["properties"]
        for word in (*kind.amounts, *filter(None, [kind.resolution])):
            assert word.partition(".")[0] in words, (kind.name, word)
        assert kind.surface <= ({"membrane", "fabric"} <= words.keys())
        assert (kind.resolution == "box.resolution") == ("box" in words) and (kind.matter != "cells" or "box" in words)
    assert GRIDS == ("heat", "compressible", "gas") and "hair" in BOUND and "collider" not in OBJECTS
