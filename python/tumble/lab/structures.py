"""`tumble lab structures`: which link patterns resist what, and how evenly."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from tumble.lab import patterns, portraits
from tumble.lab.exact import Floats
from tumble.lab.page import Section, table, write
from tumble.lab.patterns import (
    BEND,
    BLOCK_DEFORMATIONS,
    BLOCKS,
    CELL,
    HINGE,
    SHEAR,
    SHEET_DEFORMATIONS,
    SHEETS,
    STRUCTURAL,
    Measured,
)

FINITE = 0.3
"""Large shear at which left and right are compared [rad]."""

_LIKE = {
    "structural only": "a fishing net: keeps its mesh width, slides shut",
    "+ shear, one diagonal": "twill: leans over when pulled, stiffer one way than the other",
    "+ shear, both diagonals": "a membrane: even in its plane, folds for free",
    "+ both + bend (skip one)": "a cloth that does not fold onto itself, but bends for free",
    "+ both + hinges": "paper, real cloth: every fold is resisted, the more the sharper, up to a right angle",
}


@dataclass
class Study:
    """All that was measured."""

    sheet: list[list[Measured]]
    block: list[list[Measured]]
    matrices: list[Floats]
    """Stiffness of the sheets [N/m], 3 x 3."""
    shear_bias: list[float]


def study(progress: Callable[[int, int], None] | None = None) -> Study:
    """The measurements of the page."""
    total = len(SHEETS) * (len(SHEET_DEFORMATIONS) + 2) + len(BLOCKS) * len(BLOCK_DEFORMATIONS) + 1
    done = 0

    def tick() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done, total)

    sheet = patterns.measure(SHEETS, SHEET_DEFORMATIONS, False, tick)
    block = patterns.measure(BLOCKS, BLOCK_DEFORMATIONS, True, tick)
    matrices, bias = [], []
    for pattern in SHEETS:
        matrices.append(patterns.stiffness(pattern))
        tick()
        bias.append(patterns.shear_bias(pattern, FINITE))
        tick()
    return Study(sheet, block, matrices, bias)


def page(folder: Path, *, progress: Callable[[int, int], None] | None = None) -> Path:
    """Deforms sheets and blocks of every link pattern and writes structures.html, .png and .csv; returns the first.
    Raises ExportError."""
    told: list[int] = []

    def tell(done: int, total: int) -> None:
        told[:] = [total]
        if progress is not None:
            progress(done, total)

    measured = study(tell)
    lead = (
        f"Cells of {CELL} m; moduli: structural {STRUCTURAL:.0f}, shear {SHEAR:.0f}, bend {BEND:.0f} N/m (Pa in the "
        f"block), hinges {HINGE} N m. Every shape is prescribed, mass by mass, and its elastic energy read."
    )
    sections = [
        _portraits(measured.sheet),
        _overview(measured),
        _directions(measured),
        _numbers(measured),
        _blocks(measured.block),
        _block_numbers(measured.block),
    ]
    notes = [
        "Moduli are those of the bulk: the energies of three sheets of n × n cells (four blocks) are a polynomial in "
        "n, whose leading coefficient knows neither rim nor corners.",
        f"Strains and angles of 0.0001, both ways, for moduli; 0.1 and 0.05 for the power of the energy; {FINITE} rad "
        "for the comparison of large shears. “Weakly” is an energy with the fourth power of the angle: no stiffness at "
        "rest.",
        "Closed forms: the continuum behind the lattice, see the theory pages on structures and on bending. All "
        "numbers are in structures.csv.",
    ]
    written = write(
        Path(folder),
        "structures",
        "What link patterns resist",
        lead,
        _points(measured),
        sections,
        notes,
        _rows(measured),
    )
    if progress is not None:
        progress(told[0], told[0])
    return written


def _points(measured: Study) -> list[str]:
    values = {m.deformation.key: m.modulus for m in measured.sheet[1]}
    ratio = values["stretch +45"] / values["stretch -45"]
    hinges = [m.modulus for m in measured.sheet[4] if m.deformation.fold]
    uneven = max(hinges) / min(hinges) - 1
    return [
        "<b>Structural links alone do not resist shear:</b> every square is a hinged parallelogram.",
        f"<b>One diagonal has a bias:</b> stretched along it, a sheet is {ratio:.2g} times as stiff as across it, and "
        "pulled along the grid it leans over. Both diagonals together have none.",
        "<b>Shear links do not resist folding, skip-one links hardly:</b> their energy grows with the fourth power of "
        f"the angle. Hinges resist small folds in proportion, alike in every direction (to {uneven:.0e}).",
    ]


def _portraits(rows: list[list[Measured]]) -> Section:
    text = (
        "<p>A pattern in each row, a deformation in each column; links are orange where they are stretched, blue where "
        "they are compressed. Below each: the modulus that resists a small deformation of this kind.</p>"
    )
    draw = partial(portraits.draw_sheets, rows=rows)
    return Section("Sheets", text, draw, 7.1, "Link patterns, deformed", raster=True)


def _overview(measured: Study) -> Section:
    head = ["links", "pull along<br>the grid", "pull along<br>diagonals", "shear", "fold along<br>the grid"]
    head += ["fold along<br>diagonals", "bias", "behaves like"]
    rows = []
    for row, matrix in zip(measured.sheet, measured.matrices, strict=True):
        words = {m.deformation.key: m.word for m in row}
        pulls = patterns.young(matrix, np.array([0.0, 0.25, 0.5, 0.75]) * np.pi)
        cells = [_pair(*("yes" if y > 1e-3 * STRUCTURAL else "no" for y in pair)) for pair in (pulls[::2], pulls[1::2])]
        for a, b in (("shear +", "shear -"), ("fold y", "fold x"), ("fold +45", "fold -45")):
            cells.append(_pair(words[a], words[b]))
        ratio = pulls[1] / pulls[3]
        cells.append("none" if abs(ratio - 1) < 1e-3 else f"<b>{ratio:.2g} : 1</b>")
        rows.append([f"<b>{row[0].pattern.title}</b>", *cells, _LIKE[row[0].pattern.title]])
    text = (
        "<p>“Pull” leaves the sides free to contract. The bias is the stiffness of a pull along one diagonal over that "
        "of a pull along the other.</p>"
    )
    return Section("What resists what", text, table=table(head, rows, range(len(head))))


def _pair(one: str, other: str) -> str:
    return _word(one) if one == other else f"{_word(one)} ↗, {_word(other)} ↘"


def _word(word: str) -> str:
    return {"yes": "<b>yes</b>", "weakly": "weakly", "no": '<span class="none">no</span>'}[word]


def _directions(measured: Study) -> Section:
    text = (
        "<p>Young's modulus of the sheet (pulled along a direction, its sides free to contract) over that direction: "
        "a circle is a sheet without preferred directions. With the shear modulus at twice the structural one, both "
        "diagonals make one; bend links add to the grid's own directions.</p>"
    )
    draw = partial(portraits.draw_directions, patterns=SHEETS, matrices=measured.matrices)
    return Section("Stiffness over direction", text, draw, 3.3, "Polar plots of Young's modulus")


def _numbers(measured: Study) -> Section:
    titles = [d.title.replace(", ", ",<br>").replace("shear ", "shear<br>") for d in SHEET_DEFORMATIONS]
    head = ["links", *(t.replace("stretch ", "stretch<br>") for t in titles)]
    head += ["stretch<br>↗ / ↘", f"right / left<br>at {FINITE}", "leans,<br>pulled →"]
    rows = []
    for row, matrix, bias in zip(measured.sheet, measured.matrices, measured.shear_bias, strict=True):
        values = {m.deformation.key: m.modulus for m in row}
        ratio = values["stretch +45"] / values["stretch -45"]
        cells = [_value(m) for m in row]
        rows.append([row[0].pattern.title, *cells, f"{ratio:.3f}", _number(bias), _number(patterns.lean(matrix))])
    text = (
        "<p>Moduli, measured, and below them in closed form: N/m for stretch and shear (sides held), N m for folds. "
        "Then the bias: the ratio of the two diagonal stretches, that of the energies of a large shear to either side, "
        "and the shear angle over the stretch when the sheet is pulled along x.</p>"
    )
    return Section("Sheets in numbers", text, table=table(head, rows, (0,)))


def _blocks(rows: list[list[Measured]]) -> Section:
    text = "<p>The same families across the three axes of a block; diagonals are those of the faces of every cell.</p>"
    draw = partial(portraits.draw_blocks, rows=rows)
    return Section("Blocks", text, draw, 7.9, "Block patterns, deformed", raster=True)


def _block_numbers(rows: list[list[Measured]]) -> Section:
    titles = [d.title.replace("s dia", "s<br>dia").replace("shear ", "shear<br>") for d in BLOCK_DEFORMATIONS]
    head = ["links", *titles, "one diagonal /<br>the other"]
    body = []
    for row in rows:
        values = {m.deformation.key: m.modulus for m in row}
        ratio = values["stretch +45"] / values["stretch -45"]
        body.append([row[0].pattern.title, *(_value(m) for m in row), f"{ratio:.3f}"])
    text = "<p>Moduli [Pa], measured, and below them in closed form.</p>"
    return Section("Blocks in numbers", text, table=table(head, body, (0,)))


def _value(m: Measured) -> str:
    exact = f'<br><span class="none">{_number(m.exact)}</span>'
    if m.word == "no":
        return '<span class="none">0</span>' + exact
    if m.word == "weakly":
        return "∝ angle⁴" + exact
    return f"{m.modulus:.4g}" + exact


def _number(value: float) -> str:
    return "–" if np.isnan(value) else f"{value:.4g}".replace("-", "−")


def _rows(measured: Study) -> Iterator[dict[str, Any]]:
    for structure, rows in (("sheet", measured.sheet), ("block", measured.block)):
        for m in _flat(rows):
            yield {
                "structure": structure,
                "pattern": m.pattern.title,
                "deformation": m.deformation.key,
                "modulus": m.modulus,
                "exact": m.exact,
                "energy_power": m.power,
                "resists": m.word,
            }
    for pattern, matrix, bias in zip(SHEETS, measured.matrices, measured.shear_bias, strict=True):
        for i, j in ((0, 0), (1, 1), (0, 1), (2, 2), (0, 2), (1, 2)):
            name = f"C{(i + 1) * 11 if i == j and i < 2 else f'{(1, 2, 6)[i]}{(1, 2, 6)[j]}'}"
            yield {
                "structure": "sheet",
                "pattern": pattern.title,
                "deformation": name,
                "modulus": float(matrix[i, j]),
                "exact": float(pattern.stiffness[i, j]),
            }
        yield {"structure": "sheet", "pattern": pattern.title, "deformation": "shear right/left", "modulus": bias}


def _flat(rows: Sequence[Sequence[Measured]]) -> Iterator[Measured]:
    for row in rows:
        yield from row
