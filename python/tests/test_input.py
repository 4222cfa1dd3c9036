"""Wrong input on the command line: code 2, one clear message with a cure, no traceback, nothing half-written."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from conftest import Answer
from runs import Tree

Command = Callable[..., Answer]
SceneFile = Callable[..., Path]


def wrong(**changes: Any) -> Callable[[Tree], Tree]:
    def change(tree: Tree) -> Tree:
        tree["particles"][0].update(changes)
        return tree

    return change


def unknown_key(tree: Tree) -> Tree:
    return tree | {"partcles": []}


def billion(tree: Tree) -> Tree:
    return tree | {"sheet": [{"name": "s", "size": [1.0, 1.0], "resolution": [31623, 31623]}]}


def no_resolution(tree: Tree) -> Tree:
    return tree | {"sheet": [{"name": "s", "size": [1.0, 1.0], "resolution": [0, 4]}]}


def empty_mesh(tree: Tree) -> Tree:
    Path("empty.obj").write_text("")
    return tree | {"net": [{"name": "n", "mesh": {"path": "empty.obj"}}]}


def missing_mesh(tree: Tree) -> Tree:
    return tree | {"collider": [{"name": "c", "shape": {"mesh": {"path": "gone.ply"}}}]}


def no_such_bone(tree: Tree) -> Tree:
    """Held by a figure that has bones, but none of that name."""
    pin = {"center": [0, 0, 0], "radius": 1, "follow": {"collider": "dancer", "bone": "tail"}}
    return tree | {
        "collider": [{"name": "dancer", "shape": {"mannequin": {}}}],
        "sheet": [{"name": "s", "size": [1, 1], "resolution": [4, 4], "pin": [pin]}],
    }


def five_rows_of_stretching(tree: Tree) -> Tree:
    stretching, bending = "[500.0, 100.0, 500.0, 200.0], " * 5, "[1e-5, 1e-5, 1e-5, 1e-5, 1e-5], " * 3
    Path("short.toml").write_text(f"density = 0.2\nstretching = [{stretching}]\nbending = [{bending}]\n")
    return tree | {"sheet": [{"name": "s", "size": [1, 1], "resolution": [4, 4], "fabric": {"path": "short.toml"}}]}


def unequal_seams(tree: Tree) -> Tree:
    def panel(name: str, height: float) -> Tree:
        return {"name": name, "outline": [[0, 0], [1, 0], [1, height], [0, height]]}

    seam = {"from": {"panel": "a", "side": 1}, "to": {"panel": "b", "side": 3}}
    return tree | {
        "cloth": [{"name": "c", "resolution": 0.2, "panels": [panel("a", 1), panel("b", 2)], "seams": [seam]}]
    }


def tracers(tree: Tree) -> Tree:
    """The particles as tracers, without what only masses have."""
    thing = {key: tree["particles"][0][key] for key in ("name", "position")}
    field = [{"kind": "swirl", "axis": [0, 0, 1], "rate": 1.0}]
    return tree | {
        "particles": [thing],
        "system": [{"name": "t", "method": "tracers", "integrator": "rk4"}],
        "field": field,
    }


def force_on_tracers(tree: Tree) -> Tree:
    return tracers(tree) | {"force": [{"kind": "drag", "rate": 1.0, "on": ["p"]}]}


def no_axis(tree: Tree) -> Tree:
    return tracers(tree) | {"field": [{"kind": "swirl", "axis": [0, 0, 0], "rate": 1.0}]}


def several(tree: Tree) -> Tree:
    """Wrong in ways that are seen at different times."""
    tree = wrong(pin=["vertex 9"])(tree)
    return tree | {
        "output": {"columns": ["colour"]},
        "anchor": [{"name": "a", "between": ["p 0", "q 0"], "stiffness": 1.0}],
    }


WRONG = [
    (force_on_tracers, r"force\[0\]\.on.*tracers.*no force"),
    (no_axis, r"field\[0\]\.axis.*direction"),
    (several, r"pin\[0\].*last one is vertex 1"),
    (several, r"output\.columns\[0\].*colour"),
    (several, r"anchor.*no object \"q\""),
    (wrong(mass=[1e-60]), r'"p".*mass of 1\.000e-60.*double'),
    (wrong(spring=[{"between": [0, 1], "stiffness": 1e50}]), r'"p".*spring constant of 1\.000e50.*double'),
    (unknown_key, "partcles.*did you mean.*particles"),
    (wrong(spring=[{"between": [0, 1], "stiffness": -1.0}]), r"stiffness.*-1.*>= 0.*N/m"),
    (wrong(mass=[0.0]), r"mass.*0.*> 0.*kg"),
    (wrong(pin=["vertex 9"]), "pin.*vertex 9"),
    (wrong(spring=[{"between": [0, 9], "stiffness": 1.0}]), "between|9"),
    (wrong(position=[]), "position"),
    (no_resolution, r"resolution.*0.*>= 2"),
    (billion, "memory_limit"),
    (empty_mesh, r"empty\.obj"),
    (missing_mesh, r"gone\.ply"),
    (no_such_bone, r'sheet "s"\.pin\[0\]: collider "dancer" has no bone "tail"; known are hips, spine'),
    (
        five_rows_of_stretching,
        r'sheet "s"\.fabric\.path.*short\.toml.*line 2: stretching: 5 rows.*row 6 \(90°\) is missing',
    ),
    (unequal_seams, r'cloth "c"\.seams\[0\].*1\.0000 m and 2\.0000 m long, expected the same'),
    (lambda tree: tree | {"time": {"frames": 0}}, r"time\.frames.*0"),
    (lambda tree: {}, "version"),
]


@pytest.mark.parametrize("verb", ["run", "check"])
@pytest.mark.parametrize(("change", "message"), WRONG)
def test_wrong_input_ends_with_2_and_leaves_nothing(
    spring: Tree, scene_file: SceneFile, tumble: Command, change: Callable[[Tree], Tree], message: str, verb: str
) -> None:
    answer = tumble(verb, scene_file(change(spring)))
    assert answer.code == 2
    assert re.search(message, answer.err, re.DOTALL), answer.err
    assert "Traceback" not in answer.err and answer.out == ""
    assert not Path("out").exists()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("version = 1\n[[particles]]\nname = 'p'\nposition = [[0, 0, nan]]\n", "NaN, expected a finite number in m"),
        ("version = 1\n[[particles]]\nname = 'p'\nposition = [[0, 0, 1e999]]\n", "inf, expected a finite number in m"),
        ("version = 1\nx = = 2\n", "line 2"),
        ("", "version"),
        ("version = 2\n", "version: 2, expected 1\n"),
        (
            "version = 1\n[[emitter]]\nname = 'e'\nfrom = { point = {}, disk = { radius = 1 } }\n",
            "point and disk: only one is allowed",
        ),
        (
            "version = 1\n[[emitter]]\nname = 'e'\nfrom = { point = {} }\nburst = [{ count = 1 }]\ncolor = [255, 128, 0]\n",
            "color: [255, 128, 0], expected numbers from 0 to 1",
        ),
    ],
)
def test_wrong_files_end_with_2(tumble: Command, text: str, message: str) -> None:
    Path("wrong.toml").write_text(text)
    answer = tumble("run", "wrong.toml")
    assert answer.code == 2
    assert "wrong.toml" in answer.err and message in answer.err
    assert not Path("out").exists()


def test_a_binary_file_is_no_scene(tumble: Command) -> None:
    Path("picture.toml").write_bytes(bytes(range(256)))
    answer = tumble("check", "picture.toml")
    assert (answer.code, "Traceback" in answer.err, "picture.toml" in answer.err) == (2, False, True)


def test_unknown_names_suggest_near_ones(spring: Tree, scene_file: SceneFile, tumble: Command) -> None:
    scene_file(spring, "pendulum.json")
    for arguments, hint in [
        (("run", "pendulm.json"), "did you mean pendulum.json?"),
        (("run", "no-such-scene"), "tumble scenes"),
        (("rn", "pendulum.json"), "run"),
        (("run", "pendulum.json", "--frmes", "3"), "--frames"),
        (("run", "."), "is a folder"),
        (("run",), "SCENE"),
        (("run", "pendulum.json", "--set", "time.fps"), "path.to.key=value"),
        (("run", "pendulum.json", "--set", "time.fsp=3"), "fps"),
        (("render", "out/pendulum"), "tumble run"),
        (("export", "out/pendulum"), "--usd"),
    ]:
        answer = tumble(*arguments)
        assert answer.code == 2, arguments
        assert hint in answer.err, (arguments, answer.err)
        assert "Traceback" not in answer.err


def test_words_that_nothing_heeds_are_told(spring: Tree, scene_file: SceneFile, tumble: Command) -> None:
    field = {"field": [{"kind": "sink", "rate": 1.0}], "output": {"stills": [400], "plot": False}}
    answer = tumble("check", scene_file(spring | field))
    assert (answer.code, "nothing follows the fields" in answer.err, "no frame 400" in answer.err) == (0, True, True)
    floor = {"collider": [{"name": "f", "shape": {"floor": {"height": 0.0}}}]}
    answer = tumble("check", scene_file(tracers(spring) | floor))
    assert (answer.code, "feel no colliders" in answer.err) == (0, True)
    still = {key: value for key, value in tracers(spring).items() if key != "field"}
    answer = tumble("check", scene_file(still))
    assert (answer.code, "no [[field]] to follow" in answer.err) == (0, True)


BOX = {"inside": {"box": {"center": [5, 0, 0], "size": [1, 1, 1]}}}


@pytest.mark.parametrize(
    ("words", "doubt"),
    [
        ({"rate": 100, "start": 99}, "nothing is born in the 1 s"),
        ({"burst": [{"time": 50, "count": 9}]}, "nothing is born in the 1 s"),
        ({"rate": 100}, None),
        ({"burst": [{"time": 0.5, "count": 9}]}, None),
        (
            {"rate": 100, "velocity": [40, 0, 0], "kill": [BOX]},
            r"kill\[0\].inside: at 40 m/s.*time.exchanges to 2 or more",
        ),
        ({"rate": 100, "velocity": [20, 0, 0], "kill": [BOX]}, None),
    ],
)
def test_what_emitters_hardly_mean_is_told(
    scene_file: SceneFile, tumble: Command, words: Tree, doubt: str | None
) -> None:
    emitter = {"name": "e", "from": {"point": {}}} | words
    scene = {"version": 1, "time": {"fps": 24, "frames": 24}, "emitter": [emitter], "output": {"plot": False}}
    answer = tumble("check", scene_file(scene))
    told = re.sub(r"\s+", " ", answer.err)
    assert answer.code == 0
    assert re.search(doubt, told) if doubt else "emitter" not in told, told


def test_a_formula_that_is_not_finite_is_named(spring: Tree) -> None:
    from tumble import StepError, World

    free = {"name": "q", "position": [[0.5, 0, 0], [0, 0, 1]]}
    forces = [{"kind": "drag", "rate": 0.1}, {"kind": "acceleration", "value": ["1/x", 0, 0], "on": ["q"]}]
    world = World(spring | {"particles": [*spring["particles"], free], "force": forces})
    with pytest.raises(
        StepError, match=r"\"q\", particle 1. force\[1\] gives no finite number at \[0.0, 0.0, 1.0\] m"
    ) as caught:
        world.step(1)
    assert caught.value.report["cause"].startswith("force[1]")


def broken(*_: Any) -> Any:
    raise KeyError("wind")


def bad_shape(*_: Any) -> Any:
    return [1.0, 2.0]


def nothing(*_: Any) -> None:
    return None


def not_finite(t: float, x: Any, v: Any, mass: Any) -> Any:
    return x * float("nan")


@pytest.mark.parametrize(
    ("function", "cause", "message"),
    [
        (broken, KeyError, "force broken failed: KeyError: 'wind'"),
        (bad_shape, ValueError, r"force bad_shape failed.*shape \[2\], expected \(2, 3\)"),
        (nothing, TypeError, "force nothing failed.*None.*is a return missing"),
        (not_finite, ValueError, "force not_finite failed.*NaN for particle 0"),
    ],
)
def test_a_force_that_fails_is_named_and_keeps_its_cause(
    spring: Tree, function: Callable[..., Any], cause: type[Exception], message: str
) -> None:
    from tumble import StepError, World

    world = World(spring)
    world.add_force(function)
    with pytest.raises(StepError, match=message) as raised:
        world.step()
    assert isinstance(raised.value.__cause__, cause)
    assert raised.value.report["kind"] == "user"
    assert world.frame_index == 0


def test_an_integrator_that_returns_something_else(spring: Tree) -> None:
    from tumble import StepError, World

    world = World(spring)
    world.set_integrator(bad_shape)
    with pytest.raises(StepError, match=r"integrator bad_shape failed.*x has shape.*expected \(2, 3\)"):
        world.step()
    world.set_integrator(nothing)
    with pytest.raises(StepError, match=r"integrator nothing failed.*returned a NoneType, expected \(x, v\)"):
        world.step()


def test_a_force_reaches_every_mass_of_a_large_system() -> None:
    import numpy as np

    from tumble import World

    n, h = 9000, 1e-3  # More than two chunks of rows.
    wanted = np.arange(n)[:, None] * np.array([1e-3, -2e-3, 5e-4])
    world = World(
        {
            "version": 1,
            "precision": "double",
            "time": {"fps": 1 / h},
            "world": {"gravity": [0, 0, 0]},
            "system": [{"integrator": "symplectic_euler", "substeps": 1}],
            "particles": [{"name": "p", "position": np.zeros((n, 3)), "mass": [2.0]}],
        }
    )
    world.add_force(lambda t, x, v, mass: mass[:, None] * wanted)
    world.step()
    np.testing.assert_allclose(world.columns("velocity")["p"]["velocity"], h * wanted, rtol=1e-12)
