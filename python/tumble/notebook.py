"""A run as notebooks show it: a picture of its last frame, its energies, and its film if there is one."""

import base64
import html
import io
import tempfile
from pathlib import Path
from typing import Any, Protocol

from tumble._engine import TumbleError
from tumble.pictures.things import Recording

WIDTH = 480
"""Of the picture [pixels]."""

LARGEST = 30_000_000
"""Bytes of a film that is put into the notebook itself."""


class Shown(Recording, Protocol):
    """What is shown of a run."""

    @property
    def status(self) -> str:
        """How it ended."""

    @property
    def manifest(self) -> Any:
        """What run.json says."""


def page(run: Shown) -> str:
    """HTML with all pictures inside. What cannot be drawn is said in its place: a notebook must not break on it."""
    state = f"{run.n_frames} frames, {run.status}"
    if (failure := run.manifest.get("failure")) is not None:
        state += f": {failure['message']}"
    title = html.escape(str(run.scene.get("title") or run.folder.name))
    head = f"<b>{title}</b><br><code>{html.escape(str(run.folder))}</code>: {html.escape(state)}"
    if not run.n_frames:
        return f"<div>{head}</div>"
    last = run.n_frames - 1
    parts = [
        _drawn(lambda: _picture(run, last), f"frame {last}, t = {run.time(last):.4g} s"),
        _drawn(lambda: _energy(run), "energies [J] over time [s]"),
        _film(run.folder / "film.mp4"),
    ]
    figures = "".join(f'<figure style="margin:0.5em">{part}</figure>' for part in parts if part)
    return f'<div>{head}<div style="display:flex;flex-wrap:wrap;align-items:flex-start">{figures}</div></div>'


def _drawn(draw: Any, caption: str) -> str:
    try:
        data = base64.b64encode(draw()).decode()
    except (TumbleError, OSError, ValueError) as error:
        return f"<figcaption>{html.escape(str(error))}</figcaption>"
    text = html.escape(caption)
    return f'<img width="{WIDTH}" alt="{text}" src="data:image/png;base64,{data}"><figcaption>{text}</figcaption>'


def _picture(run: Recording, i: int) -> bytes:
    from matplotlib.image import imsave

    from tumble.pictures import Studio

    width, height = Studio(run).camera.size
    buffer = io.BytesIO()
    size = (WIDTH, max(16, round(WIDTH * height / width)))
    imsave(buffer, Studio(run, size=size).picture(i), format="png")
    return buffer.getvalue()


def _energy(run: Recording) -> bytes:
    from tumble.plots import energy

    with tempfile.TemporaryDirectory() as folder:
        return energy(run, Path(folder) / "energy.png").read_bytes()


def _film(path: Path) -> str:
    """The film, if it is there; one that is too large by its place."""
    if not path.is_file():
        return ""
    if path.stat().st_size > LARGEST:
        return f"<figcaption>{html.escape(str(path))}</figcaption>"
    data = base64.b64encode(path.read_bytes()).decode()
    source = f"data:video/mp4;base64,{data}"
    return (
        f'<video width="{WIDTH}" controls loop src="{source}"></video><figcaption>{html.escape(path.name)}</figcaption>'
    )
