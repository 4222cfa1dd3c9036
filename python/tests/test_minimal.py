"""Minimal scenes: what breaks still breaks in them, for the same reason, and little else is there."""

import copy
import json
import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Answer
from runs import Tree

from tumble import Run, Scene, StepError, World, bundled, minimal
from tumble.run import simulate
from tumble.toml import toml

Command = Callable[..., Answer]
SceneFile = Callable[..., Path]

CLUTTER: Tree = {
    "version": 1,
    "title": "Much beside what breaks",
    "time": {"fps": 24, "frames": 40},
    "rope": [{"name": "rope", "from": [3, 0, 0], "to": [4, 0, 0], "segments": 6, "pin": ["start"], "system": "quiet"}],
    "collider": [
        {"name": "ball", "shape": {"sphere": {"radius": 0.3, "center": [5, 0, 5]}}},
        {"name": "ground", "shape": {"plane": {"normal": [0, 0, 1], "point": [0, 0, -50]}}},
    ],
    "force": [
        {"kind": "drag", "rate": 0.1},
        {"kind": "acceleration", "value": [0, 0, "0.1*sin(t)"], "on": ["rope"]},
    ],
    "system": [{"name": "quiet"}],
    "camera": {"position": [1, 2, 3]},
    "output": {"film": False, "plot": False, "stills": [3], "columns": ["position"]},
    "expect": {"max_stretch": 100.0, "probe": [{"object": "rope", "index": 0, "value": [3, 0, 0], "tolerance": 1}]},
}

HEAT = {
    "box": {"size": [1, 1, 1], "resolution": 32},
    "temperature": 300,
    "conductivity": 200,
    "density": 2700,
    "heat_capacity": 900,
    "scheme": "explicit",
}

AIR = {"box": {"size": [1, 1, 1], "resolution": 16}, "sound_speed": 343.0, "density": 1.2}

LIQUID = {
    "spacing": 0.1,
    "stiffness": 1e5,
    "viscosity": 1e4,
    "fill": [{"center": [0, 0, 0.5], "size": [0.6, 0.6, 0.6]}, {"center": [0, 0, 0.53], "size": [0.6, 0.6, 0.6]}],
}


def cluttered(**words: Any) -> Tree:
    """CLUTTER and more; lists are joined, the new things first."""
    tree = copy.deepcopy(CLUTTER)
    for key, value in words.items():
        tree[key] = value + tree.get(key, []) if isinstance(value, list) else value
    return tree


