"""`tumble branch`: another way from any frame of a run, and the curves of both."""

import copy
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Answer
from runs import Killed, N, Tree, assert_same, kill_at
from test_kills import SCENES
from test_soak import MIXED

from tumble import ExportError, Run, Scene, SceneError, World
from tumble.branch import branch, family, lineage, world_at
from tumble.compare import compare
from tumble.run import simulate

Command = Callable[..., Answer]
SceneFile = Callable[..., Path]

SOFTER = "particles.p.spring.0.stiffness=50"
SYSTEMS: dict[str, Tree] = {
    **SCENES,
    "everything": MIXED,
    "implicit": SCENES["sheets"]
    | {"system": [{"integrator": "implicit_euler", "solver": {"newton_tolerance": 1e-3, "linear_tolerance": 1e-2}}]},
    "two steps back": SCENES["sheets"] | {"system": [{"integrator": "bdf2"}]},
}
"""Emitters with adaptive steps, cloth on positions and on forces, a gas, and systems side by side."""

HANGING = "particles.p.spring.0.rest_length=0.5"
"""Settings that the engine would otherwise derive from the initial positions."""


@pytest.mark.parametrize("frame", [0, 1, 13, 20, 24])
def test_a_branch_without_a_change_has_the_bits_of_its_parent(reference: Run, tmp_path: Path, frame: int) -> None:
    """13 and 24 have no checkpoint: they are simulated to, from the start and from 20."""
    assert_same(branch(reference, frame, tmp_path / "again"), reference)


@pytest.mark.parametrize("kind", SYSTEMS)
def test_branches_of_any_system_have_the_bits_of_their_parent(kind: str, tmp_path: Path) -> None:
    """Births go on where they were, adaptive steps from the last one, solvers from what they keep. Of frame 3 there is no
    checkpoint: it is simulated to."""
    scene = SYSTEMS[kind] | {"output": {"plot": False, "checkpoint": 4}}
    parent = simulate(scene, tmp_path / "parent", frames=7)
    assert len(set(parent.hashes)) == 8
    for frame in (3, 4):
        assert_same(branch(parent, frame, tmp_path / f"again-{frame}"), parent)


def test_a_value_that_is_there_already_is_no_change(reference: Run, spring: Tree, tmp_path: Path) -> None:
    was = f"particles.p.spring.0.stiffness={spring['particles'][0]['spring'][0]['stiffness']}"
    found = branch(reference, 13, tmp_path / "again", [was, "time.frames=30"])
    assert found.descent[-1]["set"] == []
    assert_same(found, simulate(spring, tmp_path / "whole", frames=30))


def test_frames_after_the_parents_last_are_those_of_a_longer_run(reference: Run, spring: Tree, tmp_path: Path) -> None:
    longer = branch(reference, -1, tmp_path / "longer", frames=8)
    assert longer.n_frames == N + 1 + 8
    assert_same(longer, simulate(spring, tmp_path / "whole", frames=N + 8))


def test_a_branch_is_the_changed_world_in_the_old_state(reference: Run, spring: Tree, tmp_path: Path) -> None:
    found = branch(reference, 13, tmp_path / "softer", [SOFTER])
    old = World(Scene(spring))
    old.step(13)
    old.save(tmp_path / "state")
    world = World(Scene(spring).replace(SOFTER))
    world.load(tmp_path / "state")
    world.reconsider()
    assert found.hashes[:14] == reference.hashes[:14]
    for i in range(13, N + 1):
        assert found.hashes[i] == world.hash()
        np.testing.assert_array_equal(found.frame(i)["p"]["position"], world.frame["p"]["position"])
        assert found.ledger["elastic"][i] == world.ledger["elastic"]
        world.step()
    assert found.hashes[14] != reference.hashes[14]
    difference = compare(reference, found)
    # The spring holds half the energy from that frame on: books differ first, then the state.
    assert (difference.frame, difference.seen) == (13, 14)
    assert difference.columns[0].column == "elastic"
    assert found.ledger["elastic"][13] == pytest.approx(reference.ledger["elastic"][13] / 2, rel=1e-6)
    # The cost up to there belongs to the parent.
    np.testing.assert_array_equal(found.ledger["steps"][:14], reference.ledger["steps"][:14])


