"""What is to be told of USD files, remembered by path, time of change and size."""

import warnings
from pathlib import Path

from tumble.usd.stage import Reading, open_stage

Doubt = tuple[str, str]
"""Code, as in docs/warnings.md, and message."""

Key = tuple[str, int, int]

SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")

STANDS = "stands-still"

_told: dict[Key, list[Doubt]] = {}

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


def moves(path: Path | str) -> bool:
    """Whether what a file shows is animated. Raises ValueError, OSError."""
    return any(code == STANDS for code, _ in doubts(path))


def warn(path: Path | str, found: list[Doubt], cure: str = "") -> None:
    """Warns of doubts in Python, with a cure for what stands still."""
    for code, message in found:
        more = f"; {cure}" if code == STANDS and cure else ""
        warnings.warn(f"{path}: {message}{more}", UsdWarning, stacklevel=3)
