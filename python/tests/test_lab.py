"""The lab: do its numbers agree with what is known in closed form, and are its pages whole?"""

import csv
import math
import re
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread

from tumble import Scene, SceneError, World
from tumble.lab import exact, findings, flocks, integrators, patterns, positions, pressure, structures
from tumble.lab.cells import Purse
from tumble.lab.limits import Found, largest_steps, stiffest_mode
from tumble.lab.measure import Results
from tumble.lab.schemes import BY_WORD, SCHEMES
from tumble.lab.subject import Subject, subject

Tree = dict[str, Any]

W = 3.0
"""Angular frequency of the oscillator [rad/s]."""


def oscillator(**spring: Any) -> Tree:
    return {
        "version": 1,
        "title": "An oscillator",
        "world": {"gravity": [0, 0, 0]},
        "particles": [
            {
                "name": "p",
                "position": [[0, 0, 0], [1, 0, 0]],
                "pin": ["vertex 0"],
                "spring": [{"between": [0, 1], "stiffness": W * W, "rest_length": 0, **spring}],
            }
        ],
    }


def damped(c: float) -> Tree:
    """Stretched by little, so that even a thousandfold energy keeps it near its rest length and the spring linear."""
    tree = oscillator(rest_length=1.0, damping=c)
    tree["particles"][0]["position"] = [[0, 0, 0], [1.001, 0, 0]]
    return tree


def swirl() -> Tree:
    return {
        "version": 1,
        "system": [{"name": "dust", "method": "tracers", "integrator": "midpoint"}],
        "field": [{"kind": "swirl", "rate": 2.0}],
        "particles": [{"name": "p", "position": [[1, 0, 0], [0.3, 0.4, 0.1]]}],
    }


def steps_of(tree: Tree, *words: str, budget: float = 60.0) -> dict[str, Found]:
    return largest_steps(subject(Scene(tree)), [BY_WORD[w] for w in words], Purse(budget), lambda: None)


def ratio_at_limit(z: float, growth: Callable[[float], float]) -> float:
    """ln of the energy's growth within 100 periods, over ln 1000."""
    return math.log(growth(z)) * 200 * math.pi / z / math.log(1000)


@pytest.fixture(scope="module")
def undamped() -> dict[str, Found]:
    return steps_of(oscillator(), "forward_euler", "symplectic_euler", "verlet", "rk4", "implicit_euler", "bdf2")


@pytest.mark.parametrize("word", ["forward_euler", "symplectic_euler", "verlet", "rk4"])
def test_the_largest_usable_step_is_the_predicted_one(undamped: dict[str, Found], word: str) -> None:
    found = undamped[word]
    # Bisection ends within 1.5 % below; measured 0.991 for all four.
    assert 0.9 < found.measured / found.predicted < 1.1
    assert 0.9 < found.disturbed / found.predicted < 1.1


def test_the_largest_usable_step_is_that_of_the_closed_form(undamped: dict[str, Found]) -> None:
    z = {word: W * found.measured for word, found in undamped.items()}
    # Forward Euler multiplies the energy by 1 + z² a step (integrators.21); 2 % of z are 2 % of the exponent.
    assert ratio_at_limit(z["forward_euler"], lambda z: 1 + z * z) == pytest.approx(1.0, abs=0.03)
    assert z["verlet"] == pytest.approx(2.0, rel=0.02)
    assert z["rk4"] == pytest.approx(math.sqrt(8), rel=0.02)


def test_implicit_schemes_survive_every_step(undamped: dict[str, Found]) -> None:
    for word in ("implicit_euler", "bdf2"):
        assert undamped[word].measured == math.inf
        assert undamped[word].largest_tried * W == pytest.approx(78.0)


def test_what_broke_is_named(undamped: dict[str, Found]) -> None:
    for word in ("forward_euler", "symplectic_euler", "verlet", "rk4"):
        autopsy = undamped[word].autopsy
        assert autopsy is not None
        assert (autopsy.failure["object"], autopsy.failure["index"]) == ("p", 1)
        assert 0 < autopsy.failure["time"] <= autopsy.duration


def test_damping_is_in_the_prediction_and_in_the_measurement() -> None:
    c = 0.6
    found = steps_of(damped(c), "forward_euler", "symplectic_euler")
    # (integrators.30): w²h² + 2 c h = 4. Growth beyond it is fast, so usable is stable.
    h = found["symplectic_euler"].disturbed
    assert W * W * h * h + 2 * c * h == pytest.approx(4.0, rel=0.04)
    # (integrators.31): stable up to c/w², usable a little beyond; an undamped one could use a twentieth.
    h = found["forward_euler"].disturbed
    assert 1.0 < h / (c / W**2) < 1.1
    assert 0.9 < h / found["forward_euler"].predicted < 1.1