CASES: dict[str, Tree] = {
    # Forward Euler on a stiff spring that starts stretched; others hang beside it.
    "springs": cluttered(
        system=[{"name": "soft", "integrator": "forward_euler", "step": 0.004}],
        particles=[
            {
                "name": "p",
                "position": [[0, 0, 1], [0, 0, 0.5], [1, 1, 1], [2, 1, 1], [2, 2, 2]],
                "pin": ["vertex 0"],
                "color": [1, 0, 0],
                "spring": [
                    {"between": [0, 1], "stiffness": 1e6, "rest_length": 0.4},
                    {"between": [2, 3], "stiffness": 1.0},
                ],
            },
            {"name": "beside", "position": [[7, 7, 7]]},
        ],
    ),
    # 150 times its largest stable step.
    "cloth": cluttered(
        system=[{"name": "cloth", "substeps": 1}],
        sheet=[
            {
                "name": "s",
                "size": [1, 1],
                "resolution": [20, 20],
                "pin": ["corner 0 0", "corner 1 0"],
                "links": {"structural": 5000.0},
            }
        ],
    ),
    # A source that is infinite between frames.
    "heat": cluttered(
        dimension=2,
        time={"fps": 0.1, "frames": 40},
        collider=[],
        system=[{"name": "warm", "method": "heat", "step": 2.5}],
        heat=[
            {
                "name": "h",
                **HEAT,
                "source": [{"power": 100, "shape": {"sphere": {"radius": 0.2}}}, {"power": "1e6/(t-25)"}],
            },
            {"name": "other", **HEAT},
        ],
    ),
    # Eight times what sound allows.
    "gas": cluttered(
        time={"fps": 100, "frames": 40},
        system=[
            {"name": "loud", "method": "compressible", "substeps": 12},
            {"name": "still", "method": "compressible"},
        ],
        compressible=[
            {"name": "g", "system": "loud", **AIR, "initial_density": "1.2+0.01*exp(-50*(x^2+y^2))"},
            {"name": "other", "system": "still", **AIR},
        ],
    ),
    # Far too viscous, and twice as dense as it should be.
    "liquid": cluttered(
        system=[{"name": "wet", "method": "position_based", "substeps": 1}],
        particles=[{"name": "w", "system": "wet", "fluid": LIQUID}],
    ),
    # The force that is to blame is the last of three.
    "force": {
        **cluttered(particles=[{"name": "p", "position": [[0, 0, 0], [1, 0, 0]]}]),
        "system": [{"name": "quiet", "substeps": 4}],
        "time": {"fps": 10, "frames": 20},
        "rope": [],
        "expect": {},
        "force": [
            {"kind": "drag", "rate": 0.1},
            {"kind": "drag", "rate": 0.2},
            {"kind": "acceleration", "value": ["1/(t-0.25)", 0, 0]},
        ],
    },
}
CASES["heat"]["collider"] = []
# Sources, fields and births of which one is infinite between frames, or draws what is born into its centre.
BOX = {"size": [1, 1, 1], "resolution": 8}
BALL = {"sphere": {"radius": 0.2}}
CASES["fluid"] = {
    "version": 1,
    "time": {"fps": 10, "frames": 20},
    "system": [{"name": "air", "method": "gas", "substeps": 4}],
    "gas": [
        {
            "name": "g",
            "box": BOX,
            "smoke": {},
            "source": [{"shape": BALL, "density": 1}, {"shape": BALL, "velocity": ["1/(t-0.525)", 0, 0]}],
        },
        {"name": "other", "box": BOX},
    ],
}
CASES["tracers"] = {
    "version": 1,
    "time": {"fps": 10, "frames": 20},
    "system": [{"name": "flow", "method": "tracers", "integrator": "rk4", "substeps": 2}],
    "particles": [{"name": "p", "position": [[1, 0, 0], [0.5, 1, 0], [0, 0, 1]]}],
    "field": [{"kind": "formula", "velocity": "[-1/(t-0.525), 0, 0]"}, {"kind": "uniform", "velocity": [0, 0.1, 0]}],
}
CASES["emitter"] = {
    "version": 1,
    "time": {"fps": 10, "frames": 20},
    "system": [{"name": "drops", "integrator": "forward_euler", "substeps": 4}],
    "emitter": [
        {"name": "e", "rate": 20, "from": {"point": {}}, "velocity": [1, 0, 1]},
        {"name": "beside", "rate": 5, "from": {"point": {"at": [5, 0, 0]}}},
    ],
    "force": [{"kind": "attraction", "gm": 1}, {"kind": "drag", "rate": 0.1}],
}
FIRST = {
    "springs": ("p", 2),
    "cloth": ("s", 4),
    "heat": ("h", 1),
    "gas": ("g", 8),
    "liquid": ("w", 432),
    "force": ("p", 1),
    "fluid": ("g", 8),
    "tracers": ("p", 1),
    "emitter": ("e", 0),
}
"""The failing object, and the measured upper bounds of remaining masses and cells."""


def broken(scene: Scene, frames: int) -> tuple[dict[str, Any], int]:
    """The report of a break, and the frame that broke."""
    world = World(scene)
    with pytest.raises(StepError) as error:
        world.step(frames)
    return error.value.report, world.frame_index + 1


def things(tree: Tree) -> list[str]:
    lists = [v for k, v in tree.items() if isinstance(v, list) and k != "system"]
    return [item.get("name", item.get("kind")) for value in lists for item in value]


