"""Runs in the file formats of other programs."""

import re

DIGITS = 6
"""Digits of the number of a frame in the name of its file, at least."""


def file_names(names: list[str]) -> dict[str, str]:
    """Names of objects as names of files, which stay apart."""
    found: dict[str, str] = {}
    for name in names:
        stem = re.sub(r"[^\w-]", "_", name)
        free = next(s for s in (stem, *(f"{stem}_{k}" for k in range(2, 1_000_000))) if s not in found.values())
        found[name] = free
    return found
