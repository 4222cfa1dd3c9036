"""Every Python snippet of the README and of docs/*.md runs."""

import ast
import doctest
import importlib
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import tumble

ROOT = Path(__file__).parents[2]
PACKAGE = Path(tumble.__file__).parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
SNIPPETS = [
    pytest.param(code, id=f"{page.name}-{i}")
    for page in PAGES
    for i, code in enumerate(re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.S | re.M))
]


@pytest.mark.parametrize("code", SNIPPETS)
def test_snippet(code: str) -> None:
    exec(compile(code, "snippet", "exec"), {"__name__": "snippet"})


def test_there_are_snippets() -> None:
    assert len(SNIPPETS) >= 7


MODULES = [
    f"tumble.{path.relative_to(PACKAGE).with_suffix('').as_posix().replace('/', '.')}".removesuffix(".__init__")
    for path in sorted(PACKAGE.rglob("*.py"))
    if path.name != "__main__.py" and ">>> " in path.read_text(encoding="utf-8")
]


@pytest.mark.parametrize("name", MODULES)
def test_examples_of_docstrings_run(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    found = doctest.testmod(importlib.import_module(name))
    assert found.attempted and not found.failed


def test_there_are_examples_where_help_begins() -> None:
    assert {"tumble", "tumble.fields", "tumble.slices"} <= set(MODULES)


TYPES = ("Array", "Columns", "Ledger", "Path", "Side", "StepReport", "Vectors")
"""Names of the stub that are for type checkers alone."""


def test_stubs_are_true(tmp_path: Path) -> None:
    allowed = tmp_path / "allowed.txt"
    allowed.write_text("\n".join(f"tumble._engine.{name}" for name in (*TYPES, "__all__")))
    words = ["--allowlist", str(allowed), "--ignore-disjoint-bases", "--mypy-config-file", str(ROOT / "pyproject.toml")]
    words.append("tumble._engine")
    found = subprocess.run([sys.executable, "-m", "mypy.stubtest", *words], capture_output=True, text=True, cwd=ROOT)
    assert found.returncode == 0, found.stdout + found.stderr


def test_the_scene_page_is_up_to_date() -> None:
    from tumble.words import page

    assert (ROOT / "docs" / "scene.md").read_text(encoding="utf-8") == page(), "python -m tumble.words > docs/scene.md"


def test_the_engine_says_what_its_stub_says() -> None:
    stub = ast.parse((ROOT / "python" / "tumble" / "_engine.pyi").read_text(encoding="utf-8"))
    described = 0
    for kind in (n for n in stub.body if isinstance(n, ast.ClassDef) and n.name in ("Scene", "World")):
        for member in (n for n in kind.body if isinstance(n, ast.FunctionDef) and not n.name.startswith("__")):
            wanted = ast.get_docstring(member)
            found = inspect.getdoc(getattr(getattr(tumble, kind.name), member.name))
            assert (found or None) == wanted, f"{kind.name}.{member.name}"
            described += wanted is not None
    assert described > 20
