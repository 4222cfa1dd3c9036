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
    assert np.isnan(run.ledger["volume"]).all()


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


def test_a_number_that_is_nan_breaks_a_bound(reference: Run) -> None:
    bounds = expectations.Bounds({"max_speed": 1e9, "max_energy_drift": 1e9, "max_heat_error": None})
    row = {name: float(column[0]) for name, column in reference.ledger.items()}
    bounds.add(row)
    assert bounds.broken == []
    bounds.add(row | {"speed": np.nan, "energy": np.nan})
    assert [(b.name, b.frame) for b in bounds.broken] == [("max_speed", 1), ("max_energy_drift", 1)]


def test_a_broken_bound_ends_the_run_there(spring: Tree, tmp_path: Path, reference: Run) -> None:
    speed = reference.ledger["speed"]
    bound = float(np.sort(speed)[-5])
    first = int(np.argmax(speed > bound))
    assert 0 < first < N
    scene = spring | {"expect": {"max_speed": bound, "max_final_kinetic": 0.0, "broken_links": 7}}
    run = simulate(scene, tmp_path / "run")
    assert run.status == "failed" and run.n_frames == first + 1 and run.hashes == reference.hashes[: first + 1]
    # Bounds that only the end can violate are not judged.
    assert [(b["name"], b["frame"]) for b in run.manifest["expectations"]] == [("max_speed", first)]
    # It goes on no further, and with another bound to the bits of the whole.
    again = simulate(scene, run.folder, resume=True)
    assert again.n_frames == first + 1 and again.manifest["expectations"] == run.manifest["expectations"]
    whole = simulate(spring | {"expect": {"max_speed": 2 * bound + 9}}, run.folder, resume=True)
    assert whole.status == "finished" and whole.hashes == reference.hashes


def culprit(scene: Tree, folder: Path, **expect: Any) -> tuple[dict[str, Any], str]:
    run = simulate(scene | {"expect": expect}, folder, overwrite=True)
    (found,) = run.manifest["expectations"]
    assert found["frame"] == run.n_frames - 1
    return found["culprit"], found["text"]


def test_what_broke_a_bound_is_named(tmp_path: Path) -> None:
    """Two objects, of which one is at fault, in each way."""

    def ball(name: str, x: float, z: float, v: float) -> Tree:
        return {"name": name, "position": [[x, 9, 9], [x, 0, z]], "velocity": [[0, 0, 0], [0, 0, v]], "mass": [1, 1]}

    folder = tmp_path / "run"
    system = {"integrator": "symplectic_euler", "substeps": 50}
    scene: Tree = {"version": 1, "time": {"fps": 24, "frames": 24}, "system": [system], "world": {"gravity": [0, 0, 0]}}
    moving = scene | {"particles": [ball("still", 0, 1, 0), ball("fast", 2, 1, -3)]}
    found, text = culprit(moving, folder, max_speed=1.0)
    assert found == {"object": "fast", "particles": [1]}
    assert text == 'max_speed: 3 m/s at frame 0, expected at most 1 m/s, by "fast", particle 1'
    # It meets a floor, which takes its momentum and its energy.
    floor = {"name": "floor", "shape": {"floor": {"height": 0.5}}, "thickness": 0.1, "restitution": 0.0}
    landing = moving | {"collider": [floor]}
    for name in ("max_momentum_change", "max_angular_momentum_change"):
        found, text = culprit(landing, folder, **{name: 0.1})
        assert found == {"system": "main", "object": "fast"} and text.endswith(', by "fast"')
    found, text = culprit(landing, folder, max_energy_drift=0.1)
    assert found["system"] == "main" and text.endswith(f'; fastest there "{found["fastest"]["object"]}", particle 0')
    # A start within the floor's thickness counts as penetration.
    deep = moving | {"collider": [floor | {"shape": {"floor": {"height": 0.95}}}]}
    found, _ = culprit(
        deep | {"particles": [ball("still", 0, 2, 0), ball("deep", 2, 1, 0)]}, folder, max_penetration=0.04
    )
    assert found == {"object": "deep", "particles": [1]}
    rope = {"name": "slack", "from": [0, 0, 0], "to": [1, 0, 0], "segments": 4, "pin": ["start"]}
    taut = rope | {"name": "taut", "from": [0, 1, 0], "to": [1, 1, 0], "links": {"structural": {"modulus": 1.0}}}
    for integrator in ("symplectic_euler", "position_based"):
        hung = scene | {"rope": [rope, taut], "world": {}, "system": [system | {"integrator": integrator}]}
        found, text = culprit(hung, folder, max_stretch=1.01)
        assert found == {"object": "taut", "particles": [0, 1]} and text.endswith(', by "taut", particles 0 and 1')
    # Two sheets that fall through a third, and nothing keeps them from it.
    sheet = {"size": [1, 1], "resolution": [5, 5]}
    sheets = [
        sheet | {"name": "upper", "center": [0, 0, 0.05], "rotate": [0, 20, 0]},
        sheet | {"name": "held", "center": [0, 0, -0.4], "pin": ["all"]},
        sheet | {"name": "aside", "center": [5, 0, 0]},
    ]
    falls = scene | {"sheet": sheets, "world": {}}
    found, text = culprit(falls, folder, max_intersections=0)
    assert {found["object"], found["other"]} == {"upper", "held"} and f'through "{found["other"]}"' in text


