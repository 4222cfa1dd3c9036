"""The run folder: what is in it, and that a stopped run goes on to the same bits."""

import copy
import errno
import json
import math
import shutil
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Answer
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from runs import OBJECT, Killed, N, Tree, assert_same, half, kill_at, killed, truncate

from tumble import ExportError, Run, Scene, SceneError, World, _engine
from tumble.branch import branch
from tumble.folder import LEDGER, RunFolder, cell, plain, read_rows
from tumble.reader import LostFrames
from tumble.run import simulate

# Content of the folder


def test_the_folder_holds_what_the_design_says(reference: Run) -> None:
    files = {str(f.relative_to(reference.folder)) for f in reference.folder.rglob("*") if f.is_file()}
    frames = {f"frames/{i:06}.npz" for i in range(N + 1)}
    checkpoints = {"checkpoints/000020.safetensors", "checkpoints/000025.safetensors"}
    assert files == {"run.json", "static.npz", "columns.json", "ledger.csv"} | frames | checkpoints


def test_frames_are_what_the_world_shows(spring: Tree, reference: Run) -> None:
    world = World(Scene(spring))
    assert reference.n_frames == len(reference) == N + 1
    for i in range(N + 1):
        found, expected = reference.frame(i), world.frame
        assert list(found) == list(expected)
        for column, array in expected[OBJECT].items():
            np.testing.assert_array_equal(found[OBJECT][column], array)
            assert found[OBJECT][column].dtype == array.dtype
        assert reference.time(i) == world.time == pytest.approx(i / 24, abs=1e-12)
        assert reference.hashes[i] == world.hash()
        assert reference.ledger["energy"][i] == world.ledger["energy"]
        world.step()
    assert np.ptp([reference.frame(i)[OBJECT]["position"][1, 0] for i in range(N)]) > 0.05
    np.testing.assert_array_equal(reference.frame(-1)[OBJECT]["position"], reference.frame(N)[OBJECT]["position"])


def test_static_columns_have_units_and_shapes(reference: Run) -> None:
    assert reference.static[OBJECT]["mass"].tolist() == [1.0, 1.0]
    assert reference.static[OBJECT]["pinned"].tolist() == [0]
    described = reference.columns[OBJECT]
    assert described["position"] == {"unit": "m", "shape": [2, 3], "dtype": "float32", "in": "frames"}
    assert described["velocity"]["unit"] == "m/s"
    assert described["mass"]["unit"] == "kg"
    assert described["mass"]["in"] == "static"


def test_the_manifest_tells_how_it_was_made(spring: Tree, reference: Run) -> None:
    manifest = reference.manifest
    assert manifest["status"] == "finished"
    assert manifest["failure"] is None
    assert manifest["tumble"] == _engine.version
    assert (manifest["bits"], manifest["precision"], manifest["seed"]) == ("portable", "single", 0)
    assert manifest["scene"] == json.loads(json.dumps(plain(Scene(spring).to_dict())))
    assert manifest["machine"]["cpus"] >= 1
    assert manifest["timings"]["total"] >= manifest["timings"]["simulate"] > 0
    assert manifest["stability"][0]["frequency"] == pytest.approx(10.0, rel=0.5)
    assert len(set(manifest["hashes"])) == N + 1


def test_native_bits_are_noted_with_the_instructions(spring: Tree, tmp_path: Path) -> None:
    spring["bits"] = "native"
    manifest = simulate(Scene(spring), tmp_path / "run").manifest
    assert manifest["bits"] == "native"
    assert manifest["machine"]["instructions"] in ("scalar", "avx2", "avx512")


def test_bits_of_a_factorization_are_those_of_a_machine(spring: Tree, tmp_path: Path) -> None:
    for integrator, linear, bits in (
        ("implicit_euler", "cholesky", "machine"),
        ("bdf2", "cholesky", "machine"),
        ("implicit_midpoint", "pcg", "portable"),
        ("rk4", "cholesky", "portable"),
    ):
        spring["system"] = [{"integrator": integrator, "substeps": 8, "solver": {"linear": linear}}]
        run = simulate(spring, tmp_path / "run", frames=1, overwrite=True)
        assert run.manifest["bits"] == bits, integrator


