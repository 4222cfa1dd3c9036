"""A design from the options of the command line: `--vary KEY=VALUES`, `--zip KEY=VALUES`, `--table FILE`, `--design NAME`."""

from collections.abc import Sequence
from pathlib import Path

from tumble.arguments import wrong
from tumble.bundled import unknown
from tumble.sweeps import design as designs
from tumble.sweeps.design import Axis, Design
from tumble.sweeps.mistakes import Mistakes

KINDS = ("grid", "latin", "sobol")


def design(
    mistakes: Mistakes,
    vary: Sequence[str] = (),
    zips: Sequence[str] = (),
    table: Path | None = None,
    kind: str = "grid",
    samples: int | None = None,
) -> tuple[Design | None, dict[str, str]]:
    """The design, or None where mistakes were found; and how each parameter was typed: key -> "--vary key"."""
    before = len(mistakes.found)
    places: dict[str, str] = {}
    pairs = [(option, *_pair(mistakes, option, text)) for option, texts in _options(vary, zips) for text in texts]
    pairs = [pair for pair in pairs if pair[1]]
    if kind not in KINDS:
        mistakes.add("--design", unknown("design", kind, KINDS))
    drawn = kind in KINDS[1:]
    if drawn and (zips or table is not None):
        mistakes.add(f"--design {kind}", "draws the values itself; leave --zip and --table out")
    if drawn and samples is None:
        mistakes.add(f"--design {kind}", "says no number of points, expected --samples N")
    if not drawn and samples is not None:
        mistakes.add("--samples", "is of --design latin or sobol; a grid has as many points as --vary says")
    for option, key, _ in pairs:
        if key in places:
            mistakes.add(f"{option} {key}", "is varied twice; name each key once")
        places[key] = f"{option} {key}"
    read = None
    if table is not None:
        with mistakes.gathered():
            read = designs.points(table)
            for key in read.paths:
                if key in places:
                    mistakes.add(
                        f"--table {table}", f"{key} is varied by {places[key].split()[0]}, too; name each key once"
                    )
                places[key] = f"--table {table}: {key}"
    if not pairs and read is None and len(mistakes.found) == before and not drawn:
        mistakes.add("", "nothing is varied; expected --vary KEY=VALUES, --zip, --table, or --seeds N of 2 or more")
    found = None
    with mistakes.gathered():
        if drawn and samples is not None:
            found = _drawn(mistakes, kind, pairs, samples)
        elif kind == KINDS[0]:
            found = _grid(mistakes, pairs, read)
    return (found if len(mistakes.found) == before else None), places


def _options(vary: Sequence[str], zips: Sequence[str]) -> list[tuple[str, Sequence[str]]]:
    return [("--vary", vary), ("--zip", zips)]


def _pair(mistakes: Mistakes, option: str, text: str) -> tuple[str, str]:
    """KEY and VALUES."""
    key, equals, values = text.partition("=")
    key, values = key.strip(), values.strip()
    if equals and key and values:
        return key, values
    mistakes.add(
        f"{option} {text}", "expected KEY=VALUES, e.g. system.0.substeps=10,20,40 or world.gravity.2=-9.8:-1.6:5"
    )
    return "", ""


def _grid(mistakes: Mistakes, pairs: Sequence[tuple[str, str, str]], read: Axis | None) -> Design:
    axes = []
    zipped: dict[str, list[str]] = {}
    for option, key, text in pairs:
        with mistakes.gathered():
            values = designs.spread(f"{option} {key}", text)
            if option == "--zip":
                zipped[key] = values
            else:
                axes.append(Axis((key,), tuple((value,) for value in values)))
    if zipped:
        axes.append(designs.together(zipped))
    if read is not None:
        axes.append(read)
    return Design("table" if read is not None else "grid", tuple(axes))


def _drawn(mistakes: Mistakes, kind: str, pairs: Sequence[tuple[str, str, str]], samples: int) -> Design | None:
    ranges = {}
    for option, key, text in pairs:
        with mistakes.gathered():
            ranges[key] = designs.interval(f"{option} {key}", text)
    if pairs and len(ranges) < len(pairs):
        return None
    if not pairs:
        raise wrong(f"--design {kind}", "nothing to draw, expected --vary KEY=LO:HI")
    return designs.drawn(kind, ranges, samples)
