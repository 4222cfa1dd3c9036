"""The integrators as the lab sees them: what one step costs, what order it should show, how it is drawn."""

from dataclasses import dataclass

from tumble.bundled import unknown
from tumble.style import INK


@dataclass(frozen=True)
class Family:
    """Integrators that behave alike, and share a colour."""

    title: str
    color: str
    """Of curves."""
    ink: str
    """The same hue, dark enough for letters."""


TANGENT = Family("Euler along the tangent", "#ee6677", "#c0394d")
RUNGE_KUTTA = Family("Runge-Kutta", "#4477aa", "#35608c")
SYMPLECTIC = Family("Symplectic", "#228833", "#1b6f29")
IMPLICIT = Family("Implicit", "#c79a1b", "#85650a")
POSITIONS = Family("Position-based", "#33a5b5", "#1d7380")
ADAPTIVE = Family("Adaptive", "#aa3377", "#932b66")
FAMILIES = (TANGENT, RUNGE_KUTTA, SYMPLECTIC, IMPLICIT, POSITIONS, ADAPTIVE)


@dataclass(frozen=True)
class Scheme:
    """An integrator."""

    word: str
    """Its name in a scene."""
    family: Family
    order: int
    evaluations: int
    """Forces computed in one step (one trial, if adaptive). Implicit ones compute one force per Newton iteration and
    one product with the stiffness matrix per linear iteration, which costs about as much; see `Cell.evaluations`."""
    line: str
    """How its curve is dashed."""
    marker: str
    needs_velocities: bool = False

    @property
    def adaptive(self) -> bool:
        """Whether it chooses its own steps."""
        return self.family is ADAPTIVE

    @property
    def implicit(self) -> bool:
        """Whether a step solves equations."""
        return self.family is IMPLICIT

    @property
    def color(self) -> str:
        return self.family.color

    @property
    def ink(self) -> str:
        return self.family.ink or INK


def _scheme(
    word: str, family: Family, order: int, evaluations: int, rank: int, needs_velocities: bool = False
) -> Scheme:
    line = ("-", "--", ":")[rank]
    return Scheme(word, family, order, evaluations, line, "osD"[rank], needs_velocities)


SCHEMES: tuple[Scheme, ...] = (
    _scheme("forward_euler", TANGENT, 1, 1, 0),
    _scheme("modified_euler", TANGENT, 1, 1, 1, True),
    _scheme("midpoint", RUNGE_KUTTA, 2, 2, 0),
    _scheme("heun", RUNGE_KUTTA, 2, 2, 1),
    _scheme("rk4", RUNGE_KUTTA, 4, 4, 2),
    _scheme("symplectic_euler", SYMPLECTIC, 1, 1, 0, True),
    _scheme("verlet", SYMPLECTIC, 2, 1, 1, True),
    _scheme("velocity_verlet", SYMPLECTIC, 2, 1, 2, True),
    _scheme("implicit_euler", IMPLICIT, 1, 0, 0),
    _scheme("implicit_midpoint", IMPLICIT, 2, 0, 1),
    _scheme("bdf2", IMPLICIT, 2, 0, 2),
    _scheme("position_based", POSITIONS, 1, 1, 0, True),
    _scheme("adaptive_euler", ADAPTIVE, 1, 2, 0),
    _scheme("dormand_prince", ADAPTIVE, 5, 6, 1),
)
"""All integrators, family by family."""

BY_WORD = {s.word: s for s in SCHEMES}


def chosen(words: list[str] | None, massless: bool) -> list[Scheme]:
    """The integrators named, or all; without masses only those that need no velocities. Raises ValueError, also where none is
    left."""
    strange = [unknown("integrator", w, BY_WORD) for w in words or [] if w not in BY_WORD]
    if strange:
        raise ValueError("\n".join(strange))
    asked = [s for s in SCHEMES if not words or s.word in words]
    able = [s for s in asked if not (massless and s.needs_velocities)]
    if not able:
        raise ValueError(
            f"{', '.join(s.word for s in asked)} {'need' if len(asked) > 1 else 'needs'} {NEEDS_VELOCITIES}"
        )
    return able


NEEDS_VELOCITIES = "velocities, which tracers do not have: a field gives them"
"""Why an integrator moves nothing that has no mass."""
