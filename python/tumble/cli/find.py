"""Resolution of arguments: a scene by file or by name, a run by folder or by name, overrides."""

import difflib
import shlex
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from tumble import Run, Scene

SCENES = Path(__file__).resolve().parent.parent / "scenes"
"""The bundled scenes, ROW/NAME.toml."""

OUT = Path("out")

SceneArgument = Annotated[
    str, typer.Argument(metavar="SCENE", help="A .toml or .json file, or the name of a scene from `tumble scenes`.")
]
RunArgument = Annotated[
    str, typer.Argument(metavar="RUN", help="A folder that `tumble run` wrote, or its name in out/.")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Override a key of the scene, e.g. time.fps=30 or sheet.flag.size='[1, 2]'."
    ),
]


def shipped() -> dict[str, Path]:
    """The bundled scenes, by `row/name`."""
    files = sorted(SCENES.glob("*/*.toml"))
    return {f"{f.parent.name}/{f.stem}": f for f in files}


def title(file: Path) -> str:
    """The title of a scene file, empty if it has none or cannot be read."""
    try:
        return str(tomllib.loads(file.read_text(encoding="utf-8")).get("title", ""))
    except (OSError, ValueError):
        return ""


def near(name: str, known: Sequence[str]) -> str:
    """`; did you mean a, b?`, or nothing."""
    short = {k.rsplit("/", 1)[-1]: k for k in reversed(known)}
    found = difflib.get_close_matches(name, known, 3, 0.6) or [
        short[s] for s in difflib.get_close_matches(name.rsplit("/", 1)[-1], list(short), 3, 0.6)
    ]
    return f"; did you mean {' or '.join(found)}?" if found else ""


def scene_file(argument: str) -> Path:
    """The file of a scene argument. Raises SceneError, with similar names, if there is none."""
    from tumble import SceneError

    path = Path(argument)
    if path.is_file():
        return path
    known = shipped()
    name = argument.removesuffix(".toml")
    if name in known:
        return known[name]
    matches = [k for k in known if k.endswith(f"/{name}")]
    if len(matches) == 1:
        return known[matches[0]]
    if matches:
        raise SceneError(f"{argument}: more than one scene has this name: {', '.join(matches)}")
    if path.is_dir():
        raise SceneError(f"{argument}: is a folder, expected a scene file")
    if path.suffix in (".toml", ".json"):
        beside = [str(f) for ending in ("toml", "json") for f in path.parent.glob(f"*.{ending}")]
        hint = near(argument, beside) or near(name, list(known))
        raise SceneError(f"{argument}: there is no such file{hint}")
    hint = near(name, list(known)) or "; `tumble scenes` lists those that come with tumble"
    raise SceneError(f"{argument}: there is no such file or scene{hint}")


def scene(argument: str, overrides: Sequence[str] | None) -> "Scene":
    """The checked scene. Its errors name the file."""
    from tumble import Scene

    file = scene_file(argument)
    with naming(file):
        return Scene.load(file, list(overrides or ()))


@contextmanager
def naming(file: Path, besides: Path | None = None, scene: "Scene | None" = None) -> Iterator[None]:
    """Prefixes errors of the scene, including those found when it is built, with the name of its file. Errors of the folder
    `besides` are not the scene's. If the scene needs too much memory, the emitter that needs most is named."""
    from tumble import SceneError

    try:
        yield
    except SceneError as error:
        if any(issue["path"] == str(besides) for issue in getattr(error, "issues", ())):
            raise
        lines = str(error).splitlines()
        if scene is not None and any(issue["path"] == "world.memory_limit" for issue in getattr(error, "issues", ())):
            from tumble.emitters import largest

            lines += largest(scene.to_dict())
        text = f"{file}: {lines[0]}" if len(lines) == 1 else "\n  ".join([f"{file}:", *lines])
        named = SceneError(text)
        named.issues = getattr(error, "issues", [])
        raise named from None


def run(argument: str) -> "Run":
    """The run of a folder, or of a name in out/; it has at least one frame."""
    from tumble import Run, SceneError

    path = Path(argument)
    if not (path / "run.json").is_file() and (OUT / argument / "run.json").is_file():
        path = OUT / argument
    if not path.exists():
        known = sorted(f.parent.name for f in OUT.glob("*/run.json"))
        hint = near(path.name, known)
        if known and not hint:
            hint = f"; runs in {OUT}: {', '.join(known[:8])}"
        raise SceneError(f"{argument}: there is no such run{hint or '; `tumble run SCENE` makes one'}")
    found = Run(path)
    if found.n_frames == 0:
        raise SceneError(f"{path}: not even the first frame was written; run the scene again with --resume")
    return found


def command(verb: str, argument: str, overrides: Sequence[str] | None = None, *more: str) -> str:
    """A command line to copy."""
    return " ".join([shlex.join(["tumble", verb, argument]), *settings(overrides or ()), *map(shlex.quote, more)])


def without(overrides: Sequence[str], changes: Sequence[str], systems: Sequence[str]) -> list[str]:
    """The overrides that the changes do not replace; a system is given by its index or by its name in `systems`."""

    def key(override: str) -> str:
        words = override.split("=", 1)[0].strip().split(".")
        if words[0] == "system" and len(words) > 1 and words[1] in systems:
            words[1] = str(systems.index(words[1]))
        return ".".join(words)

    replaced = {key(change) for change in changes}
    return [override for override in overrides if key(override) not in replaced]


def settings(overrides: Sequence[str]) -> list[str]:
    """Overrides as options to copy."""
    return [f"--set {shlex.quote(override)}" for override in overrides]