def test_a_membrane_comes_instead_of_links_as_it_does_in_a_file(tmp_path: Path) -> None:
    sheet = {"name": "p", "size": [1, 1], "resolution": [5, 5], "pin": ["edge x-"]}
    cloth = {"version": 1, "time": {"frames": 6}, "sheet": [sheet]}
    woven = "sheet.0.membrane={warp=100}"
    run = simulate(cloth, tmp_path / "cloth")
    found = branch(run, 3, tmp_path / "woven", [woven])
    world = World(Scene(cloth).replace(woven))
    assert world.scene.to_dict()["sheet"] == found.scene["sheet"]
    old = World(Scene(cloth))
    old.step(3)
    old.save(tmp_path / "state")
    world.load(tmp_path / "state")
    world.reconsider()
    world.step(3)
    assert found.hashes[6] == world.hash() != run.hashes[6]


def test_a_stiffer_branch_chooses_its_steps_anew(reference: Run, spring: Tree, tmp_path: Path) -> None:
    """One step a frame is enough for the parent, and would throw the mass out of a branch ten times as fast."""
    assert set(reference.ledger["steps"][1:14]) == {1}
    stiffer = ["particles.p.spring.0.stiffness=1e4", HANGING]
    found = branch(reference, 13, tmp_path / "stiff", stiffer)
    assert found.status == "finished" and found.ledger["steps"][14:].min() >= 3
    assert_same(branch(found, 20, tmp_path / "again"), found)
    # The first step after a change takes nothing from before it: what a scheme keeps is of the old forces.
    shutil.rmtree(found.folder / "checkpoints")
    assert world_at(found, 20).hash() == found.hashes[20]


def test_the_manifest_keeps_the_line_of_descent(reference: Run, tmp_path: Path) -> None:
    child = branch(reference, 5, tmp_path / "child", [SOFTER])
    grandchild = branch(child, 17, tmp_path / "deep/grandchild", ["world.gravity=[0, 0, 0]"])
    assert reference.descent == []
    first = {"name": "reference", "frame": 5, "time": reference.time(5), "hash": reference.hashes[5], "set": [SOFTER]}
    assert child.descent == [{"run": "../reference", **first}]
    assert grandchild.descent == [
        {"run": "../../reference", **first},
        {
            "run": "../../child",
            "name": "child",
            "frame": 17,
            "time": child.time(17),
            "hash": child.hashes[17],
            "set": ["world.gravity=[0, 0, 0]"],
        },
    ]
    assert grandchild.scene["particles"][0]["spring"][0]["stiffness"] == 50
    assert [path.resolve() for path in lineage(grandchild)] == [reference.folder, child.folder]
    assert [run.folder for run in family(reference)] == [child.folder]
    assert [run.folder for run in family(child)] == [reference.folder]
    # Folders that move together stay a family.
    shutil.move(tmp_path / "reference", tmp_path / "elsewhere/reference")
    shutil.move(tmp_path / "child", tmp_path / "elsewhere/child")
    assert [run.folder.name for run in family(Run(tmp_path / "elsewhere/child"))] == ["reference"]


@pytest.mark.parametrize("frame", [13, 14, 20, 24])
@pytest.mark.parametrize("checkpoints", [True, False])
def test_a_killed_branch_goes_on_to_the_same_bits(
    reference: Run, tmp_path: Path, frame: int, checkpoints: bool
) -> None:
    whole = branch(reference, 13, tmp_path / "whole", [SOFTER])
    folder = tmp_path / "killed"
    with pytest.raises(Killed):
        branch(reference, 13, folder, [SOFTER], progress=kill_at(frame))
    assert Run(folder).status == "running"
    if not checkpoints:
        shutil.rmtree(folder / "checkpoints")
    resumed = branch(reference, 13, folder, [SOFTER], resume=True)
    assert_same(resumed, whole)
    assert resumed.descent == whole.descent


def test_a_damaged_parent_is_named_before_anything_is_lost(reference: Run, spring: Tree, tmp_path: Path) -> None:
    path = reference.folder / "frames/000005.npz"
    whole = path.read_bytes()
    path.write_bytes(whole[:300] + bytes([whole[300] ^ 1]) + whole[301:])
    with pytest.raises(ExportError, match=r"reference.*000005\.npz: is damaged .*--resume"):
        branch(reference, 13, tmp_path / "b", [SOFTER])
    assert not (tmp_path / "b/run.json").exists()
    found = branch(simulate(spring, reference.folder, resume=True), 13, tmp_path / "b", [SOFTER])
    # The damage may come later, to a file that both have.
    path.unlink()
    path.write_bytes(whole)
    own = found.folder / "frames/000007.npz"
    own.write_bytes(own.read_bytes()[:100])
    with pytest.raises(ExportError, match=r"reference.*000007\.npz: is damaged"):
        branch(reference, 13, found.folder, [SOFTER], resume=True)
    assert Run(found.folder).frame(20)
    parent = simulate(spring, reference.folder, resume=True)
    healed = branch(parent, 13, found.folder, [SOFTER], resume=True)
    assert_same(healed, branch(parent, 13, tmp_path / "whole", [SOFTER]))


