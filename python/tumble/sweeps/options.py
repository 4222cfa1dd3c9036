"""How a sweep is carried out."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Options:
    """How a sweep is carried out; see `tumble.sweep`."""

    on: str = "cores"
    workers: int | None = None
    keep: bool = False
    stills: bool = False
    films: bool = False
    plots: bool = True
    resume: bool = False
    overwrite: bool = False
    memory: float | None = None
    renderer: str = "auto"
