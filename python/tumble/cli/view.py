"""`tumble view`: the browser laboratory, served from this machine, with a scene open."""

import base64
import json
import mimetypes
import zlib
from collections.abc import Mapping
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import quote, unquote, urlsplit

import typer

from tumble.bundled import scene_file, shipped
from tumble.cli import find
from tumble.cli.console import say

if TYPE_CHECKING:
    from tumble import Scene

BUILT = Path(__file__).resolve().parent.parent / "web"
"""Output folder of `make web`."""

LARGEST = 2_000_000
"""Limit of the unpacked bytes of a link; web/src/share.ts has the same."""

LONGEST = 100_000
"""Limit of the characters of an address as a program argument."""

_TYPES = {
    ".js": "text/javascript",
    ".wasm": "application/wasm",
    ".css": "text/css",
    ".webp": "image/webp",
    ".webmanifest": "application/manifest+json",
}


def view(
    scene: Annotated[
        str | None,
        typer.Argument(
            metavar="[SCENE]",
            help="A .toml or .json file, or the name of a scene from `tumble scenes`. Default: the gallery.",
        ),
    ] = None,
    set: find.SetOption = None,
    port: Annotated[int, typer.Option(min=0, max=65535, metavar="N", help="Port; 0 takes any free one.")] = 0,
    open: Annotated[bool, typer.Option("--open/--no-open", help="Open a browser.")] = True,
) -> None:
    """Run a scene in a browser with live controls.

    Nothing leaves this machine. Ctrl-C stops the server.

    \b
    Examples:
      tumble view rope
      tumble view my.toml --set time.fps=30
    """
    from tumble import TumbleError, __version__

    if not (BUILT / "v" / __version__ / "index.html").is_file():
        raise TumbleError(
            f"{BUILT} does not contain the browser laboratory of tumble {__version__}; `make web` builds it"
        )
    fragment, meshes = ("", {}) if scene is None else address(scene, set)
    with server(port, meshes) as served:
        url = f"http://127.0.0.1:{served.server_port}/v/{__version__}/?view#/{fragment}"
        say(f"{url}\nCtrl-C ends it")
        if open:
            import webbrowser

            webbrowser.open(url)
        try:
            served.serve_forever()
        except KeyboardInterrupt:
            say()


def address(argument: str, overrides: list[str] | None) -> tuple[str, dict[str, Path]]:
    """The part of the address after `#/` that opens a scene, and the files of its meshes by path."""
    from tumble import SceneError

    file = scene_file(argument)
    checked = find.scene(argument, overrides)
    meshes = {path: Path(checked.folder) / path for path in mesh_paths(checked)}
    bundled = {path: name for name, path in shipped().items()}
    if file in bundled and not overrides:
        return f"scene/{bundled[file]}", meshes
    text = file.read_text(encoding="utf-8")
    tree = shared(text, overrides or [], checked.to_dict())
    if len(tree) > LARGEST:
        raise SceneError(
            f"{file}: with all defaults filled in, the scene has {len(tree) / 1e6:.1f} MB; "
            f"the browser accepts up to {LARGEST // 1_000_000} MB"
        )
    packed = link(tree)
    if len(packed) > LONGEST:
        raise SceneError(
            f"{file}: the scene is too large for an address, {len(packed)} characters of {LONGEST}; "
            "open the gallery with `tumble view` and drop the file on it"
        )
    return f"s/{packed}", meshes


def shared(text: str, overrides: list[str], resolved: dict[str, Any]) -> bytes:
    """A scene as web/src/share.ts reads it: its text and its resolved form."""
    from tumble import __version__

    tree: dict[str, Any] = {"tumble": __version__, "text": text, "overrides": overrides, "scene": resolved}
    tree |= {"changes": [], "frame": 0, "hash": ""}
    return json.dumps(tree, ensure_ascii=False, separators=(",", ":")).encode()


def link(tree: bytes) -> str:
    """The part of the address after `#/s/`."""
    packer = zlib.compressobj(9, wbits=-15)
    return base64.urlsafe_b64encode(packer.compress(tree) + packer.flush()).decode().rstrip("=")


def mesh_paths(scene: "Scene") -> list[str]:
    """Paths of the mesh files of a scene."""

    def walk(node: Any) -> list[str]:
        if isinstance(node, dict):
            own = [node["path"]] if isinstance(node.get("path"), str) and "hash" in node else []
            return own + [path for below in node.values() for path in walk(below)]
        return [path for below in node for path in walk(below)] if isinstance(node, list) else []

    return list(dict.fromkeys(walk(scene.to_dict())))


def server(port: int, meshes: Mapping[str, Path]) -> ThreadingHTTPServer:
    """Serves the laboratory, and the meshes at view/PATH, to this machine only."""
    files = {f"/view/{quote(path, safe='')}": file for path, file in meshes.items()}

    class Handler(SimpleHTTPRequestHandler):
        def __init__(self, *arguments: Any, **options: Any) -> None:
            self.extensions_map = {**mimetypes.types_map, **_TYPES, "": "application/octet-stream"}
            super().__init__(*arguments, directory=str(BUILT), **options)

        def send_head(self) -> Any:
            # A page elsewhere whose name is made to lead here must not read the scene's files.
            host = self.headers.get("Host", "127.0.0.1")
            if host.rsplit(":", 1)[0] not in ("127.0.0.1", "localhost"):
                return self.send_error(421)
            # Nor any other page, be it on this machine: it may only lead here.
            if self.headers.get("Origin", f"http://{host}") != f"http://{host}":
                return self.send_error(403)
            site, mode = (self.headers.get(f"Sec-Fetch-{name}") for name in ("Site", "Mode"))
            if site in ("cross-site", "same-site") and mode != "navigate":
                return self.send_error(403)
            if "\0" in unquote(self.path):
                return self.send_error(404)
            return super().send_head()

        def translate_path(self, path: str) -> str:
            own = urlsplit(path).path
            if own.startswith("/view/"):
                found = files.get(f"/view/{quote(unquote(own.removeprefix('/view/')), safe='')}")
                return str(found) if found else str(BUILT / "view")
            return super().translate_path(path)

        def end_headers(self) -> None:
            self.send_header("Cache-Control", "no-cache")
            self.send_header("X-Content-Type-Options", "nosniff")
            self.send_header("Cross-Origin-Resource-Policy", "same-origin")
            self.send_header("Content-Security-Policy", "frame-ancestors 'none'")
            super().end_headers()

        def list_directory(self, path: Any) -> None:
            self.send_error(404)

        def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
            lost = BUILT / "404.html"
            if code != 404 or not lost.is_file():
                return super().send_error(code, message, explain)
            # Links to other versions lead here; the page says which, and what to do.
            body = lost.read_bytes()
            self.send_response(404)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            if self.command != "HEAD":
                self.wfile.write(body)

        def log_message(self, format: str, *arguments: Any) -> None:
            pass

    return ThreadingHTTPServer(("127.0.0.1", port), Handler)
