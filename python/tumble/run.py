"""Simulates a scene frame by frame into a run folder."""

import copy
import json
import os
import shlex
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from tumble import _engine, expect
from tumble._engine import ExportError, Scene, SceneError, StepError, World
from tumble.arguments import whole, wrong
from tumble.folder import LEDGER, RunFolder, plain, read_rows, reason, refuse
from tumble.interrupts import held
from tumble.lock import alone, ask
from tumble.reader import Run, read_manifest
from tumble.recorder import Recorder, Unchanging, changed

Progress = Callable[[int, int], None]
"""Called with frames done and frames in all."""

Broke = Callable[[StepError], None]
"""Called with why the physics broke, before cures are tried."""


Prepare = Callable[[World], object]
"""Adds custom forces and integrators to a world that was built from a scene."""


def simulate(
    scene: World | Scene | Mapping[str, Any],
    folder: str | os.PathLike[str],
    frames: int | None = None,
    resume: bool = False,
    threads: int | None = None,
    progress: Progress | None = None,
    overwrite: bool = False,
    cures: bool = True,
    broke: Broke | None = None,
) -> Run:
    """Simulates a scene, or a world as it stands at its start, into a folder.

    A world is recorded with its custom forces and integrators, with what was written into it, on its own threads, and is at
    the last frame afterwards. The run says what was custom (`manifest["custom"]`), for no file holds the functions: to go on
    with it, hand over a world that has them again.

    `frames` overrides the scene's. `resume` goes on where an earlier run in the folder was stopped, to the same bits as if it
    had not been; without an earlier run it starts one. `overwrite` replaces an earlier run. Where the physics breaks, `cures`
    are tried and a minimal scene that breaks as well is looked for, which takes as long as many such runs; `broke` is told
    before. Neither is done for a world that is more than its scene.

    Raises SceneError if the scene or the folder is wrong, before anything is written; StepError if the physics breaks;
    ExportError if a file cannot be written. Whatever was finished by then can be read with `Run.open`. A bound of [expect] that
    is broken ends the run after that frame, with status "failed" and the bound and its culprit in `manifest["expectations"]`.
    """
    frames = None if frames is None else whole(frames, "frames", 1)
    threads = None if threads is None else whole(threads, "threads", 1)
    given = None
    if isinstance(scene, World):
        given, scene = scene, scene.scene
        _at_start(given, threads)
    elif not isinstance(scene, Scene):
        scene = Scene(scene)
    if frames is not None and given is None:
        scene = scene.replace(f"time.frames={frames}")
    files = RunFolder(folder)
    ask(files.path)
    admit(files, scene, resume, overwrite, custom=() if given is None else given.custom)
    world = World(scene, threads) if given is None else given
    expect.probes(world, scene.to_dict())
    altered = given is not None and World(scene).hash() != given.hash()
    with alone(files.path):
        # Another run may have come and gone meanwhile.
        earlier = admit(files, scene, resume, overwrite, custom=world.custom)
        unchanging = Unchanging.of(world)
        start = None if earlier is None or given is None else copy.copy(given)
        if earlier is not None and not return_to_checkpoint(world, files):
            earlier, overwrite = None, True
            world = World(scene, threads) if start is None else start
        if earlier is None and overwrite and files.is_run():
            files.clear()
        altered = altered or bool((earlier or {}).get("altered"))
        recorder = Recorder(files, world, unchanging, threads, earlier, frames=frames, altered=altered)
        return record(recorder, recorder.start if earlier is None else recorder.go_on, progress, cures, broke)


def _at_start(world: World, threads: int | None) -> None:
    """Refuses a world that is on its way, and threads that it cannot take."""
    if world.frame_index:
        raise wrong(
            "world", f"stands at frame {world.frame_index}; a run is recorded from the start, hand over a new one"
        )
    if threads is not None:
        raise wrong("threads", f"{threads}, but the world has threads of its own; say World(scene, threads={threads})")


def record(
    recorder: Recorder,
    begin: Callable[[], None],
    progress: Progress | None,
    cures: bool = True,
    broke: Broke | None = None,
) -> Run:
    """Begins to record, and simulates to the last frame. Where that fails, `broke` is told and `cures` are tried."""
    files, world = recorder.files, recorder.world
    try:
        with held():
            begin()
        _advance(world, recorder, progress)
        with held():
            recorder.finish()
        run = Run(files.path)
        recorder.judge(run)
    except StepError as error:
        if broke is not None and cures:
            broke(error)
        recorder.fail(error, cures)
        raise
    except KeyboardInterrupt:
        with held():
            recorder.stop("interrupted", "stopped by the user")
        raise
    except ExportError as error:
        recorder.stop("failed", str(error))
        raise
    finally:
        recorder.close()
    return Run(files.path)