def test_the_stiffest_mode_of_a_chain() -> None:
    tree = oscillator()
    tree["particles"][0] |= {
        "position": [[i, 0, 0] for i in range(6)],
        "pin": ["vertex 0", "vertex 5"],
        "spring": [{"between": [i, i + 1], "stiffness": 4.0, "rest_length": 0} for i in range(5)],
        "velocity": [[0, 0, 0]],
    }
    mode = stiffest_mode(subject(Scene(tree)))
    assert mode is not None
    # Neighbours in antiphase: sin(4 pi i/5), in every coordinate (oscillator.8's chain).
    shape = np.sin(4 * np.pi * np.arange(6) / 5)
    shape /= np.linalg.norm(shape)
    along = np.abs(shape @ mode)
    assert np.linalg.norm(along) == pytest.approx(1.0, abs=1e-3)


def studied(tree: Tree, **settings: Any) -> Results:
    return integrators.study(Scene(tree), **settings)


def test_observed_orders() -> None:
    words = ["forward_euler", "midpoint", "rk4", "verlet", "implicit_midpoint", "position_based"]
    results = studied(oscillator(), integrators=words, steps=[0.04, 0.02, 0.01, 0.005], duration=3.7, budget=20.0)
    seen = {s.word: findings.order(results, s) for s in results.schemes}
    # Measured 1.09, 2.00, 4.00, 2.00, 2.00, 0.92.
    for word in words:
        assert abs(seen[word] - BY_WORD[word].order) < 0.3, seen
    assert results.reference is not None
    assert results.reference.how == "the exact solution"


@pytest.mark.parametrize(
    ("word", "factor"),
    [
        ("forward_euler", lambda z: 1 + z**2),
        ("heun", lambda z: 1 + z**4 / 4),
        ("implicit_euler", lambda z: 1 / (1 + z**2)),
        ("implicit_midpoint", lambda z: 1.0),
        # Converged on one spring by a single sweep, it is implicit Euler.
        ("position_based", lambda z: 1 / (1 + z**2)),
    ],
)
def test_energy_of_one_spring(word: str, factor: Callable[[float], float]) -> None:
    """(integrators.21), .27, .25 and .26; those that solve equations do so to a relative residual of 1e-9."""
    tested = subject(Scene(oscillator()))
    for system in tested.tree["system"]:
        system["solver"] = {"newton_tolerance": 1e-9, "linear_tolerance": 1e-9}
    for z in (0.03, 0.3, 0.8):
        world = tested.world(BY_WORD[word], z / W, 1, 1)
        start = world.ledger["energy"]
        for n in range(1, 11):
            world.step()
            assert world.ledger["energy"] / start == pytest.approx(factor(z) ** n, rel=1e-7), (z, n)
    assert start == pytest.approx(W * W / 2)


def test_a_converged_solution_stands_in_for_the_exact_one() -> None:
    tree = oscillator(rest_length=0.5)
    settings: dict[str, Any] = {
        "integrators": ["verlet"],
        "steps": [0.02, 0.01, 0.005],
        "duration": 2.3,
        "budget": 10.0,
    }
    results = studied(tree, **settings)
    assert results.reference is not None
    assert "dormand_prince" in results.reference.how
    assert results.reference.uncertainty < 1e-9
    # x - 1/2 = cos(w t)/2, as long as the mass does not pass the pin.
    end = results.reference.positions[-1][1]
    assert end == pytest.approx([0.5 + 0.5 * math.cos(W * 2.3), 0, 0], abs=1e-9)
    assert findings.order(results, BY_WORD["verlet"]) == pytest.approx(2.0, abs=0.1)


def test_exact_solution_of_linear_springs() -> None:
    """Against the equation itself: x'' = (k (x0 - x) + k' (y - x))/m + g - c x', by finite differences."""
    tree = oscillator()
    tree["world"] = {"gravity": [0, 0, -2.0]}
    tree["force"] = [{"kind": "drag", "rate": 0.3}]
    tree["particles"][0] |= {
        "position": [[0, 0, 0], [1, 0.2, 0], [2, 0, 1]],
        "velocity": [[0, 0, 0], [0.1, 0, 0], [0, -1, 0]],
        "mass": [1.0, 0.5, 2.0],
        "spring": [
            {"between": [0, 1], "stiffness": 4.0, "rest_length": 0},
            {"between": [1, 2], "stiffness": 7.0, "rest_length": 0},
        ],
    }
    solution = subject(Scene(tree)).solution
    assert solution is not None
    d, t = 1e-4, 1.3
    before, x, after = (solution.at(t + s * d) for s in (-1, 0, 1))
    v, a = (after - before) / (2 * d), (after - 2 * x + before) / d**2
    force = 4.0 * (x[0] - x[1]) + 7.0 * (x[2] - x[1])
    # Differences are off by 1e-16/d² = 1e-8 from round-off and by d²/12 times the fourth derivative, under 1e-5.
    assert a[1] == pytest.approx(force / 0.5 + [0, 0, -2] - 0.3 * v[1], abs=1e-5)
    assert a[2] == pytest.approx(7.0 * (x[1] - x[2]) / 2.0 + [0, 0, -2] - 0.3 * v[2], abs=1e-5)
    assert solution.at(0.0) == pytest.approx(np.array([[0, 0, 0], [1, 0.2, 0], [2, 0, 1]]))
    assert np.linalg.norm(a[1]) > 0.1


