"""The page of `tumble lab contact`."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from tumble._engine import StepError
from tumble.lab.contact.cases import CASES, Case
from tumble.lab.contact.figure import Figure, Result, within
from tumble.lab.findings import off
from tumble.lab.page import Section, table, write

HEAD = ("figure", "measured", "exact, or band", "deviation", "bound", "holds")


def run(case: Case) -> Result:
    """Carries out an experiment. One that breaks down has a figure that does not hold."""
    try:
        return case.run()
    except StepError as error:
        text = f"<p>The simulation broke down: {escape(str(error).splitlines()[0])}</p>"
        return Result(text, [within("simulated to its end", float("nan"), 1.0, 1.0)])


def page(
    folder: Path, names: Sequence[str] = (), *, progress: Callable[[int, int], None] | None = None
) -> tuple[Path, str]:
    """Carries out the experiments of these names, by default all, and writes contact.html, .png and .csv; returns the first,
    and the figures as lines for a console. Raises ExportError."""
    chosen = [case for case in CASES.values() if not names or case.name in names]
    results: dict[str, Result] = {}
    for done, case in enumerate(chosen):
        if progress is not None:
            progress(done, len(chosen) + 1)
        results[case.name] = run(case)
    written = write(
        folder,
        "contact",
        "Contact of rigid bodies and grains",
        "Experiments whose outcome is known: from a closed form, from statics, or from measurements.",
        _points(results),
        [_section(CASES[name], result) for name, result in results.items()],
        [
            "Equations and limits: docs/theory/rigid.md, joints.md and grains.md.",
            "A deviation is relative to the exact value. A figure holds if it lies within its bound, which is given on the "
            "page and does not depend on what was measured.",
            "All figures are in contact.csv.",
        ],
        _rows(results),
    )
    if progress is not None:
        progress(len(chosen) + 1, len(chosen) + 1)
    return written, text(results)


def verdict(results: Mapping[str, Result]) -> str:
    """`19 of 19 figures hold`."""
    figures = [figure for result in results.values() for figure in result.figures]
    count = sum(figure.holds for figure in figures)
    return f"{count} of {len(figures)} figure{'s' * (len(figures) != 1)} hold{'s' * (len(figures) == 1)}"


def text(results: Mapping[str, Result]) -> str:
    """For a console: a line for each figure, and how many hold."""
    found = [(name, figure) for name, result in results.items() for figure in result.figures]
    cells = [
        (name, f.what, _number(f.measured, f.unit), _expected(f), "holds" if f.holds else "DOES NOT HOLD")
        for name, f in found
    ]
    widths = [max(len(row[k]) for row in cells) for k in range(len(cells[0]))]
    lines = [
        f"{name:{widths[0]}}  {what:{widths[1]}}  {measured:>{widths[2]}}  {expected:{widths[3]}}  {word}"
        for name, what, measured, expected, word in cells
    ]
    broken = [f"{name}: {figure.what}" for name, figure in found if not figure.holds]
    lines.append(verdict(results) + (f"; does not hold: {'; '.join(broken)}" if broken else ""))
    return "\n".join(lines)


def _expected(figure: Figure) -> str:
    """`3.468 m/s² ± 0.5 %`, or a band."""
    if math.isinf(figure.high):
        return f"more than {_number(figure.low, figure.unit)}"
    if math.isinf(figure.low):
        return f"less than {_number(figure.high, figure.unit)}"
    if figure.exact is None:
        return f"{_number(figure.low)} to {_number(figure.high, figure.unit)}"
    if figure.exact == 0.0:
        return f"0 ± {_number(figure.high, figure.unit)}"
    return f"{_number(figure.exact, figure.unit)} ± {_bound(figure)}"


def _bound(figure: Figure) -> str:
    if figure.exact is None:
        return ""
    if figure.exact == 0.0:
        return _number(figure.high, figure.unit)
    return f"{100 * (figure.high / figure.exact - 1):.2g} %"


def _number(value: float, unit: str = "") -> str:
    if value != value:
        return "none"
    number = f"{value:.3g}" if 0 < abs(value) < 1e-3 else f"{value:.5g}"
    return f"{number.replace('-', '−')} {unit}".rstrip()


def _points(results: Mapping[str, Result]) -> list[str]:
    points = [f"<b>{verdict(results)}.</b>"]
    for name, result in results.items():
        for figure in result.figures:
            if not figure.holds:
                points.append(
                    f"<b>Does not hold:</b> {escape(CASES[name].title)}, {escape(figure.what)}: "
                    f"{_number(figure.measured, figure.unit)}, expected {_expected(figure)}."
                )
    return points


def _section(case: Case, result: Result) -> Section:
    rows = []
    for figure in result.figures:
        exact = figure.exact
        known = _expected(figure) if exact is None else _number(exact, figure.unit)
        deviation = "–" if figure.deviation is None else off(figure.deviation, signed=True)
        word = "holds" if figure.holds else "<b>does not hold</b>"
        bound = "the band" if exact is None else f"± {_bound(figure)}"
        rows.append([escape(figure.what), _number(figure.measured, figure.unit), known, deviation, bound, word])
    return Section(case.title, result.text, result.draw, result.height, case.title, table(HEAD, rows, (0,)))


def _rows(results: Mapping[str, Result]) -> Iterator[dict[str, Any]]:
    for name, result in results.items():
        for figure in result.figures:
            yield {
                "case": name,
                "figure": figure.what,
                "measured": figure.measured,
                "exact": "" if figure.exact is None else figure.exact,
                "low": figure.low,
                "high": figure.high,
                "unit": figure.unit,
                "holds": "yes" if figure.holds else "no",
            }
