"""A figure: what an experiment measured, beside what it must be and how far it may be off."""

from collections.abc import Sequence
from dataclasses import dataclass

from tumble.lab.page import Draw


@dataclass(frozen=True)
class Figure:
    """A measured number and its bounds. A number that could not be measured is nan, which no bounds contain."""

    what: str
    measured: float
    low: float
    high: float
    unit: str = ""
    exact: float | None = None
    """None where a band is all that is known."""

    @property
    def holds(self) -> bool:
        """Whether it lies within its bounds."""
        return self.low <= self.measured <= self.high

    @property
    def deviation(self) -> float | None:
        """From the exact value, relative; None without one, and where that is zero."""
        return self.measured / self.exact - 1.0 if self.exact else None


def near(what: str, measured: float, exact: float, share: float, unit: str = "") -> Figure:
    """A figure that has an exact value, and may be off by this share of it."""
    slack = share * abs(exact)
    return Figure(what, measured, exact - slack, exact + slack, unit, exact)


def within(what: str, measured: float, low: float, high: float, unit: str = "") -> Figure:
    """A figure that is to lie in a band."""
    return Figure(what, measured, low, high, unit)


def small(what: str, measured: float, bound: float, unit: str = "") -> Figure:
    """A figure that is exactly zero."""
    return Figure(what, measured, -bound, bound, unit, 0.0)


@dataclass(frozen=True)
class Result:
    """An experiment that has been carried out."""

    text: str
    """How it was done, HTML."""
    figures: Sequence[Figure]
    draw: Draw | None = None
    height: float = 3.6
    """Of what is drawn [inch]."""
