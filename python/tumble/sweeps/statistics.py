"""Mean, spread and confidence over seeds, and main effects over parameters.

Confidence is that of the bootstrap (percentiles of the means of resampled runs). Its random numbers are the raw output of
Philox, keyed by what is resampled: the same table gives the same bounds, whatever else is in it.
"""

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from tumble.sweeps.design import number

Floats = npt.NDArray[np.float64]

RESAMPLES = 2000
CONFIDENCE = 0.95

BINS = 8
"""Parts into which the range of a parameter is divided that has more values."""


@dataclass(frozen=True)
class Spread:
    """Values of a measure over the runs of one point."""

    n: int
    """Runs that have one."""
    mean: float
    std: float
    """Standard deviation of the values (n - 1); nan of a single one."""
    low: float
    high: float
    """Confidence interval of the mean, CONFIDENCE; nan of a single one."""
    least: float
    most: float


NONE = Spread(0, *[math.nan] * 6)


def spread(values: Sequence[float], name: str) -> Spread:
    """Of the values that are numbers; `name` keys the random numbers of the bootstrap."""
    found = np.array([x for x in values if math.isfinite(x)])
    if not found.size:
        return NONE
    std, low, high = math.nan, math.nan, math.nan
    if found.size > 1:
        std = float(np.std(found, ddof=1))
        low, high = confidence(found, name)
    return Spread(found.size, float(np.mean(found)), std, low, high, float(found.min()), float(found.max()))


def confidence(values: Floats, name: str) -> tuple[float, float]:
    """The bootstrap interval of the mean of two values or more."""
    n = len(values)
    means = np.empty(RESAMPLES)
    generator = np.random.Philox(key=int.from_bytes(hashlib.sha256(name.encode()).digest()[:16], "little"))
    piece = max(1, 1_000_000 // n)
    for begin in range(0, RESAMPLES, piece):
        rows = min(piece, RESAMPLES - begin)
        raw = generator.random_raw(rows * n)
        # The upper 32 bits, times n, without the part after the point: below 1e-6 from uniform for n < 4000.
        index = ((raw >> np.uint64(32)) * np.uint64(n)) >> np.uint64(32)
        means[begin : begin + rows] = values[index.reshape(rows, n)].mean(axis=1)
    tail = 50.0 * (1.0 - CONFIDENCE)
    low, high = np.percentile(means, [tail, 100.0 - tail])
    return float(low), float(high)


@dataclass(frozen=True)
class Effect:
    """How a measure depends on one parameter alone, over all values of the others."""

    path: str
    levels: list[str]
    """Its values, or the middles of the bins that they are in."""
    spreads: list[Spread]
    share: float
    """Share of the variance of all runs that lies between levels (the correlation ratio); nan where nothing varies."""

    @property
    def size(self) -> float:
        """The largest mean less the smallest."""
        means = [s.mean for s in self.spreads if s.n]
        return max(means) - min(means) if means else math.nan


def effect(path: str, given: Sequence[str], values: Sequence[float], name: str) -> Effect:
    """The effect of a parameter, of which each run has been given a value."""
    levels, where = binned(given)
    groups: list[list[float]] = [[] for _ in levels]
    for k, value in zip(where, values, strict=True):
        if math.isfinite(value):
            groups[k].append(value)
    spreads = [spread(group, f"{name} {path} {level}") for level, group in zip(levels, groups, strict=True)]
    every = np.array([x for group in groups for x in group])
    whole = float(((every - every.mean()) ** 2).sum()) if every.size else 0.0
    between = sum(s.n * (s.mean - every.mean()) ** 2 for s in spreads if s.n)
    return Effect(path, levels, spreads, min(between / whole, 1.0) if whole > 0.0 else math.nan)


def binned(given: Sequence[str]) -> tuple[list[str], list[int]]:
    """The levels of a parameter, and which one each value belongs to: the values themselves where they are few or no numbers,
    else bins that hold equally many."""
    distinct = list(dict.fromkeys(given))
    numbers = {value: number(value) for value in distinct}
    if any(map(math.isnan, numbers.values())):
        return distinct, [distinct.index(value) for value in given]
    ordered = sorted(distinct, key=numbers.__getitem__)
    if len(ordered) <= 2 * BINS:
        place = {value: k for k, value in enumerate(ordered)}
        return ordered, [place[value] for value in given]
    edges = [round(k) for k in np.linspace(0, len(ordered), BINS + 1)]
    place = {}
    levels = []
    for k, (a, b) in enumerate(pairwise(edges)):
        levels.append(f"{np.mean([numbers[value] for value in ordered[a:b]]):.6g}")
        place |= dict.fromkeys(ordered[a:b], k)
    return levels, [place[value] for value in given]
