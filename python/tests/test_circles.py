"""No circles of imports between the modules of a package."""

import ast
from pathlib import Path

import pytest

import tumble

ROOT = Path(tumble.__file__).parent
PACKAGES = sorted(path.parent for path in ROOT.rglob("__init__.py"))

Graph = dict[str, set[str]]


def imports(tree: ast.AST) -> set[str]:
    """Every name that is imported anywhere, also inside functions and under TYPE_CHECKING: both would hide a circle."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative imports are not followed here"
            found |= {f"{node.module}.{name.name}" for name in node.names}
    return found


def graph(package: Path) -> Graph:
    """The modules of a package, and those of them that each imports; a package inside it counts as one module."""
    prefix = ".".join(package.relative_to(ROOT.parent).parts) + "."
    files = [p for p in package.glob("*.py") if p.name != "__init__.py"]
    modules = {p.stem: [p] for p in files} | {
        p.parent.name: [*p.parent.rglob("*.py")] for p in package.glob("*/__init__.py")
    }
    found: Graph = {}
    for module, paths in modules.items():
        names = set().union(*(imports(ast.parse(p.read_text(encoding="utf-8"))) for p in paths))
        found[module] = {
            n.removeprefix(prefix).split(".")[0] for n in names if n.startswith(prefix)
        } & modules.keys() - {module}
    return found


def circle(modules: Graph) -> list[str]:
    """The modules on a circle or between two: what is left after those that import none of the rest, again and again, and
    those that none of the rest imports."""
    left = dict(modules)
    while ends := [m for m in left if not left[m] & left.keys() or not any(m in left[other] for other in left)]:
        left = {m: of for m, of in left.items() if m not in ends}
    return sorted(left)


@pytest.mark.parametrize("package", PACKAGES, ids=lambda p: p.name)
def test_modules_do_not_import_each_other(package: Path) -> None:
    assert not circle(graph(package))


def test_the_test_sees_what_it_forbids() -> None:
    assert graph(ROOT)["recorder"] >= {"reader", "folder"}
    hidden = "if TYPE_CHECKING:\n    import a.b\ndef f():\n    from a import c, d\n"
    assert imports(ast.parse(hidden)) == {"a.b", "a.c", "a.d"}
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"b", "d"}, "d": set()}) == ["b", "c"]
    assert circle({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == []
