"""`tumble bottlenecks`: which doors of a building plan cost people the most time."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tumble.cli import find
from tumble.cli.console import complain, say, warn

if TYPE_CHECKING:
    from tumble import Scene
    from tumble.bottlenecks import Findings
    from tumble.bottlenecks.check import Fault


def bottlenecks(
    plan: Annotated[
        str,
        typer.Argument(
            metavar="PLAN",
            help="A scene with a plan and a crowd, by file or name; or a .dxf, .svg, .geojson or .wkt drawing.",
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
    on: find.OnOption = "cores",
    workers: find.WorkersOption = None,
    scale: Annotated[
        float | None,
        typer.Option(
            min=1e-6, max=1e6, metavar="METRES", help="Metres in a unit of a drawing.", show_default="as it says"
        ),
    ] = None,
    units: Annotated[str | None, typer.Option(metavar="UNIT", help="The same by name: mm, cm, dm, m, in, ft.")] = None,
    layer: Annotated[
        list[str] | None,
        typer.Option(metavar="KIND=NAME", help="What a layer of a drawing holds, as in wall=A-WALL. Repeatable."),
    ] = None,
    people: Annotated[
        int | None,
        typer.Option(min=1, max=1_000_000, metavar="N", help="People in the start areas of a drawing without counts."),
    ] = None,
    check: Annotated[bool, typer.Option("--check", help="Say what is wrong with the plan, and run nothing.")] = False,
    repair: Annotated[
        bool, typer.Option("--repair", help="Mend the plan first: gaps, doubles, walls through gates.")
    ] = False,
    trajectories: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Write the ways of the first seed: .txt, .sqlite or .h5, as PedPy reads them."
        ),
    ] = None,
    set: find.SetOption = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder of the report.", show_default="out/bottlenecks/NAME")
    ] = None,
    json: find.JsonOption = False,
) -> None:
    """Rank the doors of a plan by the time that people lose in their queues.

    Writes bottlenecks.html, bottlenecks.csv and pictures of the plan. Runs end when all people have left. A scene with
    bodies is run without them, too: what falling rocks cost, and who was hit when.

    In a drawing, the name of its layer says what a line is: wall, door, exit, or start, an area where people are; A-WALL,
    Türen or sortie are understood, too. In SVG a layer is the label, class or id of an element or a group, beside data-name,
    data-count and data-density; in GeoJSON the property kind or layer, beside name, count and density.

    --trajectories also writes gates.csv: N(t), Voronoi density and speed at each gate, every second, as PedPy has them.

    The plan is checked first; what is wrong is drawn into check.png. --repair writes the mended scene into plan.json.

    \b
    Exit codes: 0 all left, or nothing fatal is wrong with the plan; 1 some did not
    leave within --limit; 2 the plan is wrong.

    \b
    Examples:
      tumble bottlenecks crowd/office
      tumble bottlenecks my.toml --seeds 20 --widen 0.2
      tumble bottlenecks floor.dxf --units mm --layer exit=A-DOOR-EXT --people 200 --check
    """
    from tumble import Scene
    from tumble.bottlenecks import files as drawings
    from tumble.bottlenecks import paths, report, study
    from tumble.bundled import scene_file

    with find.told_as_json(json):
        notes: list[str] = []
        if Path(plan).suffix.lower() in drawings.SUFFIXES:
            file, reading = Path(plan), drawings.Reading(scale, units, layer or (), people)
            scene = Scene(drawings.scene(file, reading)).replace(*(set or ()))
            notes = drawings.notes(file, reading)
        else:
            file, scene = scene_file(plan), find.scene(plan, set)
        folder = out if out is not None else find.OUT / "bottlenecks" / file.stem
        if trajectories is not None:
            paths.form(trajectories)
        with find.naming(file, scene=scene):
            scene, faults = _checked(scene, folder, repair, check, notes, json)
            if not check:
                found = study(scene, seeds, widen, first, limit, on, workers, None if json else _told)
                written = report.write(found, folder)
                if trajectories is not None:
                    written += _ways(scene, limit, trajectories, folder)
    if check:
        _say_faults(faults, json)
    else:
        _say(found, written, json)


def _checked(
    scene: "Scene", folder: Path, repair: bool, check: bool, notes: list[str], quiet: bool
) -> tuple["Scene", "list[Fault]"]:
    """The scene, mended if so asked, and its faults, which are drawn and told. Raises SceneError where one is fatal, unless all
    that is asked for is to check."""
    import json as text

    from tumble import SceneError
    from tumble.bottlenecks import check as checks
    from tumble.folder import write_whole

    if len(scene.to_dict()["plan"]) != 1:
        return scene, []  # Which is told by the study.
    if repair:
        scene, done = checks.mended(scene)
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(folder / "plan.json", text.dumps(scene.to_dict()).encode())
        if not quiet:
            for fault in done:
                say(fault.text)
            say(f"  {folder / 'plan.json'}" if done else "nothing to repair")
    found = checks.faults(scene)
    if found:
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(folder / "check.png", checks.picture(checks.floor(scene), found))
    fatal = any(fault.fatal for fault in found)
    if not check and fatal:
        raise SceneError("\n".join([*map(str, found), f"the places are marked in {folder / 'check.png'}"]))
    if not quiet:
        for note in notes:
            warn("plan-drawing", note)
        for fault in found if not check else ():
            warn("plan-fault", str(fault))
    return scene, found


def _ways(scene: "Scene", limit: float, file: Path, folder: Path) -> list[Path]:
    """Writes the ways of the first seed, and what is measured of them at each gate."""
    from tumble.bottlenecks import measures, paths
    from tumble.folder import write_whole

    walk, tree = paths.walked(scene, limit), scene.to_dict()
    found = measures.series(walk, tree["plan"][0], max(1, round(tree["time"]["fps"])))
    write_whole(folder / "gates.csv", measures.table(found).encode())
    return [paths.write(walk, file), folder / "gates.csv"]


def _say_faults(found: "list[Fault]", json: bool) -> None:
    """Prints what is wrong; exits with 2 where that is fatal."""
    fatal = any(fault.fatal for fault in found)
    if json:
        find.say_json({"ok": not fatal, "faults": [fault.__dict__ for fault in found]})
    else:
        for k, fault in enumerate(found):
            say(f"{k + 1:>4}  {'fatal' if fault.fatal else 'fault'}  {fault.kind:8}  {fault}")
        say(f"{len(found)} faults" if found else "nothing is wrong with the plan")
    if fatal:
        if not json:
            complain("nobody can walk on this plan as it is")
        raise typer.Exit(2)


def _told(done: int, total: int) -> None:
    if sys.stderr.isatty():
        print(f"\r{done} of {total} runs", end="\n" if done == total else "", file=sys.stderr, flush=True)


def _say(found: "Findings", files: list[Path], json: bool) -> None:
    """Prints the ranking; exits with 1 where not all have left."""
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
        bodies = {what: {"with": a.__dict__, "without": b.__dict__} for what, (a, b) in found.bodies.items()}
        told = {"rows": rows, "widened": changed, "fixed": found.fixed, **whole, "bodies": bodies, "stuck": found.stuck}
        find.say_json({"ok": not found.stuck, **told, "files": files})
    else:
        _say_rows(found)
        for file in files:
            say(f"  {file}")
    if found.stuck:
        raise typer.Exit(1)


def _say_rows(found: "Findings") -> None:
    from tumble.bottlenecks.report import FIXED, HEAD, cells, number, said

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
    if found.without:
        say(f"with the bodies {said(found, 0)}")
        say(f"without them {said(found, 1)}")
    for gate in found.fixed:
        say(f"{gate} was not made wider: {FIXED}; end walls there, or --repair")
    for seed in found.stuck:
        say(f"seed {seed}: not all left in time")
