"""How many particles emitters will hold: from the words of a scene, before it is simulated; and how many a run had."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from tumble._engine import ExportError, SceneError, StepError, World
from tumble.folder import RunFolder, read_column

if TYPE_CHECKING:
    from tumble.reader import Run

Floats = npt.NDArray[np.float64]
Tree = Mapping[str, Any]

PIECES = 1000
"""Parts of the time of a scene in which births are summed."""


@dataclass
class Forecast:
    """Expected numbers of an emitter, at the times `t` [s]."""

    name: str
    words: Tree
    t: Floats
    born: Floats
    """Particles born until then."""
    alive: Floats
    """Particles there then: without those that `kill` takes, and no more than `most`."""
    known: bool
    """Whether births can be told: those at bounces, and at deaths of which `kill` makes more, cannot."""

    @property
    def total(self) -> int:
        # A particle is born when the sum passes a whole number.
        return math.floor(float(self.born[-1]) + 0.01)

    @property
    def largest(self) -> int:
        """Particles there at once, at most."""
        return math.floor(float(self.alive.max()) + 0.01)

    @cached_property
    def first(self) -> float | None:
        """When the first is there [s]."""
        there = np.flatnonzero(self.alive >= 0.5)
        return float(self.t[there[0]]) if len(there) else None

    def at(self, times: Floats) -> Floats:
        """Particles there at some times [s]."""
        return np.interp(times, self.t, self.alive)


def forecast(tree: Tree) -> list[Forecast]:
    """One for each emitter of a resolved scene."""
    duration = tree["time"]["frames"] / tree["time"]["fps"]
    t = np.linspace(0.0, duration, PIECES + 1)
    found: list[Forecast] = []
    for words in tree["emitter"]:
        of = (words["from"].get("particles") or {}).get("of")
        parent = next((f for f in found if f.name == of), None)
        if of is None:
            born, known = _rated(words, t), True
            for burst in words["burst"]:
                born = born + burst["count"] * (t >= burst["time"])
        else:
            born, known = _children(words, parent, t)
        lifetime = words["lifetime"]
        dead = np.zeros_like(t) if lifetime is None else _survived(words, t, born)
        alive = born - dead
        if words["most"] is not None:
            alive = np.minimum(alive, words["most"])
        found.append(Forecast(words["name"], words, t, born, alive, known))
    return found


def rate(words: Tree, t: Floats) -> Floats:
    """Its rate at some times [1/s]; nan where that cannot be told."""
    return _course(words["rate"], t)


def _course(value: Any, t: Floats) -> Floats:
    """A number that may change, at some times; nan where that cannot be told."""
    if isinstance(value, int | float):
        return np.full_like(t, value)
    if isinstance(value, Mapping):
        return _evaluated({**value, "keys": [[when, much, 0, 0] for when, much in value["keys"]]}, t)
    return _evaluated([f"({value})", 0, 0], t)


def _evaluated(value: Any, t: Floats) -> Floats:
    """A value that changes in time, from what it gives to a mass as an acceleration: v(t + h) - v(t) = h f(t)."""
    h = float(t[1] - t[0])
    scene = {
        "version": 1,
        "precision": "double",
        "time": {"fps": 1.0 / h, "frames": len(t)},
        "world": {"gravity": [0, 0, 0]},
        "system": [{"integrator": "forward_euler", "substeps": 1}],
        "particles": [{"name": "p", "position": [[0, 0, 0]]}],
        "force": [{"kind": "acceleration", "value": value}],
    }
    found = np.full_like(t, np.nan)
    try:
        world, before = World(scene), 0.0
        for k in range(len(t)):
            world.step()
            now = float(world.columns("velocity")["p"]["velocity"][0, 0])
            found[k], before = (now - before) / h, now
    except (SceneError, StepError):
        pass
    return found


def _rated(words: Tree, t: Floats) -> Floats:
    """Born of the rate until each time."""
    end = t[-1] if words["end"] is None else words["end"]
    at, sums = _sums(words, t)
    until = np.interp(np.clip(t, words["start"], max(end, words["start"])), at, sums)
    return np.asarray(until - np.interp(words["start"], at, sums))


def _sums(words: Tree, t: Floats) -> tuple[Floats, Floats]:
    """Times [s], and the integral of the rate until each, linear between them."""
    value = words["rate"]
    if isinstance(value, Mapping) and value["interpolation"] == "step":
        # From the first to the last time: jumps lie at keys, not at t.
        keys = np.array(value["keys"], dtype=float)
        at = np.concatenate([[min(t[0], keys[0, 0])], keys[1:, 0], [max(t[-1], keys[-1, 0])]])
        return at, np.concatenate([[0.0], np.cumsum(np.maximum(keys[:, 1], 0.0) * np.diff(at))])
    rates = np.maximum(np.nan_to_num(rate(words, t)), 0.0)
    return t, np.concatenate([[0.0], np.cumsum(0.5 * (rates[1:] + rates[:-1]) * np.diff(t))])


def _survived(words: Tree, t: Floats, born: Floats) -> Floats:
    """Dead of their age until each time: lifetimes lie evenly between lifetime (1 - spread) and lifetime (1 + spread)."""
    spread = words["lifetime_spread"]
    parts = np.linspace(1.0 - spread, 1.0 + spread, 9 if spread else 1)
    # A burst is gone in an instant: what was born before t - age, not at it.
    if isinstance(words["lifetime"], int | float):
        dead = [np.interp(t - words["lifetime"] * part - 1e-9, t, born, left=0.0) for part in parts]
    else:
        # Those born in each part of the time have the lifetime of its end.
        counts, lifetimes = np.diff(born, prepend=0.0), np.nan_to_num(_course(words["lifetime"], t), nan=np.inf)
        dead = [counts @ (t + lifetimes * part + 1e-9 < t[:, None]).T for part in parts]
    return np.asarray(np.mean(dead, axis=0))


def _children(words: Tree, parent: Forecast | None, t: Floats) -> tuple[Floats, bool]:
    """Children born until each time, and whether that can be told."""
    if parent is None:
        return np.zeros_like(t), True
    source = words["from"]["particles"]
    of_each = np.maximum(np.nan_to_num(rate(words, t)), 0.0) * parent.alive
    born = np.concatenate([[0.0], np.cumsum(0.5 * (of_each[1:] + of_each[:-1]) * np.diff(t))])
    count = sum(burst["count"] for burst in words["burst"])
    if not count:
        return born, parent.known
    if source["at"] == "bounce" or (source["cause"] and "lifetime" not in source["cause"]):
        return born, False
    if parent.words["lifetime"] is not None:
        born = born + count * _survived(parent.words, t, parent.born)
    killed = bool(parent.words["kill"]) or parent.words["when_full"] == "replace_oldest"
    return born, parent.known and not killed


def largest(tree: Tree) -> list[str]:
    """The emitter that asks for most particles, in words, if they matter for memory."""
    most = max(forecast(tree), key=lambda f: f.largest, default=None)
    if most is None or most.largest < 1_000_000:
        return []
    return [
        f'emitter "{most.name}" alone asks for {most.largest:.3g} particles at once: lower its rate or set its most'
    ]


def born(run: "Run") -> dict[str, tuple[int, int]]:
    """Particles of each emitter of a run that were born, as far as its frames show, and that are in the last one."""
    counts: dict[str, tuple[int, int]] = {}
    files = RunFolder(run.folder)
    for emitter in run.scene["emitter"]:
        name, most, last = str(emitter["name"]), 0, 0
        for i in range(run.n_frames):
            ids = read_column(files.frame(i), name, "id", run.mark(i))
            if ids is not None:
                if ids.ndim != 1 or ids.dtype.kind not in "iu":
                    raise ExportError(
                        f'{files.frame(i)}: is damaged ("{name}/id" counts nothing); simulate again with --force'
                    )
                last = len(ids)
                # Ids count from 0 and are never used again.
                most = max(most, int(ids.max()) + 1) if last else most
        counts[name] = most, last
    return counts
