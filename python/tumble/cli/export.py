"""`tumble export`: converts a run to the formats of other programs."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tumble.cli import find
from tumble.cli.console import Progress, say
from tumble.cli.render import CameraOption, look_through

if TYPE_CHECKING:
    from tumble import Run


def export(
    run: find.RunArgument,
    usd: Annotated[
        bool, typer.Option("--usd", help="scene.usda with a layer per frame, for Blender, Houdini and usdview.")
    ] = False,
    blender: Annotated[
        bool, typer.Option("--blender", help="With blender.py, which imports scene.usda into Blender; implies --usd.")
    ] = False,
    npz: Annotated[
        bool, typer.Option("--npz", help="columns.npz: every column of all frames, frames x rows x width.")
    ] = False,
    ply: Annotated[bool, typer.Option("--ply", help="ply/NAME.FRAME.ply: the particles of each frame.")] = False,
    vdb: Annotated[
        bool,
        typer.Option("--vdb", help="volumes/NAME.FRAME.vdb: grids as OpenVDB; --usd refers to them."),
    ] = False,
    half: Annotated[bool, typer.Option("--half", help="VDB in half precision.")] = False,
    zip: Annotated[bool, typer.Option("--zip", help="VDB compressed, except densities.")] = False,
    camera: CameraOption = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Folder to write into.", show_default="that of the run")
    ] = None,
) -> None:
    """Convert a run to the formats of other programs.

    \b
    Examples:
      tumble export out/sheet-on-bunny --usd
      tumble export out/sheet-on-bunny --usd --camera shot.usda:/cameras/main
      tumble export out/plume --blender && blender --python out/plume/blender.py
      tumble export out/sheet-on-bunny --npz --out results
      tumble export out/fountain --ply
      tumble export out/plume --vdb --half
    """
    usd = usd or blender
    if not (usd or npz or ply or vdb):
        raise typer.BadParameter("choose at least one format: --usd, --blender, --npz, --ply, --vdb")
    if (half or zip) and not vdb:
        raise typer.BadParameter("--half and --zip say how to write --vdb")
    if camera is not None and not usd:
        raise typer.BadParameter("--camera says how to look in --usd")
    found = find.run(run)
    look_through(camera, found.scene)
    folder = out or found.folder
    if vdb:
        from tumble.export.vdb import write as write_vdb

        with Progress("vdb") as progress:
            say(write_vdb(found, folder, progress, half, zip))
    if usd:
        from tumble.export.usd import write

        with Progress("usd") as progress:
            say(write(found, folder, progress, volumes=not vdb, camera=camera))
    if blender:
        from tumble.export.blender import write as write_script

        say(write_script(found, folder, camera))
    if npz:
        with Progress("npz") as progress:
            say(stack(found, folder, progress))
    if ply:
        from tumble.export.ply import write as write_ply

        with Progress("ply") as progress:
            say(write_ply(found, folder, progress))


def stack(run: "Run", folder: Path, progress: Progress) -> Path:
    """Writes columns.npz: keys `time` [s] and `object/column`, frames x rows x width.

    For particles with birth and death, the rows of all frames are concatenated, rows x width: those of frame i are
    `first[i]` to `first[i + 1]` of the key `object/first`.
    """
    import zipfile

    import numpy as np

    from tumble.folder import writing

    path = folder / "columns.npz"
    temporary = path.with_name(path.name + ".tmp")
    first = run.frame(0) if run.n_frames else {}
    keys = [(name, column) for name, table in first.items() for column in table]
    starts = {name: _starts(run, name) for name, table in first.items() if "id" in table}
    with writing(path):
        folder.mkdir(parents=True, exist_ok=True)
        try:
            with zipfile.ZipFile(temporary, "w") as archive:
                with archive.open("time.npy", "w", force_zip64=True) as member:
                    np.lib.format.write_array(member, run.ledger["time"])
                for name, rows in starts.items():
                    with archive.open(f"{name}/first.npy", "w", force_zip64=True) as member:
                        np.lib.format.write_array(member, np.array(rows, dtype=np.int64))
                # Frame after frame, so that a run that is larger than the memory can be exported.
                for k, (name, column) in enumerate(keys):
                    array = first[name][column]
                    shape = (run.n_frames, *array.shape)
                    if name in starts:
                        shape = (starts[name][-1], *array.shape[1:])
                    header = {
                        "descr": np.lib.format.dtype_to_descr(array.dtype),
                        "fortran_order": False,
                        "shape": shape,
                    }
                    with archive.open(f"{name}/{column}.npy", "w", force_zip64=True) as member:
                        np.lib.format.write_array_header_2_0(member, header)
                        for i in range(run.n_frames):
                            member.write(np.ascontiguousarray(run.frame(i)[name][column]).tobytes())
                            progress(k * run.n_frames + i + 1, len(keys) * run.n_frames)
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    return path


def _starts(run: "Run", name: str) -> list[int]:
    """The first row of each frame of an object, and the total number of rows."""
    starts = [0]
    for i in range(run.n_frames):
        starts.append(starts[-1] + len(run.frame(i)[name]["id"]))
    return starts
