"""Runs of worlds with forces and integrators of users; expectations of runs that end elsewhere."""

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Answer, Tree

import tumble
from tumble import Run, Scene, SceneError, StepError, World
from tumble.branch import branch, world_at
from tumble.compare import compare
from tumble.refine import study

FALL: Tree = {
    "version": 1,
    "precision": "double",
    "time": {"fps": 24, "frames": 12},
    "world": {"gravity": [0, 0, 0]},
    "system": [{"name": "soft", "integrator": "rk4", "substeps": 20}],
    "particles": [{"name": "p", "position": [[1, 0, 0], [0, 2, 0]]}],
    "output": {"checkpoint": 5},
}


def spring(t: float, x: Any, v: Any, mass: Any) -> Any:
    return -4.0 * x * mass[:, None]


def leapfrog(t: float, h: float, x: Any, v: Any, acceleration: Any) -> Any:
    v = v + h / 2 * acceleration(t, x, v)
    x = x + h * v
    return x, v + h / 2 * acceleration(t + h, x, v)


def prepare(world: World) -> None:
    world.add_force(spring)


def sprung(tree: Tree = FALL) -> World:
    world = World(tree, threads=1)
    prepare(world)
    return world


def test_a_world_is_recorded_with_its_force(tmp_path: Path) -> None:
    world = sprung()
    run = tumble.simulate(world, tmp_path / "run")
    assert run.n_frames == 13 and run.status == "finished" and world.frame_index == 12
    np.testing.assert_allclose(run.frame(-1)["p"]["position"][0, 0], np.cos(2 * run.time(-1)), atol=1e-6)
    assert run.manifest["custom"] == [{"what": "force", "system": "soft", "name": "spring"}] == world.custom
    assert run.manifest["machine"]["threads"] is None
    # A plain run of the same scene is another one.
    plain = tumble.simulate(FALL, tmp_path / "plain")
    assert plain.manifest["custom"] == [] and not compare(run, plain).same
    assert tumble.plots.energy(run, tmp_path / "energy.png").stat().st_size > 5_000
    assert tumble.export.usd.write(run, tmp_path / "usd").is_file()
    size = (64, 48)
    assert (
        tumble.film.film(run, tmp_path / "film.mp4", renderer="matplotlib", size=size, processes=1).stat().st_size > 500
    )


def test_scenes_and_dicts_are_recorded_as_before(tmp_path: Path) -> None:
    from_dict, from_scene = tumble.simulate(FALL, tmp_path / "a"), tumble.simulate(Scene(FALL), tmp_path / "b")
    assert compare(from_dict, from_scene, deep=True).same and from_dict.n_frames == 13


def test_fewer_frames_of_a_world(tmp_path: Path) -> None:
    run = tumble.simulate(sprung(), tmp_path / "run", frames=4)
    assert run.n_frames == 5 and run.scene["time"]["frames"] == 4 and run.manifest["whole_frames"] == 12


def test_what_stands_elsewhere_is_not_recorded(tmp_path: Path) -> None:
    world = sprung()
    world.step()
    with pytest.raises(SceneError, match="stands at frame 1"):
        tumble.simulate(world, tmp_path / "run")
    with pytest.raises(SceneError, match="threads of its own"):
        tumble.simulate(sprung(), tmp_path / "run", threads=2)
    assert not (tmp_path / "run").exists()


def stop_at(frame: int) -> Callable[[int, int], None]:
    def told(done: int, total: int) -> None:
        if done == frame:
            raise KeyboardInterrupt

    return told


