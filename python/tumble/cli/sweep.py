"""`tumble sweep`: a scene with many values and seeds, and their statistics."""

import math
import sys
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Annotated, Any, Self

import typer

from tumble.bundled import scene_file
from tumble.cli import find
from tumble.cli.console import complain, counted, say, size, stopped

if TYPE_CHECKING:
    from tumble.sweeps.options import Options
    from tumble.sweeps.result import Sweep
    from tumble.sweeps.study import Plan, Progress, Words

ROWS = 24
"""Points of a design that are told on the console."""


def sweep(
    scene: find.SceneArgument,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY=VALUES", help="Values of a key: a,b,c or LO:HI:N or LO:HI:N:log. Repeatable: a grid."
        ),
    ] = None,
    zip: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY=VALUES", help="As --vary; all keys of --zip change together. Repeatable."),
    ] = None,
    table: Annotated[
        Path | None, typer.Option(metavar="FILE", help="A .csv file with keys in its head and a point in each row.")
    ] = None,
    design: Annotated[
        str, typer.Option(metavar="NAME", help="grid; latin or sobol draw --samples points from --vary KEY=LO:HI.")
    ] = "grid",
    samples: Annotated[int | None, typer.Option(metavar="N", help="Points of a latin or sobol design.")] = None,
    seeds: Annotated[
        int, typer.Option(min=1, metavar="N", help="Runs of each point, with seeds counted from the scene's.")
    ] = 1,
    measure: Annotated[
        list[str] | None,
        typer.Option(metavar="MEASURE", help="What to measure. Repeatable.", show_default="ledger.energy@last"),
    ] = None,
    set: find.SetOption = None,
    frames: find.FramesOption = None,
    on: find.OnOption = "cores",
    workers: find.WorkersOption = None,
    memory: Annotated[
        float | None, typer.Option(min=0.01, max=1e6, metavar="GB", help="The most memory that a run may take.")
    ] = None,
    keep: Annotated[
        str, typer.Option(metavar="WHAT", help="measures; or runs: a run folder of each run, too.")
    ] = "measures",
    stills: Annotated[
        bool, typer.Option("--stills", help="Draw the last frames of the first seed, on one sheet.")
    ] = False,
    films: Annotated[bool, typer.Option("--films", help="Films of the first seed, side by side.")] = False,
    against: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="A .csv file of a parameter and measures from elsewhere, for the plots."),
    ] = None,
    plots: Annotated[bool, typer.Option(help="Plot each measure over each parameter.")] = True,
    renderer: Annotated[str, typer.Option(metavar="NAME", help="Renderer of stills and films.")] = "auto",
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of the sweep.", show_default="out/sweep/NAME")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Compute only the runs that are not there yet.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace the sweep in the folder.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before a large sweep.")] = False,
    json: find.JsonOption = False,
) -> None:
    """Run a scene with many values and seeds; tabulate, compare and plot what is measured.

    A measure is [HOW] ledger.COLUMN[@WHEN] or [HOW] probe OBJECT.COLUMN[INDEX].x[@WHEN]. HOW over frames: max, min, mean,
    std, sum. WHEN: last, first, 12 (a frame), 3s, 100.. or 1s..3s. INDEX may be mean, min, max, sum, count or order, over all
    elements. stability.stable is the largest stable step by estimate.

    The folder holds sweep.csv (a row for each run), summary.csv (mean, spread and 95 % confidence over seeds), plots/ and
    sweep.html. A run that fails is a row with its reason. --resume goes on after any stop, with more values or seeds, too.
    The table's hash does not depend on the number or kind of workers.

    \b
    Exit codes: 0 every run has its row; 1 no run reached its end, or files could
    not be written; 2 the scene, a key or a measure is invalid.

    \b
    Examples:
      tumble sweep springs/forever --vary system.0.substeps=10,20,40 --measure "max ledger.energy"
      tumble sweep vicsek --vary system.0.vicsek.noise=0:5:11 --seeds 10 --measure "mean probe walkers.velocity[order]"
      tumble sweep my.toml --design sobol --samples 64 --vary world.gravity.2=-9.8:-1.6
    """
    from tumble.cli.render import look_for
    from tumble.sweeps.design import Design
    from tumble.sweeps.mistakes import Mistakes
    from tumble.sweeps.options import Options
    from tumble.sweeps.study import prepared
    from tumble.sweeps.words import design as read

    if resume and force:
        raise typer.BadParameter("--resume keeps what is finished and --force replaces it; choose one")
    if stills or films:
        look_for(renderer)
    overrides = [*(set or ()), *([f"time.frames={frames}"] if frames is not None else [])]
    folder = out if out is not None else find.OUT / "sweep" / scene_file(scene).stem
    with find.told_as_json(json):
        checked = find.scene(scene, overrides)
        mistakes = Mistakes()
        if keep not in ("measures", "runs"):
            mistakes.add("--keep", f"{keep!r}, expected measures or runs")
        if seeds > 1 and not (vary or zip or table or design != "grid"):
            found: Design | None = Design("grid", ())
            places: dict[str, str] = {}
        else:
            found, places = read(mistakes, vary or (), zip or (), table, design, samples)
        words = prepared(checked, found, measure or (), seeds, places, mistakes, against)
        bytes_ = None if memory is None else memory * 1e9
        options = Options(on, workers, keep == "runs", stills, films, plots, resume, force, bytes_, renderer)
        done = _carried_out(words, folder, options, yes)
    _say(done, json)


