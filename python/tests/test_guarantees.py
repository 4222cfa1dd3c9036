"""docs/guarantees.md: every promise names tests that are there, and a command that can be given."""

import ast
import re
import shlex
from pathlib import Path

import pytest
import typer.main

from tumble import bundled
from tumble.cli import application

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "guarantees.md"
LINES = PAGE.read_text(encoding="utf-8").splitlines()


def promises() -> dict[str, list[str]]:
    """The bold beginnings of paragraphs, with the items of the list below each."""
    found: dict[str, list[str]] = {}
    for line in "\n".join(LINES).split("\n\n"):
        if bold := re.match(r"\*\*(.+?)\*\*", line, re.S):
            found[" ".join(bold[1].split())] = []
        elif line.startswith("- ") and found and "::" in line:
            next(reversed(found.values())).extend(item.removeprefix("- ") for item in line.splitlines())
    return found


PROMISES = promises()
TESTS = sorted({item for items in PROMISES.values() for item in items if not item.startswith("show it")})
COMMANDS = sorted(
    {item.removeprefix("show it: ") for items in PROMISES.values() for item in items if item.startswith("show it")}
)


def there(test: str) -> bool:
    """Whether a test `file::name` exists, and is one."""
    place, _, name = test.partition("::")
    file = ROOT / place
    if not file.is_file() or not name:
        return False
    text = file.read_text(encoding="utf-8")
    match file.suffix:
        case ".py":
            functions = [f for f in ast.parse(text).body if isinstance(f, ast.FunctionDef)]
            return name.startswith("test_") and name in [f.name for f in functions]
        case ".rs":
            return re.search(rf"#\[test\]\n(?:\s*#\[.*\]\n|\s*///.*\n)*\s*fn {re.escape(name)}\(", text) is not None
        case ".ts":
            return f'test("{name}"' in text or f'it("{name}"' in text
    return False


@pytest.mark.parametrize("test", TESTS)
def test_a_test_that_is_named_exists(test: str) -> None:
    assert re.fullmatch(r"`[^`]+`", test), "each in a line of its own"
    assert there(test.strip("`")), test


def test_what_is_not_there_would_be_missed() -> None:
    assert there("python/tests/test_guarantees.py::test_what_is_not_there_would_be_missed")
    for gone in (
        "python/tests/test_guarantees.py::test_gone",
        "python/tests/test_guarantees.py::there",
        "python/tests/gone.py::test_gone",
        "crates/tumble/tests/determinism.rs::gone",
        "crates/tumble/tests/determinism.rs::simulation",  # A helper.
        "crates/tumble/tests/determinism.rs",
        "web/tests/share.test.ts::gone",
    ):
        assert not there(gone), gone


def test_every_promise_names_tests_and_one_command() -> None:
    assert len(PROMISES) >= 17
    for promise, items in PROMISES.items():
        shown = [item for item in items if item.startswith("show it: ")]
        assert len(shown) == 1 and len(items) >= 2, promise


def unseen(items: list[str]) -> list[str]:
    """Tests in Python that stand above a command of pytest which does not run their file, or leaves them out as long ones."""
    command = next(item for item in items if item.startswith("show it: ")).removeprefix("show it: ").strip("`")
    words = shlex.split(command)
    if "pytest" not in words:
        return []
    tests = [
        item.strip("`").partition("::") for item in items if "::" in item and item.strip("`").startswith("python/")
    ]
    everything = "-m" in words[words.index("pytest") :]
    marked = {
        name
        for place, _, name in tests
        if re.search(rf"@pytest\.mark\.long\n(?:@.*\n)*def {name}\(", (ROOT / place).read_text())
    }
    return [name for place, _, name in tests if place not in words or (name in marked and not everything)]


def test_every_test_that_the_suite_leaves_out_is_named() -> None:
    """What only `make validate` runs holds a promise, too."""
    ignored = r"#\[ignore[^\n]*\]\n(?:\s*#\[.*\]\n)*\s*fn (\w+)\("
    marked = r"@pytest\.mark\.long\n(?:@[^\n]*\n|[ )][^\n]*\n)*def (\w+)\("
    left = [
        f"`{file.relative_to(ROOT).as_posix()}::{name}`"
        for pattern, files in ((ignored, "crates/**/*.rs"), (marked, "python/tests/*.py"))
        for file in sorted(ROOT.glob(files))
        for name in re.findall(pattern, file.read_text(encoding="utf-8"))
    ]
    assert len(left) > 25 and [test for test in left if test not in TESTS] == []


@pytest.mark.parametrize("promise", PROMISES)
def test_a_command_runs_the_tests_that_it_shows(promise: str) -> None:
    assert unseen(PROMISES[promise]) == []


def test_a_command_that_runs_something_else_would_be_missed() -> None:
    kills, soak = (
        "`python/tests/test_kills.py::test_200_killed_runs_go_on_to_the_same_bits`",
        "`python/tests/test_soak.py::test_x`",
    )
    pytest_kills = "show it: `.venv/bin/python -m pytest -s{} python/tests/test_kills.py`"
    assert unseen([kills, pytest_kills.format(' -m ""')]) == []
    assert unseen([kills, pytest_kills.format("")]) == ["test_200_killed_runs_go_on_to_the_same_bits"]
    assert unseen([kills, soak, pytest_kills.format(' -m ""')]) == ["test_x"]


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_can_be_given(command: str) -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    verbs = typer.main.get_command(application()).commands  # type: ignore[attr-defined]
    for words in map(shlex.split, re.fullmatch(r"`([^`]+)`", command)[1].split(" && ")):  # type: ignore[index]
        match words:
            case ["make", target]:
                assert re.search(rf"^{target}:", makefile, re.M)
            case ["tumble", verb, scene, *options]:
                known = {name for option in verbs[verb].params for name in option.opts}
                assert bundled.scene_file(scene).is_file()
                assert {word for word in options if word.startswith("-")} <= known
            case [".venv/bin/python", *rest]:
                files = [ROOT / word for word in rest if word.endswith(".py")]
                assert files and all(file.is_file() for file in files)
                scenes = [word for word in rest if "/" in word and not word.endswith(".py")]
                assert all(bundled.scene_file(scene).is_file() for scene in scenes)
            case ["cd", folder]:
                assert (ROOT / folder).is_dir()
            case ["node", "--import", "tsx", "--test", file]:
                assert (ROOT / "web" / file).is_file()
            case ["cargo", "test", "--release", "-p", crate, "--test", name]:
                assert (ROOT / "crates" / crate / "tests" / f"{name}.rs").is_file()
            case _:
                pytest.fail(f"nobody knows {words}")


def test_the_readme_leads_there() -> None:
    assert "(docs/guarantees.md)" in (ROOT / "README.md").read_text(encoding="utf-8")