def test_a_stopped_run_goes_on_with_the_same_force_only(tmp_path: Path) -> None:
    whole = tumble.simulate(sprung(), tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        tumble.simulate(sprung(), tmp_path / "run", progress=stop_at(7))
    for other in (FALL, World(FALL)):
        with pytest.raises(SceneError, match='the force spring on system "soft", and is to go on with no custom'):
            tumble.simulate(other, tmp_path / "run", resume=True)
    twice = sprung()
    twice.add_force(spring)
    with pytest.raises(SceneError, match=r"the force spring .* and the force spring"):
        tumble.simulate(twice, tmp_path / "run", resume=True)
    run = tumble.simulate(sprung(), tmp_path / "run", resume=True)
    assert compare(run, whole, deep=True).same and run.manifest["resumed"] == 1


def test_a_damaged_run_is_computed_again_with_its_force(tmp_path: Path) -> None:
    whole = tumble.simulate(sprung(), tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        tumble.simulate(sprung(), tmp_path / "run", progress=stop_at(7))
    for file in (tmp_path / "run").rglob("*.safetensors"):
        file.write_bytes(b"")
    run = tumble.simulate(sprung(), tmp_path / "run", resume=True)
    assert compare(run, whole, deep=True).same


def test_the_command_line_refuses_to_go_on_without_it(
    tmp_path: Path, tumble: Callable[..., Answer], scene_file: Callable[..., Path]
) -> None:
    from tumble.run import simulate

    with pytest.raises(KeyboardInterrupt):
        simulate(sprung(), "out/scene", progress=stop_at(7))
    answer = tumble("run", scene_file(FALL), "--resume")
    assert answer.code == 2 and "the force spring" in answer.err and "tumble.simulate(world" in answer.err
    answer = tumble("branch", "scene@3")
    assert answer.code == 2 and "the force spring" in answer.err and "prepare" in answer.err


def test_checkpoints_say_what_they_do_not_hold(tmp_path: Path) -> None:
    path = tmp_path / "state.safetensors"
    world = sprung()
    world.set_integrator(leapfrog)
    world.step(3)
    world.save(path)
    with pytest.raises(SceneError, match=r"force spring .* integrator leapfrog .* prepare=") as error:
        World.restore(path)
    assert error.value.issues
    half = World(FALL)
    half.add_force(spring)
    start = half.hash()
    with pytest.raises(SceneError, match="the integrator leapfrog"):
        half.load(path)
    assert half.hash() == start
    half.load(path, others=True)
    assert half.hash() == world.hash()

    def both(fresh: World) -> None:
        fresh.set_integrator(leapfrog)
        fresh.add_force(spring)

    again = World.restore(path, prepare=both)
    again.step(2)
    world.step(2)
    assert again.hash() == world.hash()
    World(FALL).save(path)
    with pytest.raises(SceneError, match="without the force spring"):
        sprung().load(path)
    assert World.restore(path) == World(FALL)


def test_an_integrator_takes_the_place_of_another() -> None:
    world = World(FALL)
    world.set_integrator(leapfrog)
    world.set_integrator(leapfrog, system="soft")
    assert world.custom == [{"what": "integrator", "system": "soft", "name": "leapfrog"}]


def test_branches_have_the_force(tmp_path: Path) -> None:
    run = tumble.simulate(sprung(), tmp_path / "run")
    with pytest.raises(SceneError, match="was simulated with the force spring"):
        branch(run, 7, tmp_path / "branch")
    with pytest.raises(SceneError, match="the force spring"):
        world_at(run, 7)
    same = branch(run, 7, tmp_path / "branch", prepare=prepare)
    assert same.frame(-1)["p"]["position"].tobytes() == run.frame(-1)["p"]["position"].tobytes()
    assert same.manifest["custom"] == run.manifest["custom"]
    further = branch(same, 8, tmp_path / "further", ["world.gravity=[0, 0, -1]"], prepare=prepare)
    assert further.n_frames == 13 and not compare(further, run).same
    # 6 has no checkpoint, and is made anew from the start.
    assert world_at(run, 6, prepare=prepare).hash() == run.hashes[6]


def test_a_branch_may_add_a_force(tmp_path: Path) -> None:
    plain = tumble.simulate(FALL, tmp_path / "plain")
    pushed = branch(plain, 6, tmp_path / "pushed", prepare=prepare)
    assert pushed.manifest["custom"] and pushed.hashes[:6] == plain.hashes[:6]
    assert not np.allclose(pushed.frame(-1)["p"]["position"], plain.frame(-1)["p"]["position"])
    assert world_at(pushed, 9, prepare=prepare).hash() == pushed.hashes[9]


def test_refining_has_the_force(tmp_path: Path) -> None:
    measures = ["p.position.x@0"]
    coarse = Scene(FALL).replace("system.soft.substeps=2")
    found = study(coarse, tmp_path / "study", 3, measures=measures, prepare=prepare)
    assert found.measures[0].limit == pytest.approx(np.cos(2 * 12 / 24), abs=1e-6)  # measured: 2e-9
    assert found.measures[0].order == pytest.approx(4.0, abs=0.3)


def test_what_breaks_under_a_force_is_not_tried_without_it(tmp_path: Path) -> None:
    def fling(t: float, x: Any, v: Any, mass: Any) -> Any:
        return 1e9 * v + 1e9

    world = World(FALL | {"system": [{"name": "soft", "integrator": "forward_euler", "substeps": 1}]})
    world.add_force(fling)
    with pytest.raises(StepError):
        tumble.simulate(world, tmp_path / "run")
    failure = Run(tmp_path / "run").manifest["failure"]
    assert failure["message"] and failure["cures"] == [] and "minimal" not in failure


def test_what_was_written_is_the_start_of_the_run(tmp_path: Path) -> None:
    world = World(FALL)
    world.write("p", "velocity", [[0, 1, 0], [0, 0, 3]])
    run = tumble.simulate(world, tmp_path / "run")
    assert run.manifest["altered"] and not tumble.simulate(World(FALL), tmp_path / "b").manifest["altered"]
    np.testing.assert_allclose(run.frame(-1)["p"]["position"][0], [1, 0.5, 0], atol=1e-9)
    # Frame 2 is made anew from the checkpoint of the start.
    assert world_at(run, 2).hash() == run.hashes[2]


def test_unsolved_steps_reach_the_warnings_of_a_world(tmp_path: Path) -> None:
    sheet = {"name": "s", "size": [1, 1], "resolution": [8, 8], "pin": ["corner 0 0"], "links": {"structural": 1e5}}
    solver = {"newton_iterations": 1, "newton_tolerance": 1e-12}
    system = [{"name": "soft", "integrator": "implicit_euler", "substeps": 1, "solver": solver}]
    tree: Tree = {"version": 1, "time": {"frames": 3}, "sheet": [sheet], "system": system}
    world = World(tree)
    assert "unconverged" not in [w["code"] for w in world.warnings]
    report = world.step(3)
    (told,) = [w for w in world.warnings if w["code"] == "unconverged"]
    assert report["unconverged"] > 0 and told["message"].startswith(
        f"{report['unconverged']} of {report['steps']} steps"
    )
    assert [w["code"] for w in copy.copy(world).warnings] == [w["code"] for w in world.warnings]
    # A run tells of it once.
    kept = tumble.simulate(World(tree), tmp_path / "run").manifest["warnings"]
    assert [w["code"] for w in kept].count("unconverged") == 1


# Runs that end elsewhere

ENDS: Tree = FALL | {
    "particles": [{"name": "p", "position": [[1, 0, 0]], "velocity": [[1, 0, 0]]}],
    "expect": {
        "probe": [{"object": "p", "column": "position", "index": 0, "value": [1.5, 0, 0], "tolerance": 1e-6}],
        "max_final_kinetic": 1e-9,
        "max_speed": 2.0,
    },
}


def codes(run: Run) -> list[str]:
    return [w["code"] for w in run.manifest["warnings"]]


def test_expectations_at_the_end_are_skipped_where_a_run_ends_elsewhere(tmp_path: Path) -> None:
    whole = tumble.simulate(ENDS, tmp_path / "whole")
    assert [b["name"] for b in whole.manifest["expectations"]] == ["max_final_kinetic"] and "other-end" not in codes(
        whole
    )
    for frames in (5, 20):
        run = tumble.simulate(ENDS, tmp_path / f"{frames}", frames=frames)
        assert run.manifest["expectations"] == [] and run.manifest["probes"] == []
        (told,) = [w["message"] for w in run.manifest["warnings"] if w["code"] == "other-end"]
        assert told.startswith("2 expectations are not checked") and f"ends with frame {frames}" in told
    longer = branch(whole, 12, tmp_path / "longer", frames=3)
    assert "other-end" in codes(longer) and longer.manifest["expectations"] == []
    # Bounds on curves are kept.
    fast = tumble.simulate({**ENDS, "expect": {**ENDS["expect"], "max_speed": 0.5}}, tmp_path / "fast", frames=5)
    assert [b["name"] for b in fast.manifest["expectations"]] == ["max_speed"]


def test_a_shortened_run_of_the_command_line_says_so(
    scene_file: Callable[..., Path], tumble: Callable[..., Answer]
) -> None:
    tree = {**ENDS, "expect": {"probe": ENDS["expect"]["probe"]}}
    file = scene_file(tree)
    for words in (["--frames", 5], ["--set", "time.frames=5"]):
        answer = tumble("run", file, "--force", "--no-plot", *words)
        assert answer.code == 0, answer.err
        assert "warning[other-end]: 1 expectation is not checked" in answer.err
        assert "expectations" not in answer.out
    answer = tumble("run", file, "--force", "--no-plot")
    assert answer.code == 0 and "1 of 1 met" in answer.out and "other-end" not in answer.err
    answer = tumble("run", file, "--force", "--no-plot", "--frames", 12)
    assert "other-end" not in answer.err and "1 of 1 met" in answer.out


def test_what_holds_a_clamp_is_no_mass_of_a_user() -> None:
    """The points that keep a slope weigh nothing, and would break a division by the mass."""
    sheet = {
        "name": "s",
        "size": [1, 1],
        "resolution": [4, 5],
        "hinge": 1e-3,
        "pin": [{"which": "edge x-", "clamp": True}],
    }
    world = World(Scene({"version": 1, "world": {"gravity": [0, 0, 0]}, "sheet": [sheet]}))
    seen = []

    def lift(t: float, x: Any, v: Any, mass: Any) -> Any:
        seen.append((x.shape, float(mass.min())))
        return np.tile([0.0, 0.0, 0.1], (len(mass), 1)) * (mass / mass)[:, None]

    world.add_force(lift)
    world.step(3)
    assert set(seen) == {((20, 3), min(m for _, m in seen))} and seen[0][1] > 0
    assert world.columns("position")["s"]["position"][:, 2].max() > 0


STIFF: Tree = {
    "version": 1,
    "precision": "double",
    "time": {"fps": 50, "frames": 10},
    "world": {"gravity": [0, 0, 0]},
    "system": [{"integrator": "implicit_euler", "substeps": 1, "solver": {"newton_iterations": 4}}],
    "particles": [{"name": "p", "position": [[1, 0, 0], [0, 2, 0]]}],
}


STIFFNESS = np.array([1e6, 1e2])
DAMPING = np.array([1e3, 0.0])


def stiff(t: float, x: Any, v: Any, mass: Any) -> Any:
    return -STIFFNESS[:, None] * x - DAMPING[:, None] * v


def derivatives(t: float, x: Any, v: Any, mass: Any) -> Any:
    return -STIFFNESS[:, None, None] * np.eye(3), -DAMPING[:, None, None] * np.eye(3)


def test_a_force_with_its_derivatives_is_solved_at_once() -> None:
    # x_1 = x_0/(1 + h² k + h d): one step of implicit Euler.
    h = 1 / 50
    world, blind = World(STIFF), World(STIFF)
    world.add_force(stiff, jacobian=derivatives)
    blind.add_force(stiff)
    told = world.step()
    exact = (1 + h * DAMPING) / (1 + h * h * STIFFNESS + h * DAMPING)
    x = world.frame["p"]["position"]
    np.testing.assert_allclose([x[0, 0], x[1, 1] / 2], exact, rtol=1e-9)
    assert told["newton"] <= 2 and told["unconverged"] == 0
    assert blind.step()["unconverged"] == 1
    other = copy.copy(world)
    assert other == world
    world.step(3)
    other.step(3)
    assert other.hash() == world.hash()


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda t, x, v, mass: np.zeros((2, 3)), r"shape \[2, 3\], expected \(2, 3, 3\)"),
        (lambda t, x, v, mass: np.full((2, 3, 3), np.nan), "is NaN for particle 0, expected finite numbers"),
        (lambda t, x, v, mass: 1 / 0, "the user's jacobian .* failed: ZeroDivisionError"),
    ],
)
def test_a_wrong_jacobian_is_told(wrong: Any, message: str) -> None:
    world = World(STIFF)
    world.add_force(stiff, jacobian=wrong)
    with pytest.raises(tumble.StepError, match=message):
        world.step()
    with pytest.raises(TypeError, match="jacobian must be callable"):
        World(STIFF).add_force(stiff, jacobian=3)  # type: ignore[arg-type]
