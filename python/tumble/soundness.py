"""Whether the files of a run folder hold what they should: what is well-formed may still have been changed by somebody."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from tumble._engine import Scene, SceneError, version

_MANIFEST: dict[str, type | tuple[type, ...]] = {
    "status": str,
    "frames": int,
    "hashes": list,
    "descent": list,
    "warnings": list,
    "expectations": list,
    "probes": list,
    "stability": list,
    "timings": dict,
    "machine": dict,
    "failure": (dict, str, type(None)),
    "resumed": int,
    "folder": (str, type(None)),
    "custom": list,
    "whole_frames": int,
    "commit": (str, type(None)),
}

_INDICES = ("pinned", "triangles", "links", "curve")
"""Columns that count the particles of their object."""


def fault_of_manifest(manifest: Mapping[str, Any]) -> str | None:
    """Fault in a manifest."""
    for key, kind in _MANIFEST.items():
        if key in manifest and (not isinstance(manifest[key], kind) or isinstance(manifest[key], bool)):
            return f'"{key}" is {manifest[key]!r}'
    for key in ("custom", "descent", "expectations", "stability"):
        if not all(isinstance(item, dict) for item in manifest.get(key, [])):
            return f'"{key}" holds something else than tables'
    if any(type(seconds) not in (int, float) for seconds in manifest.get("timings", {}).values()):
        return '"timings" holds something else than numbers'
    # The words of another version may be others.
    if manifest.get("tumble") == version:
        try:
            if missing := _missing(Scene(manifest["scene"]).to_dict(), manifest["scene"]):
                return f"scene: {missing} is missing"
        except SceneError as error:
            # Meshes and fabrics may be gone: what they became is in the run.
            wrong = [i for i in error.issues if not str(i["path"]).endswith((".path", ".hash", ".name", ".fabric"))]
            if wrong:
                return f"scene: {wrong[0]['path']}: {wrong[0]['message']}"
    return None


def _missing(whole: Any, tree: Any, path: str = "") -> str | None:
    """The first word of a resolved scene that another tree has not."""
    if isinstance(whole, dict) and isinstance(tree, dict):
        below = [(f"{path}.{key}" if path else key, value, tree.get(key, ...)) for key, value in whole.items()]
    elif isinstance(whole, list) and isinstance(tree, list):
        below = [(f"{path}[{i}]", *pair) for i, pair in enumerate(zip(whole, tree, strict=False))]
    else:
        return path if tree is ... else None
    return next(filter(None, (_missing(a, b, at) for at, a, b in below)), None)


def fault_of_columns(described: Any) -> str | None:
    """Fault in the description of the columns."""
    if not isinstance(described, dict):
        return "it is no table of objects"
    for name, table in described.items():
        if not isinstance(table, dict):
            return f'"{name}" is no table of columns'
        for column, entry in table.items():
            if not isinstance(entry, dict) or not all(
                isinstance(entry.get(key), str) for key in ("unit", "dtype", "in")
            ):
                return f'"{name}/{column}" has no unit, dtype or file'
            shape = entry.get("shape")
            if not isinstance(shape, list) or not all(n is None or (type(n) is int and n >= 0) for n in shape):
                return f'"{name}/{column}" has no shape'
    return None


def fault_of_arrays(
    columns: Mapping[str, Mapping[str, npt.NDArray[Any]]], described: Mapping[str, Any], place: str
) -> str | None:
    """Fault in the arrays of a file. Numbers of particles vary, and tearing surfaces get more points."""
    for name, table in described.items():
        count = columns[name]["id"].size if place == "frames" and "id" in columns.get(name, {}) else None
        for column, entry in table.items():
            if entry["in"] != place:
                continue
            array = columns.get(name, {}).get(column)
            if array is None:
                return f'"{name}/{column}" is missing'
            if (
                array.ndim != len(entry["shape"])
                or list(array.shape[1:]) != entry["shape"][1:]
                or array.dtype != entry["dtype"]
            ):
                return f'"{name}/{column}" is {array.dtype} {list(array.shape)}, not {entry["dtype"]} {entry["shape"]}'
            least = entry["shape"][0] if entry["shape"] else None
            if least is not None and len(array) < least:
                return f'"{name}/{column}" has {len(array)} rows, not {least}'
            if least is None and array.ndim and count is not None and len(array) != count:
                return f'"{name}/{column}" has {len(array)} rows for {count} particles'
            own = columns.get(name, {})
            # The triangles of a rigid body are over the corners of its mesh.
            of = "vertices" if "vertices" in own else "mass"
            if place == "static" and column in _INDICES and of in own and array.size:
                most = len(own[of])
                if np.min(array) < 0 or np.max(array) >= most:
                    what = "corners" if of == "vertices" else "particles"
                    return f'"{name}/{column}" names {what} beyond the {most} that there are'
    return None