def test_what_broke_a_bound_on_a_grid_or_of_volume_mass_and_heat_is_named(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    box = {"size": [1, 1, 1], "resolution": 8}
    hot = {"shape": {"sphere": {"center": [0.2, 0, -0.2], "radius": 0.2}}, "temperature": 393}
    gases = [
        {"name": "calm", "box": box | {"center": [3, 0, 0]}},
        {"name": "g", "box": box, "temperature": {"ambient": 293}, "source": [hot], "pressure": {"tolerance": 0.3}},
    ]
    scene: Tree = {"version": 1, "time": {"fps": 24, "frames": 6}, "gas": gases}
    found, text = culprit(scene, folder, max_divergence=1e-9)
    assert found["object"] == "g" and len(found["cell"]) == 3 and 'by "g", cell (' in text
    block = {"size": [0.2, 0.2, 0.2], "resolution": [3, 3, 3], "density": 1000.0, "pin": ["face z-"]}
    blocks = [
        block | {"name": "stiff", "center": [0, 0, 1], "material": {"young": 2e6, "poisson": 0.3}},
        block | {"name": "soft", "center": [1, 0, 1], "material": {"young": 1e4, "poisson": 0.3}},
    ]
    system = {"integrator": "implicit_euler", "substeps": 4}
    pressed: Tree = {"version": 1, "time": {"fps": 24, "frames": 24}, "system": [system], "block": blocks}
    found, _ = culprit(pressed, folder, max_volume_error=0.02)
    assert found == {"system": "main", "object": "soft"}
    drops = {"name": "drops", "rate": 100, "mass": 0.1, "from": {"point": {}}}
    stone = {"name": "stone", "position": [[9, 9, 9]], "mass": [1]}
    rain: Tree = {"version": 1, "time": {"fps": 24, "frames": 6}, "particles": [stone], "emitter": [drops]}
    found, text = culprit(rain, folder, max_mass_error=0.5)
    assert found == {"system": "main", "object": "drops"} and "max_mass_error" in text
    found, text = culprit(rain | {"particles": []}, folder, max_speed=0.3)
    assert found["object"] == "drops" and found["id"] == 0 and text.endswith("the particle with id 0")


@pytest.mark.parametrize("frames", [1, 40])
def test_energies_of_frames_are_compared_with_those_before(frames: int) -> None:
    """Row by row as all at once: |E - E_0| over the largest size so far."""
    random = np.random.default_rng(frames)
    columns = {name: random.normal(size=frames) for name in ("energy", "kinetic", "elastic", "external")}
    sizes = [
        np.abs(columns["kinetic"]),
        np.abs(columns["elastic"]),
        np.abs(columns["external"] - columns["external"][0]),
    ]
    scale = np.maximum.accumulate(np.max(sizes, axis=0))
    change = (columns["energy"] - columns["energy"][0]) / scale
    np.testing.assert_allclose(expectations.energy_changes(columns), change, rtol=1e-12)


def test_an_adopted_bound_survives_resume(spring: Tree, tmp_path: Path, reference: Run) -> None:
    bound = 0.9 * float(reference.ledger["speed"].max())
    first = int(np.argmax(reference.ledger["speed"] > bound))
    scene = spring | {"expect": {"max_speed": bound}}
    resumed = simulate(scene, killed(scene, tmp_path / "run", first - 1), resume=True)
    assert [(b["name"], b["frame"]) for b in resumed.manifest["expectations"]] == [("max_speed", first)]
