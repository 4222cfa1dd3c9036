"""`tumble bottlenecks`: which doors of a building plan cost people the most time."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tumble.cli import find
from tumble.cli.console import say

if TYPE_CHECKING:
    from tumble.bottlenecks import Findings


def bottlenecks(
    plan: Annotated[
        str,
        typer.Argument(
            metavar="PLAN", help="A scene with a plan and a crowd, by file or name; or a .geojson or .svg drawing."
        ),
    ],
    seeds: Annotated[
        int, typer.Option(min=1, max=1000, metavar="N", help="Runs, with seeds counted from the scene's.")
    ] = 10,
    widen: Annotated[
        float,
        typer.Option(min=0.0, max=10.0, metavar="METRES", help="Make the first gates wider by this, and run again."),
    ] = 0.0,
    first: Annotated[int, typer.Option(min=1, metavar="N", help="How many gates --widen tries.")] = 3,
    limit: Annotated[
        float, typer.Option(min=1.0, max=1e6, metavar="SECONDS", help="When a run ends at the latest.")
    ] = 1800.0,
    workers: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Runs at a time.", show_default="as many as cores")
    ] = None,
    scale: Annotated[
        float, typer.Option(min=1e-6, max=1e6, metavar="METRES", help="Metres in a unit of a drawing.")
    ] = 1.0,
    people: Annotated[
        int | None,
        typer.Option(min=1, max=1_000_000, metavar="N", help="People in the start areas of a drawing without counts."),
    ] = None,
    set: find.SetOption = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of the report.", show_default="out/bottlenecks/NAME")
    ] = None,
    json: find.JsonOption = False,
) -> None:
    """Rank the doors of a plan by the time that people lose in their queues.

    Writes bottlenecks.html, bottlenecks.csv and pictures of the plan. Runs end when all people have left.

    In a drawing, kind says what a line is: wall, door, exit, or start, an area where people are. In GeoJSON it is a
    property, beside name, count and density; in SVG the class, id or label of an element or a group, beside data-name,
    data-count and data-density.

    \b
    Exit codes: 0 all left; 1 some did not within --limit; 2 the plan is wrong.

    \b
    Examples:
      tumble bottlenecks crowd/office
      tumble bottlenecks my.toml --seeds 20 --widen 0.2
      tumble bottlenecks floor.svg --scale 0.01 --people 200
    """
    from tumble import Scene
    from tumble.bottlenecks import files as drawings
    from tumble.bottlenecks import report, study
    from tumble.bundled import scene_file

    with find.told_as_json(json):
        if Path(plan).suffix.lower() in drawings.SUFFIXES:
            file = Path(plan)
            scene = Scene(drawings.scene(file, scale, people)).replace(*(set or ()))
        else:
            file, scene = scene_file(plan), find.scene(plan, set)
        with find.naming(file, scene=scene):
            found = study(scene, seeds, widen, first, limit, workers, None if json else _told)
        folder = out if out is not None else find.OUT / "bottlenecks" / file.stem
        files = report.write(found, folder)
    if json:
        names = ("flow", "peak_flow", "peak_density", "waiting", "lost")
        rows = [
            {"gate": row.gate, "exit": row.exit, "width": row.width, "crossed": row.crossed, "share": row.share}
            | {name: getattr(row, name).__dict__ for name in names}
            for row in found.rows
        ]
        changed = [
            {"gate": w.gate, "by": w.by, "saved": w.saved.__dict__, "earlier": w.earlier.__dict__}
            for w in found.widened
        ]
        whole = {"last_out": found.last_out.__dict__, "lost": found.lost.__dict__}
        find.say_json(
            {"ok": not found.stuck, "rows": rows, "widened": changed, **whole, "stuck": found.stuck, "files": files}
        )
    else:
        _say(found, files)
    if found.stuck:
        raise typer.Exit(1)


def _told(done: int, total: int) -> None:
    if sys.stderr.isatty():
        print(f"\r{done} of {total} runs", end="\n" if done == total else "", file=sys.stderr, flush=True)


def _say(found: "Findings", files: list[Path]) -> None:
    from tumble.bottlenecks.report import HEAD, cells, number

    rows = [list(HEAD), *(cells(row) for row in found.rows)]
    widths = [max(len(row[k]) for row in rows) for k in range(len(HEAD))]
    for k, row in enumerate(rows):
        text = [
            cell.ljust(width) if j < 2 else cell.rjust(width)
            for j, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        say(f"{k if k else '':>4}  " + "  ".join(text).rstrip())
    say(f"last person out after {number(found.last_out, 1)} s, {number(found.lost, 0)} person-seconds lost")
    for w in found.widened:
        gain = f"{number(w.saved, 0)} person-seconds saved, last out {number(w.earlier, 1)} s earlier"
        say(f"{w.gate} wider by {w.by:g} m: {gain}")
    for seed in found.stuck:
        say(f"seed {seed}: not all left in time")
    for file in files:
        say(f"  {file}")
