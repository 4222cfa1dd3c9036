"""What is said of mistakes on the command line: whose they are, all at once, in words for people; and the same for programs."""

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import Answer, Tree

from tumble import Run, Scene, SceneError
from tumble.cli import application
from tumble.cli.verbs import Verbs

Command = Callable[..., Answer]
SceneFile = Callable[..., Path]

TOML = """version = 1
[time]
fps = 24
frames = 4
[[rope]]
name = "a"
from = [0, 0, 1]
to = [1, 0, 1]
segments = 4
"""


@pytest.fixture
def toml(tmp_path: Path) -> Path:
    path = tmp_path / "my.toml"
    path.write_text(TOML)
    return path


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["time.fps=-3"], "--set time.fps=-3: time.fps: -3"),
        (["rope.a.segments=0"], '--set rope.a.segments=0: rope "a".segments: 0'),
        (["rope.0.frm=[0, 0, 0]"], "--set rope.0.frm=[0, 0, 0]: rope"),
        (["system.0.integrator=rk5"], "--set system.0.integrator=rk5: system"),
        (["camera.size=[1, 2]"], "--set camera.size=[1, 2]: camera.size"),
        (["rope.b.segments=3"], '--set rope.b.segments=3: rope.b.segments: no "b"'),
        (["nothing"], "--set nothing: nothing: expected path.to.key=value"),
        (["world.gravity=[1, 2"], "--set world.gravity=[1, 2: world.gravity"),
        # What is found when it is built.
        (['rope.a.pin=["midle"]'], '--set rope.a.pin=["midle"]: rope "a".pin'),
    ],
)
@pytest.mark.parametrize("verb", ["check", "run", "refine"])
def test_what_was_set_is_blamed_on_set(words: list[str], said: str, verb: str, toml: Path, tumble: Command) -> None:
    answer = tumble(verb, toml, *(word for text in words for word in ("--set", text)))
    assert answer.code == 2 and answer.err.startswith(f"error: {said}"), answer.err
    assert "line" not in answer.err and "my.toml" not in answer.err


def test_mistakes_of_file_and_options_are_told_together(toml: Path, tumble: Command) -> None:
    toml.write_text(TOML.replace("segments = 4", "segments = -4"))
    answer = tumble("check", toml, "--set", "time.fps=0", "--set", "rope.z.from=1", "--set", "worl.gravity=1")
    lines = answer.err.removeprefix("error: ").splitlines()
    assert lines[0] == f'{toml}: line 9: rope "a".segments: -4, expected >= 1 and <= 1e8' or "line 9" in lines[0]
    assert sorted(line.split(":")[0] for line in lines[1:]) == [
        "--set rope.z.from=1",
        "--set time.fps=0",
        "--set worl.gravity=1",
    ]


def test_overrides_of_python_are_named_too(toml: Path) -> None:
    with pytest.raises(SceneError) as error:
        Scene.load(toml, ["time.fps=-1"])
    assert str(error.value).startswith("set time.fps=-1: time.fps")
    assert error.value.issues[0]["set"] == "time.fps=-1" and error.value.issues[0]["line"] is None
    with pytest.raises(SceneError, match=r"set rope\.a\.to=1: rope"):
        Scene.load(toml).replace("time.fps=30", "rope.a.to=1")


def test_changes_of_a_branch_are_named_as_options(toml: Path, tumble: Command) -> None:
    assert tumble("run", toml, "--no-plot").code == 0
    answer = tumble("branch", "my@2", "--set", "world.gravty=[0, 0, 1]")
    assert answer.code == 2 and answer.err.startswith("error: --set world.gravty=[0, 0, 1]: world.gravty: unknown key")


