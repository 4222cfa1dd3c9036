"""`tumble plot`: curves of a run."""

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
            metavar="[COLUMN]...", help="Columns of ledger.csv, or momentum for its three; without any, the energies."
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The picture to write.", show_default="in the run")
    ] = None,
) -> None:
    """Draw curves of a run over time.

    Without columns, the energies.

    \b
    Examples:
      tumble plot out/sheet-on-bunny
      tumble plot out/sheet-on-bunny stretch speed --out stretch.png
    """
    from tumble.plots import energy, ledger

    found = find.run(run)
    names = [name for group in columns or () for name in group.split(",") if name]
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