def test_what_a_branch_is_given_is_no_energy_from_nowhere(reference: Run, tmp_path: Path) -> None:
    found = branch(reference, 6, tmp_path / "stiff", ["particles.p.spring.0.stiffness=5000"])
    assert found.ledger["energy"].max() > 2.0 * found.ledger["energy"][5] and found.manifest["warnings"] == []


def test_a_branch_is_never_begun_anew_from_the_start(reference: Run, spring: Tree, tmp_path: Path) -> None:
    """`tumble run --resume` with the branch's very scene would simulate another history."""
    found = branch(reference, 13, tmp_path / "softer", [SOFTER])
    shutil.rmtree(found.folder / "checkpoints")
    with pytest.raises(
        SceneError, match=r"is a branch of .*reference at frame 13; go on with `tumble branch .*--resume`"
    ):
        simulate(Scene(spring).replace(SOFTER), found.folder, resume=True)
    for frame, changes in ((12, [SOFTER]), (13, [])):
        with pytest.raises(SceneError, match="is a branch of"):
            branch(reference, frame, found.folder, changes, resume=True)
    other = shutil.copytree(reference.folder, tmp_path / "another")
    with pytest.raises(SceneError, match="is no branch"):
        branch(found, 13, other, resume=True)


def test_the_parent_outlives_its_branches(reference: Run, tmp_path: Path) -> None:
    before = {f: f.read_bytes() for f in reference.folder.rglob("*") if f.is_file()}
    found = branch(reference, 13, tmp_path / "b", [SOFTER])
    branch(reference, 3, tmp_path / "b", ["world.gravity=[0, 0, 0]"], overwrite=True)
    found = Run(found.folder)
    found_before = [found.frame(i)["p"]["position"].copy() for i in range(found.n_frames)]
    assert {f: f.read_bytes() for f in reference.folder.rglob("*") if f.is_file()} == before
    simulate(reference.scene | {"seed": 5}, reference.folder, frames=2, overwrite=True)
    for i, position in enumerate(found_before):
        np.testing.assert_array_equal(found.frame(i)["p"]["position"], position)


def test_no_run_on_the_line_of_descent_is_replaced(reference: Run, tmp_path: Path) -> None:
    """Each would go on from the other, and their frames would be lost."""
    shutil.copytree(reference.folder, tmp_path / "first")
    first = Run(tmp_path / "first")
    second = branch(first, 13, tmp_path / "second", [SOFTER])
    third = branch(second, 20, tmp_path / "third", [SOFTER])
    for taken in (first, second, third):
        with pytest.raises(SceneError, match="branches off from"):
            branch(third, -1, taken.folder, frames=2, overwrite=True)
        assert_same(Run(taken.folder), taken)


