"""`tumble refine`: a scene at several resolutions, and the limits of its measures."""

import json
import math
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tumble.bundled import scene_file
from tumble.cli import find
from tumble.cli.console import Progress, complain, counted, say, warn_of

if TYPE_CHECKING:
    from tumble.refine import Study


def refine(
    scene: find.SceneArgument,
    levels: Annotated[
        int, typer.Option(metavar="N", min=3, max=12, help="Number of resolutions, including the scene's own.")
    ] = 4,
    what: Annotated[
        list[str] | None,
        typer.Option(metavar="PATH", help="A key to refine, e.g. system.0.substeps or rope.rope.segments. Repeatable."),
    ] = None,
    measure: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME[@HOW]", help="A measure. Repeatable.", show_default="energies, stretch, heat"),
    ] = None,
    set: find.SetOption = None,
    frames: find.FramesOption = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of the study.", show_default="out/refine/NAME")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Keep finished levels, compute the others.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace the runs in the folder.")] = False,
    threads: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Processor cores to use; results do not depend on it.")
    ] = None,
) -> None:
    """Run a scene at several resolutions, and estimate its order of convergence and limit.

    Level 0 is the scene itself; each further level is twice as fine. By default the resolutions of all objects (segments,
    resolution) and the substeps or step of each system that has one are refined; if a scene has none of them, the
    substeps. Counts are doubled; the masses along the sides of sheets and blocks become 2 n - 1, which halves their spacing;
    lengths, times and tolerances are halved. PATH*F and PATH/F set another factor; orders still refer to doubling.

    A measure is a column of ledger.csv at the end, or its largest, smallest or mean value over the frames: energy, speed@max.
    Or a column of an object in the last frame, over all elements or for one: rope.position.z@min, p.position.x@1.

    Three levels give the order p (errors shrink by 2^p per level), the limit at infinite resolution and the error
    of the finest level (Richardson). Orders that agree for two triples of levels are accepted; others are reported as not
    settled. In single precision fine levels soon differ by round-off: --set precision=double.

    Each level is a run in out/refine/NAME/level-K; beside them are convergence.csv and convergence.png.

    \b
    Exit codes: 0 all levels were simulated, whatever the result; 1 one of them
    failed; 2 the scene, a path or a measure is invalid.

    \b
    Examples:
      tumble refine springs/forever --levels 5 --set precision=double
      tumble refine rope --measure rope.position.z@min --frames 24
      tumble refine my.toml --what system.0.substeps*4 --what sheet.flag.resolution
    """
    from tumble.plots import convergence
    from tumble.refine import study, write

    if resume and force:
        raise typer.BadParameter("--resume keeps what is finished and --force replaces it; choose one")
    overrides = [*(set or ()), *([f"time.frames={frames}"] if frames is not None else [])]
    checked = find.scene(scene, overrides)
    folder = out if out is not None else find.OUT / "refine" / scene_file(scene).stem
    with ExitStack() as stack:

        def shown(level: str) -> Progress:
            stack.pop_all().close()
            return stack.enter_context(Progress(level))

        found = study(checked, folder, levels, what or (), measure or (), resume, force, threads, shown, warn_of)
    for line in _told(found):
        say(line)
    warn_of(found.notes)
    for k, text in found.failures.items():
        complain(f"level {k} failed: {text}; for details: `tumble run` with {_words(found, k)}")
    if found.measures and any(run is not None for run in found.runs):
        for path in (write(found), convergence(found, found.folder / "convergence.png")):
            say(f"  {path}")
    if found.failures:
        raise typer.Exit(1)


def _words(found: "Study", level: int) -> str:
    return " ".join(find.settings([word.at(level) for word in found.refined]))


def _told(found: "Study") -> list[str]:
    """The table."""
    took = sum(float(run.manifest["timings"]["simulate"]) for run in found.runs if run is not None)
    lines = [f"{found.folder}: {counted(found.levels, 'level')}, {took:.3g} s"]
    heads = ["", *(f"level {k}" for k in range(found.levels)), "order", "limit", "error of the finest"]
    rows = [[word.path, *map(json.dumps, word.values), "", "", ""] for word in found.refined]
    for m in found.measures:
        orders = ", ".join(_short(p) for p in m.orders)
        error = "" if math.isnan(m.error) else f"{m.error:.2g}{_share(m.error, m.limit)}"
        rows.append([m.name, *(f"{v:.8g}" for v in m.values), orders, _digits(m.limit, m.error), error])
    widths = [max(len(row[i]) for row in [heads, *rows]) for i in range(len(heads))]
    for row in [heads, *rows]:
        text = "  ".join(
            [row[0].ljust(widths[0]), *(word.rjust(w) for word, w in zip(row[1:], widths[1:], strict=True))]
        )
        lines.append(f"  {text}".rstrip())
    lines += [f"  {m.name}: {m.verdict}" for m in found.measures]
    if found.failures:
        lines.append("  orders, limits and errors are those of the finest levels in a row that did not break")
    return lines


def _short(order: float) -> str:
    return "-" if math.isnan(order) else f"{order:.2f}"


def _share(error: float, limit: float) -> str:
    return f" ({error / abs(limit):.1e})" if limit and math.isfinite(limit) else ""


def _digits(limit: float, error: float) -> str:
    """A limit, with the digits that its error supports and one more."""
    if math.isnan(limit):
        return ""
    if not error or not limit:
        return f"{limit:.8g}"
    digits = math.floor(math.log10(abs(limit))) - math.floor(math.log10(error)) + 2
    return f"{limit:.{min(max(digits, 1), 16)}g}"
