"""`tumble plot`: curves of a run, and slices through grids."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tumble.bundled import unknown
from tumble.cli import find
from tumble.cli.console import say

if TYPE_CHECKING:
    from tumble import Run


def plot(
    run: find.RunArgument,
    columns: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[COLUMN]...",
            help="Columns of ledger.csv, or momentum for all three components; default: the energies. With --slice, grid "
            "columns; default: all.",
        ),
    ] = None,
    slice: Annotated[bool, typer.Option("--slice", help="Draw a plane slice of a grid.")] = False,
    frame: Annotated[int, typer.Option(metavar="I", help="Frame of the slice; -1 is the last.")] = -1,
    axis: Annotated[str, typer.Option(metavar="x|y|z", help="Axis normal to the slice.")] = "y",
    at: Annotated[
        float | None, typer.Option(metavar="M", help="Position on that axis [m].", show_default="the middle")
    ] = None,
    thing: Annotated[
        str | None, typer.Option("--object", metavar="NAME", help="Object with the grid.", show_default="the first")
    ] = None,
    beside: Annotated[
        list[str] | None,
        typer.Option("--with", metavar="RUN", help="Draw this run in the same plot. Repeatable."),
    ] = None,
    branches: Annotated[
        bool, typer.Option("--branches", help="Draw the run's branches and its ancestors, too.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The picture to write.", show_default="in the run")
    ] = None,
) -> None:
    """Draw curves of a run over time, or slices through its grids.

    By default the energies. With --with or --branches, one pair of axes per column and one named curve per run; the
    curve of a branch starts at its frame, marked by a line.

    \b
    Examples:
      tumble plot out/sheet-on-bunny
      tumble plot out/sheet-on-bunny stretch speed --out stretch.png
      tumble plot rope energy speed --branches
      tumble plot out/coarse stretch --with out/fine --with out/finest
      tumble plot out/plume --slice pressure vorticity --frame 40 --axis x --at 0.1
    """
    from tumble.plots import energy, ledger

    found = find.run(run)
    names = [name for group in columns or () for name in group.split(",") if name]
    if slice and (beside or branches):
        raise typer.BadParameter("--slice draws one run; --with and --branches draw curves")
    if slice:
        from tumble.slices import slices

        number = frame % found.n_frames if -found.n_frames <= frame < found.n_frames else frame
        target = out or found.folder / "slices" / f"{number:06}.png"
        say(slices(found, target, names, frame, axis, at, thing))
        return
    known = [key for key in found.ledger if key != "frame"]
    vectors = [key.removesuffix("_x") for key in known if key.endswith("_x")]
    for name in names:
        if name not in known and name not in vectors:
            raise typer.BadParameter(unknown("column", name, [*vectors, *known]), param_hint="COLUMN")
    if beside or branches:
        say(_compare(found, [find.run(name) for name in beside or ()], branches, names, out))
        return
    target = out or found.folder / ("ledger.png" if names else "energy.png")
    if names:
        ledger(found, names, target)
    else:
        energy(found, target)
    say(target)


def _compare(found: "Run", others: "list[Run]", branches: bool, names: list[str], out: Path | None) -> Path:
    """Draws runs in one picture."""
    from tumble import SceneError
    from tumble.branch import family, lineage
    from tumble.plots import beside

    runs = [found, *others]
    if branches:
        kin = family(found)
        if not kin:
            cure = f"`tumble branch {found.folder}@FRAME --set KEY=VALUE` makes one"
            raise SceneError(f"{found.folder}: has no branches beside it; {cure}")
        older = [run for run in kin if len(run.descent) < len(found.descent)]
        runs = [*older, found, *(run for run in kin if run not in older), *others]
    shown = {os.path.realpath(run.folder): run for run in runs}
    if len(shown) == 1:
        raise typer.BadParameter("is the run itself", param_hint="--with")
    labels = {where: run.folder.resolve().name for where, run in shown.items()}
    if len(set(labels.values())) < len(labels):
        labels = {where: str(run.folder) for where, run in shown.items()}
    starts = {}
    for where, run in shown.items():
        if run.descent and os.path.realpath(lineage(run)[-1]) in shown:
            starts[labels[where]] = float(run.descent[-1]["time"])
    target = out or found.folder / ("ledger.png" if names else "energy.png")
    return beside({labels[where]: run for where, run in shown.items()}, names, target, starts)