@pytest.mark.parametrize("case", CASES)
def test_what_is_left_breaks_in_the_same_place_for_the_same_reason(
    case: str, tmp_path: Path, scene_file: SceneFile, tumble: Command
) -> None:
    scene = scene_file(CASES[case])
    answer = tumble("run", scene)
    assert answer.code == 1
    file = Path("out/scene/minimal.toml")
    failure = Run("out/scene").manifest["failure"]
    assert failure["minimal"] == file.name
    assert f"tumble run {file}" in answer.err and failure["smaller"] in answer.err
    first, *rest = file.read_text().splitlines()
    assert first.startswith("# `tumble run minimal.toml`") and not any(line.startswith("#") for line in rest)
    # Little is left.
    name, most = FIRST[case]
    small = tomllib.loads(file.read_text())
    blamed = {"force": ["acceleration"], "tracers": ["formula"], "emitter": ["attraction"]}
    assert things(small) == [name, *blamed.get(case, [])]
    assert minimal._elements(World(Scene.load(file)), Scene.load(file).to_dict()) <= most
    assert not {"title", "camera", "output", "expect"} & set(small)
    # The same breaks, in the same frame or before.
    before, frame = failure["report"], failure["frame"] + 1
    after, when = broken(Scene.load(file), small["time"]["frames"])
    assert before["object"] == name
    for key in ("kind", "system", "object", "column"):
        assert after[key] == before[key], key
    assert when == small["time"]["frames"] <= frame
    assert (after["step"] > after["stable_step"]) == (before["step"] > float(before["stable_step"]))
    if case == "force":
        assert "force[2]" in before["cause"] and "force[0]" in after["cause"]
    if case in ("fluid", "tracers"):
        assert "(t-0.525)" in failure["causes"][0] and "may give no finite number" in failure["causes"][0]
    # And so says the command in its first line.
    again = tumble("run", file, "--out", "again")
    assert again.code == 1 and "FAILED" in again.err and f'of "{name}"' in again.err


def test_another_break_is_not_taken_for_the_same(tmp_path: Path) -> None:
    """Without the force that is to blame, the next one would break the same particle in the same frame."""
    poles = [{"kind": "acceleration", "value": [f"1/(t-{t})", 0, 0]} for t in (0.25, 0.275)]
    tree = {**CASES["force"], "force": [{"kind": "drag", "rate": 0.1}, *poles]}
    with pytest.raises(StepError):
        simulate(tree, tmp_path)
    (force,) = tomllib.loads((tmp_path / "minimal.toml").read_text())["force"]
    assert force["value"][0] == "1/(t-0.25)"


def test_what_makes_a_break_another_one() -> None:
    scene = Scene(CASES["force"])
    report, frame = broken(scene, 20)
    search = minimal._Search(scene, report, frame, 8.0, None, 1)
    tree = scene.to_dict()
    fault = search._fault(report, tree)
    others = {"kind": "exploded", "system": "b", "object": "q", "column": "velocity", "cause": ""}
    for key, value in others.items():
        assert report[key] != value
        assert search._fault({**report, key: value}, tree) != fault, key
    assert search._fault({**report, "step": 1.0, "stable_step": 0.5}, tree) != fault
    # Place, time and the new index.
    moved = re.sub(r"at \[.*?\]", "at [9, 9, 9]", report["cause"]).replace("force[2]", "force[1]")
    assert moved != report["cause"]
    fewer = {**tree, "force": tree["force"][1:]}
    assert search._fault({**report, "time": 0.01, "index": 7, "cause": moved}, fewer) == fault


