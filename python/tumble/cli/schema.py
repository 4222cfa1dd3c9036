"""`tumble schema`: the words of a scene, for editors."""

import json
from pathlib import Path
from typing import Annotated

import typer

from tumble.cli.console import say


def schema(
    out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The file to write.", show_default="to the terminal")
    ] = None,
) -> None:
    """Print the JSON Schema of scenes, by which editors complete and check them.

    Units are under "x-unit". Editors with the language server of Taplo (Even Better TOML in VS Code) take it from a
    first line `#:schema scene.schema.json` in a .toml file; in a .json file a key "$schema" is not needed, the setting
    json.schemas names it.

    \b
    Examples:
      tumble schema > scene.schema.json
      tumble schema --out scene.schema.json
    """
    from tumble import Scene
    from tumble.folder import write_whole

    text = json.dumps(Scene.schema(), indent=2, ensure_ascii=False)
    if out is None:
        say(text)
        return
    write_whole(out, f"{text}\n".encode())
    say(out)
