"""What USD files hold beside meshes, for `tumble check`: motion (`--bake`) and cameras (`--camera`)."""

import json
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tumble.cli.console import counted, say, warn

if TYPE_CHECKING:
    from tumble import Scene

_ENDING = ".baked"


def bake(file: Path, scene: "Scene", force: bool, mended: bool) -> tuple[Path, set[str]]:
    """Writes the motion of the USD files that are colliders as sequences of meshes beside them, and a scene beside the
    scene in which they move; returns its path, or that of the scene where nothing moves,
    and the new files as they stand in it, `mended` all alike. Raises SceneError."""
    from tumble import SceneError, usd
    from tumble.toml import toml

    tree = _tree(file)
    resolved = scene.to_dict()
    span = resolved["time"]["frames"] / resolved["time"]["fps"]
    new = file.with_name(f"{file.stem}{_ENDING}{file.suffix}")
    written: dict[str, list[dict[str, Any]]] = {}
    for collider in tree.get("collider", ()):
        words = collider["shape"].get("mesh")
        if words is None or not usd.is_usd(words["path"]) or not usd.moves(old := Path(scene.folder) / words["path"]):
            continue
        if new.exists() and not force:
            raise SceneError(f"{new}: exists already; use it, delete it, or overwrite it with --force")
        if words["path"] not in written:
            folder = old.with_name(old.stem + _ENDING)
            try:
                frames = usd.bake(old, folder, span, mended)
            except ValueError as error:
                raise SceneError(f"{old}: {error}") from None
            say(f"{old}: {counted(len(frames), 'file')} over {frames[-1][0]:.6g} s written to {folder}")
            base = Path(scene.folder)
            written[words["path"]] = [
                {"time": time, "path": (f.relative_to(base) if f.is_relative_to(base) else f).as_posix()}
                for time, f in frames
            ]
        kept = {key: words[key] for key in ("scale", "rotate", "translate", "shell") if key in words}
        collider["shape"] = {"animated_mesh": {"frames": written[words["path"]], **kept}}
    if not written:
        say("no collider of the scene is a USD file that moves")
        return file, set()
    text = json.dumps(tree, indent=1, ensure_ascii=False) if file.suffix == ".json" else toml(tree)
    new.write_text(text, encoding="utf-8")
    say(f"{new}: the scene in which they move")
    say()
    return new, {frame["path"] for frames in written.values() for frame in frames}


def has_frames(scene: "Scene") -> bool:
    """Whether a collider of a scene moves as its USD file says."""
    from tumble.usd.frames import parted

    return any(parted(Path(scene.folder) / path) for _, _, path in scene.mesh_files)


def look_with(camera: str) -> list[str]:
    """Prints the lines of a scene for a camera, FILE or FILE:PRIM, and returns them as settings. Raises SceneError."""
    from tumble import SceneError, usd
    from tumble.toml import toml

    try:
        words, doubts = usd.camera(camera)
    except ValueError as error:
        raise SceneError(f"{camera}: {error}") from None
    for code, message in doubts:
        warn(code, f"{camera}: {message}")
    say(toml({"camera": words}).strip() + "\n")
    return [f"camera.{key}={json.dumps(value)}" for key, value in words.items()]


def _tree(file: Path) -> dict[str, Any]:
    """The words of a scene file, which has been read before."""
    text = file.read_text(encoding="utf-8-sig")
    tree: dict[str, Any] = json.loads(text) if file.suffix == ".json" else tomllib.loads(text)
    return tree