def test_a_branch_is_tried_from_its_start(
    spring: Tree, scene_file: SceneFile, tumble: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert tumble("run", scene_file(spring)).code == 0
    asked = []
    minimize = minimal.minimize

    def noted(*arguments: Any, **words: Any) -> Any:
        asked.append(words["sure"])
        return minimize(*arguments, **words)

    monkeypatch.setattr(minimal, "minimize", noted)
    sets = ["system.0.integrator=forward_euler", "system.0.substeps=4", "particles.p.spring.0.stiffness=1e8"]
    words = [word for text in sets for word in ("--set", text)]
    answer = tumble("branch", "out/scene@10", *words, "--frames", 5, "--out", "out/branch")
    assert (answer.code, asked) == (1, [False])
    assert broken(Scene.load("out/branch/minimal.toml"), 11)[0]["object"] == "p"


def test_paths_hold_from_the_folder_of_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "meshes").mkdir()
    points = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
    (tmp_path / "meshes" / "tetra.obj").write_text(points + "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n")
    tree = cluttered(
        system=[{"name": "net", "substeps": 1}],
        net=[{"name": "n", "mesh": {"path": "meshes/tetra.obj"}, "pin": ["vertex 0"], "links": {"structural": 1e6}}],
    )
    with pytest.raises(StepError):
        simulate(Scene(tree, tmp_path), tmp_path / "deep" / "er" / "run")
    file = tmp_path / "deep" / "er" / "run" / "minimal.toml"
    monkeypatch.chdir("/")
    small = Scene.load(file)
    assert small.to_dict()["net"][0]["mesh"]["path"] == "../../../meshes/tetra.obj"
    assert broken(small, 40)[0]["object"] == "n"


def test_the_count_of_threads_changes_nothing() -> None:
    scene = Scene(CASES["cloth"])
    report, frame = broken(scene, 40)
    one, two = (minimal.minimize(scene, report, frame, 1.0, threads=n) for n in (1, 2))
    assert one is not None and two is not None
    assert (one.tree, one.trials, one.sizes) == (two.tree, two.trials, two.sizes)


class Counted:
    """Counts worlds that are built and frames that are stepped."""

    def __init__(self) -> None:
        self.worlds = 0

    def __call__(self, *arguments: Any) -> World:
        self.worlds += 1
        return World(*arguments)


def test_trials_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """A scene from which nothing can be removed, the most expensive case."""
    tree = copy.deepcopy(CASES["springs"])
    tree["collider"] = [{"name": f"c{i}", "shape": {"sphere": {"radius": 0.1, "center": [9, 9, i]}}} for i in range(60)]
    scene = Scene(tree)
    report, frame = broken(scene, 40)
    count = Counted()
    monkeypatch.setattr(minimal, "World", count)
    # One more world is the scene itself.
    found = minimal.minimize(scene, report, frame, 0.0)
    assert found is not None and 5 < found.trials <= minimal.TRIALS == 24 and count.worlds == found.trials + 1
    faults = iter(range(1000))
    monkeypatch.setattr(minimal._Search, "_fault", lambda *_: next(faults))
    count.worlds = 0
    found = minimal.minimize(scene, report, frame, 0.0)
    assert found is not None and found.trials == minimal.TRIALS and count.worlds == minimal.TRIALS + 1
    assert found.sizes["things"] == (65, 65)
    # Work counts as well.
    monkeypatch.setattr(minimal, "BUDGET", (0.0, 1.0))
    count.worlds = 0
    found = minimal.minimize(scene, report, frame, 0.0)
    assert found is not None and found.trials <= 1 and count.worlds <= 2


def test_a_scene_that_does_not_break_from_its_start_has_none() -> None:
    """As that of a branch, which has another past."""
    scene = Scene(CASES["springs"])
    report, frame = broken(scene, 40)
    assert minimal.minimize(scene, report, frame, 0.0, sure=False) is not None
    assert minimal.minimize(scene.replace("system.soft.step=1e-5"), report, frame, 0.0, sure=False) is None


