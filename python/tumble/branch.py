"""Goes on from a frame of a run with a changed scene, as a run of its own that knows where it comes from."""

import json
import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tumble._engine import Scene, SceneError, StepError, TumbleError, World
from tumble.arguments import whole, wrong
from tumble.columns import KINDS
from tumble.folder import RunFolder, plain, refuse
from tumble.lock import alone, ask
from tumble.reader import Run
from tumble.recorder import Recorder, Unchanging, describe
from tumble.run import Broke, Prepare, Progress, admit, record, return_to_checkpoint, told_custom

Descent = list[dict[str, Any]]


def branch(
    parent: Run,
    frame: int,
    folder: str | os.PathLike[str],
    changes: Sequence[str] = (),
    frames: int | None = None,
    resume: bool = False,
    threads: int | None = None,
    progress: Progress | None = None,
    overwrite: bool = False,
    broke: Broke | None = None,
    prepare: Prepare | None = None,
) -> Run:
    """Goes on from a frame of a run (-1 is the last) in another folder, with changes to its scene ("world.gravity=[0, 0, 0]").

    The folder begins with the parent's frames, so that it is a run like any other; its `descent` says where it comes from. The
    state is read from the nearest checkpoint before the frame, or made anew from the start, and simulated on to the frame.
    `frames` is how many to simulate; without it, to the scene's last. Masses and pins cannot change, and where things start has
    no effect: they are part of the state. `resume`, `overwrite` and `broke` are those of `simulate`. `prepare` is called with
    each world that is built and gives it the custom forces and integrators of the branch; where the parent had some, they must
    be those.

    Raises SceneError if frame, changes or folder are wrong; StepError if the physics breaks; ExportError if a file cannot be
    written.
    """
    k = _frame(parent, frame)
    scene = _scene(parent, changes, k, frames)
    files = RunFolder(folder)
    if os.path.realpath(files.path) in map(os.path.realpath, [parent.folder, *lineage(parent)]):
        raise refuse(
            files.path, "is the run itself, or one that it branches off from; choose another folder with --out"
        )
    ask(files.path)
    descent = _descent(parent, k, files.path, changes)
    world = _prepared(World(scene, threads), prepare)
    _has_those_of(world, parent)
    admit(files, scene, resume, overwrite, descent, world.custom)
    unchanging = Unchanging.of(world)
    with alone(files.path):
        earlier = admit(files, scene, resume, overwrite, descent, world.custom)
        meant = int(parent.manifest.get("whole_frames", parent.manifest["frames"]))

        def begin(how: Callable[[], None]) -> None:
            how()
            if descent[-1]["set"] and world.frame_index == k:
                world.reconsider()

        if earlier is not None and return_to_checkpoint(world, files):
            recorder = Recorder(files, world, unchanging, threads, earlier, descent, whole=meant)
            return record(recorder, lambda: begin(recorder.go_on), progress, broke=broke)
        _take_over(world, parent, k, threads, prepare)
        for i in range(k):
            RunFolder(parent.folder).check(i, parent.hashes[i])
        if files.is_run():
            files.clear()
        recorder = Recorder(files, world, unchanging, threads, None, descent, whole=meant)
        return record(recorder, lambda: begin(lambda: recorder.branch_off(parent)), progress, broke=broke)


