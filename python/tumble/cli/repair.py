"""Repair of the meshes of a scene, for `tumble check --repair`."""

import json
import os
import re
from collections.abc import Container
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tumble.cli.console import say, warn

if TYPE_CHECKING:
    from tumble import Scene

_ENDING = ".repaired.obj"

_DONE = {
    "welded": ("vertex", "vertices", "sewn to others at the same position"),
    "repeated": ("triangle", "triangles", "dropped as duplicates"),
    "degenerate": ("triangle", "triangles", "dropped for having no area"),
    "turned": ("triangle", "triangles", "flipped"),
    "split": ("edge", "edges", "of more than two triangles split"),
    "unused": ("vertex", "vertices", "of no triangle dropped"),
}
_LEFT = {
    "open": ("edge is", "edges are", "still open"),
    "odd": ("edge is", "edges are", "still inconsistent: a one-sided surface"),
}


def mend(file: Path, scene: "Scene", force: bool, done: Container[str] = ()) -> list[str]:
    """Repairs the mesh files of a scene but those that are `done`, prints the repairs, and returns the settings that use
    the new files. Raises SceneError if a new file exists, unless `force` overwrites it."""
    from tumble import SceneError, repair_mesh, usd
    from tumble.usd.frames import parted

    changes: dict[str, Path] = {}
    seen: set[str] = set()
    moving = {path: frame[0] for _, _, path in scene.mesh_files if (frame := parted(Path(scene.folder) / path))}
    for animated in dict.fromkeys(moving.values()):
        say(f"{animated}: its frames, listed one by one, are not mended; name the file in shape.mesh")
    places = [place for place in scene.mesh_files if place[2] not in done and place[2] not in moving]
    for _, _, path in places:
        if path in seen:
            continue
        seen.add(path)
        old = Path(scene.folder) / path
        text, counts = repair_mesh(old)
        left = _words(_LEFT, counts)
        if text is None:
            say(f"{old}: nothing to repair" + (f"; {left}" if left else ""))
            continue
        new = old.with_name(old.name.removesuffix(old.suffix) + _ENDING)
        if new.exists() and not force:
            raise SceneError(f"{new}: exists already; use it, delete it, or overwrite it with --force")
        say(f"{old}: {_words(_DONE, counts)}" + (f"; {left}" if left else ""))
        part = new.with_name(f".{new.name}.{os.getpid()}.part")
        try:
            part.write_text(text, encoding="ascii")
            part.replace(new)
        finally:
            part.unlink(missing_ok=True)
        say(f"  written to {new}")
        if usd.is_usd(old) and usd.moves(old):
            warn(
                "stands-still",
                f"{new}: has the shape of {old} at its start",
            )
        changes[path] = new.relative_to(scene.folder) if new.is_relative_to(scene.folder) else new
    if not seen and not moving:
        say("the scene has no mesh files")
    tree, settings = scene.to_dict(), []
    for place, line, path in places:
        if path in changes:
            where = f", line {line}" if line else ""
            value = json.dumps(changes[path].as_posix(), ensure_ascii=False)
            say(f"{file}{where}: {place} = {value}")
            settings.append(f"{_key(place, tree)}={value}")
    say()
    return settings


def _words(words: dict[str, tuple[str, str, str]], counts: dict[str, int]) -> str:
    parts = []
    for key, (one, many, what) in words.items():
        if counts[key]:
            parts.append(f"{counts[key]} {one if counts[key] == 1 else many} {what}")
    return ", ".join(parts)


def _key(place: str, tree: dict[str, Any]) -> str:
    """The path of an error, `net "n".mesh.path`, as a key of a setting: `net.0.mesh.path`."""
    kind, name, rest = re.fullmatch(r'(\w+) "(.*)"(\..*)', place, re.S).groups()  # type: ignore[union-attr]
    index = next(i for i, thing in enumerate(tree[kind]) if thing["name"] == name)
    return f"{kind}.{index}" + re.sub(r"\[(\d+)\]", r".\1", rest)
