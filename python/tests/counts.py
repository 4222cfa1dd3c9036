"""Counts of tests: `note` records them, and a table follows the tests.

    TUMBLE_COUNTS=FILE python -m pytest ... && python python/tests/counts.py FILE

Each line of the file is a count. Ends with 1 where `make validate` (TUMBLE_FUZZ of 30 or more) tried less than is promised.
"""

import json
import os
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

FACTOR = float(os.environ.get("TUMBLE_FUZZ", "1"))
"""How many times as many random cases are tried as in `make test`."""

PROMISED = {"random cases": 1_000_000, "kills": 200}
"""The least numbers of what docs/guarantees.md counts."""


def note(count: str, kind: str, **numbers: Any) -> None:
    """Adds a line to the file that is named by TUMBLE_COUNTS, if any: how many of what, and what else is worth telling."""
    if path := os.environ.get("TUMBLE_COUNTS"):
        with Path(path).open("a", encoding="utf-8") as file:
            file.write(json.dumps({"count": count, "kind": kind, **numbers}) + "\n")


def table(lines: Iterable[Mapping[str, Any]]) -> tuple[list[str], dict[str, int]]:
    """The lines in words, by what they count, each with its sum; and the sums of cases."""
    out: list[str] = []
    sums: dict[str, int] = {}
    rows = list(lines)
    for count in dict.fromkeys(row["count"] for row in rows):
        own = [row for row in rows if row["count"] == count]
        for row in own:
            more = ", ".join(f"{key} {value}" for key, value in row.items() if key not in ("count", "kind", "cases"))
            out.append(f"{count:16} {row['kind']:34} {row['cases']:>9,}{'  ' + more if more else ''}")
        sums[count] = sum(row["cases"] for row in own)
        if len(own) > 1:
            out.append(f"{count:16} {'in all':34} {sums[count]:>9,}")
    return out, sums


def main() -> int:
    path = Path(sys.argv[1])
    text = path.read_text(encoding="utf-8") if path.is_file() else ""
    out, sums = table(map(json.loads, text.splitlines()))
    print("\n".join(out) or "nothing was counted")
    few = [f"{sums.get(what, 0):,} {what}, {least:,} are promised" for what, least in PROMISED.items()]
    few = [line for line, (what, least) in zip(few, PROMISED.items(), strict=True) if sums.get(what, 0) < least]
    if FACTOR < 30:
        return 0
    for line in few:
        print(f"TOO FEW: {line}")
    return 1 if few else 0


if __name__ == "__main__":
    sys.exit(main())