# Options and verbs


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["run", "rope", "--frames", "ten"], ["'--frames': 'ten', expected a whole number"]),
        (["run", "rope", "--frames=-5"], ["'--frames': '-5', expected >= 1"]),
        (["run", "rope", "--frames", "0", "--threads", "x"], ["'--frames': '0'", "'--threads': 'x', expected a whole"]),
        (
            ["lab", "pressure", "--cells", "5000", "--budget", "long"],
            ["'--cells': '5000', expected <= 256", "'--budget': 'long'"],
        ),
        (["refine", "--levels", "2"], ["'--levels': '2', expected >= 3", "SCENE"]),
        (["branch", "a@1", "--frames", "1.5"], ["'--frames': '1.5', expected a whole number"]),
        (["run", "rope", "--renderer", "mitsubi"], ["--renderer", "did you mean mitsuba"]),
        (["lab", "integrators", "rope", "--integrator", "rk44"], ["--integrator", "did you mean rk4"]),
    ],
)
def test_mistakes_in_options_name_them_all(arguments: list[str], said: list[str], tumble: Command) -> None:
    answer = tumble(*arguments)
    assert answer.code == 2
    for words in said:
        assert words in answer.err, answer.err
    for foreign in ("Input should", "pydantic", "valid integer", "Traceback"):
        assert foreign not in answer.err


@pytest.mark.parametrize(
    ("arguments", "said", "list_"),
    [
        (["chek", "rope"], "did you mean check", "there are run, check, "),
        (["zzz"], "no command 'zzz'", "there are run, check, "),
        (["lab", "presure"], "did you mean pressure", "there are integrators, structures, "),
        (["lab", "qqqq"], "no command 'qqqq'", "there are integrators, structures, "),
    ],
)
def test_mistyped_verbs_are_told_with_all_there_are(
    arguments: list[str], said: str, list_: str, tumble: Command
) -> None:
    answer = tumble(*arguments)
    assert answer.code == 2 and said in answer.err and answer.err.count(list_) == 1, answer.err


def test_help_of_verbs_is_not_cut(tumble: Command) -> None:
    import typer.main

    top = typer.main.get_command(application())
    assert isinstance(top, Verbs)
    for group, words in ((top, []), (top.commands["lab"], ["lab"])):
        answer = tumble(*words, "--help")
        text = " ".join(answer.out.split())
        for name, verb in group.commands.items():
            first = " ".join(str(verb.help).split("\n\n")[0].split())
            assert f"{name} {first}" in text, name
        assert "..." not in text.split("Commands:")[1]


@pytest.mark.parametrize(
    "text",
    [
        "version = 1\nx = = 2\n",
        "version = 1\n[time\n",
        "version = 1\n[time]\nfps = fast\n",
        "a = [1, 2\n",
        'a = "\\q"\n',
        "a\n",
    ],
)
def test_what_is_no_toml_is_told_in_our_words(text: str, tmp_path: Path, tumble: Command) -> None:
    (tmp_path / "bad.toml").write_text(text)
    answer = tumble("check", "bad.toml")
    assert answer.code == 2 and re.match(r"error: bad.toml: line \d: ", answer.err)
    for foreign in ("expected `", "literal", "not TOML", "inline", "newline"):
        assert foreign not in answer.err
    assert text.splitlines()[-1].strip() in answer.err, "the line is not shown"


@pytest.mark.parametrize("text", ['{"version": 1,', "{version: 1}", '{"a": 1} x', "["])
def test_what_is_no_json_is_told_in_our_words(text: str, tmp_path: Path, tumble: Command) -> None:
    (tmp_path / "bad.json").write_text(text)
    answer = tumble("check", "bad.json")
    assert answer.code == 2 and answer.err.startswith("error: bad.json: line 1: ")
    for foreign in ("EOF", "column", "trailing characters", "must be a string"):
        assert foreign not in answer.err


def test_a_key_that_stands_there_twice_is_told_at_the_second(tmp_path: Path, tumble: Command) -> None:
    (tmp_path / "twice.toml").write_text("version = 1\n[time]\nfps = 3\nframes = 2\nfps = 4\n")
    assert "line 5: this key stands here for the second time" in tumble("check", "twice.toml").err