def test_the_ledger_counts_steps(reference: Run) -> None:
    ledger = reference.ledger
    assert list(ledger) == LEDGER[:-1]
    assert ledger["frame"].tolist() == list(range(N + 1))
    assert ledger["steps"][0] == 0
    assert math.isnan(ledger["smallest_step"][0])
    assert (ledger["steps"][1:] >= 1).all()
    np.testing.assert_allclose(ledger["steps"][1:] * ledger["largest_step"][1:], 1 / 24, rtol=1e-9)
    np.testing.assert_allclose(ledger["energy"], ledger["kinetic"] + ledger["elastic"] + ledger["external"])


def test_trials_of_adaptive_integrators_are_kept(spring: Tree, tmp_path: Path, reference: Run) -> None:
    assert not (reference.folder / "trials.csv").exists()
    spring["system"] = [{"name": "a", "integrator": "dormand_prince"}]
    whole = simulate(spring, tmp_path / "whole")
    assert whole.trials["accepted"].sum() == whole.ledger["steps"].sum() > 0
    assert whole.trials["frame"][-1] == N
    resumed = simulate(spring, killed(spring, tmp_path / "killed", 17), resume=True)
    assert_same(resumed, whole)
    for name, column in whole.trials.items():
        np.testing.assert_array_equal(resumed.trials[name], column, err_msg=name)


@given(st.floats(allow_nan=False))
def test_numbers_in_tables_keep_their_bits(x: float) -> None:
    assert float(cell(x)) == float(cell(np.float64(x))) == x


def test_infinite_numbers_fit_into_json() -> None:
    tree = {"a": [math.inf, -math.inf, math.nan, np.float32(0.5)], "b": (np.arange(2), True, None)}
    assert json.loads(json.dumps(plain(tree), allow_nan=False)) == {
        "a": ["inf", "-inf", "nan", 0.5],
        "b": [[0, 1], True, None],
    }


# Stopping and going on


@pytest.mark.parametrize("frame", [0, 1, 9, 10, 11, 20, 24, 25])
def test_a_killed_run_goes_on_to_the_same_bits(spring: Tree, tmp_path: Path, reference: Run, frame: int) -> None:
    folder = killed(spring, tmp_path / "run", frame)
    stopped = Run.open(folder)
    assert (stopped.status, stopped.n_frames) == ("running", frame + 1)
    assert stopped.hashes == reference.hashes[: frame + 1]
    seen: list[int] = []
    resumed = simulate(spring, folder, resume=True, progress=lambda done, _: seen.append(done))
    assert_same(resumed, reference)
    assert seen[0] == frame - frame % 10 if frame < N else N
    assert resumed.manifest["resumed"] == (1 if frame >= 10 else 0)


def test_resume_without_an_earlier_run_starts_one(spring: Tree, tmp_path: Path, reference: Run) -> None:
    assert_same(simulate(spring, tmp_path / "run", resume=True), reference)


def test_resume_of_a_finished_run_changes_nothing_and_more_frames_extend_it(
    spring: Tree, tmp_path: Path, reference: Run
) -> None:
    short = simulate(spring, tmp_path / "run", frames=13)
    again = simulate(spring, tmp_path / "run", frames=13, resume=True)
    assert_same(again, short)
    assert_same(simulate(spring, tmp_path / "run", resume=True), reference)


def test_ctrl_c_keeps_everything_up_to_the_last_frame(spring: Tree, tmp_path: Path, reference: Run) -> None:
    def interrupt(done: int, total: int) -> None:
        if done == 7:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate(spring, tmp_path / "run", progress=interrupt)
    stopped = Run(tmp_path / "run")
    assert (stopped.status, stopped.n_frames, stopped.manifest["hashes"]) == ("interrupted", 8, reference.hashes[:8])
    seen: list[int] = []
    resumed = simulate(spring, tmp_path / "run", resume=True, progress=lambda done, _: seen.append(done))
    assert seen[0] == 7
    assert_same(resumed, reference)


def damage_last_frame(folder: Path) -> None:
    half(folder / "frames/000023.npz")


def damage_early_frame(folder: Path) -> None:
    half(folder / "frames/000003.npz")


def damage_frame_before_checkpoint(folder: Path) -> None:
    half(folder / "frames/000015.npz")


def exchange_frames(folder: Path) -> None:
    shutil.copy(folder / "frames/000004.npz", folder / "frames/000002.npz")


def put_a_frame_of_another_run(folder: Path) -> None:
    scene = json.loads((folder / "run.json").read_text())["scene"]
    scene["particles"][0]["velocity"] = [[0, 0, 0], [0.6, 0, 0]]
    other = simulate(scene, folder.parent / "other", frames=3).folder
    shutil.copy(other / "frames/000003.npz", folder / "frames/000003.npz")


