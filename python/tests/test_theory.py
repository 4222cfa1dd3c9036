"""Do the code, the theory pages and the references agree?

A *definition* of an equation is its tag at the end of a line inside a code fence of a page in docs/theory. Every
other tag is a *citation*: in a comment of Rust, in a comment or string of Python, in the prose of any page of docs.
"""

import io
import re
import tokenize
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
THEORY = DOCS / "theory"

# One tag or several in one pair of parentheses: (springs.1), (elements.1, elements.2).
TAG = r"[a-z_]{3,}\.[1-9][0-9]*"
TAGS = re.compile(rf"\(({TAG}(?:,\s*{TAG})*)\)")
DEFINITION = re.compile(rf"\(({TAG})\)\s*$")
KEY = re.compile(r"\[([a-z]+[0-9]{4}[a-z]?)\]")
ENTRY = re.compile(r"^@[a-z]+\{([^,\s]+),", re.MULTILINE)
LINK = re.compile(r"\]\(([^()\s]+)\)")
IGNORED = {".git", ".venv", "node_modules", "target", "dist", "out", "__pycache__"}


def files(folder: Path, suffix: str) -> list[Path]:
    """Files of a kind below a folder, without what is built or installed there."""
    found = folder.rglob(f"*{suffix}")
    return sorted(p for p in found if not IGNORED.intersection(p.relative_to(ROOT).parts))


def rust_comments(text: str) -> str:
    """The comments of a Rust file."""
    return "\n".join(line.partition("//")[2] for line in text.splitlines())


def python_words(text: str) -> str:
    """The comments and strings of a Python file."""
    wanted = {tokenize.COMMENT, tokenize.STRING, getattr(tokenize, "FSTRING_MIDDLE", None)}
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    return "\n".join(token.string for token in tokens if token.type in wanted)


def fences(text: str) -> tuple[str, str]:
    """The lines of a page within code fences, and the others."""
    inside: list[str] = []
    outside: list[str] = []
    fenced = False
    for line in text.splitlines():
        if line.lstrip().startswith("```"):
            fenced = not fenced
        else:
            (inside if fenced else outside).append(line)
    return "\n".join(inside), "\n".join(outside)


def definitions() -> dict[str, list[str]]:
    """For every tag the pages that define it."""
    found = defaultdict(list)
    for page in files(THEORY, ".md"):
        formulas, _ = fences(page.read_text(encoding="utf-8"))
        for line in formulas.splitlines():
            if match := DEFINITION.search(line):
                found[match[1]].append(page.name)
    return dict(found)


def texts() -> dict[str, str]:
    """All that may cite: file name -> text."""
    out = {}
    for path in files(ROOT / "crates", ".rs"):
        out[path] = rust_comments(path.read_text(encoding="utf-8"))
    for path in files(ROOT / "python", ".py"):
        out[path] = python_words(path.read_text(encoding="utf-8"))
    for path in files(DOCS, ".md"):
        text = path.read_text(encoding="utf-8")
        if THEORY in path.parents:
            formulas, prose = fences(text)
            # A tag at the end of a formula line is a definition; any before it cites.
            cited = [DEFINITION.sub("", line) for line in formulas.splitlines()]
            text = prose + "\n" + "\n".join(cited)
        out[path] = text
    return {str(path.relative_to(ROOT)): text for path, text in out.items()}


def anchors(page: Path) -> set[str]:
    """The anchors that headings of a page get: lower case, no punctuation, dashes for spaces."""
    _, prose = fences(page.read_text(encoding="utf-8"))
    headings = re.findall(r"^#+ (.*)$", prose, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_every_equation_is_defined_once_on_the_page_of_its_name() -> None:
    found = definitions()
    assert len(found) > 100, "the test sees no equations"
    twice = {tag: pages for tag, pages in found.items() if len(pages) > 1}
    assert not twice, f"defined more than once: {twice}"
    astray = {tag: pages[0] for tag, pages in found.items() if pages[0] != tag.partition(".")[0] + ".md"}
    assert not astray, f"defined on another page: {astray}"
    numbers = defaultdict(set)
    for tag in found:
        page, _, number = tag.partition(".")
        numbers[page].add(int(number))
    gaps = {page: sorted(set(range(1, max(n) + 1)) - n) for page, n in numbers.items() if max(n) != len(n)}
    assert not gaps, f"numbers left out: {gaps}"


def test_every_cited_equation_is_defined() -> None:
    found, cited = definitions(), defaultdict(set)
    for name, text in texts().items():
        for match in TAGS.finditer(text):
            for tag in re.split(r",\s*", match[1]):
                cited[tag].add(name)
    sources = {Path(name).suffix for names in cited.values() for name in names}
    assert {".rs", ".md"} <= sources, "the test sees no citations"
    missing = {tag: sorted(names) for tag, names in cited.items() if tag not in found}
    assert not missing, f"cited but not defined: {missing}"


def test_every_cited_source_is_in_the_references() -> None:
    entries = ENTRY.findall((DOCS / "references.bib").read_text(encoding="utf-8"))
    assert len(entries) == len(set(entries)), "an entry is there twice"
    cited = defaultdict(set)
    for name, text in texts().items():
        for key in KEY.findall(text):
            cited[key].add(name)
    assert len(cited) > 10, "the test sees no citations"
    missing = {key: sorted(names) for key, names in cited.items() if key not in entries}
    assert not missing, f"cited but not in references.bib: {missing}"
    unused = sorted(set(entries) - set(cited))
    assert not unused, f"in references.bib but never cited: {unused}"


def test_every_reference_says_who_what_where_and_when() -> None:
    text = (DOCS / "references.bib").read_text(encoding="utf-8")
    starts = [match.start() for match in ENTRY.finditer(text)]
    for start, end in zip(starts, [*starts[1:], len(text)], strict=True):
        entry = text[start:end]
        fields = set(re.findall(r"^\s*([a-z]+)\s*=\s*\{", entry, re.MULTILINE))
        name = entry.partition(",")[0]
        assert {"author", "title", "year"} <= fields, name
        assert fields & {"journal", "booktitle", "publisher", "institution"}, name
        assert entry.count("{") == entry.count("}"), name
        key_year = re.search(r"[0-9]{4}", name)
        assert key_year and re.search(rf"year\s*=\s*\{{{key_year[0]}\}}", entry), name


def test_the_index_names_every_page() -> None:
    index = (THEORY / "README.md").read_text(encoding="utf-8")
    linked = {target.partition("#")[0] for target in LINK.findall(index)}
    pages = {page.name for page in files(THEORY, ".md")} - {"README.md"}
    assert len(pages) > 10, "the test sees no pages"
    assert pages <= linked, f"not in the index: {sorted(pages - linked)}"


def test_every_relative_link_in_docs_leads_somewhere() -> None:
    broken, seen = [], 0
    for page in files(DOCS, ".md"):
        _, prose = fences(page.read_text(encoding="utf-8"))
        prose = re.sub(r"`[^`\n]*`", "", prose)
        for target in LINK.findall(prose):
            if re.match(r"[a-z]+:", target):
                continue
            seen += 1
            path, _, anchor = target.partition("#")
            to = (page.parent / path).resolve() if path else page
            good = to.exists() and (not anchor or to.suffix != ".md" or anchor in anchors(to))
            if not good:
                broken.append(f"{page.relative_to(ROOT)}: {target}")
    assert seen > 20, "the test sees no links"
    assert not broken, f"links that lead nowhere: {broken}"
