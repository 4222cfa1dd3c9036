"""`tumble diff`: the first difference between two runs."""

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from tumble.cli import find
from tumble.cli.console import counted, say

if TYPE_CHECKING:
    from tumble.compare import ColumnDifference, Comparison

LEDGER_OBJECT = "ledger"
_LISTED = 8
"""Number of columns listed at the first differing frame."""


def diff(
    a: Annotated[str, typer.Argument(metavar="RUN", help="A folder that `tumble run` wrote, or its name in out/.")],
    b: Annotated[str, typer.Argument(metavar="RUN", help="Another one of the same scene.")],
    until: Annotated[
        int | None,
        typer.Option(metavar="I", min=0, help="Last frame to compare.", show_default="the last common one"),
    ] = None,
    deep: Annotated[
        bool,
        typer.Option("--deep", help="Read every frame, even if the state hashes agree."),
    ] = False,
    json: find.JsonOption = False,
) -> None:
    """Find the first difference between two runs, to the last bit.

    Prints the first frame, object, column and element that differ, both values, their distance in units and in ulps
    (steps between adjacent numbers of that precision), and the number of differing elements. Then their distance at the
    last common frame.

    run.json and ledger.csv hold a state hash per frame, so only the first differing frame is read.
    --deep reads all frames, and so finds files that were changed or damaged later.

    \b
    Exit codes: 0 identical, with equal length; 1 they differ, or one is longer
    (--until compares only the frames up to it); 2 the runs are not comparable:
    different objects, resolution or frame rate.

    \b
    Examples:
      tumble run sheet-on-ball --out out/a --threads 1
      tumble run sheet-on-ball --out out/b --threads 2
      tumble diff out/a out/b
      tumble diff out/a out/b --until 20 --deep
      tumble diff out/a out/b --json
    """
    from tumble.compare import at, compare

    with find.told_as_json(json):
        one, other = find.run(a), find.run(b)
        found = compare(one, other, until, deep)
    if json:
        find.say_json({"same": found.same, "longer": found.longer, **asdict(found)})
        raise typer.Exit(0 if found.same else 1)
    for line in _told(found):
        say(line)
    last = found.compared - 1
    if found.frame is not None and found.seen is not None and last > found.seen:
        apart = at(one, other, last)
        say(f"  by frame {last}  {_farthest(apart)}" if apart else f"  by frame {last}  identical again")
    if not found.same:
        raise typer.Exit(1)


def _told(found: "Comparison") -> list[str]:
    """The comparison as text."""
    a, b = found.runs
    lines = [f"  note      {text}" for text in found.unlike]
    frames = counted(found.compared, "frame")
    same = "numbers, as far as single precision tells," if found.mixed else "bits"
    if found.frame is None:
        head = f"{a} and {b}: the same {same} in {frames}"
        if found.longer:
            k = 0 if found.frames[0] > found.frames[1] else 1
            more = counted(abs(found.frames[0] - found.frames[1]), "frame")
            head += f"; {found.runs[k]} has {more} more (--until {found.compared - 1} compares without them)"
        return [head, *lines, *_background(found)]
    when = f"frame {found.frame} (t = {found.time:.6g} s)"
    before = (
        f"after {counted(found.frame, 'frame')} with the same {same.rstrip(',')}" if found.frame else "from the start"
    )
    lines.insert(0, f"{a} and {b} differ at {when}, {before}")
    if found.hashes is not None:
        lines.append(f"  state     hash {found.hashes[0]} and {found.hashes[1]}")
    books = [column for column in found.columns if column.object == LEDGER_OBJECT]
    if books and found.seen != found.frame:
        one = books[0]
        lines.append(f"  ledger    {one.column}: {one.values[0]!r} and {one.values[1]!r}")
    if found.seen is None:
        until = found.compared - 1
        lines.append(f"  columns   no object column differs by frame {until}; --set 'output.columns=[...]' stores more")
        return lines + _background(found)
    if found.seen != found.frame:
        lines.append(f"  columns   of objects differ from frame {found.seen} on; the earlier difference is not stored")
    lines += _first(found, found.seen_columns[0])
    lines += [f"  total     {_many(column)}" for column in found.seen_columns[:_LISTED]]
    if len(found.seen_columns) > _LISTED:
        lines.append(f"            and {len(found.seen_columns) - _LISTED} more columns")
    return lines + _background(found)


def _first(found: "Comparison", first: "ColumnDifference") -> list[str]:
    """The first number that differs."""
    a, b = found.runs
    unit = "" if first.unit in ("", "1") else f" {first.unit}"
    what = f"{first.column} of {_object(first)}"
    if not first.index:
        return [f"  first     {what}: {first.lengths[0]} elements in {a}, {first.lengths[1]} in {b}"]
    width = max(len(str(a)), len(str(b)))
    values = [
        f"            {run!s:{width}}  {value!r}{unit}" for run, value in zip(found.runs, first.values, strict=True)
    ]
    apart = abs(first.values[0] - first.values[1])
    single = "the two zeros" if first.ulps == 0 and apart == 0 else f"{apart:.3g}{unit} apart, {_ulps(first.ulps)}"
    return [f"  first     {what}, {first.place()}", *values, f"            {single}"]


def _object(column: "ColumnDifference") -> str:
    return f'"{column.object}"'


def _ulps(ulps: float) -> str:
    if math.isinf(ulps):
        return "one of them not finite"
    return f"{int(ulps)} ulp" if ulps == 1 else f"{ulps:.0f} ulps" if ulps < 1e6 else f"{ulps:.2e} ulps"


def _many(column: "ColumnDifference") -> str:
    """The number of differing elements of a column, and their largest distance."""
    what = f"{column.column} of {_object(column)}"
    if column.lengths[0] != column.lengths[1]:
        what += f" ({column.lengths[0]} elements and {column.lengths[1]})"
    if not column.count:
        return f"{what}: only the number of elements"
    return f"{what}: {column.count} of {column.size} numbers differ, {_most(column)}"


def _most(column: "ColumnDifference") -> str:
    unit = "" if column.unit in ("", "1") else f" {column.unit}"
    return f"by up to {column.largest:.3g}{unit} at {column.place(column.largest_at)}"


def _farthest(columns: "list[ColumnDifference]") -> str:
    """The distance of two runs in their first column, the position if it is stored."""
    first = next((column for column in columns if column.count), columns[0])
    return _many(first)


def _background(found: "Comparison") -> list[str]:
    """Possible causes."""
    lines = []
    if found.scenes is not None:
        lines.append(f"  scenes    {found.scenes}")
    if found.versions[0] != found.versions[1]:
        lines.append(f"  versions  tumble {found.versions[0]} and {found.versions[1]}")
    return lines
