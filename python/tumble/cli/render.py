"""`tumble render`: pictures and films of a run."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tumble.bundled import unknown
from tumble.cli import find
from tumble.cli.console import Progress, say, warn

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tumble import Run

SamplesOption = Annotated[
    int | None,
    typer.Option(
        min=1,
        max=65536,
        metavar="N",
        help="Samples per pixel of mitsuba: more are slower, and show finer things.",
        show_default="16, of films 4",
    ),
]

CameraOption = Annotated[
    str | None,
    typer.Option(
        metavar="FILE[:PRIM]",
        help="Look with a camera of a USD file, which may move.",
        show_default="that of the scene",
    ),
]


def render(
    run: find.RunArgument,
    frame: Annotated[
        list[int] | None, typer.Option(metavar="I", help="Frame to draw as a still; -1 is the last. Repeatable.")
    ] = None,
    as_film: Annotated[bool, typer.Option("--film", help="Draw all frames into an .mp4.")] = False,
    renderer: Annotated[
        str,
        typer.Option(
            metavar="NAME", help="Renderer; `auto` takes the best one installed; `mitsuba-smoke` traces smoke, too."
        ),
    ] = "auto",
    every: Annotated[int, typer.Option(min=1, metavar="N", help="Only every Nth frame of the film.")] = 1,
    size: Annotated[str | None, typer.Option(metavar="WxH", help="Pixels, instead of the scene's.")] = None,
    samples: SamplesOption = None,
    camera: CameraOption = None,
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="The .png or .mp4 to write.")] = None,
) -> None:
    """Draw stills or a film of a run.

    By default a still of the last frame.

    \b
    Examples:
      tumble render out/sheet-on-bunny
      tumble render out/sheet-on-bunny --frame 0 --frame 60
      tumble render out/sheet-on-bunny --film --size 1280x720 --samples 16
      tumble render out/sheet-on-bunny --film --camera shot.usda:/cameras/main
    """
    if as_film and frame:
        raise typer.BadParameter("--film draws all frames and --frame a single one; choose one")
    if frame and len(frame) > 1 and out is not None:
        raise typer.BadParameter("--out names one file, and there are several frames")
    found = find.run(run)
    pixels = _pixels(size)
    for i in frame or ():
        if not -found.n_frames <= i < found.n_frames:
            text = f"frame {i}, expected 0 to {found.n_frames - 1}: the run has {found.n_frames} frames"
            raise typer.BadParameter(text, param_hint="--frame")
    look_for(renderer, samples)
    look_through(camera, found.scene)
    _ending(out, ".mp4" if as_film else ".png")
    if as_film:
        target = out or found.folder / "film.mp4"
        film(found, target, renderer, every, pixels, samples, camera)
        say(target)
        return
    for i in frame or [-1]:
        say(still(found, i % found.n_frames, out, renderer, pixels, samples, camera))


def look_for(renderer: str, samples: int | None = None) -> None:
    """Rejects unknown renderers, and samples of one that takes none. (One that does not work here fails when it draws.)"""
    from tumble.pictures import RENDERERS, TRACED, resolve

    known = ["auto", *RENDERERS, TRACED]
    if renderer not in known:
        raise typer.BadParameter(unknown("renderer", renderer, known), param_hint="--renderer")
    if samples is not None and not (drawn := resolve(renderer)).startswith("mitsuba"):
        cure = "leave it out" if renderer != "auto" else "leave it out, or pip install 'tumble[pictures]'"
        text = f"{drawn} would draw, and only mitsuba takes samples: {cure}"
        raise typer.BadParameter(text, param_hint="--samples")


def look_through(camera: str | None, scene: "Mapping[str, Any]") -> None:
    """Rejects a camera that a run of the scene could not be seen through, and tells what is not as its file has it."""
    if camera is None:
        return
    from tumble.usd.cameras import Shot

    if scene["dimension"] == 2:
        raise typer.BadParameter("scenes of two dimensions are seen head-on; leave it out", param_hint="--camera")
    try:
        shot = Shot(camera)
    except ValueError as error:
        raise typer.BadParameter(f"{camera}: {error}", param_hint="--camera") from None
    for code, message in shot.doubts():
        warn(code, f"{camera}: {message}")


def _ending(path: Path | None, ending: str) -> None:
    if path is not None and path.suffix.lower() != ending:
        raise typer.BadParameter(f"{path}, expected a name ending in {ending}", param_hint="--out")


def _pixels(text: str | None) -> tuple[int, int] | None:
    if text is None:
        return None
    try:
        width, height = (int(n) for n in text.lower().split("x"))
    except ValueError:
        width = height = 0
    if not (16 <= width <= 8192 and 16 <= height <= 8192):
        raise typer.BadParameter(
            f"{text!r}, expected WIDTHxHEIGHT of 16 to 8192 each, such as 1280x720", param_hint="--size"
        )
    return width, height


def film(
    run: "Run",
    path: Path,
    renderer: str = "auto",
    every: int = 1,
    size: tuple[int, int] | None = None,
    samples: int | None = None,
    camera: str | None = None,
) -> None:
    """Writes a film, showing progress."""
    from tumble.film import SAMPLES
    from tumble.film import film as write

    with Progress("film") as progress:
        write(run, path, renderer, every, size, progress, samples=samples or SAMPLES, camera=camera)


def still(
    run: "Run",
    i: int,
    path: Path | None = None,
    renderer: str = "auto",
    size: tuple[int, int] | None = None,
    samples: int | None = None,
    camera: str | None = None,
) -> Path:
    """Writes a picture of a frame, by default to stills/NNNNNN.png."""
    import io

    from matplotlib.image import imsave

    from tumble.folder import write_whole, writing
    from tumble.pictures import SAMPLES, picture

    path = path or run.folder / "stills" / f"{i:06}.png"
    pixels = picture(run, i, renderer, size, samples or SAMPLES, camera)
    buffer = io.BytesIO()
    imsave(buffer, pixels, format="png")
    with writing(path.parent):
        path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, buffer.getvalue())
    return path
