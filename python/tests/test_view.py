"""`tumble view`: what is served, and what is not."""

import base64
import json
import random
import signal
import socket
import subprocess
import sys
import threading
import urllib.error
import urllib.request
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from conftest import Answer
from runs import Tree

from tumble import Scene, __version__, bundled
from tumble.cli import view

Command = Callable[..., Answer]
SceneFile = Callable[..., Path]


@pytest.fixture
def built(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "web"
    (folder / "assets").mkdir(parents=True)
    (folder / "v" / __version__).mkdir(parents=True)
    for place in (folder, folder / "v" / __version__):
        (place / "index.html").write_text("<title>tumble</title>")
    (folder / "404.html").write_text("<title>lost</title>")
    (folder / "assets" / "a.wasm").write_bytes(b"\0asm")
    (folder / "assets" / "a.js").write_text("export {}")
    (tmp_path / "secret").write_text("secret")
    monkeypatch.setattr(view, "BUILT", folder)
    return folder


@pytest.fixture
def site(built: Path, tmp_path: Path) -> Iterator[str]:
    mesh = tmp_path / "my mesh (1).ply"
    mesh.write_text("ply")
    with view.server(0, {"../my mesh (1).ply": mesh}) as served:
        thread = threading.Thread(target=served.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{served.server_port}"
        served.shutdown()
        thread.join()


def get(url: str) -> tuple[int, str, bytes]:
    try:
        with urllib.request.urlopen(url, timeout=10) as answer:
            return answer.status, answer.headers["Content-Type"], answer.read()
    except urllib.error.HTTPError as error:
        return error.code, error.headers["Content-Type"], error.read()


def test_the_laboratory_is_served_with_its_types(site: str) -> None:
    assert get(f"{site}/?view")[1:] == ("text/html", b"<title>tumble</title>")
    assert get(f"{site}/v/{__version__}/?view")[1:] == ("text/html", b"<title>tumble</title>")
    assert get(f"{site}/assets/a.wasm")[1:] == ("application/wasm", b"\0asm")
    assert get(f"{site}/assets/a.js")[1] == "text/javascript"


def test_the_meshes_of_the_scene_are_served_and_nothing_else(site: str) -> None:
    # encodeURIComponent leaves the parentheses as they are.
    assert get(f"{site}/view/..%2Fmy%20mesh%20(1).ply")[2] == b"ply"
    for path in ("view/..%2Fsecret", "view/other.ply", "..%2Fsecret", "%2e%2e/secret", "assets/", "view/"):
        assert get(f"{site}/{path}")[0] == 404, path


def test_other_names_and_odd_paths_are_refused(site: str, capfd: pytest.CaptureFixture[str]) -> None:
    def asked(host: str) -> int:
        request = urllib.request.Request(f"{site}/view/..%2Fmy%20mesh%20(1).ply", headers={"Host": host})
        try:
            with urllib.request.urlopen(request, timeout=10) as answer:
                return int(answer.status)
        except urllib.error.HTTPError as error:
            return error.code

    port = site.rsplit(":", 1)[1]
    assert [asked(f"{name}:{port}") for name in ("127.0.0.1", "localhost", "elsewhere.example")] == [200, 200, 421]
    assert get(f"{site}/a%00b")[0] == get(f"{site}/index.html%00.js")[0] == 404
    assert "Traceback" not in capfd.readouterr().err


def test_a_scene_that_ships_is_opened_by_name(built: Path) -> None:
    fragment, meshes = view.address("sheet-on-bunny", None)
    assert fragment == "scene/drape/sheet-on-bunny"
    assert [path.resolve() for path in meshes.values()] == [bundled.SCENES / "assets" / "bunny.ply"]


def test_any_other_scene_is_in_the_link(built: Path, spring: Tree, scene_file: SceneFile) -> None:
    file = scene_file(spring)
    fragment, meshes = view.address(str(file), ["time.fps=30"])
    assert fragment.startswith("s/") and meshes == {}
    packed = fragment.removeprefix("s/")
    tree = json.loads(zlib.decompress(base64.urlsafe_b64decode(packed + "=" * (-len(packed) % 4)), wbits=-15))
    resolved = tree.pop("scene")
    assert (tree.pop("text"), tree.pop("overrides")) == (file.read_text(), ["time.fps=30"])
    assert tree == {"tumble": __version__, "changes": [], "frame": 0, "hash": ""}
    # Every default is written out, so that no later version takes another.
    assert resolved == Scene.load(file, ["time.fps=30"]).to_dict()
    assert resolved["time"]["fps"] == 30 and resolved["seed"] == 0 and "gravity" in resolved["world"]
    assert view.address("rope", ["time.fps=30"])[0].startswith("s/")


def test_wrong_scenes_are_told_before_anything_is_served(
    built: Path, spring: Tree, scene_file: SceneFile, tumble: Command
) -> None:
    answer = tumble("view", scene_file(spring | {"time": {"fps": -1}}), "--no-open")
    assert answer.code == 2 and "expected > 0" in answer.err
    long = scene_file(spring)
    long.write_text(long.read_text() + " " * view.LARGEST)
    answer = tumble("view", long, "--no-open")
    assert answer.code == 2 and "up to 2 MB" in answer.err
    numbers = random.Random(1)
    points = [[numbers.random() for _ in range(3)] for _ in range(8000)]
    many = scene_file({"version": 1, "particles": [{"name": "p", "position": points}]})
    answer = tumble("view", many, "--no-open")
    assert answer.code == 2 and "too large for an address" in answer.err and "drop the file" in answer.err


def test_versions_that_are_not_there_are_told_by_a_page(site: str) -> None:
    assert get(f"{site}/v/0.0.1/") == (404, "text/html; charset=utf-8", b"<title>lost</title>")
    assert get(f"{site}/v/{__version__}/assets/a.js") == (404, "text/html; charset=utf-8", b"<title>lost</title>")


def test_what_is_not_built_is_said(built: Path, tumble: Command) -> None:
    (built / "v" / __version__ / "index.html").unlink()
    answer = tumble("view", "--no-open")
    assert answer.code == 1 and "make web" in answer.err


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT to a child")
def test_ctrl_c_ends_it(built: Path) -> None:
    # A job in the background is born deaf to Ctrl-C.
    listen = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    code = f"{listen}; from pathlib import Path; from tumble.cli import main, view; view.BUILT = Path({str(built)!r}); main()"
    command = [sys.executable, "-c", code, "view", "rope", "--no-open"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        url = child.stdout.readline()
        assert url.startswith("http://127.0.0.1:") and url.endswith(f"/v/{__version__}/?view#/scene/structures/rope\n")
        assert get(url.split("#")[0])[0] == 200
        child.send_signal(signal.SIGINT)
        try:
            _, errors = child.communicate(timeout=20)
        finally:
            child.kill()
    assert child.returncode == 0 and errors == ""


def raw(site: str, request: str) -> tuple[int, str]:
    """The answer to words that no browser would send."""
    host, port = site.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port)), timeout=10) as line:
        line.sendall(request.encode())
        line.shutdown(socket.SHUT_WR)
        answer = b"".join(iter(lambda: line.recv(65536), b"")).decode()
    return int(answer.split()[1]), answer