@pytest.mark.parametrize("trouble", [KeyboardInterrupt, RuntimeError, MemoryError])
def test_trouble_on_the_way_leaves_the_error_as_it_was(
    exploding: Tree,
    scene_file: SceneFile,
    tumble: Command,
    monkeypatch: pytest.MonkeyPatch,
    trouble: type[BaseException],
) -> None:
    begun = []

    def world(*arguments: Any) -> World:
        begun.append(1)
        if len(begun) == 3:
            raise trouble
        return World(*arguments)

    monkeypatch.setattr(minimal, "World", world)
    answer = tumble("run", scene_file(exploding))
    assert len(begun) == 3
    assert answer.code == 1
    for word in ("FAILED", "Likely causes", "<- recommended", "Kept: "):
        assert word in answer.err, word
    assert "A minimal scene" not in answer.err and "Traceback" not in answer.err
    # The failure is printed before the search.
    assert answer.err.index("energy exploded") < answer.err.index("Looking for") < answer.err.index("FAILED")
    failure = Run("out/scene").manifest["failure"]
    assert "minimal" not in failure and any(cure["survived"] for cure in failure["cures"])
    assert not Path("out/scene/minimal.toml").exists()


def test_it_goes_with_the_run(exploding: Tree, scene_file: SceneFile, tumble: Command) -> None:
    file = Path("out/scene/minimal.toml")
    assert tumble("run", scene_file(exploding)).code == 1 and file.exists()
    assert tumble("run", scene_file(exploding), "--set", "system.0.integrator=implicit_euler", "--force").code == 0
    assert not file.exists()


@pytest.mark.parametrize("name", bundled.shipped())
def test_scenes_are_written_in_few_words(name: str) -> None:
    """Without what goes without saying, and with nothing lost."""
    file = bundled.shipped()[name]
    scene = Scene.load(file).to_dict()
    text = toml(minimal.slim(scene))
    assert Scene(tomllib.loads(text), file.parent).to_dict() == scene
    # Measured: at most 1.05 times what people wrote, comments and all.
    assert len(text) < 1.2 * file.stat().st_size


@pytest.mark.parametrize(
    "text",
    ["", 'quote " and \\', "tab\tline\nend\r", "\x7f\x00\x1f", "ü 日本 \U0001f600", "'''", "a.b", "# no comment"],
)
def test_any_text_and_number_is_written(text: str) -> None:
    tree = {
        "t": text,
        "list": [text, [text]],
        "in": [{text or "k": text, "x": {"y": 1e-300}}],
        "n": [1, 1e20, -0.5, True],
    }
    assert tomllib.loads(toml(tree)) == tree


# Causes and cures


def failed(tree: Tree, folder: Path) -> dict[str, Any]:
    with pytest.raises(StepError):
        simulate(tree, folder)
    failure: dict[str, Any] = Run(folder).manifest["failure"]
    return failure


def test_the_step_against_its_limit_is_the_first_cause(tmp_path: Path) -> None:
    for case in ("springs", "cloth", "gas"):
        failure = failed(CASES[case], tmp_path / case)
        report = failure["report"]
        ratio, limit = report["step"] / report["stable_step"], report["stable_step"]
        assert f" are {ratio:.3g} times the largest stable one, {limit:.3g} s" in failure["causes"][0]
        assert failure["causes"][0].startswith(f"steps of {report['step']:.3g} s")
        assert any(cure["survived"] for cure in failure["cures"])
    # A stretch of 0.5/0.4.
    springs = failed(CASES["springs"], tmp_path / "again")["causes"]
    assert springs[1] == "links started stretched up to 1.25 times their rest length"


def test_liquids_have_causes_and_cures(tmp_path: Path) -> None:
    viscous, overlapping = failed(CASES["liquid"], tmp_path / "liquid")["causes"][:2]
    # rho d^2/(8 mu) = 1000 x 0.01/8e4 s.
    assert f"{1 / 24 / 1.25e-4:.3g} times what the explicit viscosity" in viscous and "0.000125 s" in viscous
    shared = re.match(r"(\d+) of 432 particles", overlapping)
    assert shared is not None and 100 < int(shared[1]) <= 216
    cure = next(cure for cure in Run(tmp_path / "liquid").manifest["failure"]["cures"] if cure["survived"])
    # 0.7 of the limit.
    assert cure["set"] == f"system.0.substeps={int(np.ceil(1 / 24 / (0.7 * 1.25e-4)))}"
    world = World(Scene(CASES["liquid"]).replace(cure["set"]))
    world.step(6)
    assert np.isfinite(world.frame["w"]["position"]).all()


