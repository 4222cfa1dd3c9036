"""The command line: exit codes, messages that say what to do, never a traceback."""

import os
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from conftest import Answer
from runs import Tree

from tumble import ExportError, Run, _engine, bundled
from tumble.cli import find, report
from tumble.cli.console import Progress, seconds, size

Command = Callable[..., Answer]
SceneFile = Callable[..., Path]

PYTHON = [sys.executable, "-c", "from tumble.cli import main; main()"]


def copied(text: str, verb: str) -> list[str]:
    """The last command to copy in a message, as arguments."""
    line = [line for line in text.splitlines() if line.lstrip(" fine:").startswith(f"tumble {verb}")][-1]
    return shlex.split(line[line.index("tumble") :])[1:]


# Running


def test_run_ends_with_0_and_says_where_the_results_are(spring: Tree, scene_file: SceneFile, tumble: Command) -> None:
    answer = tumble("run", scene_file(spring))
    run = Run("out/scene")
    assert answer.code == 0
    assert answer.out.startswith("out/scene: 26 frames")
    assert run.hashes[-1] in answer.out
    assert "error" not in answer.err


def test_options_override_the_scene(spring: Tree, scene_file: SceneFile, tumble: Command) -> None:
    answer = tumble(
        "run", scene_file(spring), "--frames", 3, "--out", "here", "--threads", 1, "--set", "world.gravity=[0, 0, -1.5]"
    )
    assert answer.code == 0
    run = Run("here")
    assert run.n_frames == 4
    assert run.scene["world"]["gravity"] == [0, 0, -1.5]
    assert run.manifest["machine"]["threads"] == 1


def test_a_run_in_the_way_needs_force_or_resume(spring: Tree, scene_file: SceneFile, tumble: Command) -> None:
    file = scene_file(spring)
    assert tumble("run", file, "--frames", 5).code == 0
    answer = tumble("run", file)
    assert answer.code == 2
    assert "--resume" in answer.err and "--force" in answer.err and "--out" in answer.err
    assert Run("out/scene").n_frames == 6
    assert tumble("run", file, "--resume").code == 0
    assert Run("out/scene").n_frames == 26
    assert tumble("run", file, "--force", "--frames", 4).code == 0
    assert Run("out/scene").n_frames == 5
    assert tumble("run", file, "--force", "--resume").code == 2


def test_a_broken_expectation_ends_with_1_and_is_named(spring: Tree, scene_file: SceneFile, tumble: Command) -> None:
    spring["expect"] = {"max_stretch": 1.0001, "max_speed": 1e-3, "max_energy_drift": 100.0}
    answer = tumble("run", scene_file(spring))
    assert answer.code == 1
    assert "1 violated; the run ends there, at frame 0 of 25" in answer.out
    told = r'violated expectation: max_speed: 0.5 m/s at frame 0, expected at most 0.001 m/s, by "p", particle 1'
    assert re.search(told, answer.err)
    spring["expect"] = {"max_final_kinetic": 0.0, "broken_links": 0}
    answer = tumble("run", scene_file(spring), "--force")
    assert (answer.code, "1 of 2 met" in answer.out) == (1, True)
    assert "violated expectation: max_final_kinetic: " in answer.err and " J at frame 25, expected" in answer.err
    spring["expect"] = {"max_stretch": 10.0, "broken_links": 0}
    answer = tumble("run", scene_file(spring), "--force")
    assert (answer.code, "2 of 2 met" in answer.out) == (0, True)


def test_broken_physics_end_with_1_a_report_and_a_cure_that_works(
    exploding: Tree, scene_file: SceneFile, tumble: Command
) -> None:
    answer = tumble("run", scene_file(exploding))
    assert answer.code == 1
    for word in (
        "FAILED",
        '"soft"',
        "forward_euler",
        'of "p"',
        "3.79e-03 s",
        "gains energy on this system at any step",
        "<- recommended",
    ):
        assert word in answer.err, word
    assert "Traceback" not in answer.err
    assert Run("out/scene").n_frames >= 1
    cure = copied(answer.err, "run")
    assert "--force" in cure
    assert tumble(*cure).code == 0
    assert Run("out/scene").n_frames == 26


def test_a_cure_also_works_where_the_scene_lists_no_system(
    exploding: Tree, scene_file: SceneFile, tumble: Command
) -> None:
    del exploding["system"]
    answer = tumble(
        "run", scene_file(exploding), "--set", "system.0.integrator=forward_euler", "--set", "system.0.step=0.02"
    )
    assert answer.code == 1
    cure = copied(answer.err, "run")
    # Its changes are not repeated.
    assert sum("integrator" in word for word in cure) == 1
    assert tumble(*cure).code == 0
    (system,) = Run("out/scene").scene["system"]
    assert system["name"] == "main"
    assert system["integrator"] != "forward_euler"