def _advance(world: World, recorder: Recorder, progress: Progress | None) -> None:
    total = recorder.manifest["frames"]
    if progress is not None:
        progress(min(world.frame_index, total), total)
    while world.frame_index < total and not recorder.bounds.broken:
        begin = time.perf_counter()
        report = world.step()
        with held():
            recorder.frame(report, time.perf_counter() - begin)
        if progress is not None:
            progress(world.frame_index, total)


def admit(
    files: RunFolder,
    scene: Scene,
    resume: bool,
    overwrite: bool,
    descent: Sequence[Mapping[str, Any]] = (),
    custom: Sequence[Mapping[str, str]] = (),
) -> dict[str, Any] | None:
    """The manifest of the run to go on with, if any; refuses a folder in which something else is. `descent` is that of the
    branch to be, `custom` the custom functions of the world."""
    try:
        if files.is_free():
            return None
    except OSError as error:
        raise refuse(files.path, reason(error)) from error
    if not files.is_run():
        what = "holds files, but no run" if files.path.is_dir() else "is a file"
        raise refuse(files.path, f"{what}; choose another folder with --out")
    if overwrite and not resume:
        return None
    manifest = read_manifest(files)
    if not resume:
        done = max(len(read_rows(files.ledger, LEDGER)) - 1, 0)
        state = f"{manifest.get('status')}, {done} of {manifest.get('frames')} frames"
        cure = "go on with --resume, replace it with --force, or choose another folder with --out"
        raise refuse(files.path, f"holds a run already ({state}); {cure}")
    if manifest.get("tumble") != _engine.version:
        text = f"was simulated by tumble {manifest.get('tumble')}, and this is {_engine.version}: the bits could differ"
        raise refuse(files.path, f"{text}; start again with --force, or choose another folder with --out")
    if (found := manifest.get("descent", [])) != json.loads(json.dumps(plain(descent))):
        what = "is no branch; go on with `tumble run SCENE --resume`"
        if found:
            parent = os.path.normpath(files.path / found[-1]["run"])
            what = f"is a branch of {parent} at frame {found[-1]['frame']}; go on with `{go_on(files.path, manifest)}`"
        raise refuse(files.path, f"{what}, replace it with --force, or choose another folder with --out")
    if (had := manifest.get("custom", [])) != list(custom):
        text = f"was simulated with {told_custom(had)}, and is to go on with {told_custom(custom)}"
        cure = "go on from Python with tumble.simulate(world, folder, resume=True) and a world that has the same"
        raise refuse(files.path, f"{text}; {cure}")
    # Both scenes as JSON has them, so that 1 and 1.0, lists and tuples compare as equal.
    difference = changed(manifest["scene"], json.loads(json.dumps(plain(scene.to_dict()))))
    if difference is not None:
        text = f"the scene has changed since the run was started: {difference}"
        raise refuse(files.path, f"{text}; start again with --force, or choose another folder with --out")
    return manifest


def told_custom(custom: Sequence[Mapping[str, str]]) -> str:
    """Custom functions in words: `the force pull on system "main"`."""
    told = [f'the {one["what"]} {one["name"]} on system "{one["system"]}"' for one in custom]
    return " and ".join(told) or "no custom force or integrator"


def return_to_checkpoint(world: World, files: RunFolder) -> bool:
    """Goes to the newest checkpoint that is sound and before which every frame can be read."""
    rows = read_rows(files.ledger, LEDGER)
    intact = files.intact(rows)
    for frame in reversed([k for k in files.checkpoints() if k < intact]):
        try:
            world.load(files.checkpoint(frame))
        except (SceneError, OSError):
            continue
        if world.frame_index == frame and world.hash() == rows[frame][-1]:
            return True
    return False


def go_on(path: Path, manifest: Mapping[str, Any]) -> str:
    """The command that goes on with a branch."""
    last = manifest["descent"][-1]
    parent = os.path.normpath(path / last["run"])
    sets = [word for text in last["set"] for word in ("--set", text)]
    frames = ["--frames", str(manifest["frames"] - last["frame"])]
    return shlex.join(["tumble", "branch", f"{parent}@{last['frame']}", *sets, *frames, "--out", str(path), "--resume"])
