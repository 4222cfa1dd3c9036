"""Resistance of link patterns: a sheet and a block are deformed by hand, and their elastic energy is read.

Energies are those of the bulk: the energy of n x n cells is w n² + rim n + corners, so w is the leading coefficient of
the polynomial through the energies at three sizes (four in a block); rims and corners drop out exactly.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from tumble._engine import Scene, World
from tumble.lab.exact import Floats

CELL = 0.25
"""Side of a cell [m]."""

STRUCTURAL, SHEAR, BEND = 100.0, 200.0, 20.0
"""Moduli of the families [N/m; Pa in a block]. SHEAR = 2 STRUCTURAL makes the sheet with both diagonals isotropic."""

HINGE = 0.1
"""Bending stiffness of the hinges [N m]."""

Move = Callable[[Floats, float], Floats]


@dataclass(frozen=True)
class Pattern:
    """A choice of links."""

    title: str
    scene: dict[str, Any]
    """Keys of the sheet or the block."""
    stiffness: Floats
    """Exact stiffness matrix of the continuum; 3 x 3 in a sheet [N/m], of (exx, eyy, 2 exy) (structures.2, .3, .7)."""
    bending: Floats | None = None
    """Exact bending stiffness [N m], 3 x 3, of (kxx, kyy, 2 kxy) (bending.13); None where it vanishes."""


@dataclass(frozen=True)
class Deformation:
    """A way to deform."""

    key: str
    title: str
    move: Move
    strain: Floats
    """Of the unit amount: strain in the plane, or curvature times CELL of a fold, in the order of
    `Pattern.stiffness`."""
    shown: float
    """Amount in pictures."""
    fold: bool = False


@dataclass
class Measured:
    """Resistance of a pattern to a deformation."""

    pattern: Pattern
    deformation: Deformation
    modulus: float
    """M in the energy per area M/2 e² of a small strain [N/m], or M/2 curvature² of a small fold [N m]."""
    exact: float
    power: float
    """Of the strain, in the energy at larger strains: 2 where it is resisted; 4 if only by the way links turn; nan
    without any energy."""

    @property
    def word(self) -> str:
        """yes, weakly or no."""
        return "no" if np.isnan(self.power) else "weakly" if self.power > 3 else "yes"


def _links(shear: str = "", bend: bool = False, kind: str = "sheet", **more: Any) -> dict[str, Any]:
    links: dict[str, Any] = {"structural": STRUCTURAL}
    if shear:
        links |= {"shear": SHEAR, "diagonals": shear}
    if bend:
        links |= {"bend": BEND}
    return {"links": links, **more}


def _sheet_stiffness(along: float, shear: str = "") -> Floats:
    matrix = np.diag([along, along, 0.0])
    if shear == "both":
        k = SHEAR / 4  # (structures.2)
        matrix += k * np.array([[1, 1, 0], [1, 1, 0], [0, 0, 1]])
    if shear == "one":
        matrix += SHEAR / 4 * np.ones((3, 3))  # (structures.7), k2 = SHEAR/2
    return matrix


_HINGES = HINGE * np.diag([1.0, 1.0, 0.5])  # (bending.13)

SHEETS = (
    Pattern("structural only", _links(), _sheet_stiffness(STRUCTURAL)),
    Pattern("+ shear, one diagonal", _links("one"), _sheet_stiffness(STRUCTURAL, "one")),
    Pattern("+ shear, both diagonals", _links("both"), _sheet_stiffness(STRUCTURAL, "both")),
    Pattern("+ both + bend (skip one)", _links("both", True), _sheet_stiffness(STRUCTURAL + BEND, "both")),
    Pattern("+ both + hinges", _links("both", hinge=HINGE), _sheet_stiffness(STRUCTURAL, "both"), _HINGES),
)


def _block_stiffness(along: float, shear: str = "") -> Floats:
    """6 x 6, of (exx, eyy, ezz, 2 eyz, 2 exz, 2 exy): each plane of cells is a sheet (structures.10)."""
    matrix = np.zeros((6, 6))
    for i, j, s in ((0, 1, 5), (1, 2, 3), (0, 2, 4)):
        matrix[np.ix_([i, j, s], [i, j, s])] += _sheet_stiffness(0.0, shear)
    return np.asarray(matrix + np.diag([along] * 3 + [0.0] * 3))


BLOCKS = (
    Pattern("structural only", _links(), _block_stiffness(STRUCTURAL)),
    Pattern("+ shear, one diagonal", _links("one"), _block_stiffness(STRUCTURAL, "one")),
    Pattern("+ shear, both diagonals", _links("both"), _block_stiffness(STRUCTURAL, "both")),
    Pattern("+ both + bend (skip one)", _links("both", True), _block_stiffness(STRUCTURAL + BEND, "both")),
)


def _strain(matrix: list[list[float]]) -> Move:
    e = np.zeros((3, 3))
    e[: len(matrix), : len(matrix)] = matrix
    return lambda x, amount: np.asarray(x + amount * x @ e.T)


def _shear(sign: float) -> Move:
    """Rows slide over each other; nothing along the grid changes its length."""

    def move(x: Floats, amount: float) -> Floats:
        y = x.copy()
        y[:, 0] = x[:, 0] + sign * np.sin(amount) * x[:, 1]
        y[:, 1] = np.cos(amount) * x[:, 1]
        return y

    return move


def _fold(across: tuple[float, float], pitch: float) -> Move:
    """Folds by an angle at each of the creases that run at right angles to `across`, `pitch` apart; facets stay
    flat."""
    n = np.array([*across, 0.0]) / np.hypot(*across)

    def move(x: Floats, amount: float) -> Floats:
        s = x @ n
        k = np.round((s - s.min()) / pitch).astype(int)
        angles = amount * (np.arange(k.max()) - (k.max() - 1) / 2)
        along = np.concatenate([[0.0], np.cumsum(np.cos(angles))]) * pitch
        up = np.concatenate([[0.0], np.cumsum(np.sin(angles))]) * pitch
        along -= along.mean()
        return np.asarray(x + np.outer(along[k] - s, n) + np.outer(up[k] - up.mean(), [0.0, 0.0, 1.0]))

    return move


_DIAGONAL = CELL / np.sqrt(2)


def _curved(xx: float, yy: float, xy: float) -> Floats:
    return np.array([xx, yy, 2 * xy])


SHEET_DEFORMATIONS = (
    Deformation("stretch x", "stretch →", _strain([[1, 0], [0, 0]]), np.array([1.0, 0, 0]), 0.2),
    Deformation("stretch y", "stretch ↑", _strain([[0, 0], [0, 1]]), np.array([0, 1.0, 0]), 0.2),
    Deformation("stretch +45", "stretch ↗", _strain([[0.5, 0.5], [0.5, 0.5]]), np.array([0.5, 0.5, 1]), 0.2),
    Deformation("stretch -45", "stretch ↘", _strain([[0.5, -0.5], [-0.5, 0.5]]), np.array([0.5, 0.5, -1]), 0.2),
    Deformation("shear +", "shear to the right", _shear(1.0), np.array([0, 0, 1.0]), 0.3),
    Deformation("shear -", "shear to the left", _shear(-1.0), np.array([0, 0, -1.0]), 0.3),
    Deformation("fold y", "fold, crease ↑", _fold((1, 0), CELL), _curved(1, 0, 0), 0.5, True),
    Deformation("fold x", "fold, crease →", _fold((0, 1), CELL), _curved(0, 1, 0), 0.5, True),
    Deformation("fold +45", "fold, crease ↗", _fold((1, -1), _DIAGONAL), _curved(0.5, 0.5, -0.5), 0.32, True),
    Deformation("fold -45", "fold, crease ↘", _fold((1, 1), _DIAGONAL), _curved(0.5, 0.5, 0.5), 0.32, True),
)


def _voigt(matrix: list[list[float]]) -> Floats:
    m = np.array(matrix, dtype=float)
    return np.array([m[0, 0], m[1, 1], m[2, 2], 2 * m[1, 2], 2 * m[0, 2], 2 * m[0, 1]])


def _block_stretch(key: str, title: str, direction: tuple[float, float, float]) -> Deformation:
    n = np.array(direction) / np.linalg.norm(direction)
    matrix = [[float(a) for a in row] for row in np.outer(n, n)]
    return Deformation(key, title, _strain(matrix), _voigt(matrix), 0.2)


_SLIDE = np.array([0, 0, 0, 0, 0, 1.0])

BLOCK_DEFORMATIONS = (
    _block_stretch("stretch x", "along an edge", (1, 0, 0)),
    _block_stretch("stretch +45", "along a face's diagonal", (1, 1, 0)),
    _block_stretch("stretch -45", "along the other one", (1, -1, 0)),
    _block_stretch("stretch 111", "along the body's diagonal", (1, 1, 1)),
    Deformation("shear +", "shear to the right", _shear(1.0), _SLIDE, 0.3),
    Deformation("shear -", "shear to the left", _shear(-1.0), -_SLIDE, 0.3),
    Deformation("swell", "swell", _strain([[1, 0, 0], [0, 1, 0], [0, 0, 1]]), np.array([1.0, 1, 1, 0, 0, 0]), 0.15),
)


@dataclass
class Thing:
    """A sheet or block of one pattern, to be deformed."""

    world: World
    rest: Floats
    links: Floats = field(default_factory=lambda: np.zeros((0, 2)))

    def energy(self, x: Floats) -> float:
        """Elastic energy [J] with the masses at x."""
        self.world.write("thing", "position", x)
        return float(self.world.ledger["elastic"])

    def strains(self, x: Floats) -> Floats:
        """Of the links, with the masses at x."""
        self.world.write("thing", "position", x)
        return np.asarray(self.world.columns("link_strain")["thing"]["link_strain"], dtype=float)


def thing(pattern: Pattern, cells: int, block: bool = False) -> Thing:
    """A square or a cube of cells."""
    dimensions = 3 if block else 2
    shape = {"size": [cells * CELL] * dimensions, "resolution": [cells + 1] * dimensions}
    tree = {
        "version": 1,
        "precision": "double",
        "world": {"gravity": [0, 0, 0]},
        "block" if block else "sheet": [{"name": "thing", **shape, **pattern.scene}],
    }
    world = World(Scene(tree), 1)
    topology = world.topology["thing"]
    rest = np.asarray(world.columns("position")["thing"]["position"], dtype=float)
    return Thing(world, rest, np.asarray(topology["links"]))


def bulk(things: list[Thing], cells: list[int], move: Move, amount: float, dimensions: int) -> float:
    """Elastic energy per area [J/m²] (volume [J/m³]), without rims and corners."""
    energies = [t.energy(move(t.rest, amount)) for t in things]
    # The leading coefficient of the polynomial through them, by divided differences.
    for order in range(1, len(cells)):
        energies = [(b - a) / (cells[k + order] - cells[k]) for k, (a, b) in enumerate(pairwise(energies))]
    return energies[0] / CELL**dimensions


def measure(
    patterns: tuple[Pattern, ...], deformations: tuple[Deformation, ...], block: bool, tick: Callable[[], None]
) -> list[list[Measured]]:
    """A row for each pattern."""
    dimensions = 3 if block else 2
    cells = [4, 5, 6, 7][: dimensions + 1]
    rows = []
    for pattern in patterns:
        things = [thing(pattern, n, block) for n in cells]
        row = []
        for deformation in deformations:
            row.append(_one(pattern, deformation, things, cells, dimensions))
            tick()
        rows.append(row)
    return rows


def _one(
    pattern: Pattern, deformation: Deformation, things: list[Thing], cells: list[int], dimensions: int
) -> Measured:
    unit = 1.0 / CELL if deformation.fold else 1.0
    if deformation.fold and deformation.key.endswith("45"):
        unit = 1.0 / _DIAGONAL
    small, large = 1e-4, 0.1
    # Both ways: what is odd in the strain, such as the slow turning of the links, drops out.
    pushed, pulled = (bulk(things, cells, deformation.move, sign * small, dimensions) for sign in (-1, 1))
    modulus = (pushed + pulled) / (small * unit) ** 2
    matrix = pattern.bending if deformation.fold else pattern.stiffness
    exact = float(deformation.strain @ matrix @ deformation.strain) if matrix is not None else 0.0
    scale = HINGE if deformation.fold else STRUCTURAL
    modulus = 0.0 if abs(modulus) < 1e-6 * scale else modulus
    at, half = (bulk(things, cells, deformation.move, a, dimensions) for a in (large, large / 2))
    nothing = at < 1e-12 * STRUCTURAL
    return Measured(pattern, deformation, modulus, exact, float("nan") if nothing else float(np.log2(at / half)))


def stiffness(pattern: Pattern) -> Floats:
    """Measured stiffness matrix of a sheet [N/m], from the energies of six small strains."""
    cells = [4, 5, 6]
    things = [thing(pattern, n) for n in cells]
    e = 1e-4

    def energy(strain: Floats) -> float:
        a, b, c = strain / 2
        move = _strain([[2 * a, c], [c, 2 * b]])
        return (bulk(things, cells, move, e, 2) + bulk(things, cells, move, -e, 2)) / (2 * e**2)

    unit = np.eye(3)
    matrix = np.diag([2 * energy(u) for u in unit])
    for i in range(3):
        for j in range(i):
            both = energy(unit[i] + unit[j])
            matrix[i, j] = matrix[j, i] = both - 0.5 * (matrix[i, i] + matrix[j, j])
    return matrix


def young(matrix: Floats, angles: Floats) -> Floats:
    """Young's modulus [N/m] of a sheet pulled along directions [rad], its sides free to contract."""
    soft = np.linalg.inv(matrix + 1e-6 * np.trace(matrix) * np.eye(3))
    c, s = np.cos(angles), np.sin(angles)
    stress = np.stack([c * c, s * s, c * s], axis=-1)
    return np.asarray(1.0 / np.einsum("ai,ij,aj->a", stress, soft, stress))


def lean(matrix: Floats) -> float:
    """Shear angle over stretch of a sheet pulled along x; nan if nothing resists shear."""
    if matrix[2, 2] < 1e-3 * STRUCTURAL:
        return float("nan")
    soft = np.linalg.inv(matrix)
    return round(float(soft[2, 0] / soft[0, 0]), 6) + 0.0


def shear_bias(pattern: Pattern, amount: float) -> float:
    """Energy of a large shear to the right over that of the same to the left; nan where there is none."""
    cells = [4, 5, 6]
    right, left = (bulk([thing(pattern, n) for n in cells], cells, _shear(sign), amount, 2) for sign in (1.0, -1.0))
    return right / left if left > 1e-12 * STRUCTURAL else float("nan")
