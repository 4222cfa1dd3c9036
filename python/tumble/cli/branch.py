"""`tumble branch`: continue from a frame of a run with a changed scene."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tumble.cli import find, report
from tumble.cli.console import Progress, broke, complain, counted, say, stopped, warn

if TYPE_CHECKING:
    from tumble import Run


def branch(
    origin: Annotated[
        str,
        typer.Argument(metavar="RUN@FRAME", help="A folder that `tumble run` wrote, or its name in out/, and a frame."),
    ],
    set: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Change a key of the scene from that frame on. Repeatable."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of the branch.", show_default="RUN@FRAME, beside RUN")
    ] = None,
    frames: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            max=find.FRAMES,
            help="Frames to simulate after FRAME.",
            show_default="to the scene's last",
        ),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue the stopped branch in the folder.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace the run in the folder.")] = False,
    threads: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Processor cores to use; results do not depend on it.")
    ] = None,
) -> None:
    """Continue from a frame of a run with a changed scene, as a new run.

    FRAME is any frame of the run; -1 is the last. If it has no checkpoint, the state is recomputed from the nearest
    earlier one, or from the start, and its hash is checked. The branch begins with the frames of its parent (as links, if
    the disk supports them), so it can be plotted, rendered, compared and branched like any run. Its run.json lists its
    ancestors: each parent, frame, state hash and changes.

    Forces, stiffness, damping, colliders and steps can be changed. Properties held in the state cannot: masses, pins,
    numbers of objects. Initial positions have no effect; a branch whose changes have no effect gives a warning.

    \b
    Examples:
      tumble branch sheet-on-ball@40 --set world.gravity='[0, 0, -1.6]'
      tumble branch out/rope@-1 --frames 48 --out out/rope-longer
      tumble plot rope --branches
      tumble diff rope rope@40
    """
    from tumble import StepError
    from tumble.branch import branch as go
    from tumble.branch import is_branch, with_name
    from tumble.cli.run import judge, present

    if resume and force:
        raise typer.BadParameter("--resume goes on with a branch and --force replaces it; choose one")
    parent, frame = _origin(origin)
    changes = list(set or ())
    k = frame % parent.n_frames if -parent.n_frames <= frame < parent.n_frames else frame
    folder = out if out is not None else with_name(parent.folder).with_name(f"{parent.folder.resolve().name}@{k}")
    again = [*(["--out", str(out)] if out else []), *(["--frames", str(frames)] if frames else [])]
    at = f"{parent.folder}@{k}"
    try:
        with Progress("simulate") as progress:
            done = go(parent, frame, folder, changes, frames, resume, threads, progress, force, broke)
    except StepError as error:
        from tumble import Run

        if not (folder / "run.json").is_file():
            raise
        print(report.failure(Run(folder), error, at, changes, again, "branch"), file=sys.stderr)
        raise typer.Exit(1) from None
    except KeyboardInterrupt as stop:
        # Before the branch has begun, the folder may hold another run, or none.
        how = ["--resume"] if is_branch(folder, parent, k, changes) else ["--force"] if force else []
        complain(f"stopped. Continue with\n  {find.command('branch', at, changes, *again, *how)}")
        raise typer.Exit(stopped(stop)) from None
    wanted = done.scene["output"]
    asked = {name: wanted[name] for name in ("film", "usd", "ply", "vdb", "plot")}
    failures = present(done, asked, wanted["stills"], "auto")
    changed = f", changed: {' '.join(find.settings(changes))}" if changes else ", unchanged"
    say(f"  branch    of {parent.folder} at frame {k} (t = {parent.time(k):.6g} s, hash {parent.hashes[k]}){changed}")
    if changes and (text := _idle(done, parent, k)):
        warn("idle-branch", text)
    judge(done, failures)


def _origin(argument: str) -> "tuple[Run, int]":
    """The run and the frame of RUN@FRAME."""
    name, mark, number = argument.rpartition("@")
    try:
        frame = int(number)
    except ValueError:
        mark = ""
    if not mark or not name:
        raise typer.BadParameter(f"{argument!r}, expected a run and a frame, as in sheet@40 or out/sheet@-1")
    return find.run(name), frame


def _idle(done: "Run", parent: "Run", frame: int) -> str | None:
    """A warning if the changes had no effect."""
    from tumble.compare import compare

    n = min(done.n_frames, parent.n_frames)
    # Not by hashes: what a branch chooses anew is in them, too.
    if n <= frame + 1 or compare(parent, done, until=n - 1).seen is not None:
        return None
    return (
        f"the change had no effect in {counted(n - 1 - frame, 'frame')}: the states are those of {parent.folder}; initial "
        "positions are part of the state, which a branch takes from its parent"
    )