def test_a_spring_too_stiff_for_any_step_is_cured_by_an_implicit_scheme(
    spring: Tree, scene_file: SceneFile, tumble: Command
) -> None:
    spring["precision"] = "double"
    spring["particles"][0]["spring"][0]["stiffness"] = 1e20
    answer = tumble("run", scene_file(spring))
    assert answer.code == 1
    for word in ("the required step became too small", "implicit integrator", "<- recommended"):
        assert word in answer.err, word
    cure = copied(answer.err, "run")
    assert "system.0.integrator=implicit_euler" in cure
    assert tumble(*cure).code == 0


@pytest.mark.parametrize(("kind", "missing"), [("ply", "no particles"), ("vdb", "nothing lies on a grid")])
def test_files_of_what_is_not_there_are_refused_before_the_simulation(
    kind: str, missing: str, scene_file: SceneFile, tumble: Command
) -> None:
    rope = {"name": "r", "from": [0, 0, 0], "to": [1, 0, 0], "segments": 4}
    tree = {"version": 1, "time": {"frames": 2}, "rope": [rope]}
    file = scene_file(tree | {"output": {kind: True}})
    for verb in ("check", "run"):
        answer = tumble(verb, file)
        assert (
            answer.code == 2
            and f"output.{kind}" in answer.err
            and missing in answer.err
            and "leave it out" in answer.err
        )
    file = scene_file(tree)
    answer = tumble("run", file, f"--{kind}")
    assert answer.code == 2 and f"--{kind}" in answer.err and missing in answer.err
    assert not Path("out").exists()
    assert tumble("run", file, f"--no-{kind}").code == 0


def test_overrides_that_a_change_replaces() -> None:
    given = ["system.soft.integrator=rk4", "system.1.step = 0.1", "time.frames=3"]
    assert find.without(given, ["system.0.integrator=verlet"], ["soft", "stiff"]) == given[1:]
    assert find.without(given, ["system.stiff.step=1e-3", "system.1.integrator=rk4"], ["soft", "stiff"]) == given[::2]


def test_a_folder_that_is_taken_is_not_blamed_on_the_scene(
    spring: Tree, scene_file: SceneFile, tumble: Command
) -> None:
    assert tumble("run", scene_file(spring), "--out", "there").code == 0
    answer = tumble("run", scene_file(spring), "--out", "there")
    assert answer.code == 2
    assert answer.err.startswith("error: there: ")


def test_errors_found_while_building_name_the_file(spring: Tree, scene_file: SceneFile, tumble: Command) -> None:
    spring["anchor"] = [{"name": "a", "between": ["p 0", "p 7"], "stiffness": 1.0}]
    for verb in ("check", "run"):
        answer = tumble(verb, scene_file(spring))
        assert answer.code == 2
        assert "scene.toml: " in answer.err or "scene.json: " in answer.err
        assert "there is no mass 7" in answer.err


def test_check_lists_anchors(spring: Tree, scene_file: SceneFile, tumble: Command) -> None:
    spring["anchor"] = [{"name": "a", "between": ["p 0", "p 1"], "stiffness": 1.0}]
    assert 'anchor     "a": from p 0 to p 1' in tumble("check", scene_file(spring)).out


def test_the_first_change_that_gains_no_energy_is_recommended() -> None:
    def cure(name: str, survived: bool, growth: float | str) -> Tree:
        return {"set": name, "survived": survived, "energy_ratio": growth}

    cures = [
        cure("fails", False, "nan"),
        cure("gains", True, 0.8),
        cure("holds", True, 0.01),
        cure("damps", True, -0.9),
        cure("unknown", True, "nan"),
    ]
    assert [c["set"] for c in report._ranked(cures)] == ["holds", "damps", "gains", "unknown", "fails"]


# Checking


@pytest.mark.parametrize("scene", ["contact/moving", "gas/bunny", "gas/ball_in_a_tank"])
def test_check_lists_what_ships_with_moving_colliders_and_fluids(scene: str, tumble: Command) -> None:
    answer = tumble("check", scene)
    assert answer.code == 0 and f"fine: tumble run {scene}" in answer.out


