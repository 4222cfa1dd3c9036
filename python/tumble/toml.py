"""Writes trees of a scene as TOML; Python can only read it."""

import json
import math
import re
from collections.abc import Iterator, Mapping
from typing import Any

WIDTH = 110
"""Characters of a line beyond which lists of lists are broken into lines."""


def toml(tree: Mapping[str, Any]) -> str:
    """The text of a tree: numbers first, then tables, then lists of tables; what is within those stands in their lines."""
    lines = [_line(key, value) for key, value in tree.items() if not isinstance(value, Mapping) and not _tables(value)]
    for key, value in tree.items():
        tables = [value] if isinstance(value, Mapping) else value if _tables(value) else []
        for table in tables:
            lines += ["", f"[{_key(key)}]" if isinstance(value, Mapping) else f"[[{_key(key)}]]"]
            lines += [_line(word, item) for word, item in table.items()]
    return "\n".join(lines) + "\n"


def _tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(item, Mapping) for item in value)


def _line(key: str, value: Any) -> str:
    line = f"{_key(key)} = {_inline(value)}"
    if len(line) <= WIDTH or not isinstance(value, list):
        return line
    return "\n".join([f"{_key(key)} = [", *_rows(value), "]"])


def _rows(items: list[Any]) -> Iterator[str]:
    """The items of a list, as many in a line as fit."""
    row = "   "
    for item in items:
        text = f" {_inline(item)},"
        if len(row) + len(text) > WIDTH and row.strip():
            yield row
            row = "   "
        row += text
    yield row


def _inline(value: Any) -> str:
    match value:
        case bool():
            return "true" if value else "false"
        case int():
            return str(value)
        case float():
            return repr(value) if math.isfinite(value) else str(value)
        case str():
            return _text(value)
        case Mapping():
            inner = ", ".join(f"{_key(key)} = {_inline(item)}" for key, item in value.items())
            return f"{{ {inner} }}" if inner else "{}"
        case list() | tuple():
            return f"[{', '.join(map(_inline, value))}]"
    raise TypeError(f"{type(value).__name__} has no words in TOML")


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _text(key)


def _text(text: str) -> str:
    """As in JSON, which does not escape the last of the control characters."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