def test_no_exact_solution_where_something_is_not_linear() -> None:
    for change in ({"rest_length": 0.5}, {"damping": 0.1}):
        assert subject(Scene(oscillator(**change))).solution is None, change
    tree = oscillator()
    tree["collider"] = [{"name": "floor", "shape": {"plane": {"normal": [0, 0, 1]}}}]
    assert subject(Scene(tree)).solution is None


def test_exponential() -> None:
    a = np.array([[0.0, 2.0], [-2.0, 0.0]])
    turn = [[math.cos(14), math.sin(14)], [-math.sin(14), math.cos(14)]]
    assert exact.exponential(7 * a) == pytest.approx(np.array(turn), abs=1e-12)


def test_tracers_are_limited_by_their_field() -> None:
    found = steps_of(swirl(), "forward_euler", "rk4", "implicit_euler")
    # (integrators.32): the squared radius grows by 1 + z² a step, as the oscillator's energy does.
    z = 2.0 * found["forward_euler"].predicted
    assert ratio_at_limit(z, lambda z: 1 + z * z) == pytest.approx(1.0, abs=1e-3)
    for word in ("forward_euler", "rk4"):
        assert 0.9 < found[word].measured / found[word].predicted < 1.1
    assert found["implicit_euler"].measured == math.inf


def test_page_of_an_oscillator(tmp_path: Path) -> None:
    told: list[tuple[int, int]] = []
    path = integrators.page(
        Scene(oscillator()),
        tmp_path / "lab",
        integrators=["forward_euler", "verlet", "rk4", "implicit_euler", "dormand_prince"],
        steps=[0.5, 0.1, 0.02, 0.004],
        progress=lambda done, total: told.append((done, total)),
        budget=10.0,
    )
    text = whole(path)
    assert "An oscillator" in text
    for word in ("forward_euler", "verlet", "rk4", "implicit_euler", "dormand_prince"):
        assert word in text
    assert "bdf2" not in {row["integrator"] for row in table(path)} and "bdf2" in text.split("not asked for")[0]
    assert "p, particle 1" in text
    assert told[0][0] == 0
    assert told[-1][0] == told[-1][1] > 10
    assert all(a[0] <= b[0] for a, b in pairwise(told))
    rows = table(path)
    errors = [float(r["error"]) for r in rows if r["experiment"] == "accuracy" and r["integrator"] == "verlet"]
    assert len(errors) == 4
    assert errors == sorted(errors, reverse=True)
    summary = {r["integrator"]: r for r in rows if r["experiment"] == "summary"}
    assert float(summary["verlet"]["usable_predicted"]) == pytest.approx(2 / W, rel=1e-3)


def test_page_of_tracers(tmp_path: Path) -> None:
    path = integrators.page(Scene(swirl()), tmp_path, steps=[0.1, 0.05, 0.025], budget=10.0)
    tried = {row["integrator"] for row in table(path)}
    for scheme in SCHEMES:
        assert (scheme.word in tried) != scheme.needs_velocities, scheme.word


def birds(**flock: Any) -> Tree:
    return {
        "version": 1,
        "title": "Birds",
        "seed": 4,
        "time": {"fps": 24, "frames": 240},
        "world": {"gravity": [0, 0, 0]},
        "particles": [
            {"name": "birds", "cloud": {"count": 40, "size": [4, 4, 4], "speed": 3}, "velocity": [[3, 0, 0]]},
            {"name": "hawk", "position": [[-8, 0, 0]], "velocity": [[6, 0, 0]]},
        ],
        "force": [
            {
                "kind": "flock",
                "radius": 3,
                "cohesion": 1.5,
                "alignment": 2,
                "separation": 6,
                "spacing": 0.9,
                "speed": 5,
                "propulsion": 1,
                "max_acceleration": 25,
                "goal": [{"point": [0, 0, 0], "strength": 4}],
                "predators": ["hawk"],
                "fear": 40,
                "fear_radius": 4,
                "chase": 8,
                "predator_speed": 6.5,
            }
            | flock
        ],
    }


def test_order_spacing_and_speed_of_a_flock() -> None:
    x = np.array([[0, 0, 0], [2, 0, 0], [0, 0, 7.0]])
    v = np.array([[3, 0, 0], [0, 4, 0], [0, 0, 0.0]])
    # Headings are unit vectors along x and y, and nothing; nearest neighbours are 2, 2 and 7 away.
    assert flocks.observe(x, v) == pytest.approx([math.sqrt(2) / 3, 11 / 3, 7 / 3])


