"""The [expect] table: each bound holds at the worst value, and breaks just below it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from runs import OBJECT, N, Tree, killed

from tumble import Run, SceneError
from tumble import expect as expectations
from tumble.run import simulate


def broken(scene: Tree, folder: Path, **expect: Any) -> list[tuple[str, int]]:
    run = simulate(scene | {"expect": expect}, folder, overwrite=True)
    found = [(b["name"], b["frame"]) for b in run.manifest["expectations"]]
    assert found == [(b.name, b.frame) for b in expectations.check(run)]
    return found


def test_bounds_on_curves_hold_at_the_worst_frame_and_not_below(spring: Tree, tmp_path: Path, reference: Run) -> None:
    ledger = reference.ledger
    curves = {"max_stretch": "stretch", "max_speed": "speed"}
    for name, column in curves.items():
        worst = int(np.argmax(ledger[column]))
        bound = float(ledger[column][worst])
        assert broken(spring, tmp_path / "run", **{name: bound}) == []
        first = int(np.argmax(ledger[column] > 0.999 * bound))
        assert broken(spring, tmp_path / "run", **{name: 0.999 * bound}) == [(name, first)]


def test_energy_bounds_are_relative_to_what_moves(spring: Tree, tmp_path: Path, reference: Run) -> None:
    ledger = reference.ledger
    external = np.abs(ledger["external"] - ledger["external"][0])
    scale = np.maximum.accumulate(np.max([ledger["kinetic"], ledger["elastic"], external], axis=0))
    change = (ledger["energy"] - ledger["energy"][0]) / scale
    assert 0 < np.abs(change).max() < 0.5
    drift, growth = float(np.abs(change).max()), float(change.max())
    assert broken(spring, tmp_path / "run", max_energy_drift=1.001 * drift, max_energy_growth=abs(growth) * 1.001) == []
    assert broken(spring, tmp_path / "run", max_energy_drift=0.999 * drift)[0][0] == "max_energy_drift"
    sheared = dict(ledger) | {"energy": ledger["energy"] + 7.0, "external": ledger["external"] + 7.0}
    np.testing.assert_allclose(expectations.energy_changes(sheared), change, atol=1e-12)


def test_bounds_at_the_end(spring: Tree, tmp_path: Path, reference: Run) -> None:
    kinetic = float(reference.ledger["kinetic"][-1])
    assert kinetic > 0
    assert broken(spring, tmp_path / "run", max_final_kinetic=kinetic) == []
    assert broken(spring, tmp_path / "run", max_final_kinetic=0.99 * kinetic) == [("max_final_kinetic", N)]
    assert broken(spring, tmp_path / "run", broken_links=0) == []
    assert broken(spring, tmp_path / "run", broken_links=1) == [("broken_links", N)]


def test_probes(spring: Tree, tmp_path: Path, reference: Run) -> None:
    end = reference.frame(-1)[OBJECT]["position"][1].tolist()
    probe = {"object": OBJECT, "index": 1, "value": end, "tolerance": 1e-6}
    assert broken(spring, tmp_path / "run", probe=[probe]) == []
    moved = probe | {"value": [end[0] + 0.3, end[1], end[2] - 0.4], "tolerance": 0.499}
    assert broken(spring, tmp_path / "run", probe=[moved]) == [('probe "p".position[1]', N)]
    assert broken(spring, tmp_path / "run", probe=[moved | {"tolerance": 0.501}]) == []


@pytest.mark.parametrize("wrong", [{"object": "q"}, {"index": 2}, {"column": "orientation"}])
def test_a_probe_that_sees_nothing_is_an_error_before_the_run(spring: Tree, tmp_path: Path, wrong: Tree) -> None:
    probe: Tree = {"object": OBJECT, "index": 1, "value": [0, 0, 0], "tolerance": 1.0}
    with pytest.raises(SceneError, match=r"expect\.probe\[0\]"):
        simulate(spring | {"expect": {"probe": [probe | wrong]}}, tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_number_that_is_nan_breaks_a_bound() -> None:
    assert expectations._over("max_speed", np.array([0.0, np.nan, 0.0]), 1.0) is not None


def test_an_adopted_bound_survives_resume(spring: Tree, tmp_path: Path, reference: Run) -> None:
    bound = 0.9 * float(reference.ledger["speed"].max())
    scene = spring | {"expect": {"max_speed": bound}}
    resumed = simulate(scene, killed(scene, tmp_path / "run", 24), resume=True)
    assert [b["name"] for b in resumed.manifest["expectations"]] == ["max_speed"]
