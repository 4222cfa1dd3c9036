"""`tumble scenes`: the bundled scenes."""

from itertools import groupby
from typing import Annotated

import typer

from tumble.bundled import scene_file, shipped
from tumble.cli import find
from tumble.cli.console import say


def scenes(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="Scene whose file to print.")] = None,
) -> None:
    """List the bundled scenes, or print one.

    \b
    Examples:
      tumble scenes
      tumble scenes sheet-on-bunny > my.toml
    """
    if name is not None:
        say(scene_file(name).read_text(encoding="utf-8"), end="")
        return
    known = shipped()
    width = max((len(file.stem) for file in known.values()), default=0)
    for row, files in groupby(known.values(), key=lambda file: file.parent.name):
        say(row)
        for file in files:
            say(f"  {file.stem:{width}}  {find.title(file)}".rstrip())
