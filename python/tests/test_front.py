"""The Python front: arguments that are wrong, names, paths, copies and pickles."""

import copy
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Tree

import tumble
from tumble import Run, Scene, SceneError, TumbleError, World, branch, bundled, compare, film, plots, refine, slices
from tumble.fields import Grid, advect, average, curl, project
from tumble.lab.schemes import chosen

ROPE: Tree = {
    "version": 1,
    "rope": [{"name": "rope", "from": [0, 0, 1], "to": [1, 0, 1], "segments": 4, "pin": ["start"]}],
}


def pull(t: float, x: Any, v: Any, mass: Any) -> Any:
    return -3.0 * x * mass[:, None]


# Names


@pytest.mark.parametrize(
    ("ask", "said"),
    [
        (lambda w: w.columns("velocty"), 'no column "velocty" in frames; did you mean "velocity"?'),
        (lambda w: w.columns("position", "speeed", "tempratur"), 'did you mean "temperature"'),
        (lambda w: w.columns("mass"), "it does not change, topology has it"),
        (lambda w: w.inside(1, "positon"), 'did you mean "position"'),
        (lambda w: w.write("rop", "position", 0), 'did you mean "rope"'),
        (lambda w: w.write("rope", "postion", 0), 'did you mean "position"'),
        (lambda w: w.add_force(pull, system="mian"), 'did you mean "main"'),
        (lambda w: w.set_integrator(pull, system="mainn"), 'did you mean "main"'),
    ],
)
def test_a_mistyped_name_of_a_world_is_an_error_with_the_nearest(ask: Callable[[World], Any], said: str) -> None:
    world = World(ROPE)
    with pytest.raises(SceneError) as error:
        ask(world)
    assert said in str(error.value)
    assert error.value.issues


def test_all_mistyped_columns_are_told_at_once() -> None:
    with pytest.raises(SceneError) as error:
        World(ROPE).columns("velocty", "position", "forse")
    assert len(error.value.issues) == 2


def test_columns_of_users_and_of_what_is_not_there_are_known() -> None:
    emitter = {
        "name": "e",
        "rate": 9,
        "from": {"point": {"at": [0, 0, 0]}},
        "columns": {"warmth": {"from": 1, "to": 2}},
    }
    world = World({"version": 1, "emitter": [emitter]})
    world.step(3)
    assert len(world.columns("warmth")["e"]["warmth"])
    with pytest.raises(SceneError, match='did you mean "warmth"'):
        world.columns("warmht")
    # The engine describes it, and nothing here has it.
    assert "temperature" not in world.columns("temperature")["e"]


def test_names_of_fields_are_suggested() -> None:
    grid = Grid((8, 8), spacing=0.125)
    f = grid.field(lambda x, y: np.sin(x) * y)
    u = curl(grid.field(lambda x, y: x * y, "node"))
    for ask, said in (
        (lambda: grid.shape("cel"), '"cell"'),
        (lambda: average(f, "face z"), "z"),
        (lambda: advect(f, u, 0.1, trace="rk33"), '"rk3"'),
        (lambda: advect(f, u, 0.1, interpolation="linaer"), '"linear"'),
        (lambda: project(u, method="multgrid"), '"multigrid"'),
        (lambda: project(u, precision="duoble"), '"double"'),
        (lambda: Grid((8, 8), spacing=1, plane="xyz"), '"xy"'),
    ):
        with pytest.raises(TumbleError) as error:
            ask()
        assert said in str(error.value)


def test_names_of_runs_are_suggested(tmp_path: Path) -> None:
    run = tumble.simulate(ROPE, tmp_path / "run", frames=2)
    for ask, said in (
        (lambda: plots.ledger(run, "kintic", tmp_path / "a.png"), "did you mean kinetic"),
        (lambda: plots.beside({"a": run}, ["enery"], tmp_path / "a.png"), "did you mean energy"),
        (lambda: film.film(run, tmp_path / "a.mp4", renderer="matplotlob"), "did you mean matplotlib"),
        (lambda: refine.value(run, "energi"), "did you mean energy"),
        (lambda: refine.value(run, "energy@maximum"), "max"),
        (lambda: refine.value(run, "rop.position.z"), "did you mean rope"),
        (lambda: refine.value(run, "rope.positon.z"), "did you mean position"),
        (lambda: refine.plan(Scene(ROPE), 3, ["rope.rope.segmnts"]), "did you mean segments"),
        (lambda: refine.plan(Scene(ROPE), 3, ["rope.rop.segments"]), "did you mean rope"),
    ):
        with pytest.raises(TumbleError) as error:
            ask()
        assert said in str(error.value), said
    with pytest.raises(ValueError, match="did you mean velocity_verlet"):
        chosen(["velocity_verlt"], False)


