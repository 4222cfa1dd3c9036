"""Counts are listed in a table, and too low ones are errors."""

import json
import subprocess
import sys
from pathlib import Path

import counts
import pytest


def test_counts_are_added_up_and_too_few_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "counts"
    monkeypatch.delenv("TUMBLE_COUNTS", raising=False)
    counts.note("random cases", "nowhere", cases=1)
    monkeypatch.setenv("TUMBLE_COUNTS", str(path))
    counts.note("random cases", "meshes", cases=999_000, refused=5)
    counts.note("random cases", "trees", cases=999)
    counts.note("kills", "sheets", cases=200)

    def told(factor: str) -> tuple[int, list[str]]:
        done = subprocess.run(
            [sys.executable, counts.__file__, path],
            env={"TUMBLE_FUZZ": factor, "PATH": ""},
            stdout=subprocess.PIPE,
            text=True,
        )
        return done.returncode, [" ".join(line.split()) for line in done.stdout.splitlines()]

    rows = [
        "random cases meshes 999,000 refused 5",
        "random cases trees 999",
        "random cases in all 999,999",
        "kills sheets 200",
    ]
    assert told("1") == (0, rows)
    assert told("30") == (1, [*rows, "TOO FEW: 999,999 random cases, 1,000,000 are promised"])
    counts.note("random cases", "links", cases=1)
    assert told("30")[0] == 0
    path.write_text(json.dumps({"count": "random cases", "kind": "x", "cases": 10**6}) + "\n")
    assert told("30")[1][-1] == "TOO FEW: 0 kills, 200 are promised"
    path.unlink()
    assert told("30")[1][0] == "nothing was counted" and told("30")[0] == 1