def flip_a_bit_of_a_frame(folder: Path) -> None:
    """In the middle of its numbers, where the archive's directory shows nothing."""
    path = folder / "frames/000003.npz"
    data = bytearray(path.read_bytes())
    data[data.index(b"PK\x03\x04", 4) - 1] ^= 1
    path.write_bytes(data)


def lose_frame(folder: Path) -> None:
    (folder / "frames/000012.npz").unlink()


def damage_checkpoint(folder: Path) -> None:
    half(folder / "checkpoints/000020.safetensors")


def damage_both_checkpoints(folder: Path) -> None:
    half(folder / "checkpoints/000010.safetensors")
    (folder / "checkpoints/000020.safetensors").write_bytes(b"")


def swap_checkpoints(folder: Path) -> None:
    shutil.copy(folder / "checkpoints/000010.safetensors", folder / "checkpoints/000020.safetensors")


def put_a_checkpoint_of_another_state(folder: Path) -> None:
    scene = json.loads((folder / "run.json").read_text())["scene"]
    scene["particles"][0]["velocity"] = [[0, 0, 0], [0.6, 0, 0]]
    other = simulate(scene, folder.parent / "other", frames=20).folder
    shutil.copy(other / "checkpoints/000020.safetensors", folder / "checkpoints/000020.safetensors")


def cut_ledger(folder: Path) -> None:
    truncate(folder / "ledger.csv", (folder / "ledger.csv").stat().st_size - 9)


def empty_ledger(folder: Path) -> None:
    (folder / "ledger.csv").write_bytes(b"")


def exchange_static(folder: Path) -> None:
    shutil.copy(folder / "frames/000004.npz", folder / "static.npz")


def damage_columns(folder: Path) -> None:
    half(folder / "columns.json")


def lose_static(folder: Path) -> None:
    (folder / "static.npz").unlink()


def leave_temporary_files(folder: Path) -> None:
    for name in ("frames/000024.npz.tmp", "checkpoints/000024.safetensors.tmp", "run.json.tmp"):
        (folder / name).write_bytes(b"half")


@pytest.mark.parametrize(
    "damage",
    [
        damage_last_frame,
        damage_early_frame,
        damage_frame_before_checkpoint,
        exchange_frames,
        put_a_frame_of_another_run,
        flip_a_bit_of_a_frame,
        lose_frame,
        damage_checkpoint,
        damage_both_checkpoints,
        swap_checkpoints,
        put_a_checkpoint_of_another_state,
        cut_ledger,
        empty_ledger,
        lose_static,
        exchange_static,
        damage_columns,
        leave_temporary_files,
    ],
)
def test_damage_is_survived(spring: Tree, tmp_path: Path, reference: Run, damage: Callable[[Path], None]) -> None:
    folder = killed(spring, tmp_path / "run", 23)
    damage(folder)
    resumed = simulate(spring, folder, resume=True)
    assert_same(resumed, reference)
    for name in ("static.npz", "columns.json"):
        assert (folder / name).read_bytes() == (reference.folder / name).read_bytes()
    assert not list(folder.rglob("frames/*.tmp"))


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    share=st.floats(0, 1), which=st.sampled_from(["ledger.csv", "checkpoints/000010.safetensors", "frames/000008.npz"])
)
def test_a_file_cut_off_anywhere_is_survived(
    spring: Tree, tmp_path_factory: pytest.TempPathFactory, share: float, which: str
) -> None:
    folder = tmp_path_factory.mktemp("cut")
    whole = simulate(spring, folder / "whole", frames=13)
    path = killed(spring, folder / "run", 12) / which
    truncate(path, int(share * path.stat().st_size))
    assert_same(simulate(spring, folder / "run", frames=13, resume=True), whole)


