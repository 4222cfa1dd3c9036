"""`tumble run`: simulate a scene into a folder."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tumble.bundled import scene_file
from tumble.cli import find, report
from tumble.cli.console import Progress, broke, complain, counted, say, stopped, warn_of
from tumble.cli.render import CameraOption, SamplesOption, look_for, look_through

if TYPE_CHECKING:
    from tumble import Run, TumbleError


def run(
    scene: find.SceneArgument,
    set: find.SetOption = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder of the run.", show_default="out/NAME")] = None,
    frames: find.FramesOption = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue the stopped run in the folder.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace the run in the folder.")] = False,
    threads: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Processor cores to use; results do not depend on it.")
    ] = None,
    film: Annotated[bool | None, typer.Option(help="Write film.mp4.", show_default="as the scene says")] = None,
    usd: Annotated[bool | None, typer.Option(help="Write scene.usda.", show_default="as the scene says")] = None,
    ply: Annotated[bool | None, typer.Option(help="Write ply/.", show_default="as the scene says")] = None,
    vdb: Annotated[bool | None, typer.Option(help="Write volumes/.", show_default="as the scene says")] = None,
    plot: Annotated[bool | None, typer.Option(help="Write energy.png.", show_default="as the scene says")] = None,
    stills: Annotated[bool, typer.Option(help="Write the stills requested by the scene.")] = True,
    renderer: Annotated[str, typer.Option(metavar="NAME", help="Renderer of film and stills.")] = "auto",
    samples: SamplesOption = None,
    camera: CameraOption = None,
    json: find.JsonOption = False,
) -> None:
    """Simulate a scene into a folder, out/NAME by default.

    --resume continues a stopped run to the same bits. A run that violates its scene's [expect] table exits
    with code 1.

    \b
    Examples:
      tumble run sheet-on-bunny
      tumble run my.toml --frames 48 --set system.soft.step=0.001 --film
      tumble run my.toml --film --camera shot.usda:/cameras/main
      tumble run my.toml --resume
      tumble run my.toml --json
    """
    from tumble import StepError
    from tumble.reader import Run
    from tumble.run import simulate

    if resume and force:
        raise typer.BadParameter("--resume goes on with a run and --force replaces it; choose one")
    overrides = list(set or ())
    if frames is not None:
        overrides.append(f"time.frames={frames}")
    from tumble.pictures import resolve

    look_for(renderer, samples)
    with find.told_as_json(json):
        checked = find.scene(scene, overrides)
    folder = out if out is not None else find.OUT / scene_file(scene).stem
    wanted = checked.to_dict()["output"]
    asked = {
        "film": wanted["film"] if film is None else film,
        "usd": wanted["usd"] if usd is None else usd,
        "ply": wanted["ply"] if ply is None else ply,
        "vdb": wanted["vdb"] if vdb is None else vdb,
        "plot": wanted["plot"] if plot is None else plot,
    }
    _refuse_empty(checked.to_dict(), ply, vdb)
    frames_to_draw = wanted["stills"] if stills else []
    flags = {"film": film, "usd": usd, "ply": ply, "vdb": vdb, "plot": plot, "stills": None if stills else False}
    if camera is not None and not (asked["film"] or asked["usd"] or frames_to_draw):
        raise typer.BadParameter(
            "nothing is looked at; ask for --film or --usd, or for stills in the scene", param_hint="--camera"
        )
    look_through(camera, checked.to_dict())
    if renderer != "auto" and (asked["film"] or frames_to_draw):
        resolve(renderer)  # Says now, rather than after the simulation, if it does not work here.
    try:
        with (
            find.told_as_json(json),
            find.naming(scene_file(scene), folder, checked),
            Progress("simulate") as progress,
        ):
            done = simulate(
                checked, folder, resume=resume, threads=threads, progress=progress, overwrite=force, broke=broke
            )
    except StepError as error:
        again = [*(["--out", str(out)] if out else []), *_flags(flags, renderer, samples, camera)]
        print(report.failure(Run(folder), error, scene, overrides, again), file=sys.stderr)
        if json:
            find.say_json(report.as_tree(Run(folder)))
        raise typer.Exit(1) from None
    except KeyboardInterrupt as stop:
        again = [*(["--out", str(out)] if out else []), "--resume", *_flags(flags, renderer, samples, camera)]
        _say_what_is_kept(folder, find.command("run", scene, overrides, *again))
        raise typer.Exit(stopped(stop)) from None

    failures = present(done, asked, frames_to_draw, renderer, samples, json, camera)
    again = [*(["--out", str(out)] if out else []), *_flags(flags, renderer, samples, camera)]
    if text := report.gained(done, scene, overrides, again):
        print(text, file=sys.stderr)
    judge(done, failures)


def _refuse_empty(scene: dict[str, Any], ply: bool | None, vdb: bool | None) -> None:
    """Raises BadParameter if an option requests files without content; requests in the scene are checked by the engine."""
    from tumble.columns import GRIDS

    for option, given, kinds, what in (
        ("--ply", ply, ("particles", "emitter", "galaxy"), "there are no particles"),
        ("--vdb", vdb, GRIDS, "nothing lies on a grid"),
    ):
        if given and not any(scene[kind] for kind in kinds):
            sections = ", ".join(f"[[{kind}]]" for kind in kinds)
            raise typer.BadParameter(
                f"{what} to write, such as {sections}; leave it out, --usd writes everything else",
                param_hint=option,
            )


def present(
    done: "Run",
    asked: dict[str, bool],
    stills: list[int],
    renderer: str,
    samples: int | None = None,
    json: bool = False,
    camera: str | None = None,
) -> "list[TumbleError]":
    """Prints the warnings of a finished run, writes the requested output and a summary; returns the outputs that failed."""
    from tumble.lock import alone

    warn_of(done.manifest["warnings"])
    try:
        with alone(done.folder):
            failures = write_results(done, asked, stills, renderer, samples, camera)
    except KeyboardInterrupt as stop:
        complain(
            f"stopped; the simulation in {done.folder} is complete, see `tumble render --help` and `tumble export --help`"
        )
        raise typer.Exit(stopped(stop)) from None
    if json:
        find.say_json(report.as_tree(done, failures))
    else:
        say(report.summary(done))
    return failures


def judge(done: "Run", failures: "list[TumbleError]") -> None:
    """Exits with 1 if an output failed or an expectation is violated."""
    for failure in failures:
        complain(str(failure))
    broken = done.manifest["expectations"]
    for expectation in broken:
        complain(f"violated expectation: {expectation['text']}")
    if broken or failures:
        raise typer.Exit(1)


def _flags(asked: dict[str, bool | None], renderer: str, samples: int | None, camera: str | None) -> list[str]:
    """The output options, as given."""
    flags = [f"--{'' if wanted else 'no-'}{name}" for name, wanted in asked.items() if wanted is not None]
    flags += ["--renderer", renderer] if renderer != "auto" else []
    flags += ["--camera", camera] if camera is not None else []
    return [*flags, *(["--samples", str(samples)] if samples is not None else [])]


def _say_what_is_kept(folder: Path, cure: str) -> None:
    from tumble import Run, TumbleError

    try:
        kept = Run(folder).n_frames
    except TumbleError:
        complain("stopped before anything was written")
        return
    complain(f"stopped; {counted(kept, 'frame')} in {folder} can be read. Continue with\n  {cure}")


def write_results(
    run: "Run",
    asked: dict[str, bool],
    stills: list[int],
    renderer: str,
    samples: int | None = None,
    camera: str | None = None,
) -> "list[TumbleError]":
    """Writes the output requested by the scene, the film last. A failure does not prevent the rest."""
    from tumble import TumbleError
    from tumble.cli.render import film, still

    failures: list[TumbleError] = []

    def usd() -> None:
        from tumble.export.usd import write

        with Progress("usd") as progress:
            write(run, run.folder, progress, volumes=not asked["vdb"], camera=camera)

    def vdb() -> None:
        from tumble.export.vdb import write

        with Progress("vdb") as progress:
            write(run, run.folder, progress)

    def ply() -> None:
        from tumble.export.ply import write

        with Progress("ply") as progress:
            write(run, run.folder, progress)

    def plot() -> None:
        from tumble.plots import energy

        if run.ledger["mass"].any():  # Tracers have none.
            energy(run, run.folder / "energy.png")

    def draw_film() -> None:
        film(run, run.folder / "film.mp4", renderer, samples=samples, camera=camera)

    def draw_stills() -> None:
        there = [i for i in stills if i < run.n_frames]
        with Progress("stills") as progress:
            for k, i in enumerate(there):
                still(run, i, None, renderer, samples=samples, camera=camera)
                progress(k + 1, len(there))

    tasks = {"plot": plot, "vdb": vdb, "usd": usd, "ply": ply, "stills": draw_stills, "film": draw_film}
    for name, task in tasks.items():
        if asked.get(name, True):
            try:
                task()
            except TumbleError as error:
                failures.append(error)
    return failures