def _carried_out(words: "Words", folder: Path, options: "Options", yes: bool) -> "Sweep":
    """Runs the sweep with its progress shown; a stop exits."""
    from tumble.sweeps.study import carry_out

    try:
        with Shown() as shown:
            return carry_out(words, folder, options, lambda plan: _agree(plan, yes, shown), shown, shown.drawn)
    except KeyboardInterrupt as stop:
        _say_what_is_kept(folder)
        raise typer.Exit(stopped(stop)) from None


def _say(done: "Sweep", json: bool) -> None:
    """Prints the result; exits with 1 where no run reached its end."""
    from tumble.sweeps.study import as_tree

    if json:
        find.say_json(as_tree(done))
    else:
        for line in _told(done):
            say(line)
    if done.rows and len(done.failed) == len(done.rows):
        complain(f"no run reached its end: {done.failed[0].reason}")
        raise typer.Exit(1)


def _agree(plan: "Plan", yes: bool, shown: "Shown") -> bool:
    """Whether to go on with a sweep, which is asked about where it is large."""
    from tumble.arguments import wrong

    for note in plan.notes:
        print(note, file=sys.stderr, flush=True)
    if plan.large:
        there = f", {plan.there:,} of them there already" if plan.there else ""
        text = f"{plan.runs:,} runs{there}; about {duration(plan.seconds)} with {counted(plan.workers, 'worker')}"
        if not yes and not sys.stdin.isatty():
            raise wrong("", f"{text}: say --yes to run them, or vary less")
        print(text, file=sys.stderr, flush=True)
        if not yes and not typer.confirm("Run them?", err=True):
            raise typer.Exit(1)
    shown.start(plan.runs)
    return True


def duration(value: float) -> str:
    """A time in words: `40 s`, `3 min 20 s`, `2 h 5 min`, `11 days`."""
    if not math.isfinite(value):
        return "an unknown time"
    if value < 60:
        return f"{value:.0f} s" if value >= 1 else "1 s"
    n = round(value)
    if n < 3600:
        return f"{n // 60} min {n % 60} s"
    if n < 2 * 86400:
        return f"{n // 3600} h {n % 3600 // 60} min"
    days = value / 86400
    return f"{days:.0f} days" if days < 2 * 365.25 else f"{days / 365.25:.3g} years"


def _say_what_is_kept(folder: Path) -> None:
    from tumble.sweeps.store import Store

    done = len(Store(folder).keys())
    complain(f"stopped; {counted(done, 'run')} in {folder} can be read. Continue with the same command and --resume")