def test_a_run_may_be_where_one_is(
    reference: Run, tmp_path: Path, tumble: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(reference.folder, tmp_path / "runs" / "first")
    monkeypatch.chdir(tmp_path / "runs" / "first")
    answer = tumble("branch", ".@13", "--set", SOFTER)
    assert answer.code == 0, answer.err
    assert [run.folder.name for run in family(Run("."))] == ["first@13"]
    assert (tmp_path / "runs" / "first@13" / "run.json").is_file()


def test_copies_where_the_disk_has_no_links(reference: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def link(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr("os.link", link)
    found = branch(reference, 13, tmp_path / "copy")
    assert_same(found, reference)
    assert (found.folder / "frames/000003.npz").stat().st_nlink == 1


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (["time.fps=30"], "time.fps: 30"),
        (["time.frames=13"], "--frames"),
        (["precision=double"], "another precision"),
        (["system.0.integrator=bdf2"], "integrators with the same state"),
        (["particles.p.pin=[]"], "pins of"),
        (["particles.p.mass=[2.0]"], "masses of"),
        (['output.columns=["position"]'], "velocity of"),
        (["particles.p.sping=3"], "did you mean"),
        (["world.gravity=down"], "world.gravity"),
    ],
)
def test_what_a_branch_cannot_change(
    reference: Run, tmp_path: Path, tumble: Command, changes: list[str], words: str
) -> None:
    with pytest.raises(SceneError, match=words):
        branch(reference, 13, tmp_path / "b", changes)
    answer = tumble("branch", f"{reference.folder}@13", "--set", changes[0], "--out", "b")
    assert answer.code == 2
    assert words in answer.err and "Traceback" not in answer.err
    assert not (tmp_path / "b/run.json").exists()


def test_frames_that_are_not_there(reference: Run, tmp_path: Path, tumble: Command) -> None:
    for word in ("26", "-27"):
        answer = tumble("branch", f"{reference.folder}@{word}")
        assert answer.code == 2 and "it has 0 to 25" in answer.err
    for word in ("", "@", "@x", "@1.5"):
        answer = tumble("branch", f"{reference.folder}{word}")
        assert answer.code == 2 and "sheet@40" in answer.err
    assert tumble("branch", "nowhere@3").code == 2
    answer = tumble("branch", f"{reference.folder}@3", "--out", reference.folder)
    assert answer.code == 2 and "the run itself" in answer.err


def test_a_state_that_cannot_be_made_again_is_refused(reference: Run, tmp_path: Path) -> None:
    ledger = reference.folder / "ledger.csv"
    ledger.write_text(ledger.read_text().replace(reference.hashes[13], "0" * 16))
    run = Run(reference.folder)
    assert world_at(run, 12).hash() == reference.hashes[12]
    with pytest.raises(SceneError, match=r"frame 13 cannot be recomputed to the same bits.*with a checkpoint: 20, 25"):
        branch(run, 13, tmp_path / "b", [SOFTER])


def test_a_branch_of_a_branch_needs_the_first_run_only_before_it(reference: Run, tmp_path: Path) -> None:
    child = branch(reference, 13, tmp_path / "child", [SOFTER])
    for frame in (4, 13, 17, 25):
        assert world_at(child, frame).hash() == child.hashes[frame]
    # Its own start is always kept, the others may be lost.
    assert (child.folder / "checkpoints/000013.safetensors").is_file()
    for file in (child.folder / "checkpoints").iterdir():
        file.unlink()
    for frame in (4, 13, 17):
        assert world_at(child, frame).hash() == child.hashes[frame]
    shutil.rmtree(reference.folder)
    with pytest.raises(SceneError, match="frame 17 must be recomputed from the parent run"):
        world_at(child, 17)


def test_meshes_are_found_where_the_scene_lay(tmp_path: Path, scene_file: SceneFile, tumble: Command) -> None:
    tree: Tree = {
        "version": 1,
        "time": {"fps": 24, "frames": 4},
        "net": [{"name": "n", "mesh": {"path": "t.obj"}}],
        "output": {"plot": False},
    }
    (tmp_path / "in").mkdir()
    (tmp_path / "in/t.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\nf 1 2 3\nf 2 4 3\n")
    file = scene_file(tree, "in/scene.json")
    assert tumble("run", file).code == 0
    # Of a killed run there may be no checkpoint.
    shutil.rmtree("out/scene/checkpoints")
    answer = tumble("branch", "scene@2", "--set", "world.gravity=[0, 0, -1]")
    assert answer.code == 0, answer.err
    assert tumble("branch", "scene@2@3", "--set", "world.gravity=[0, 0, -2]").code == 0


# The command line


def test_the_command_says_where_the_branch_is_and_comes_from(
    spring: Tree, scene_file: SceneFile, tumble: Command
) -> None:
    assert tumble("run", scene_file(spring)).code == 0
    answer = tumble("branch", "scene@13", "--set", SOFTER, "--frames", 4)
    assert answer.code == 0
    run = Run("out/scene@13")
    assert run.n_frames == 13 + 4 + 1
    for word in ("out/scene@13: 18 frames", "of out/scene at frame 13", Run("out/scene").hashes[13], f"--set {SOFTER}"):
        assert word in answer.out, word
    assert "warning" not in answer.err
    again = tumble("branch", "scene@13", "--set", SOFTER, "--frames", 4)
    assert again.code == 2 and "--force" in again.err
    assert tumble("branch", "scene@13", "--set", SOFTER, "--frames", 4, "--resume").code == 0
    assert tumble("branch", "scene@13", "--force").code == 0
    assert Run("out/scene@13").n_frames == N + 1
    last = tumble("branch", "scene@-1", "--frames", 2)
    assert last.code == 0 and Run("out/scene@25").n_frames == N + 3


def test_a_change_without_effect_is_told(spring: Tree, scene_file: SceneFile, tumble: Command) -> None:
    assert tumble("run", scene_file(spring)).code == 0
    answer = tumble("branch", "scene@13", "--set", "particles.p.velocity=[[0, 0, 0], [9, 0, 0]]")
    assert answer.code == 0
    assert "the change had no effect in 12 frames" in answer.err


def test_a_branch_that_breaks_ends_with_1_and_a_command_for_branches(
    spring: Tree, scene_file: SceneFile, tumble: Command
) -> None:
    spring["system"] = [{"name": "soft", "integrator": "symplectic_euler", "step": 0.004}]
    assert tumble("run", scene_file(spring)).code == 0
    answer = tumble("branch", "scene@13", "--set", "particles.p.spring.0.stiffness=1e7")
    assert answer.code == 1
    assert "FAILED" in answer.err and "tumble branch out/scene@13" in answer.err
    assert Run("out/scene@13").status == "failed"
    assert Run("out/scene@13").n_frames >= 14


# Curves


def test_branches_are_drawn_beside_their_parent(
    reference: Run, tmp_path: Path, tumble: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    branch(reference, 13, tmp_path / "softer", [SOFTER])
    branch(reference, 5, tmp_path / "weightless", ["world.gravity=[0, 0, 0]"], frames=30)
    (tmp_path / "spoilt").mkdir()
    (tmp_path / "spoilt/run.json").write_text("{")
    answer = tumble("plot", reference.folder, "--branches", "--out", "both.png")
    assert answer.code == 0, answer.err
    assert Path("both.png").stat().st_size > 10_000
    drawn: list[Any] = []
    monkeypatch.setattr("tumble.plots.save", lambda figure, path: drawn.append(figure) or path)
    assert tumble("plot", "--with", "softer", "--branches", reference.folder, "speed", "momentum").code == 0
    (figure,) = drawn
    assert [ax.get_ylabel() for ax in figure.axes] == ["speed [m/s]"] + ["momentum [kg m/s]"] * 3
    curves = [line for line in figure.axes[0].lines if len(line.get_xdata()) > 2]
    assert [(len(c.get_xdata()), round(c.get_xdata()[0] * 24)) for c in curves] == [(26, 0), (13, 13), (31, 5)]
    np.testing.assert_array_equal(curves[1].get_ydata(), Run(tmp_path / "softer").ledger["speed"][13:])
    assert {text.get_text() for text in figure.axes[0].texts} == {"reference", "softer", "weightless"}
    assert len({curve.get_color() for curve in curves}) == 3


def test_runs_that_are_no_kin_are_drawn_whole(reference: Run, spring: Tree, tmp_path: Path, tumble: Command) -> None:
    spring["world"] = {"gravity": [0, 0, -1]}
    simulate(spring, tmp_path / "other")
    assert tumble("plot", reference.folder, "energy", "--with", "other", "--out", "two.png").code == 0
    assert Path("two.png").is_file()
    answer = tumble("plot", reference.folder, "--branches")
    assert answer.code == 2 and "tumble branch" in answer.err
    answer = tumble("plot", reference.folder, "--with", reference.folder)
    assert answer.code == 2 and "the run itself" in answer.err
    assert tumble("plot", reference.folder, "--with", "other", "--slice").code == 2
    assert tumble("plot", reference.folder, "--with", "nowhere").code == 2


def test_older_runs_without_descent_are_runs_of_their_own(reference: Run, tmp_path: Path) -> None:
    manifest = json.loads((reference.folder / "run.json").read_text())
    for key in ("descent", "folder"):
        del manifest[key]
    (reference.folder / "run.json").write_text(json.dumps(manifest))
    run = Run(reference.folder)
    assert run.descent == []
    assert_same(branch(run, 4, tmp_path / "b"), copy.copy(run))


def test_a_checkpoint_of_another_state_is_passed_over(reference: Run, spring: Tree, tmp_path: Path) -> None:
    spring["particles"][0]["velocity"][1] = [0.6, 0, 0]
    other = simulate(spring, tmp_path / "other")
    shutil.copy(other.folder / "checkpoints/000020.safetensors", reference.folder / "checkpoints")
    assert world_at(reference, 22).hash() == reference.hashes[22]
    (reference.folder / "checkpoints/000025.safetensors").write_bytes(b"torn")
    assert world_at(reference, 25).hash() == reference.hashes[25]
