"""Every Python snippet of the README and of docs/*.md runs."""

import ast
import inspect
import re
from pathlib import Path

import pytest

import tumble

ROOT = Path(__file__).parents[2]
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


def test_the_scene_page_is_up_to_date() -> None:
    from tumble.words import page

    assert (ROOT / "docs" / "scene.md").read_text(encoding="utf-8") == page(), "python -m tumble.words > docs/scene.md"


def test_the_engine_says_what_its_stub_says() -> None:
    stub = ast.parse((ROOT / "python" / "tumble" / "_engine.pyi").read_text(encoding="utf-8"))
    described = 0
    for kind in (n for n in stub.body if isinstance(n, ast.ClassDef) and n.name in ("Scene", "World")):
        for member in (n for n in kind.body if isinstance(n, ast.FunctionDef) and n.name != "__init__"):
            wanted = ast.get_docstring(member)
            found = inspect.getdoc(getattr(getattr(tumble, kind.name), member.name))
            assert (found or None) == wanted, f"{kind.name}.{member.name}"
            described += wanted is not None
    assert described > 20
