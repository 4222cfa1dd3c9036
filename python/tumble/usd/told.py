"""What is to be told of USD files, remembered by path, time of change and size."""

import warnings
from pathlib import Path

from tumble.usd.stage import Reading, has_shapes, names, open_stage

Doubt = tuple[str, str]
"""Code, as in docs/warnings.md, and message."""

Key = tuple[str, int, int]

SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")

STANDS = "stands-still"

_told: dict[Key, list[Doubt]] = {}

_figures: dict[Key, list[Doubt]] = {}

_strands: dict[Key, list[Doubt]] = {}

stiff: dict[Key, str] = {}
"""Why files that are animated cannot move."""


class UsdWarning(UserWarning):
    """What a USD file holds and is not as it seems in a scene."""


def is_usd(path: Path | str) -> bool:
    """Whether a file has one of the suffixes of USD."""
    return Path(path).suffix.lower() in SUFFIXES


def key(path: Path | str) -> Key:
    """By which a file is known as it is now. Raises OSError."""
    about = Path(path).stat()
    return str(Path(path).resolve()), about.st_mtime_ns, about.st_size


def doubts(path: Path | str) -> list[Doubt]:
    """All that is to be told of a file. Raises ValueError, OSError."""
    where = key(path)
    if where not in _told:
        reading = Reading(open_stage(path))
        reading.surfaces()
        note(path, reading)
    reason = f"; it cannot move: {stiff[where]}" if where in stiff else ""
    return [(code, message + reason if code == STANDS else message) for code, message in _told[where]]


def note(path: Path | str, reading: Reading) -> None:
    """Remembers the doubts about a file, whose surfaces have been read."""
    _told[key(path)] = reading.doubts()


def note_figure(path: Path | str, reading: Reading, skinned: set[str]) -> None:
    """Remembers the doubts about the figure of a file, whose surfaces have been read; bones carry those that are `skinned`."""
    found = [doubt for doubt in reading.doubts() if doubt[0] != STANDS]
    shaped = [name for name in sorted(skinned) if has_shapes(reading.stage.GetPrimAtPath(name))]
    if shaped:
        message = f"blend shapes, of which figures have none: {names(shaped)}; in shape.mesh they move, without bones"
        found.append(("unread-prims", message))
    if still := [name for name in reading.moving if name not in skinned]:
        found.append(
            (STANDS, f"no bone carries them, so they stand in figures: {names(still)}; bind them to the skeleton")
        )
    _figures[key(path)] = found


def of_figure(path: Path | str) -> list[Doubt]:
    """All that is to be told of the figure of a file, once it has been read. Raises OSError."""
    return _figures.get(key(path), [])


def note_strands(path: Path | str, reading: Reading) -> None:
    """Remembers the doubts about the curves of a file, which have been read."""
    _strands[key(path)] = reading.doubts()


def of_strands(path: Path | str) -> list[Doubt]:
    """All that is to be told of the curves of a file, once they have been read. Raises OSError."""
    return _strands.get(key(path), [])


def moves(path: Path | str) -> bool:
    """Whether what a file shows is animated. Raises ValueError, OSError."""
    return any(code == STANDS for code, _ in doubts(path))


def warn(path: Path | str, found: list[Doubt], cure: str = "") -> None:
    """Warns of doubts in Python, with a cure for what stands still."""
    for code, message in found:
        more = f"; {cure}" if code == STANDS and cure else ""
        warnings.warn(f"{path}: {message}{more}", UsdWarning, stacklevel=3)