def test_scenes_that_come_with_tumble_are_loaded_by_name() -> None:
    scene = Scene.load("rope")
    assert scene == Scene.load("structures/rope") == Scene.load(Path("rope"))
    assert Scene.load("kepler", ["time.frames=3"]).to_dict()["time"]["frames"] == 3
    with pytest.raises(SceneError, match=r"did you mean .*figure-of-eight"):
        Scene.load("figure-of-eigth")
    with pytest.raises(SceneError, match=r"nowhere/x\.toml: there is no such file"):
        Scene.load("nowhere/x.toml")


# Whole numbers


@pytest.mark.parametrize("frames", [-1, 1.5, "3", int, -(10**30), np.float64(2)])
def test_steps_are_whole_numbers(frames: Any) -> None:
    world = World(ROPE)
    with pytest.raises(TumbleError, match=r"frames: .*, expected a whole number >= 0"):
        world.step(frames)
    assert world.frame_index == 0


def test_whole_numbers_of_numpy_are_whole_numbers() -> None:
    world = World(ROPE, threads=np.int64(1))
    world.step(np.int32(2))
    world.step(frames=0)
    assert world.frame_index == 2


def test_every_count_is_checked(tmp_path: Path) -> None:
    world = World(ROPE)
    run = tumble.simulate(ROPE, tmp_path / "run", frames=2)
    grid = Grid((4, 4), spacing=0.25)
    f, u = grid.field(lambda x, y: x * y), curl(grid.field(lambda x, y: x * y, "node"))
    for name, ask in (
        ("substeps", lambda: world.inside(1.5, "position")),
        ("substeps", lambda: world.inside(-2)),
        ("threads", lambda: World(ROPE, threads=0)),
        ("threads", lambda: World(ROPE, threads="two")),
        ("threads", lambda: World(ROPE, threads=2.0)),
        ("cells", lambda: Grid((4, 0), spacing=1.0)),
        ("cells", lambda: Grid((4, -3), spacing=1.0)),
        ("cells", lambda: Grid((4, 2.5), spacing=1.0)),
        ("cells", lambda: Grid(4, spacing=1.0)),
        ("substeps", lambda: advect(f, u, 0.1, substeps=0)),
        ("substeps", lambda: advect(f, u, 0.1, substeps=1.5)),
        ("iterations", lambda: project(u, iterations=-1)),
        ("frame", lambda: run.frame(0.5)),
        ("frame", lambda: run.time("1")),
        ("frames", lambda: tumble.simulate(ROPE, tmp_path / "b", frames=-3)),
        ("frames", lambda: tumble.simulate(ROPE, tmp_path / "b", frames=2.5)),
        ("threads", lambda: tumble.simulate(ROPE, tmp_path / "b", threads=0)),
        ("frames", lambda: branch.branch(run, 1, tmp_path / "b", frames=0)),
        ("frame", lambda: branch.branch(run, 1.0, tmp_path / "b")),
        ("frame", lambda: branch.world_at(run, None)),
        ("levels", lambda: refine.study(Scene(ROPE), tmp_path / "b", levels=2)),
        ("until", lambda: compare.compare(run, run, until=-1)),
        ("every", lambda: film.film(run, tmp_path / "a.mp4", every=0)),
        ("processes", lambda: film.film(run, tmp_path / "a.mp4", processes=1.5)),
        ("frame", lambda: tumble.pictures.picture(run, 1.5)),
        ("frame", lambda: slices.slices(run, tmp_path / "a.png", frame=0.5)),
    ):
        with pytest.raises(TumbleError, match=name):
            ask()
    assert not (tmp_path / "b").exists()
    with pytest.raises(IndexError):
        run.frame(3)


