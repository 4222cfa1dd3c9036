"""`tumble plot`: curves of a run, and slices through what lies on grids."""

from pathlib import Path
from typing import Annotated

import typer

from tumble.cli import find
from tumble.cli.console import say


def plot(
    run: find.RunArgument,
    columns: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[COLUMN]...",
            help="Columns of ledger.csv, or momentum for its three; without any, the energies. With --slice, columns on a "
            "grid; without any, all.",
        ),
    ] = None,
    slice: Annotated[bool, typer.Option("--slice", help="Draw what lies on a grid, in a plane.")] = False,
    frame: Annotated[int, typer.Option(metavar="I", help="Frame of the slice; -1 is the last.")] = -1,
    axis: Annotated[str, typer.Option(metavar="x|y|z", help="Axis across the slice.")] = "y",
    at: Annotated[
        float | None, typer.Option(metavar="M", help="Where on that axis [m].", show_default="the middle")
    ] = None,
    thing: Annotated[
        str | None, typer.Option("--object", metavar="NAME", help="Whose grid.", show_default="the first")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The picture to write.", show_default="in the run")
    ] = None,
) -> None:
    """Draw curves of a run over time, or slices through what lies on a grid.

    Without columns, the energies.

    \b
    Examples:
      tumble plot out/sheet-on-bunny
      tumble plot out/sheet-on-bunny stretch speed --out stretch.png
      tumble plot out/plume --slice pressure vorticity --frame 40 --axis x --at 0.1
    """
    from tumble.plots import energy, ledger

    found = find.run(run)
    names = [name for group in columns or () for name in group.split(",") if name]
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
            hint = find.near(name, [*known, *vectors])
            text = f"no column {name!r}{hint or '; there are ' + ', '.join([*vectors, *known])}"
            raise typer.BadParameter(text, param_hint="COLUMN")
    target = out or found.folder / ("ledger.png" if names else "energy.png")
    if names:
        ledger(found, names, target)
    else:
        energy(found, target)
    say(target)