def test_default_systems_have_the_cures_of_written_ones(tmp_path: Path) -> None:
    scene = {**CASES["fluid"], "system": [{"name": "gas", "method": "gas"}]}
    # Steps that are chosen come ever closer to it, a fourth of an interval passes it.
    source = {"shape": BALL, "velocity": ["1/(t-0.51)", 0, 0]}
    scene["gas"] = [{"name": "g", "box": BOX, "source": [source]}]
    written = failed(scene, tmp_path / "written")["cures"]
    assert {cure["set"]: cure["survived"] for cure in written}["system.0.substeps=4"]
    left_out = failed({key: value for key, value in scene.items() if key != "system"}, tmp_path / "left out")["cures"]
    assert left_out == written


@pytest.mark.parametrize(
    ("method", "things"),
    [
        ("rigid", {"body": [{"name": "b", "shape": {"box": {"size": [1, 1, 1]}}, "density": 1000}]}),
        ("liquid", {"liquid": [{"name": "l", "box": BOX, "fill": [{"shape": {"box": {"size": [0.5, 0.5, 0.5]}}}]}]}),
        ("dynamics", {"particles": [{"name": "p", "position": [[0, 0, 0]]}]}),
    ],
)
def test_gravity_that_is_infinite_between_frames_is_named_and_shorter_steps_are_tried(
    method: str, things: Tree, tmp_path: Path
) -> None:
    formula = "1/max(0, abs(t-0.3125)-0.01)"
    system = [{"name": "s", "method": method, "substeps": 10}]
    world = {"gravity": [formula, 0, -9.81]}
    scene = {"version": 1, "time": {"fps": 24, "frames": 9}, "world": world, "system": system, **things}
    failure = failed({**scene, "output": {"plot": False}}, tmp_path / "run")
    # A projection that fails names its cell.
    if method != "liquid":
        assert any(formula in cause and "gravity" in cause for cause in failure["causes"]), failure["causes"]
    # The engine knows no limit of these.
    assert any(cure["set"].startswith("system.0.substeps=") for cure in failure["cures"])


def test_formulas_of_heat_are_named_and_too_large_numbers_cured(tmp_path: Path) -> None:
    failure = failed(CASES["heat"], tmp_path / "pole")
    assert failure["causes"][0].startswith('heat "h".source[1].power = "1e6/(t-25)" ')
    assert {cure["set"] for cure in failure["cures"]} == {"heat.0.scheme=implicit", "precision=double"}
    # A value that only double precision can hold.
    tree = cluttered(
        time={"fps": 0.1, "frames": 4},
        system=[{"name": "warm", "method": "heat"}],
        heat=[{"name": "h", **HEAT, "scheme": "implicit", "source": [{"power": "1e30*exp(t)"}]}],
    )
    tree["heat"][0]["box"]["resolution"] = 4
    failure = failed(tree, tmp_path / "large")
    assert [cure["set"] for cure in failure["cures"] if cure["survived"]] == ["precision=double"]


def test_causes_are_numbered_in_the_report(exploding: Tree, scene_file: SceneFile, tumble: Command) -> None:
    error = tumble("run", scene_file(exploding)).err
    causes = json.loads(Path("out/scene/run.json").read_text())["failure"]["causes"]
    assert len(causes) >= 2
    places = [error.index(f"  {i}. {text}") for i, text in enumerate(causes, 1)]
    assert error.index("Likely causes") < places[0] and places == sorted(places)