# Paths


def test_paths_are_paths_or_text(tmp_path: Path) -> None:
    (tmp_path / "tent.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\nf 1 2 3\nf 2 4 3\n")
    net: Tree = {"version": 1, "net": [{"name": "n", "mesh": {"path": Path("tent.obj")}}]}
    scene = Scene(net, tmp_path)
    assert scene == Scene(copy.deepcopy(net) | {"net": [{"name": "n", "mesh": {"path": "tent.obj"}}]}, str(tmp_path))
    for kind in (Path, str):
        assert len(tumble.load_mesh(kind(tmp_path / "tent.obj"))[0]) == 4
        assert tumble.repair_mesh(kind(tmp_path / "tent.obj"))[1]["welded"] == 0
        run = tumble.simulate(scene, kind(tmp_path / kind.__name__), frames=1)
        assert Run(kind(tmp_path / kind.__name__)).n_frames == run.n_frames == 2
        assert plots.energy(run, kind(tmp_path / "energy.png")).is_file()
        world = World(scene)
        world.save(kind(tmp_path / "state.safetensors"))
        world.load(kind(tmp_path / "state.safetensors"))
        assert World.restore(kind(tmp_path / "state.safetensors")) == world
    record = tumble.load_fabric("denim")
    assert tumble.load_fabric(Path("denim")) == record
    assert bundled.scene_file(Path("structures/rope")) == bundled.scene_file("rope")


# Copies


def test_scenes_are_pickled_copied_and_compared() -> None:
    scene = Scene(ROPE)
    for same in (pickle.loads(pickle.dumps(scene)), copy.copy(scene), copy.deepcopy(scene), Scene(scene.to_dict())):
        assert same == scene and hash(same) == hash(scene)
        assert same.to_dict() == scene.to_dict() and same.folder == scene.folder
    other = scene.replace("rope.rope.segments=5")
    assert other != scene and scene != ROPE and {scene, other, copy.copy(scene)} == {other, scene}


def test_a_pickled_scene_finds_its_meshes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "tri.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    scene = Scene({"version": 1, "net": [{"name": "n", "mesh": {"path": "tri.obj"}}]}, tmp_path)
    data = pickle.dumps(scene)
    assert pickle.loads(data) == scene
    # Another mesh is another scene, which the pickle knows.
    (tmp_path / "tri.obj").write_text("v 0 0 0\nv 2 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(SceneError, match="hash"):
        pickle.loads(data)


@pytest.mark.parametrize("made", [copy.copy, copy.deepcopy, lambda w: pickle.loads(pickle.dumps(w))])
def test_worlds_are_copied_with_state_and_forces(made: Callable[[World], World]) -> None:
    world = World(ROPE, threads=1)
    world.add_force(pull)
    world.step(3)
    other = made(world)
    assert other == world and other.hash() == world.hash() and other.custom == world.custom
    assert other.frame_index == 3
    other.step(2)
    assert other != world
    world.step(2)
    assert other == world
    plain = World(ROPE)
    plain.step(5)
    assert plain != world, "the force did nothing"
    with pytest.raises(TypeError, match="unhashable"):
        hash(world)


def test_worlds_with_the_same_state_and_other_forces_differ() -> None:
    one, other = World(ROPE), World(ROPE)
    assert one == other
    other.add_force(pull)
    assert one != other and one.hash() == other.hash()


def test_runs_are_pickled(tmp_path: Path) -> None:
    run = tumble.simulate(ROPE, tmp_path / "run", frames=2)
    again = pickle.loads(pickle.dumps(run))
    np.testing.assert_array_equal(again.frame(-1)["rope"]["position"], run.frame(-1)["rope"]["position"])


def test_a_step_that_takes_too_long_is_given_up() -> None:
    sheet = {"name": "s", "size": [1, 1], "resolution": [60, 60], "pin": ["corner 0 0"]}
    world = World({"version": 1, "sheet": [sheet], "system": [{"substeps": 100_000}]})
    start = world.hash()
    with pytest.raises(TimeoutError):
        world.step(patience=0.01)
    assert (world.frame_index, world.hash()) == (0, start)
    quick = World(ROPE)
    quick.step(patience=600.0)
    assert quick.frame_index == 1
