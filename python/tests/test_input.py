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


WRONG = [
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
        ("version = 1\n[[particles]]\nname = 'p'\nposition = [[0, 0, nan]]\n", "NaN m"),
        ("version = 1\n[[particles]]\nname = 'p'\nposition = [[0, 0, 1e999]]\n", "inf m"),
        ("version = 1\nx = = 2\n", "line 2"),
        ("", "version"),
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