def world_at(run: Run, frame: int, threads: int | None = None, prepare: Prepare | None = None) -> World:
    """The world of a run at one of its frames (-1 is the last): from the nearest checkpoint before it, or from the start,
    simulated on to the frame. `prepare` gives it the custom forces and integrators that the run had. Raises SceneError if that
    is not the state that the run had."""
    k = _frame(run, frame)
    own = run.manifest.get("custom", [])

    def new() -> World:
        # Those of a branch may not be those of its parent.
        return _prepared(World(_own_scene(run), threads), prepare if own else None)

    world = new()
    _has_those_of(world, run)
    files = RunFolder(run.folder)
    # Before that frame its scene was another one.
    start = int(run.descent[-1]["frame"]) if run.descent else 0
    for kept in reversed([i for i in files.checkpoints() if start <= i <= k]):
        try:
            world.load(files.checkpoint(kept))
        except (SceneError, OSError):
            continue
        if world.frame_index == kept and world.hash() == run.hashes[kept]:
            break
    else:
        world = new()
        if run.descent:
            try:
                parent = Run(lineage(run)[-1])
            except TumbleError as error:
                raise refuse(run.folder, f"frame {k} must be recomputed from the parent run: {error}") from error
            _load(world, parent, min(k, start), threads, prepare)
    if k > world.frame_index:
        if world.frame_index == start and run.descent and run.descent[-1]["set"]:
            world.reconsider()
        try:
            world.step(k - world.frame_index)
        except StepError as error:
            raise refuse(run.folder, f"frame {k} cannot be recomputed: {error}") from error
    if world.hash() != run.hashes[k]:
        made, own = run.manifest.get("tumble"), _version()
        why = (
            f"it was simulated by tumble {made}, and this is {own}"
            if made != own
            else "its bits hold for another machine"
        )
        there = ", ".join(map(str, files.checkpoints())) or "none"
        text = f"frame {k} cannot be recomputed to the same bits: {why}; frames with a checkpoint: {there}"
        raise refuse(run.folder, text)
    return world


def _prepared(world: World, prepare: Prepare | None) -> World:
    if prepare is not None:
        prepare(world)
    return world


def _has_those_of(world: World, run: Run) -> None:
    """Refuses a world without the custom functions that a run had: it would not go on alike."""
    missing = [one for one in run.manifest.get("custom", []) if one not in world.custom]
    if missing:
        cure = "give `prepare`, a function of a world that adds it, to tumble.branch.branch"
        raise refuse(run.folder, f"was simulated with {told_custom(missing)}, which no file holds; {cure}")


def lineage(run: Run) -> list[Path]:
    """The folders of the runs that a run branches off from, the oldest first."""
    return [Path(os.path.normpath(run.folder / step["run"])) for step in run.descent]


def family(run: Run) -> list[Run]:
    """The runs beside a run that branch off from it, and those that it branches off from; the oldest first."""
    home = with_name(run.folder)
    own = os.path.realpath(home)
    older = [other for path in lineage(run) if (other := _readable(path))]
    beside = [path.parent for path in sorted(home.parent.glob("*/run.json")) if os.path.realpath(path.parent) != own]
    others = [other for path in beside if (other := _readable(path))]
    found = older + [other for other in others if own in map(os.path.realpath, lineage(other))]
    return sorted(found, key=lambda other: len(other.descent))


def _readable(path: Path) -> Run | None:
    try:
        return Run(path)
    except TumbleError:
        return None


def with_name(folder: Path) -> Path:
    """A path that ends with the folder's own name, and not with `.` or `..`."""
    return folder if folder.name not in ("", "..") else folder.resolve()


def is_branch(folder: Path, parent: Run, frame: int, changes: Sequence[str]) -> bool:
    """Whether a folder holds this branch, which can then be gone on with."""
    if not RunFolder(folder).is_run():
        return False
    wanted: Descent = json.loads(json.dumps(plain(_descent(parent, frame, folder, changes))))
    found = _readable(folder)
    return found is not None and found.descent == wanted


def _version() -> str:
    from tumble._engine import version

    return version


def _frame(run: Run, frame: int) -> int:
    n = run.n_frames
    if not -n <= whole(frame, "frame") < n:
        raise refuse(run.folder, f"has no frame {frame}; it has 0 to {n - 1}")
    return frame % n


def _own_scene(run: Run) -> Scene:
    """The scene of a run, with the folder of its mesh files."""
    folder = run.manifest.get("folder")
    # Without empty lists, which have no first item to be changed.
    return Scene(
        {key: value for key, value in run.scene.items() if value != []},
        "." if folder is None else os.path.normpath(run.folder / folder),
    )


def _scene(parent: Run, changes: Sequence[str], frame: int, frames: int | None) -> Scene:
    """The scene of the branch."""
    more = [] if frames is None else [f"time.frames={frame + whole(frames, 'frames', 1)}"]
    own = _own_scene(parent)
    scene = _instead_of_links(own, own.replace(*changes, *more))
    tree = scene.to_dict()
    if tree["time"]["fps"] != parent.fps:
        text = f"{tree['time']['fps']:g}, earlier frames have {parent.fps:g} per second; leave time.fps unchanged"
        raise wrong("time.fps", text)
    if tree["time"]["frames"] <= frame:
        last = tree["time"]["frames"]
        raise wrong("time.frames", f"{last}, no frames are left after frame {frame}; request more with --frames")
    return scene