def test_any_bit_of_a_frame_that_changes_is_noticed(spring: Tree, tmp_path: Path) -> None:
    run = simulate(spring, tmp_path / "run", frames=2)
    path, files = run.folder / "frames/000001.npz", RunFolder(run.folder)
    whole = path.read_bytes()
    assert len(whole) > 400
    for bit in range(8 * len(whole)):
        data = bytearray(whole)
        data[bit // 8] ^= 1 << bit % 8
        path.write_bytes(data)
        with pytest.raises(ExportError, match=r"000001\.npz: is damaged \(.*--resume"):
            files.check(1, run.hashes[1])
        with pytest.raises(ExportError, match=r"000001\.npz: is damaged"):
            run.frame(1)
    for data in (whole + b"x", b"x" + whole, whole[:-1]):
        path.write_bytes(data)
        assert files.intact(read_rows(files.ledger, LEDGER)) == 1
    path.write_bytes(whole)
    assert files.intact(read_rows(files.ledger, LEDGER)) == 3


def test_lost_lines_are_noticed(spring: Tree, tmp_path: Path, reference: Run, tumble: Callable[..., Answer]) -> None:
    path = reference.folder / "ledger.csv"
    lines = path.read_bytes().splitlines(keepends=True)
    for lost, kept in (
        (lines[:5] + lines[6:], 4),
        (lines[:-1], N),
        ([*lines[:5], lines[5].replace(b",0,0,", b",0,nan,", 1), *lines[6:]], 4),
    ):
        path.write_bytes(b"".join(lost))
        text = rf"ledger\.csv: has lost lines: {kept} of {N + 1} frames can be read; --resume computes"
        with pytest.warns(LostFrames, match=text):
            assert Run(reference.folder).n_frames == kept
        answer = tumble("plot", reference.folder, "--out", "plot.png")
        assert answer.code == 0 and "warning[lost-frames]: " in answer.err
        assert simulate(spring, reference.folder, resume=True).hashes == reference.hashes
    for i in (N - 1, N):
        (reference.folder / f"frames/{i:06}.npz").unlink()
    with pytest.warns(LostFrames, match=rf"{N - 1:06}\.npz: is missing: {N - 1} of {N + 1} frames"):
        assert len(Run(reference.folder).frame(N - 2)) == 1
    assert len(simulate(spring, reference.folder, resume=True).frame(N)) == 1


def test_a_kill_while_frames_are_dropped_is_no_loss(
    spring: Tree, tmp_path: Path, reference: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    half(reference.folder / "frames/000021.npz")

    def kill(*_: object) -> None:
        raise Killed

    for place in ("tumble.folder.RunFolder.drop_after", "tumble.recorder.Table"):
        with monkeypatch.context() as patch:
            patch.setattr(place, kill)
            with pytest.raises(Killed):
                simulate(spring, reference.folder, resume=True)
        with warnings.catch_warnings(action="error"):
            assert Run(reference.folder).n_frames >= 21
    assert_same(simulate(spring, reference.folder, resume=True), reference)


@pytest.mark.parametrize("files", range(3, 40, 4))
def test_a_kill_while_a_run_is_cleared_leaves_what_can_be_read(
    spring: Tree, reference: Run, monkeypatch: pytest.MonkeyPatch, files: int
) -> None:
    left, unlink = [files], Path.unlink

    def kill(path: Path, missing_ok: bool = False) -> None:
        left[0] -= 1
        if left[0] == 0:
            raise Killed
        unlink(path, missing_ok)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", kill)
        try:
            simulate(spring, reference.folder, overwrite=True)
        except Killed:
            with warnings.catch_warnings(action="ignore"):
                run = Run(reference.folder)
            assert run.n_frames == len(list(run.folder.glob("frames/*.npz")))
            assert all(run.frame(i) for i in range(run.n_frames))
    assert_same(simulate(spring, reference.folder, overwrite=True), simulate(spring, reference.folder, resume=True))


def test_what_the_system_refuses_to_read_is_no_damage(
    spring: Tree, tmp_path: Path, reference: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = {f: f.read_bytes() for f in reference.folder.rglob("*") if f.is_file()}
    opened = Path.open

    def refuse(path: Path, *arguments: Any, **more: Any) -> Any:
        if path.name == "000003.npz":
            raise OSError(errno.EMFILE, "Too many open files")
        return opened(path, *arguments, **more)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "open", refuse)
        with pytest.raises(ExportError, match=r"000003\.npz: cannot be read \(Too many open files"):
            simulate(spring, reference.folder, resume=True)
    assert {f: f.read_bytes() for f in reference.folder.rglob("*") if f.is_file()} == before


def test_static_columns_of_torn_cloth_are_those_of_its_start(sheet: Tree, tmp_path: Path) -> None:
    sheet["sheet"][0] |= {"resolution": [6, 6], "pin": ["edge x-"], "tear": {"strain": 0.001}}
    sheet["system"] = [{"method": "position_based", "substeps": 4}]
    sheet["output"] = {"plot": False, "checkpoint": 3}
    whole = simulate(sheet, tmp_path / "whole", frames=8)
    assert whole.ledger["broken"][4] > 0
    resumed = simulate(sheet, killed(sheet, tmp_path / "run", 6), frames=8, resume=True)
    branched = branch(whole, 5, tmp_path / "branch")
    for name in ("static.npz", "columns.json"):
        assert (resumed.folder / name).read_bytes() == (whole.folder / name).read_bytes()
        assert (branched.folder / name).read_bytes() == (whole.folder / name).read_bytes()
    assert_same(branch(branched, 6, tmp_path / "second"), whole)


def test_static_columns_are_no_frame(reference: Run) -> None:
    exchange_static(reference.folder)
    with pytest.raises(ExportError, match=r"static\.npz: is damaged \(it should be static\)"):
        _ = reference.static


def test_doubts_of_runs_that_were_stopped_are_kept(spring: Tree, tmp_path: Path) -> None:
    def interrupt(done: int, total: int) -> None:
        if done == 7:
            raise KeyboardInterrupt

    solver = {"newton_iterations": 1, "newton_tolerance": 1e-9}
    spring["system"] = [{"integrator": "implicit_euler", "substeps": 1, "solver": solver}]
    with pytest.raises(KeyboardInterrupt):
        simulate(spring, tmp_path / "run", progress=interrupt)
    assert [w["code"] for w in Run(tmp_path / "run").manifest["warnings"]] == ["unconverged"]


def test_fewer_frames_than_there_are_is_finished(spring: Tree, reference: Run) -> None:
    fewer = simulate(spring, reference.folder, frames=8, resume=True)
    assert (fewer.status, fewer.n_frames) == ("finished", N + 1)


def test_lost_trials_are_told_and_nothing_else_is_lost(spring: Tree, tmp_path: Path) -> None:
    spring["system"] = [{"integrator": "dormand_prince", "adaptive": {"tolerance": 1e-9}}]
    whole = simulate(spring, tmp_path / "whole")
    path = whole.folder / "trials.csv"
    lines = path.read_bytes().splitlines(keepends=True)
    assert len(lines) > 2 * N and whole.ledger["tried"].sum() == len(lines) - 1
    # One in the middle, the last, half of a line, all.
    for lost in (lines[:9] + lines[10:], lines[:-1], [*lines[:9], lines[9][:5]], []):
        path.write_bytes(b"".join(lost))
        run = simulate(spring, whole.folder, resume=True, progress=kill_at(N - 1))
        assert_same(run, whole)
        with pytest.raises(ExportError, match=r"trials\.csv: is damaged \(of frame .* the ledger counts .*--force"):
            _ = run.trials


def test_what_came_after_the_checkpoint_is_dropped(spring: Tree, tmp_path: Path, reference: Run) -> None:
    folder = killed(spring, tmp_path / "run", 23)
    with pytest.raises(Killed):
        simulate(spring, folder, resume=True, progress=kill_at(20))
    assert len(list(folder.glob("frames/*.npz"))) == Run(folder).n_frames == 21
    assert_same(simulate(spring, folder, resume=True), reference)


def test_resume_refuses_another_scene_or_version(spring: Tree, tmp_path: Path, reference: Run) -> None:
    folder = killed(spring, tmp_path / "run", 12)
    changed = copy.deepcopy(spring)
    changed["particles"][0]["spring"][0]["stiffness"] = 101.0
    with pytest.raises(SceneError, match=r"particles\.0\.spring\.0\.stiffness was 100(\.0)?, is 101.*--force"):
        simulate(changed, folder, resume=True)
    manifest = json.loads((folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps(manifest | {"tumble": "0.0.1"}))
    with pytest.raises(SceneError, match=r"0\.0\.1.*--force"):
        simulate(spring, folder, resume=True)
    (folder / "run.json").write_text(json.dumps(manifest))
    changed = spring | {"title": "Renamed", "expect": {"max_speed": 100.0}, "output": {"plot": True}}
    assert_same(simulate(changed, folder, resume=True), reference)


def test_the_number_of_threads_does_not_change_the_bits(sheet: Tree, tmp_path: Path) -> None:
    runs = [simulate(sheet, tmp_path / f"{n}", threads=n) for n in (1, 2)]
    assert runs[0].hashes == runs[1].hashes
    assert len(set(runs[0].hashes)) == 7