def test_check_is_fine_with_a_good_step(spring: Tree, scene_file: SceneFile, tumble: Command) -> None:
    answer = tumble("check", scene_file(spring))
    assert answer.code == 0
    for word in ("2 masses", "1 link", "verdict", "ok", "symplectic_euler", "forward_euler", "none", "any", "memory"):
        assert word in answer.out, word
    assert tumble(*copied(answer.out, "run")).code == 0
    assert not Path("out/checked").exists()


def test_check_predicts_what_happens(exploding: Tree, scene_file: SceneFile, tumble: Command) -> None:
    answer = tumble("check", scene_file(exploding))
    assert answer.code == 1
    assert "will explode" in answer.out
    assert not Path("out").exists()
    cures = [shlex.split(line)[1:] for line in answer.out.splitlines() if line.startswith("  tumble run")]
    assert len(cures) >= 2
    for i, cure in enumerate(cures):
        assert tumble("check", *cure[1:]).code == 0, cure
        assert tumble(*cure, "--out", f"cured{i}", "--frames", "5").code == 0, cure


# Finding runs and exporting


def test_a_run_is_found_by_folder_or_name(spring: Tree, scene_file: SceneFile, tumble: Command) -> None:
    assert tumble("run", scene_file(spring, "pendulum.json"), "--frames", 2).code == 0
    assert find.run("pendulum").n_frames == find.run("out/pendulum").n_frames == 3
    answer = tumble("export", "pendulun", "--npz")
    assert (answer.code, "did you mean pendulum?" in answer.err) == (2, True)
    answer = tumble("render", "pendulum", "--frame", 3)
    assert (answer.code, "expected 0 to 2" in answer.err) == (2, True)
    answer = tumble("plot", "pendulum", "stretsh")
    assert (answer.code, "did you mean stretch" in answer.err) == (2, True)
    answer = tumble("render", "pendulum", "--size", "12")
    assert (answer.code, "1280x720" in answer.err) == (2, True)


def test_export_npz_stacks_all_frames(spring: Tree, scene_file: SceneFile, tumble: Command) -> None:
    tumble("run", scene_file(spring), "--frames", 4)
    assert tumble("export", "out/scene", "--npz", "--out", "results").code == 0
    run = Run("out/scene")
    with np.load("results/columns.npz") as stacked:
        np.testing.assert_array_equal(stacked["time"], run.ledger["time"])
        for i in range(5):
            for column in ("position", "velocity"):
                np.testing.assert_array_equal(stacked[f"p/{column}"][i], run.frame(i)["p"][column])
    assert not list(Path("results").glob("*.tmp"))


def test_ply_by_option_or_by_the_scene(spring: Tree, scene_file: SceneFile, tumble: Command) -> None:
    tumble("run", scene_file(spring), "--frames", 2)
    assert not Path("out/scene/ply").exists()
    assert tumble("export", "out/scene", "--ply").code == 0
    files = ["p.000000.ply", "p.000001.ply", "p.000002.ply"]
    assert sorted(p.name for p in Path("out/scene/ply").iterdir()) == files
    assert tumble("run", scene_file(spring), "--frames", 1, "--set", "output.ply=true", "--force").code == 0
    assert sorted(p.name for p in Path("out/scene/ply").iterdir()) == files[:2]


# Scenes


@pytest.fixture
def shelf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, spring: Tree) -> Path:
    """A shelf of shipped scenes."""
    folder = tmp_path / "shelf"
    for name in ("springs/pendulum", "springs/chain", "cloth/flag", "cloth/chain"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        head = f'version = 1\ntitle = "The {name}"\noutput.plot = false\n'
        (folder / f"{name}.toml").write_text(f'{head}[[particles]]\nname = "p"\nposition = [[0, 0, 0]]\n')
    monkeypatch.setattr(bundled, "SCENES", folder)
    return folder


def test_scenes_lists_rows_and_prints_files(shelf: Path, tumble: Command) -> None:
    answer = tumble("scenes")
    assert answer.code == 0
    assert answer.out.splitlines() == [
        "cloth",
        "  chain     The cloth/chain",
        "  flag      The cloth/flag",
        "springs",
        "  chain     The springs/chain",
        "  pendulum  The springs/pendulum",
    ]
    assert tumble("scenes", "flag").out == (shelf / "cloth/flag.toml").read_text()


def test_scenes_are_run_by_name(shelf: Path, tumble: Command) -> None:
    assert tumble("run", "springs/pendulum", "--frames", 1).code == 0
    assert tumble("run", "flag", "--frames", 1).code == 0
    assert Run("out/pendulum").n_frames == Run("out/flag").n_frames == 2
    for name, hint in [
        ("pendulm", "springs/pendulum"),
        ("chain", "cloth/chain, springs/chain"),
        ("cloth/flog", "cloth/flag"),
    ]:
        answer = tumble("run", name)
        assert (answer.code, hint in answer.err) == (2, True), answer.err


def test_shipped_scenes_are_right(tumble: Command) -> None:
    for name in bundled.shipped():
        assert find.scene(name, None).to_dict()["title"], name


# Stopping


def start(file: Path, *more: str) -> subprocess.Popen[str]:
    """A run in a process of its own, already simulating."""
    # A shell that runs the tests in the background has them ignore Ctrl-C, which children inherit.
    heed = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    command = [*PYTHON, "run", str(file), *more]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, preexec_fn=heed)
    assert process.stderr is not None
    while "simulate" not in process.stderr.readline():
        assert process.poll() is None
    return process


