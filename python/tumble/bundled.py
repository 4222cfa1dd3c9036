"""The scenes that come with tumble, by name."""

import difflib
import os
from collections.abc import Iterable
from pathlib import Path

SCENES = Path(__file__).resolve().parent / "scenes"
"""The bundled scenes, ROW/NAME.toml."""


def shipped() -> dict[str, Path]:
    """The bundled scenes, by `row/name`."""
    files = sorted(SCENES.glob("*/*.toml"))
    return {f"{f.parent.name}/{f.stem}": f for f in files}


def near(name: str, known: Iterable[str]) -> str:
    """`; did you mean a, b?`, or nothing."""
    known = list(known)
    short = {k.rsplit("/", 1)[-1]: k for k in reversed(known)}
    found = difflib.get_close_matches(name, known, 3, 0.6) or [
        short[s] for s in difflib.get_close_matches(name.rsplit("/", 1)[-1], list(short), 3, 0.6)
    ]
    return f"; did you mean {' or '.join(found)}?" if found else ""


def unknown(what: str, name: object, known: Iterable[str]) -> str:
    """What is wrong with a name that is none of those known: `no column 'sped'; did you mean speed?`, or all of them."""
    known = list(known)
    return f"no {what} {name!r}{near(str(name), known) or '; there are ' + (', '.join(known) or 'none')}"


def scene_file(name: str | os.PathLike[str]) -> Path:
    """The file of a scene: a path, or the name of one that is bundled, with or without its row. Raises SceneError, with similar
    names, if there is none."""
    from tumble._engine import SceneError

    path, argument = Path(name), os.fspath(name)
    if path.is_file():
        return path
    known = shipped()
    stem = argument.removesuffix(".toml")
    if stem in known:
        return known[stem]
    matches = [k for k in known if k.endswith(f"/{stem}")]
    if len(matches) == 1:
        return known[matches[0]]
    if matches:
        raise _wrong(SceneError, f"{argument}: more than one scene has this name: {', '.join(matches)}")
    if path.is_dir():
        raise _wrong(SceneError, f"{argument}: is a folder, expected a scene file")
    if path.suffix in (".toml", ".json"):
        beside = [str(f) for ending in ("toml", "json") for f in path.parent.glob(f"*.{ending}")]
        hint = near(argument, beside) or near(stem, known)
        raise _wrong(SceneError, f"{argument}: there is no such file{hint}")
    hint = near(stem, known) or "; `tumble scenes` lists those that come with tumble"
    raise _wrong(SceneError, f"{argument}: there is no such file or scene{hint}")


def _wrong(kind: type[Exception], text: str) -> Exception:
    error = kind(text)
    error.issues = [{"path": "", "line": None, "message": text}]  # type: ignore[attr-defined]
    return error
