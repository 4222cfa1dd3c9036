"""The [expect] table: each bound holds at the worst value, and breaks just below it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from runs import OBJECT, N, Tree, killed

from tumble import Run, Scene, SceneError, World
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


def test_books_of_motion_are_bounded_in_their_units(tmp_path: Path) -> None:
    """A block that falls beside the origin: m g t is added to its momentum, and as much times its arm to the angular one."""
    block = {
        "name": "b",
        "size": [0.2, 0.3, 0.5],
        "center": [1.0, 2.0, 3.0],
        "resolution": [3, 3, 3],
        "density": 1000.0,
        "material": {"young": 1e5, "poisson": 0.3},
    }
    system = {"integrator": "velocity_verlet", "substeps": 100}
    scene: Tree = {"version": 1, "time": {"fps": 24, "frames": 6}, "system": [system], "block": [block]}
    run = simulate(scene, tmp_path / "falls")
    assert run.ledger["volume"][0] == pytest.approx(0.2 * 0.3 * 0.5, rel=1e-6)
    # 30 kg in a quarter of a second.
    lost = 30.0 * 9.8 * 0.25
    assert broken(scene, tmp_path / "run", max_momentum_change=1.001 * lost, max_volume_error=1e-5) == []
    assert broken(scene, tmp_path / "run", max_momentum_change=0.999 * lost) == [("max_momentum_change", 6)]
    # It falls at x = 1, y = 2: L changes by r x P, that is by lost times sqrt(5).
    arm = 5**0.5 * lost
    assert broken(scene, tmp_path / "run", max_angular_momentum_change=1.001 * arm) == []
    assert (
        broken(scene, tmp_path / "run", max_angular_momentum_change=0.999 * arm)[0][0] == "max_angular_momentum_change"
    )


def test_volume_is_bounded_where_a_surface_encloses_one(tmp_path: Path) -> None:
    """A soft cube on a floor is pressed together by its weight."""
    block = {
        "name": "b",
        "size": [0.2, 0.2, 0.2],
        "center": [0.0, 0.0, 0.1],
        "resolution": [5, 5, 5],
        "density": 1000.0,
        "pin": ["face z-"],
        "material": {"young": 2e4, "poisson": 0.3},
    }
    system = {"integrator": "implicit_euler", "substeps": 4}
    scene: Tree = {"version": 1, "time": {"fps": 24, "frames": 24}, "system": [system], "block": [block]}
    assert broken(scene, tmp_path / "run", max_volume_error=0.2) == []
    assert broken(scene, tmp_path / "run", max_volume_error=0.01)[0][0] == "max_volume_error"
    sheet = {"name": "s", "size": [1.0, 1.0], "resolution": [3, 3]}
    run = simulate({"version": 1, "time": {"fps": 24, "frames": 1}, "sheet": [sheet]}, tmp_path / "sheet")
    assert (run.ledger["volume"] == 0).all()


def test_divergence_is_bounded(tmp_path: Path) -> None:
    """The books have the largest value of the column, and what a solver leaves is a matter of its tolerance."""
    gas = {
        "name": "g",
        "box": {"size": [1, 1, 1], "resolution": 16},
        "temperature": {"ambient": 293},
        "source": [{"shape": {"sphere": {"center": [0.1, 0, -0.2], "radius": 0.2}}, "temperature": 393}],
    }
    scene: Tree = {"version": 1, "time": {"fps": 24, "frames": 3}, "gas": [gas]}
    left = []
    for tolerance in (1e-1, 1e-5):
        gas["pressure"] = {"tolerance": tolerance}
        world = World(Scene(scene))
        world.step(3)
        left.append(float(np.abs(world.columns("divergence")["g"]["divergence"]).max()))
        assert world.ledger["divergence"] == pytest.approx(left[-1], rel=1e-6)
    assert left[0] > 10 * left[1] > 0
    gas["pressure"] = {"tolerance": 1e-1}
    assert broken(scene, tmp_path / "run", max_divergence=0.99 * left[0])[0][0] == "max_divergence"


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