def _instead_of_links(own: Scene, scene: Scene) -> Scene:
    """The stretch model of a surface replaces links that were not given, as it does in a scene's file; the resolved
    scene of a run has those written out."""
    before, after = own.to_dict(), scene.to_dict()
    changed = False
    for kind in (kind.name for kind in KINDS.values() if kind.surface):
        for old, new in zip(before[kind], after[kind], strict=False):
            given = any(old[word] is None and new[word] is not None for word in ("membrane", "fabric"))
            if given and new["links"] == old["links"] == _default_links(own, kind, old):
                del new["links"]
                changed = True
    return Scene({key: value for key, value in after.items() if value != []}, scene.folder) if changed else scene


def _default_links(own: Scene, kind: str, surface: Mapping[str, Any]) -> Any:
    alone = {"version": 1, kind: [{**surface, "links": None, "system": None, "pin": []}]}
    return Scene(alone, own.folder).to_dict()[kind][0]["links"]


def _descent(parent: Run, frame: int, folder: Path, changes: Sequence[str]) -> Descent:
    """The line of descent of a branch in `folder`."""
    steps: Descent = []
    for step, path in zip(parent.descent, lineage(parent), strict=True):
        steps.append({**step, "run": os.path.relpath(path, folder)})
    steps.append(
        {
            "run": os.path.relpath(parent.folder, folder),
            "name": parent.folder.resolve().name,
            "frame": frame,
            "time": parent.time(frame),
            "hash": parent.hashes[frame],
            "set": list(changes) if _changes(parent, changes) else [],
        }
    )
    return steps


def _changes(parent: Run, changes: Sequence[str]) -> bool:
    """Whether the world becomes another one. With the values it had it goes on as it would have, bit by bit."""
    before, after = _own_scene(parent).to_dict(), _own_scene(parent).replace(*changes).to_dict()
    before["time"]["frames"] = after["time"]["frames"]
    return bool(after != before)


def _take_over(world: World, parent: Run, frame: int, threads: int | None, prepare: Prepare | None) -> None:
    """Puts the state of the parent's frame into the world of the changed scene."""
    _same_masses(world, parent)
    _load(world, parent, frame, threads, prepare)
    _same_columns(world, parent)


def _load(world: World, parent: Run, frame: int, threads: int | None, prepare: Prepare | None) -> None:
    """Goes to the state of another run's frame."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "state.safetensors"
        world_at(parent, frame, threads, prepare).save(path)
        try:
            world.load(path, others=True)
        except SceneError as error:
            text = (
                f"the state of frame {frame} does not fit into the changed scene ({error}). A branch can change forces, "
                "stiffness, damping, colliders, steps, and integrators with the same state, but neither the number of objects "
                "nor precision. For that, run the changed scene with `tumble run`"
            )
            raise refuse(parent.folder, text) from error


def _same_masses(world: World, parent: Run) -> None:
    """Refuses a branch whose scene has other masses, or holds others of them: they are in the state, which knows no better."""
    topology, none = world.topology, np.empty(0)
    for name, table in parent.static.items():
        now = topology.get(name, {})
        for column, what in (("mass", "masses"), ("pinned", "pins")):
            if not np.array_equal(table.get(column, none), now.get(column, none)):
                text = f'{what} of "{name}" are part of the state, a branch cannot change them; run the scene anew for that'
                raise refuse(parent.folder, text)


def _same_columns(world: World, parent: Run) -> None:
    """Refuses a branch whose frames would have other columns than the parent's."""
    found = describe(world.units, world.topology, world.frame)

    def kept(table: Mapping[str, Mapping[str, Any]]) -> dict[tuple[str, str], Any]:
        return {
            (name, column): [None if n is None else int(n) for n in about["shape"]]
            for name, columns in table.items()
            for column, about in columns.items()
            if about["in"] == "frames"
        }

    before, after = kept(parent.columns), kept(found)
    for name, column in [*before, *after]:
        if before.get((name, column)) != after.get((name, column)):
            text = f'{column} of "{name}" would be kept otherwise than so far: leave output.columns and objects as they are'
            raise refuse(parent.folder, text)
