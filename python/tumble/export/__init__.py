"""Runs in the file formats of other programs."""

import importlib
import re
from itertools import chain, count
from types import ModuleType

DIGITS = 6
"""Digits of the number of a frame in the name of its file, at least."""


def file_names(names: list[str]) -> dict[str, str]:
    """Names of objects as names of files, which stay apart."""
    found: dict[str, str] = {}
    for name in names:
        stem = re.sub(r"[^\w-]", "_", name)
        others = (f"{stem}_{k}" for k in count(2))
        found[name] = next(s for s in chain([stem], others) if s not in found.values())
    return found


def __getattr__(name: str) -> ModuleType:
    """The formats, each loaded when it is first used."""
    if name in ("blender", "ply", "usd", "vdb"):
        return importlib.import_module(f"tumble.export.{name}")
    raise AttributeError(f"module 'tumble.export' has no attribute {name!r}")
