"""Pictures of runs side by side: a sheet of last frames, and a film of films."""

import hashlib
import io
import json
import math
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble._engine import ExportError, TumbleError
from tumble.folder import write_whole, writing
from tumble.reader import Run
from tumble.sweeps.figures import told
from tumble.sweeps.result import Row, Sweep
from tumble.sweeps.store import Store

Told = Callable[[str, int, int], None]
"""Called with what is drawn, how many are done and how many there are."""

WIDTH = 320
"""Of each picture [pixels]."""

MOST = 64
"""Pictures of a sheet: of more runs, some that are spread over the design."""

FILMS = 16
"""Films side by side, in the same way."""

BESIDE = 8
"""Pictures of a row, at most, where its length is that of an axis."""

LINE = 15
"""Height of a line of text under a picture [pixels]."""


def shown(found: Sweep, most: int) -> list[Row]:
    """The first run of each point, of many points some."""
    first = [rows[0] for rows in found.points.values()]
    if len(first) <= most:
        return first
    return [first[round(k)] for k in np.linspace(0, len(first) - 1, most)]


def stills(found: Sweep, store: Store, renderer: str = "auto", progress: Told | None = None) -> Path | None:
    """Draws the last frames of the first seed into stills/, and all of them on one sheet, stills.png. Raises ExportError."""
    from matplotlib.image import imread, imsave

    rows = shown(found, MOST)
    pictures: list[tuple[str, Any]] = []
    for k, row in enumerate(rows):
        path = found.folder / "stills" / f"{_name(found, row)}.png"
        if not path.is_file() and (pixels := _last(found, store, row, renderer)) is not None:
            buffer = io.BytesIO()
            imsave(buffer, pixels, format="png")
            with writing(path.parent):
                path.parent.mkdir(exist_ok=True)
            write_whole(path, buffer.getvalue())
        if path.is_file():
            shape = imread(path)[..., :3]
            pictures.append((caption(row), (shape * 255).round().astype(np.uint8)))
        if progress is not None:
            progress("stills", k + 1, len(rows))
    if not pictures:
        return None
    goal = found.folder / "stills.png"
    buffer = io.BytesIO()
    imsave(buffer, sheet(pictures, across(found, len(pictures))), format="png")
    write_whole(goal, buffer.getvalue())
    return goal


def caption(row: Row) -> str:
    """What is written under a picture."""
    text = told(row.parameters) or f"seed {row.seed}"
    return text if row.status == "finished" else f"{text}: {row.status} at frame {row.frame}"


def _name(found: Sweep, row: Row) -> str:
    """Of a picture: the run's key and a hash of the camera, which the key does not tell apart."""
    camera = json.dumps(found.manifest["scene"].get("camera"), sort_keys=True)
    return f"{row.key}-{hashlib.sha256(camera.encode()).hexdigest()[:8]}"


def _run(found: Sweep, store: Store, row: Row) -> Run:
    """A run as the camera of the sweep's scene sees it; the run may be older than that camera."""
    run = Run(store.runs(row.key))
    if camera := found.manifest["scene"].get("camera"):
        run.scene["camera"] = camera
    return run


def _last(found: Sweep, store: Store, row: Row, renderer: str) -> npt.NDArray[np.uint8] | None:
    """The last frame of a run; None where there is none to be drawn."""
    from tumble.pictures import SAMPLES, picture

    try:
        run = _run(found, store, row)
        if not run.n_frames:
            return None
        return np.asarray(picture(run, run.n_frames - 1, renderer, size_of(run.scene, WIDTH), SAMPLES))
    except TumbleError:
        # An exploded run may have nothing that can be seen.
        return None


def size_of(scene: Any, width: int) -> tuple[int, int]:
    """Pixels of a small picture, of the shape of the scene's camera; both even, for films."""
    across, down = scene["camera"]["resolution"]
    return width, max(2, round(width * down / across / 2) * 2)