def test_only_this_machine_is_listened_to(built: Path) -> None:
    with view.server(0, {}) as served:
        assert served.server_address[0] == "127.0.0.1"
        assert served.socket.getsockname()[0] == "127.0.0.1"


def test_other_pages_cannot_read_it(site: str) -> None:
    def asked(path: str = "/assets/a.js", **headers: str) -> int:
        lines = "".join(f"{name.replace('_', '-')}: {value}\r\n" for name, value in headers.items())
        return raw(site, f"GET {path} HTTP/1.1\r\nHost: {site.removeprefix('http://')}\r\n{lines}\r\n")[0]

    mesh = "/view/..%2Fmy%20mesh%20(1).ply"
    own = {"Origin": site, "Sec_Fetch_Site": "same-origin", "Sec_Fetch_Mode": "cors"}
    for path in ("/", "/assets/a.js", mesh):
        assert asked(path) == asked(path, **own) == 200
        # Typed in, or opened by the command; or a link on another page.
        assert asked(path, Sec_Fetch_Site="none", Sec_Fetch_Mode="navigate") == 200
        assert asked(path, Sec_Fetch_Site="cross-site", Sec_Fetch_Mode="navigate") == 200
        for origin in (
            "https://elsewhere.example",
            "null",
            "http://127.0.0.1:1",
            site.replace("http", "https"),
            f"{site}.example",
        ):
            assert asked(path, Origin=origin) == 403, origin
        for where in ("cross-site", "same-site"):
            assert asked(path, Sec_Fetch_Site=where, Sec_Fetch_Mode="no-cors") == 403
    for host in ("127.0.0.1.example", "elsewhere.example:127.0.0.1", "127.0.0.1:80:80", "[::1]", ""):
        assert raw(site, f"GET / HTTP/1.1\r\nHost: {host}\r\n\r\n")[0] == 421, host
    head = raw(site, f"GET / HTTP/1.1\r\nHost: {site.removeprefix('http://')}\r\n\r\n")[1]
    assert "Cross-Origin-Resource-Policy: same-origin" in head and "frame-ancestors 'none'" in head
    assert "Access-Control" not in head


def test_no_path_leads_out_of_its_folders(site: str, tmp_path: Path, built: Path) -> None:
    (tmp_path / "web-beside").mkdir()
    (tmp_path / "web-beside" / "secret").write_text("secret")
    host = site.removeprefix("http://")
    paths = [
        "/../secret",
        "//../secret",
        "/assets/../../secret",
        "/./../secret",
        "/..%5csecret",
        "/%2e%2e/%2e%2e/secret",
    ]
    paths += [
        f"/{tmp_path}/secret",
        f"//{tmp_path}/secret",
        f"/view/{tmp_path}/secret",
        "/view/../../secret",
        "/view/..%2f..%2fsecret",
    ]
    paths += [
        "/../web-beside/secret",
        "/view/..%2Fmy%20mesh%20(1).ply/../secret",
        f"file://{tmp_path}/secret",
        f"{site}/../secret",
    ]
    paths += [
        "/view/..%252Fsecret",
        "/..;/secret",
        "/%c0%ae%c0%ae/secret",
        "/assets/a.js/../../../secret",
        "/view",
        "/" + "../" * 40 + "etc/passwd",
    ]
    for path in paths:
        code, answer = raw(site, f"GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n")
        assert code == 404 and "secret\n" not in answer + "\n" and "root:" not in answer, path
    for method in ("PUT", "POST", "DELETE", "OPTIONS", "PATCH", "TRACE", "CONNECT"):
        code, _ = raw(site, f"{method} /assets/a.js HTTP/1.1\r\nHost: {host}\r\nContent-Length: 1\r\n\r\nx")
        assert code == 501, method
    assert (built / "assets" / "a.js").read_text() == "export {}"
