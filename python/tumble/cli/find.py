"""Resolution of arguments: a scene by file or by name, a run by folder or by name, overrides."""

import shlex
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tumble.bundled import near, scene_file
from tumble.cli.console import say
from tumble.cli.verbs import told

if TYPE_CHECKING:
    from tumble import Run, Scene

OUT = Path("out")

FRAMES = 100_000_000
"""The most frames that a scene may have."""

FramesOption = Annotated[
    int | None,
    typer.Option(min=1, max=FRAMES, metavar="N", help="Frames to simulate, instead of the scene's."),
]
JsonOption = Annotated[
    bool, typer.Option("--json", help="Print the result as JSON on stdout; messages stay on stderr.")
]

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
OnOption = Annotated[
    str, typer.Option(metavar="ENGINE", help="cores, dask, or the address of a Dask scheduler: tcp://HOST:PORT.")
]
WorkersOption = Annotated[
    int | None, typer.Option(min=1, metavar="N", help="Runs at a time.", show_default="as many as cores")
]


def title(file: Path) -> str:
    """The title of a scene file, empty if it has none or cannot be read."""
    try:
        return str(tomllib.loads(file.read_text(encoding="utf-8")).get("title", ""))
    except (OSError, ValueError):
        return ""


def scene(argument: str, overrides: Sequence[str] | None) -> "Scene":
    """The checked scene. Its errors name the file."""
    from tumble import Scene

    file = scene_file(argument)
    with naming(file):
        return Scene.load(file, list(overrides or ()))


@contextmanager
def told_as_json(asked: bool) -> Iterator[None]:
    """If asked, prints errors as JSON, too: {"ok": false, "errors": [{"path", "line", "message"}]}."""
    from tumble import StepError, TumbleError

    try:
        yield
    except TumbleError as error:
        # A run that broke is told as a run.
        if asked and not isinstance(error, StepError):
            issues = getattr(error, "issues", None) or [{"path": "", "line": None, "message": str(error)}]
            say_json({"ok": False, "errors": issues})
        raise


def say_json(tree: Mapping[str, Any]) -> None:
    """A result for programs, on stdout; infinities and nan are "inf", "-inf" and "nan"."""
    import json

    from tumble.folder import plain

    say(json.dumps(plain(tree), indent=1, allow_nan=False))


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
        lines = told(error).splitlines()
        if scene is not None and any(issue["path"] == "world.memory_limit" for issue in getattr(error, "issues", ())):
            from tumble.emitters import largest

            lines += largest(scene.to_dict())
        # What was overridden is not the file's fault.
        typed = [line for line in lines if line.startswith("--set ")]
        lines = [line for line in lines if line not in typed]
        if lines:
            lines = [f"{file}: {lines[0]}"] if len(lines) == 1 else [f"{file}:", *(f"  {line}" for line in lines)]
        named = SceneError("\n".join([*lines, *typed]))
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