def sheet(pictures: Sequence[tuple[str, npt.NDArray[np.uint8]]], across: int) -> npt.NDArray[np.uint8]:
    """Pictures with their captions, in rows of so many."""
    from PIL import Image, ImageDraw

    height, width = (max(picture.shape[k] for _, picture in pictures) for k in (0, 1))
    font = _font(12)
    texts = [_broken(text, width, font) for text, _ in pictures]
    below = LINE * max(map(len, texts)) + 6
    down = math.ceil(len(pictures) / across)
    paper = Image.new("RGB", (across * (width + 8) + 8, down * (height + below + 8) + 8), "white")
    pen = ImageDraw.Draw(paper)
    for k, (_, pixels) in enumerate(pictures):
        x, y = 8 + k % across * (width + 8), 8 + k // across * (height + below + 8)
        paper.paste(Image.fromarray(pixels), (x, y))
        for i, line in enumerate(texts[k]):
            pen.text((x, y + height + 3 + LINE * i), line, fill="#22272e", font=font)
    return np.asarray(paper)


def _broken(text: str, width: int, font: Any) -> list[str]:
    """A caption in lines of words; a word that is too long is cut."""
    lines = [""]
    for word in text.split(" "):
        longer = f"{lines[-1]} {word}".strip()
        if font.getlength(longer) <= width or not lines[-1]:
            lines[-1] = longer
        else:
            lines.append(word)
    cut = [line for line in lines if line]
    for k in range(len(cut)):
        while font.getlength(cut[k]) > width:
            cut[k] = cut[k][:-2].rstrip("…") + "…"
    return cut


def across(found: Sweep, n: int) -> int:
    """How many of n pictures stand beside each other: of a grid the values of its last axis."""
    axes = found.design.axes
    if len(axes) > 1 and n == len(found.design) and len(axes[-1].rows) <= BESIDE:
        return len(axes[-1].rows)
    return min(n, max(1, math.ceil(math.sqrt(n * 1.2))))


def _font(size: int) -> Any:
    """The one that plots have."""
    from matplotlib.font_manager import findfont
    from PIL import ImageFont

    return ImageFont.truetype(findfont("DejaVu Sans"), size)


# Films


def films(found: Sweep, store: Store, renderer: str = "auto", progress: Told | None = None) -> list[tuple[Row, Path]]:
    """Draws films of the first seed into films/, and all of them side by side into films.mp4; returns the single ones, of the
    runs that have two frames. Raises ExportError."""
    from tumble.film import film

    rows = [row for row in shown(found, FILMS) if (store.runs(row.key) / "run.json").is_file()]
    made = []
    for k, row in enumerate(rows):
        path = found.folder / "films" / f"{_name(found, row)}.mp4"
        run = _run(found, store, row)
        if run.n_frames > 1:
            if not path.is_file():
                film(run, path, renderer, 1, size_of(run.scene, WIDTH))
            made.append((row, path))
        if progress is not None:
            progress("films", k + 1, len(rows))
    if len(made) > 1:
        beside([path for _, path in made], found.folder / "films.mp4", across(found, len(made)))
    return made


def beside(files: Sequence[Path], goal: Path, across: int) -> Path:
    """Films in rows of so many, in one; those that end earlier stay at their last picture. Raises ExportError."""
    import imageio_ffmpeg

    down = math.ceil(len(files) / across)
    inputs = [word for file in files for word in ("-i", str(file))]
    sizes = [imageio_ffmpeg.count_frames_and_secs(str(file)) for file in files]
    longest = max(seconds for _, seconds in sizes)
    parts = [
        f"[{k}:v]tpad=stop_mode=clone:stop_duration={max(longest - seconds, 0.0):.6f},pad=iw+8:ih+8:4:4:white[v{k}]"
        for k, (_, seconds) in enumerate(sizes)
    ]
    names = "".join(f"[v{k}]" for k in range(len(files)))
    places = "|".join(
        f"{'+'.join(['w0'] * (k % across)) or '0'}_{'+'.join(['h0'] * (k // across)) or '0'}" for k in range(len(files))
    )
    stack = (
        f"{names}xstack=inputs={len(files)}:layout={places}:fill=white[out]"
        if down * across > 1
        else f"{names}null[out]"
    )
    unfinished = goal.with_name(f".{goal.name}.part")
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-hide_banner", "-loglevel", "error", "-y", *inputs]
    command += ["-filter_complex", ";".join([*parts, stack]), "-map", "[out]", "-c:v", "libx264", "-crf", "18"]
    command += ["-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4", str(unfinished)]
    found = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False)
    if found.returncode:
        unfinished.unlink(missing_ok=True)
        said = found.stderr.decode(errors="replace").strip().splitlines()
        raise ExportError(f"{goal}: ffmpeg failed: {said[-1] if said else f'exit code {found.returncode}'}")
    with writing(goal):
        unfinished.replace(goal)
    return goal