def test_ctrl_c_says_what_is_kept_and_how_to_go_on(spring: Tree, scene_file: SceneFile, tumble: Command) -> None:
    process = start(scene_file(spring), "--frames", "1000000")
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in err
    kept = Run("out/scene")
    assert kept.status == "interrupted"
    assert f"{kept.n_frames} frame" in err
    again = copied(err, "run")
    assert again[-1] == "--resume"
    more = ["--set", f"time.frames={kept.n_frames + 20}"]
    assert tumble(*again, *more).code == 0
    assert tumble("run", "scene.json", *more, "--out", "whole").code == 0
    assert Run("out/scene").hashes == Run("whole").hashes


def test_a_run_that_was_really_killed_goes_on_to_the_same_bits(
    spring: Tree, scene_file: SceneFile, tumble: Command
) -> None:
    spring["time"]["frames"] = 400
    process = start(scene_file(spring))
    process.kill()
    process.communicate(timeout=60)
    assert tumble("run", "scene.json", "--resume").code == 0
    assert tumble("run", "scene.json", "--out", "whole").code == 0
    assert Run("out/scene").hashes == Run("whole").hashes
    assert len(Run("whole").hashes) == 401


def test_ctrl_c_anywhere_else_is_quiet(
    spring: Tree, scene_file: SceneFile, tumble: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("tumble.cli.find.scene", stop)
    answer = tumble("check", scene_file(spring))
    assert (answer.code, answer.err) == (130, "error: stopped\n")


def test_a_signal_to_terminate_ends_as_ctrl_c_does(spring: Tree, scene_file: SceneFile, tumble: Command) -> None:
    process = start(scene_file(spring), "--frames", "1000000")
    process.terminate()
    _, err = process.communicate(timeout=60)
    assert process.returncode == 143
    assert "Traceback" not in err
    kept = Run("out/scene")
    assert (kept.status, f"{kept.n_frames} frame" in err) == ("interrupted", True)
    assert tumble(*copied(err, "run"), "--set", f"time.frames={kept.n_frames + 5}").code == 0


def test_a_folder_in_which_a_run_is_writing_is_refused(spring: Tree, scene_file: SceneFile, tumble: Command) -> None:
    file = scene_file(spring)
    process = start(file, "--frames", "1000000")
    for more in (["--force"], ["--resume"], []):
        answer = tumble("run", file, *more)
        assert answer.code == 2
        assert answer.err.startswith(f"error: out/scene: a run is writing here (pid {process.pid})")
    assert tumble("run", file, "--out", "elsewhere").code == 0
    process.kill()
    process.communicate(timeout=60)
    # The file outlives who wrote it, the lock does not.
    assert Path("out/scene/.lock").exists()
    assert tumble("run", file, "--resume", "--set", "time.frames=1000").code == 0
    assert not Path("out/scene/.lock").exists()
    assert len(set(Run("out/scene").hashes)) == Run("out/scene").n_frames


def test_results_are_written_alone_too(
    spring: Tree, scene_file: SceneFile, tumble: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = scene_file(spring)
    codes = []

    def film(*_: object, **__: object) -> None:
        again = subprocess.run([*PYTHON, "run", str(file), "--force"], capture_output=True, check=False)
        codes.append((again.returncode, b"a run is writing here" in again.stderr))

    monkeypatch.setattr("tumble.cli.render.film", film)
    assert tumble("run", file, "--film").code == 0
    assert codes == [(2, True)]


def test_a_frame_that_is_not_there_is_missed_once(spring: Tree, scene_file: SceneFile, tumble: Command) -> None:
    spring["output"]["stills"] = [120]
    assert tumble("run", scene_file(spring)).err.count("120") == 1


# Disks and streams


def test_a_folder_that_cannot_be_is_a_fault_of_the_input(spring: Tree, scene_file: SceneFile, tumble: Command) -> None:
    Path("file").touch()
    for place in ("file", "file/below", "/proc/nowhere", "x" * 300):
        answer = tumble("run", scene_file(spring), "--out", place)
        assert answer.code == 2, place
        assert answer.err.startswith(f"error: {place}: ") and "choose another" in answer.err
    # Nor is anything left behind by a scene that is wrong.
    assert tumble("run", scene_file(spring), "--out", "a/b", "--set", "system.0.step=-1").code == 2
    assert not Path("a").exists()


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (ExportError("out: no space left on the disk"), 1),
        (OSError(28, "No space left on device"), 1),
        (_engine.SceneError("the input is wrong"), 2),
        (_engine.TumbleError("something"), 1),
        (MemoryError(), 1),
    ],
)
def test_errors_become_one_message(
    spring: Tree,
    scene_file: SceneFile,
    tumble: Command,
    monkeypatch: pytest.MonkeyPatch,
    error: Exception,
    code: int,
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("tumble.run.simulate", fail)
    answer = tumble("run", scene_file(spring))
    assert answer.code == code
    assert answer.err.startswith("error: ") and answer.err.count("\n") == 1


def test_a_result_that_fails_leaves_the_run_and_ends_with_1(
    spring: Tree, scene_file: SceneFile, tumble: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise ExportError("film.mp4: there is no encoder here")

    monkeypatch.setattr("tumble.cli.render.film", fail)
    answer = tumble("run", scene_file(spring), "--film")
    assert answer.code == 1
    assert "no encoder" in answer.err
    assert Run("out/scene").status == "finished"


def test_narrow_streams_say_what_they_can(spring: Tree, scene_file: SceneFile, tmp_path: Path) -> None:
    spring["title"] = "10 m/s² × ω 猫"
    done = subprocess.run(
        [*PYTHON, "check", str(scene_file(spring))],
        env=os.environ | {"PYTHONIOENCODING": "ascii"},
        capture_output=True,
        cwd=tmp_path,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert b'"10 m/s^2 x w ?"' in done.stdout


def test_progress_off_a_terminal_is_few_plain_lines(capsys: pytest.CaptureFixture[str]) -> None:
    with Progress("simulate") as progress:
        for done in range(1001):
            progress(done, 1000)
    lines = capsys.readouterr().err.splitlines()
    assert 10 <= len(lines) <= 12
    assert (lines[0], lines[-1]) == ("simulate       0 / 1000    0%", "simulate    1000 / 1000  100%")


def test_numbers_for_people() -> None:
    assert [seconds(x) for x in (0.0, float("inf"), 0.25, 0.00123)] == ["none", "any", "0.25 s", "1.23e-03 s"]
    assert [size(n) for n in (0, 999, 1000, 123456, 5e9, 7e13)] == ["0 B", "999 B", "1 kB", "123 kB", "5 GB", "70 TB"]


# Speed and help


def loaded_by(code: str) -> set[str]:
    code = f"import sys; sys.argv = ['tumble', '--help']\ntry:\n {code}\nexcept SystemExit: pass\nprint(*sys.modules)"
    return set(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split())


def test_importing_and_help_load_nothing_heavy() -> None:
    heavy = {"numpy", "rich", "matplotlib", "tumble._engine"}
    assert loaded_by("import numpy") & heavy == {"numpy"}
    assert not loaded_by("import tumble") & heavy
    assert not loaded_by("from tumble.cli import main; main()") & heavy


def test_every_verb_teaches_by_example(tumble: Command) -> None:
    verbs = re.findall(r"^  ([a-z]+) ", tumble("--help").out.split("Commands:")[1], re.MULTILINE)
    assert set(verbs) == {
        "run",
        "check",
        "render",
        "export",
        "plot",
        "bottlenecks",
        "branch",
        "diff",
        "refine",
        "lab",
        "scenes",
        "schema",
        "sweep",
        "view",
    }
    for verb in [[v] for v in verbs] + [["lab", "integrators"], ["lab", "structures"]]:
        answer = tumble(*verb, "--help")
        assert answer.code == 0
        assert f"tumble {' '.join(verb)}" in answer.out.split("Example", 1)[1]


def test_names_of_the_package_are_there() -> None:
    import tumble

    assert tumble.__version__ == _engine.version
    assert all(hasattr(tumble, name) for name in tumble.__all__)
    assert set(tumble.__all__) <= set(dir(tumble))
    with pytest.raises(AttributeError, match="nothing"):
        tumble.nothing  # noqa: B018