@pytest.mark.long
def test_a_flock_is_compared_as_long_as_paths_stay_close() -> None:
    words = ["forward_euler", "heun", "verlet", "dormand_prince"]
    results = studied(birds(), integrators=words, steps=[0.04, 0.02, 0.01, 0.005, 0.0025], budget=30.0)
    tested = results.subject
    assert tested.flock
    assert results.reference is not None
    assert "rk4" in results.reference.how
    # Kinks let errors fall a little unevenly: measured 1.00, 2.0 to 2.3, 2.0.
    for word in words[:3]:
        assert abs(findings.order(results, BY_WORD[word]) - BY_WORD[word].order) < 0.45, word
    # Another scheme and another disturbance grow about tenfold, too.
    assert results.horizon is not None
    assert 0.5 < results.horizon < tested.duration
    one, other = (tested.world(BY_WORD["heun"], results.horizon, 1, 400) for _ in range(2))
    push = 1e-8 * np.cos(np.arange(tested.start.size)).reshape(tested.start.shape)
    tested.write(other, "position", tested.start + push)
    one.step()
    other.step()
    growth = np.linalg.norm(tested.positions(other) - tested.positions(one)) / np.linalg.norm(push)
    assert 2 < growth < 50


def test_page_of_a_flock(tmp_path: Path) -> None:
    words = ["forward_euler", "verlet", "implicit_midpoint", "dormand_prince"]
    path = integrators.page(Scene(birds()), tmp_path, integrators=words, steps=[0.04, 0.01], budget=12.0)
    text = whole(path)
    assert "a step that is too large" in text
    assert "Energy" not in text
    assert "10 times as far apart" in text
    rows = [r for r in table(path) if r["experiment"] == "observed"]
    steps = sorted({float(r["step"]) for r in rows})
    assert steps[1] / steps[0] == pytest.approx(8.0)

    def late(word: str, step: float) -> dict[str, float]:
        mine = [r for r in rows if r["integrator"] == word and float(r["step"]) == step]
        return {k: float(np.mean([float(r[k]) for r in mine[len(mine) // 2 :]])) for k in flocks.NAMES}

    truth = late("truth", steps[0])
    assert 0.2 < truth["polarization"] <= 1
    assert 0.3 < truth["distance"] < 1.5
    # Cruising speed is 5 m/s, the goal and the hawk make it less even.
    assert 3 < truth["speed"] < 7
    for word in words[:3]:
        assert late(word, steps[0])["speed"] == pytest.approx(truth["speed"], rel=0.15), word
    # A step of 2.4 over the highest rate is beyond Verlet's limit of 2: neighbours are thrown apart.
    assert late("verlet", steps[1])["distance"] > 1.3 * truth["distance"]


def test_large_flocks_are_thinned_at_the_same_density() -> None:
    tree = birds()
    tree["particles"][0]["cloud"] |= {"count": 800}
    tested = subject(Scene(tree))
    assert len(tested.start) == 101
    assert np.abs(tested.start[:100]).max() == pytest.approx(1.0, abs=0.05)
    assert any("100 take part" in note for note in tested.notes)


def test_a_map_has_no_integrators_to_compare() -> None:
    tree = {
        "version": 1,
        "dimension": 2,
        "system": [{"method": "vicsek", "vicsek": {"side": 3, "radius": 1, "speed": 0.1, "noise": 1}}],
        "particles": [{"name": "p", "cloud": {"count": 9, "size": [3, 0, 3]}}],
    }
    with pytest.raises(SceneError, match="a map"):
        subject(Scene(tree))


@pytest.mark.long
def test_molecules_show_the_orders_of_schemes() -> None:
    tree = {
        "version": 1,
        "dimension": 2,
        "world": {"gravity": [0, 0, 0]},
        "time": {"fps": 24, "frames": 240},
        "particles": [{"name": "gas", "position": [[0.42 * i, 0, 0.4 * j] for i in range(5) for j in range(5)]}],
        "force": [{"kind": "lennard_jones", "epsilon": 1, "sigma": 0.25, "cutoff": 0.9}],
    }
    words = ["forward_euler", "verlet"]
    results = studied(tree, integrators=words, steps=[2e-3, 1e-3, 5e-4, 2.5e-4], budget=40.0)
    assert results.horizon is not None
    assert results.horizon < results.subject.duration
    # The prediction follows the gas as it condenses: at the start it is far from its equilibrium.
    assert results.subject.rate > 10
    for word in words:
        assert findings.order(results, BY_WORD[word]) == pytest.approx(BY_WORD[word].order, abs=0.25), word


def test_page_of_contact_with_a_single_adaptive_integrator(tmp_path: Path) -> None:
    tree = {
        "version": 1,
        "time": {"fps": 24, "frames": 12},
        "rope": [
            {"name": "rope", "from": [-0.2, 0, 0.2], "to": [0.2, 0, 0.25], "segments": 3, "links": {"structural": 20}}
        ],
        "collider": [{"name": "floor", "shape": {"plane": {"normal": [0, 0, 1]}}}],
    }
    text = whole(integrators.page(Scene(tree), tmp_path, integrators=["dormand_prince"], budget=10.0))
    assert "Contact, breaking" in text


def test_what_takes_too_long_is_left_out_and_said_so(tmp_path: Path) -> None:
    tree = {"version": 1, "sheet": [{"name": "sheet", "size": [1, 1], "resolution": [40, 40], "pin": ["corner 0 0"]}]}
    path = integrators.page(Scene(tree), tmp_path, integrators=["forward_euler", "verlet"], budget=0.3)
    assert "did not fit into the time allowed" in whole(path)


def test_wrong_questions() -> None:
    with pytest.raises(ValueError, match="leapfrog"):
        studied(oscillator(), integrators=["leapfrog"])
    still = oscillator(rest_length=1.0)
    with pytest.raises(SceneError, match="nothing moves"):
        studied(still)


def test_the_scene_is_run_as_it_is_but_for_the_integrator() -> None:
    tree = oscillator()
    tree["system"] = [{"name": "soft", "integrator": "modified_euler", "clamp": 1.5, "step": 0.1}]
    tree["force"] = [{"kind": "drag", "rate": 0.5}]
    tested: Subject = subject(Scene(tree))
    world = tested.world(BY_WORD["rk4"], 0.25, 3, 5)
    system = world.scene.to_dict()["system"][0]
    assert (system["integrator"], system["substeps"], system["clamp"]) == ("rk4", 5, None)
    assert world.scene.to_dict()["force"][0]["rate"] == 0.5
    assert world.scene.to_dict()["precision"] == "double"
    world.step()
    assert world.time == pytest.approx(0.25)
    assert tested.world(BY_WORD["verlet"], 0.25, 1, 5).scene.to_dict()["system"][0]["clamp"] == 1.5


def slope(errors: list[float]) -> float:
    """How fast they fall from the first to the last, each with twice the work of the one before."""
    return math.log2(errors[0] / errors[-1]) / (1 - len(errors))


@pytest.mark.long
def test_a_hanging_chain_converges_to_its_compliance_at_every_frame_rate() -> None:
    """(positions.2): of second order in sub-steps, of first in sweeps until these reach from end to end."""
    steps, sweeps = (
        [abs(positions.error(False, substeps, work)) for work in (64, 128, 256, 512)] for substeps in (True, False)
    )
    # 10.5, 2.63, 0.656 and 0.164 %: -2.00 to the third digit.
    assert slope(steps) == pytest.approx(-2.0, abs=0.02) and 0.001 < steps[-1] < 0.0025
    # 5.84, 2.50, 0.88, 0.200: -1.62; from 1 to 16: 420 to 26, -1.00.
    assert -1.8 < slope(sweeps) < -1.4 and sweeps[-1] > 50 * steps[-1]
    assert slope([abs(positions.error(False, False, work)) for work in (1, 2, 4, 8, 16)]) == pytest.approx(
        -1.0, abs=0.05
    )
    # Only the length of a sub-step counts, not of a frame: 1/7680 s, 0.420 % at 60 as at 120 frames a second.
    at_60, at_120 = positions.error(False, True, 128, 60), positions.error(False, True, 64, 120)
    assert 0.003 < at_60 < 0.005 and at_120 == pytest.approx(at_60, rel=1e-3)
    # Sweeps that are enough converge to the same length: 2.7e-7.
    assert 0 < positions.error(False, False, 256, 120) < 1e-5


def test_a_plain_chain_ends_without_stretch_whatever_its_stiffness() -> None:
    """Sub-steps: -0.993 and -0.999; sweeps, which are slower: 0.24 at 24 frames a second, -0.80 at 60, -0.95 at 120."""
    assert positions.error(True, True, 256) == pytest.approx(-1.0, abs=0.01)
    assert positions.error(True, True, 256, 60) == pytest.approx(-1.0, abs=0.002)
    sweeps = [positions.error(True, False, 256, rate) for rate in positions.RATES]
    assert sweeps[0] > 0.1 > sweeps[1] + 0.7 > sweeps[2] + 0.7, sweeps


def test_page_of_positions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        positions, "lengthening", lambda plain, substeps, sweeps, rate=24: 0.02 + 1.0 / (substeps + sweeps)
    )
    path = positions.page(tmp_path / "lab")
    assert "whatever the stiffness" in whole(path)
    rows = table(path)
    assert len(rows) == 8 * len(positions.WORK)
    assert {row["frames a second"] for row in rows} == {"24", "60", "120"}


@pytest.fixture(scope="module")
def measured() -> structures.Study:
    return structures.study()


def moduli(rows: list[list[patterns.Measured]], pattern: int) -> dict[str, float]:
    return {m.deformation.key: m.modulus for m in rows[pattern]}


def test_moduli_are_those_of_the_continuum(measured: structures.Study) -> None:
    """(structures.2, .3, .7, .10) and (bending.13); the terms of second order in a strain of 1e-4 are 1e-8."""
    for row in [*measured.sheet, *measured.block]:
        for m in row:
            assert m.modulus == pytest.approx(m.exact, rel=1e-6, abs=1e-9), (m.pattern.title, m.deformation.key)
    for pattern, matrix in zip(patterns.SHEETS, measured.matrices, strict=True):
        assert matrix == pytest.approx(pattern.stiffness, abs=1e-4), pattern.title


def test_structural_links_alone_do_not_resist_shear(measured: structures.Study) -> None:
    for rows in (measured.sheet, measured.block):
        structural = moduli(rows, 0)
        assert structural["shear +"] == structural["shear -"] == 0.0
        assert structural["stretch x"] == pytest.approx(100.0)
        assert moduli(rows, 1)["shear +"] == pytest.approx(50.0, rel=1e-6)


def test_one_diagonal_has_a_bias_and_two_have_none(measured: structures.Study) -> None:
    one, both = moduli(measured.sheet, 1), moduli(measured.sheet, 2)
    # k1 = k2 = 100: (k1/4 + k2)/(k1/4) along one diagonal and the other, sides held.
    assert one["stretch +45"] / one["stretch -45"] == pytest.approx(5.0, rel=1e-6)
    assert both["stretch +45"] / both["stretch -45"] == pytest.approx(1.0, abs=1e-6)
    # Sheared by 0.3, the diagonal of sqrt(2) becomes sqrt(2 ± 2 sin 0.3).
    longer, shorter = (math.sqrt(2 + 2 * s * math.sin(0.3)) - math.sqrt(2) for s in (1, -1))
    assert measured.shear_bias[1] == pytest.approx((longer / shorter) ** 2, rel=1e-6)
    assert measured.shear_bias[1] < 0.8
    assert measured.shear_bias[2] == pytest.approx(1.0, abs=1e-6)
    # Pulled along the grid it leans over by as much as it stretches.
    assert patterns.lean(measured.matrices[1]) == pytest.approx(-1.0, abs=1e-3)
    assert patterns.lean(measured.matrices[2]) == pytest.approx(0.0, abs=1e-3)


def test_young_modulus_over_direction(measured: structures.Study) -> None:
    directions = np.linspace(0, np.pi, 37)
    one, both = (patterns.young(measured.matrices[k], directions) for k in (1, 2))
    # (structures.6): 8 k2/3 with k2 = 50, all round. (structures.8): 2 k2 and 2 k1 k2/(k1 + 4 k2) with k2 = 100.
    assert both == pytest.approx(np.full(37, 400 / 3), rel=1e-3)
    assert one[9] == pytest.approx(200.0, rel=1e-3)
    assert one[27] == pytest.approx(40.0, rel=1e-3)


def test_folding(measured: structures.Study) -> None:
    words = [{m.deformation.key: m.word for m in row} for row in measured.sheet]
    for key in ("fold y", "fold x"):
        assert [w[key] for w in words] == ["no", "no", "no", "weakly", "yes"]
    # Only the diagonal that crosses the creases is in their way.
    assert (words[1]["fold +45"], words[1]["fold -45"]) == ("no", "weakly")
    hinges = moduli(measured.sheet, 4)
    for key in ("fold x", "fold -45", "fold +45"):
        assert hinges[key] / hinges["fold y"] == pytest.approx(1.0, rel=1e-6)


def test_page_of_structures(tmp_path: Path) -> None:
    told: list[tuple[int, int]] = []
    path = structures.page(tmp_path / "lab", progress=lambda done, total: told.append((done, total)))
    text = whole(path)
    for pattern in patterns.SHEETS:
        assert pattern.title in text
    assert told[-1][0] == told[-1][1]
    assert all(a[0] <= b[0] for a, b in pairwise(told))
    rows = table(path)
    shear = [r for r in rows if r["deformation"] == "shear +" and r["structure"] == "sheet"]
    assert [r["resists"] for r in shear] == ["no", "yes", "yes", "yes", "yes"]


@pytest.fixture(scope="module")
def ladder(tmp_path_factory: pytest.TempPathFactory) -> tuple[pressure.Study, Path]:
    """All rungs on 24³ cells, and their page."""
    told: list[tuple[int, int]] = []
    kept: list[pressure.Study] = []
    taken = pressure.lessons
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pressure, "lessons", lambda seen: kept.append(seen) or taken(seen))
        path = pressure.page(
            tmp_path_factory.mktemp("lab"), 24, progress=lambda done, total: told.append((done, total))
        )
    assert told[-1][0] == told[-1][1] and all(a[0] <= b[0] for a, b in pairwise(told))
    return kept[0], path


def test_every_rung_of_the_ladder_is_higher_than_the_one_below(ladder: tuple[pressure.Study, Path]) -> None:
    seen, _ = ladder
    order = [
        "jacobi",
        "gauss_seidel",
        "sor",
        "incomplete_cholesky",
        "modified_incomplete_cholesky",
        "multigrid_gradients",
    ]
    for name in pressure.NAMES:
        its = {r.rung.word: r.at(1e-5) for r in seen.runs[name]}
        assert all(its[word] is not None for word in its if word != "cosine"), (name, its)
        assert all(its[a] > its[b] for a, b in pairwise(order)), (name, its)
        assert its["conjugate_gradients"] > its["incomplete_cholesky"]
        # Multigrid is the last by far, and conjugate gradients make it no worse. 5 to 7 of them.
        assert 3 <= its["multigrid_gradients"] <= its["multigrid"] <= 9 < its["modified_incomplete_cholesky"] / 2, (
            name,
            its,
        )
        found = [r.found for r in seen.runs[name] if r.found is not None]
        assert all(f.pockets == (2 if name == "two sealed pockets" else 0) for f in found)
        assert all(np.all(np.diff(f.times) > 0) and len(f.times) == len(f.residuals) for f in found)
    assert seen.of("a plain box", "cosine").at(1e-12) == 1
    for name in pressure.NAMES[1:]:
        assert "cosine transform cannot solve this" in seen.of(name, "cosine").refused


def test_rates_of_the_ladder_are_those_of_theory(ladder: tuple[pressure.Study, Path]) -> None:
    seen, _ = ladder
    for n, runs in seen.sizes.items():
        theory = pressure.Theory(n)
        by_word = {r.rung.word: r for r in runs}
        for word, near in [("jacobi", 0.01), ("gauss_seidel", 0.01)]:
            ratio = np.log(by_word[word].factor) / np.log(theory.factor(word))  # type: ignore[arg-type]
            # The first order of what walls do to D is in it, the second, of size 1/n², is not: 1.001 to 1.003 at 12 and 24.
            assert n < 12 or abs(ratio - 1.0) < near, (n, word, ratio)
    # Over-relaxation: omega - 1 for the whole spectrum, but with a Jordan block on top of it.
    sor = np.log(seen.of("a plain box", "sor").factor) / np.log(pressure.Theory(24).factor("sor"))
    assert 0.8 < sor < 1.2, sor
    # The bound of conjugate gradients is one: they do better, for they find single eigenvalues.
    plain = seen.of("a plain box", "conjugate_gradients").factor
    assert 0.5 < plain < pressure.Theory(24).factor("conjugate_gradients")
    # From 12 to 24 cells: not far from the slopes of large boxes.
    for rung in pressure.RUNGS[:-1]:
        assert rung.growth is not None
        assert abs(seen.growth(rung.word) - rung.growth) < 0.4, (rung.word, seen.growth(rung.word))


def test_theory_of_the_ladder_against_a_dense_matrix() -> None:
    n = 5
    one = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    one[0, 0] = one[-1, -1] = 1.0
    eye = np.eye(n)
    a = sum(np.kron(np.kron(x, y), z) for x, y, z in [(one, eye, eye), (eye, one, eye), (eye, eye, one)])
    values = np.linalg.eigvalsh(a)
    assert pressure.Theory(n).condition == pytest.approx(values[-1] / values[1], rel=1e-12)
    scale = 1.0 / np.sqrt(np.diag(a))
    least = np.linalg.eigvalsh(a * scale[:, None] * scale)[1]
    # To first order in 1/n: 3 % at 5 cells.
    assert pressure.Theory(n).smoothest == pytest.approx(least, rel=0.05)


def test_page_of_the_ladder(ladder: tuple[pressure.Study, Path]) -> None:
    seen, path = ladder
    text = whole(path)
    for rung in pressure.RUNGS:
        assert rung.title in text
    for name in pressure.NAMES:
        assert name in text
    rows = {(r["system"], r["cells"], r["method"]): r for r in table(path)}
    assert len(rows) == 5 * 9
    a, b = (seen.of("a plain box", word).at(1e-5) for word in ("jacobi", "multigrid_gradients"))
    assert rows["a plain box", "24", "jacobi"]["iterations_to_1e-05"] == str(a)
    lessons = pressure.lessons(seen)
    assert f"conjugate gradients with multigrid {b} and" in lessons[0]
    assert sum("cannot with a ball in it or two sealed pockets" in line for line in lessons) == 1
    assert "Not done" not in text


def test_a_rung_that_takes_too_long_is_stopped_and_told(ladder: tuple[pressure.Study, Path]) -> None:
    seen, _ = ladder
    slow = pressure.run(pressure.case("a plain box", 24), pressure.BY_WORD["jacobi"], iterations=30)
    assert slow.at(1e-5) is None and slow.time(1e-5) is None and slow.at(1e-1) is not None
    runs = {name: [slow if r.rung.word == "jacobi" else r for r in runs] for name, runs in seen.runs.items()}
    cut = pressure.Study(24, "double", runs, {**seen.sizes, 24: runs["a plain box"]}, seen.glances)
    lines = pressure.lessons(cut)
    assert any("Not done in the time allowed" in line and "Jacobi (a plain box)" in line for line in lines)
    assert math.isnan(cut.growth("jacobi")) and not any("Jacobi 4" in line for line in lines)


def whole(path: Path) -> str:
    """The text of a page, which needs nothing from elsewhere; its picture can be read."""
    text = path.read_text(encoding="utf-8")
    assert "://" not in text
    assert "<script" not in text
    assert text.count("<img") == text.count('src="data:image/') >= 1
    assert text.rstrip().endswith("</html>")
    picture = imread(path.with_suffix(".png"))
    assert picture.shape[1] > 1000
    assert float(picture.std()) > 0.02
    return text


def table(path: Path) -> list[dict[str, str]]:
    with path.with_suffix(".csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


# What the lab refuses, leaves out, and says


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("finned_plate", "heat .*, which is .* heat.0.scheme"),
        ("obstacle", "gas .*, which is stepped by a scheme of its own.*tumble lab pressure"),
        ("bad_solver", "compressible .*, which is .*tumble lab compressible"),
        ("flag_in_a_jet", "gas .*, which is"),
        ("pool", 'a liquid, particles "water", which position-based dynamics alone can move.*tumble lab positions'),
    ],
)
def test_scenes_without_integrators_to_compare_are_refused_with_what_to_do(name: str, said: str) -> None:
    with pytest.raises(SceneError, match=said):
        integrators.study(Scene.load(name))


def test_what_runs_under_no_other_integrator_is_refused() -> None:
    tree: Tree = {
        "version": 1,
        "system": [{"method": "position_based"}],
        "block": [{"name": "b", "size": [1, 1, 1], "resolution": [2, 2, 2], "links": {}, "shape_matching": {}}],
    }
    try:
        World(tree)
    except SceneError as error:
        pytest.fail(f"the scene itself is wrong: {error}")
    with pytest.raises(SceneError, match=r"under no integrator but its own.*tumble refine"):
        subject(Scene(tree))


def test_schemes_that_are_left_out_are_named_with_the_reason(tmp_path: Path) -> None:
    text = whole(integrators.page(Scene.load("spiral"), tmp_path, budget=1.0))
    assert re.search(
        r"Left out: modified_euler, symplectic_euler, .*: need velocities, which tracers do not have", text
    )
    results = studied(oscillator(), integrators=["rk4", "verlet"])
    assert {s.word for s in results.schemes} == {"rk4", "verlet"}
    assert results.left_out["heun"] == "not asked for" and len(results.left_out) == len(BY_WORD) - 2
    with pytest.raises(ValueError, match="verlet needs velocities, which tracers do not have"):
        integrators.study(Scene.load("spiral"), integrators=["verlet"])


def test_a_scheme_that_cannot_move_the_scene_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    own = Subject.world

    def world(self: Subject, scheme: Any, *rest: Any, **more: Any) -> World:
        if scheme.word == "bdf2":
            raise SceneError("force[0]: it has no derivative")
        return own(self, scheme, *rest, **more)

    monkeypatch.setattr(Subject, "world", world)
    results = studied(oscillator(), integrators=["rk4", "bdf2"])
    assert [s.word for s in results.schemes] == ["rk4"]
    assert results.left_out["bdf2"] == "force[0]: it has no derivative"
    with pytest.raises(SceneError, match=r"no integrator can move this scene: .*no derivative"):
        studied(oscillator(), integrators=["bdf2"])


def test_the_budget_bounds_every_experiment() -> None:
    """A sheet whose first run alone would take minutes."""
    sheet = {"name": "s", "size": [1, 1], "resolution": [60, 60], "pin": ["corner 0 0"], "links": {"structural": 1e5}}
    scene = Scene({"version": 1, "time": {"frames": 240}, "sheet": [sheet]})
    begin = time.process_time()
    results = integrators.study(scene, budget=1.0, integrators=["rk4", "implicit_euler", "dormand_prince"])
    # Threads of this process are counted, too: it has two cores at least for some of it. A single run takes minutes.
    assert time.process_time() - begin < 20.0
    assert findings.skipped(results)


def test_figures_are_said_properly() -> None:
    assert findings.per_second(0.0256).replace("\u00a0", " ") == "1 in 39.1 s"
    assert findings.per_second(1234.0) == "1\u202f230"
    assert findings.off(13.4) == "13 times the right value"
    assert findings.off(0.0314) == "3.1\u00a0%" and findings.off(-0.5, signed=True) == "−50\u00a0%"
    assert findings.off(2e-7) == "less than 0.001\u00a0%" and findings.off(0.0) == "0\u00a0%"
    for share in (1e-9, 3e-3, 0.7, 20.0, 4e5):
        assert "e+" not in findings.off(share) and "e-" not in findings.off(share)