def test_names_that_stand_there_twice_are_told_at_the_later_ones(tmp_path: Path, tumble: Command) -> None:
    rope = '[[rope]]\nname = "{}"\nfrom = [0, 0, 0]\nto = [1, 0, 0]\nsegments = 2\n'
    ball = '[[collider]]\nname = "b"\nshape = { sphere = { radius = 1 } }\n'
    text = "version = 1\n" + rope.format("a") + rope.format("b") + rope.format("a") + rope.format("a") + ball
    text += '[[system]]\nname = "s"\n[[system]]\nname = "s"\n'
    lines = [k + 1 for k, line in enumerate(text.splitlines()) if line.startswith("name =")]
    (tmp_path / "twice.toml").write_text(text)
    err = tumble("check", "twice.toml").err
    told = sorted(int(n) for n in re.findall(r"line (\d+): .*has this name", err))
    # The third and fourth rope, the collider, which is called like the second, and the second system.
    assert told == [lines[2], lines[3], lines[4], lines[6]], err


# For programs


def test_check_as_json(toml: Path, tumble: Command) -> None:
    answer = tumble("check", toml, "--json")
    told = json.loads(answer.out)
    assert answer.code == 0 and told["ok"] and told["file"] == str(toml)
    assert told["systems"][0]["level"] == "ok" and told["systems"][0]["step"] > 0
    unstable = ["--set", "system.0.integrator=forward_euler", "--set", "system.0.substeps=1"]
    answer = tumble("check", toml, "--json", *unstable)
    told = json.loads(answer.out)
    assert answer.code == 1 and not told["ok"] and told["systems"][0]["level"] == "explodes" and told["cures"]
    answer = tumble("check", toml, "--json", "--set", "time.fps=-1")
    told = json.loads(answer.out)
    assert answer.code == 2 and not told["ok"] and "--set time.fps=-1" in answer.err
    assert told["errors"][0]["path"] == "time.fps" and told["errors"][0]["set"] == "time.fps=-1"


def test_run_and_diff_as_json(toml: Path, tumble: Command) -> None:
    one = json.loads(tumble("run", toml, "--out", "one", "--json").out)
    assert one["ok"] and one["frames"] == 5 and one["status"] == "finished" and one["folder"] == "one"
    assert one["hash"] == Run("one").hashes[-1] and one["files"] == ["one/energy.png"]
    assert tumble("run", toml, "--out", "two", "--set", "world.gravity=[0, 0, -9]").code == 0
    answer = tumble("diff", "one", "two", "--json")
    told = json.loads(answer.out)
    assert (answer.code == 1 and not told["same"] and told["frame"] == 0) or told["frame"] == 1
    assert told["columns"] and told["runs"] == ["one", "two"]
    answer = tumble("diff", "one", "one", "--json")
    assert answer.code == 0 and json.loads(answer.out)["same"]
    answer = tumble("diff", "one", "three", "--json")
    assert answer.code == 2 and "no such run" in json.loads(answer.out)["errors"][0]["message"]
    answer = tumble("run", toml, "--out", "one", "--json")
    assert answer.code == 2 and "holds a run already" in json.loads(answer.out)["errors"][0]["message"]


def test_a_broken_run_as_json(exploding: Tree, scene_file: SceneFile, tumble: Command) -> None:
    answer = tumble("run", scene_file(exploding), "--json")
    told = json.loads(answer.out)
    assert answer.code == 1 and not told["ok"] and told["status"] == "failed"
    assert told["failure"]["cures"] and "FAILED" in answer.err


def test_the_schema_is_for_editors(tmp_path: Path, tumble: Command) -> None:
    answer = tumble("schema")
    assert json.loads(answer.out) == Scene.schema()
    assert tumble("schema", "--out", "s.json").code == 0
    assert json.loads((tmp_path / "s.json").read_text()) == Scene.schema()


def test_a_run_knows_the_commit_of_its_engine(toml: Path, tumble: Command) -> None:
    from tumble import _engine

    assert tumble("run", toml, "--no-plot").code == 0
    commit = Run("out/my").manifest["commit"]
    assert commit == _engine.commit
    assert commit is None or re.fullmatch(r"[0-9a-f]{40}", commit)