class Shown:
    """Shows runs done, failed, running and the time left: a bar on a terminal, elsewhere a line per tenth or five seconds."""

    def __init__(self) -> None:
        self.bar: Any = None
        self.task: Any = None
        self.said = -math.inf
        self.when = -math.inf

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.bar is not None:
            self.bar.stop()

    def start(self, total: int) -> None:
        """Begins, once nothing is asked any more."""
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
            from rich.progress import Progress as Bar

            columns: list[Any] = [
                TextColumn("sweep"),
                BarColumn(),
                MofNCompleteColumn(),
                TextColumn("{task.description}"),
            ]
            self.bar = Bar(*columns, console=Console(stderr=True))
            self.bar.start()
            self.task = self.bar.add_task("", total=total)

    def __call__(self, at: "Progress") -> None:
        import time

        parts = [f"{at.failed} failed"] if at.failed else []
        parts += [f"{at.running} running"] if at.running else []
        parts += [f"{duration(at.left)} left"] if math.isfinite(at.left) and at.done < at.total else []
        told = ", ".join(parts)
        if self.bar is not None:
            self.bar.update(self.task, completed=at.done, description=told)
            return
        now = time.monotonic()
        share = at.done / at.total if at.total else 1.0
        if share - self.said >= 0.1 or now - self.when >= 5.0 or (at.done == at.total and share > self.said):
            self.said, self.when = share, now
            print(f"sweep     {at.done:6} / {at.total}  {share:4.0%}  {told}".rstrip(), file=sys.stderr, flush=True)

    def drawn(self, what: str, done: int, total: int) -> None:
        """How far stills or films are."""
        if self.bar is not None:
            self.bar.update(self.task, description=f"{what} {done} / {total}")
        else:
            print(f"{what:9} {done:6} / {total}", file=sys.stderr, flush=True)


def _told(found: "Sweep") -> list[str]:
    """The result in lines."""
    from tumble.sweeps.design import short

    timings = found.manifest["timings"]
    there = len(found.rows) - found.computed
    counts = ", ".join(f"{n} {end}" for end, n in found.manifest["ends"].items())
    lines = [
        f"{found.folder}: {counted(len(found.rows), 'run')} ({counts}){f', {there} were there' if there else ''}, "
        f"{duration(timings['wall'])}, table {found.hash}"
    ]
    lines += _means(found)
    for end in dict.fromkeys(row.status for row in found.failed):
        row = next(row for row in found.failed if row.status == end)
        words = ", ".join([*(f"{k}={short(v)}" for k, v in row.parameters.items()), f"seed={row.seed}"])
        lines.append(f"  {end}, the first of {found.manifest['ends'][end]}: run {row.run} ({words}): {row.reason}")
    if found.failed:
        lines.append("  all reasons: the column reason of sweep.csv")
    if found.manifest.get("transferred"):
        lines.append(f"  {size(found.manifest['transferred'])} of run folders came back as archives")
    names = ("sweep.html", "sweep.csv", "summary.csv", "stills.png", "films.mp4")
    return lines + [f"  {found.folder / name}" for name in names if (found.folder / name).exists()]


def _means(found: "Sweep") -> list[str]:
    """Means over seeds, with their confidence."""
    from tumble.sweeps.design import short

    head = [*found.design.paths, *(m.name + (f" [{m.unit}]" if m.unit else "") for m in found.measures)]
    table = [head]
    for point, rows in list(found.points.items())[:ROWS]:
        cells = [short(value) for value in rows[0].parameters.values()]
        for m in found.measures:
            s = found.spreads[point, m.name]
            near = f" ({s.low:.4g} to {s.high:.4g})" if s.n > 1 and s.low < s.high else ""
            cells.append(f"{s.mean:.6g}{near}" if s.n else "-")
        table.append(cells)
    widths = [max(len(row[i]) for row in table) for i in range(len(head))]
    lines = ["  " + "  ".join(word.rjust(w) for word, w in zip(row, widths, strict=True)) for row in table]
    if (more := len(found.points) - ROWS) > 0:
        lines.append(f"  {more} more in summary.csv")
    return lines
