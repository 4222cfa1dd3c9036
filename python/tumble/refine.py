"""A study of convergence: one scene at several resolutions, and what its measures tend to.

See docs/theory/refinement.md.
"""

import json
import math
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tumble._engine import Scene, SceneError, StepError, World
from tumble.arguments import whole, wrong
from tumble.bundled import unknown
from tumble.columns import KINDS
from tumble.energy import ADAPTIVE
from tumble.folder import LEDGER, Columns, RunFolder, cell, write_whole
from tumble.lock import alone
from tumble.reader import Run
from tumble.run import Prepare, simulate

if TYPE_CHECKING:
    import numpy.typing as npt

FACTOR = 2.0
"""How much finer each level is than the one before."""

ROUND_OFF = 64
"""Differences of fewer units in the last place of the largest value are taken for round-off."""

SETTLED = 0.3
"""Orders of neighbouring levels that are no farther apart than this are one order."""

_SHORTER = ("step", "resolution", "spacing", "tolerance", "first_step", "smallest")
"""Words whose values are lengths, times or errors where they are no counts: they are halved."""

_WORDS = {kind.name: kind.resolution for kind in KINDS.values() if kind.resolution is not None}
"""The word of each kind of thing that says how finely it is divided."""

_DEFAULTS = ("kinetic", "elastic", "external", "energy", "stretch@max", "heat")

Named = Callable[[str], "Callable[[int, int], None] | None"]


@dataclass(frozen=True)
class Refined:
    """A word of the scene that is refined."""

    path: str
    values: list[Any]
    """At each level, the coarsest first."""

    def at(self, level: int) -> str:
        """As an override."""
        return f"{self.path}={json.dumps(self.values[level])}"


@dataclass
class Measure:
    """A number at each level, and what it tends to."""

    name: str
    values: list[float]
    """Nan where the level's run broke."""
    orders: list[float] = field(default_factory=list)
    """Observed with each three neighbouring levels; nan where they do not tend to anything."""
    order: float = math.nan
    """With the three finest."""
    limit: float = math.nan
    """Its limit: the finest value less its estimated error."""
    error: float = math.nan
    """Estimated error of the finest value, positive."""
    verdict: str = ""

    def judge(self, ulp: float, factor: float = FACTOR) -> None:
        """Finds order, limit and error (refinement.2, refinement.3); `ulp` is the relative distance of two numbers that
        neighbour each other."""
        fine = _in_a_row(self.values)
        steps = [b - a for a, b in pairwise(fine)]
        floor = ROUND_OFF * ulp * max(map(abs, fine), default=0.0)
        self.orders = [_order(a, b, factor) for a, b in pairwise(steps)]
        if len(fine) < 3:
            self.verdict = "fewer than three levels in a row"
        elif all(step == 0.0 for step in steps):
            self.order, self.limit, self.error, self.verdict = math.nan, fine[-1], 0.0, "the same at every level"
        elif abs(steps[-1]) <= floor:
            self.limit, self.error = fine[-1], floor
            self.verdict = "differs by round-off" + ("" if ulp < 1e-12 else "; take --set precision=double")
        elif not math.isfinite(self.orders[-1]):
            self.verdict = "goes to and fro: no order; refine further, or measure something else"
        elif self.orders[-1] <= 0.1:
            self.order = self.orders[-1]
            self.verdict = "does not converge at these levels"
        else:
            self.order = self.orders[-1]
            correction = steps[-1] / (factor**self.order - 1.0)
            self.limit, self.error = fine[-1] + correction, abs(correction)
            agree = len(self.orders) < 2 or abs(self.orders[-1] - self.orders[-2]) <= SETTLED
            known = len(self.orders) > 1
            self.verdict = (
                ("converges" if known else "one order only") if agree else "the order has not settled: refine further"
            )


@dataclass
class Study:
    """Result of refining a scene."""

    scene: Scene
    folder: Path
    refined: list[Refined]
    notes: list[dict[str, str]]
    runs: list[Run | None]
    """The run of each level; None where it broke."""
    failures: dict[int, str]
    """Levels that broke, and why."""
    measures: list[Measure]

    @property
    def levels(self) -> int:
        return len(self.runs)


def study(
    scene: Scene,
    folder: str | os.PathLike[str],
    levels: int = 4,
    what: Sequence[str] = (),
    measures: Sequence[str] = (),
    resume: bool = False,
    overwrite: bool = False,
    threads: int | None = None,
    progress: Named | None = None,
    warn: Callable[[list[dict[str, str]]], object] | None = None,
    prepare: Prepare | None = None,
) -> Study:
    """Runs a scene at several resolutions, in `folder`/level-0, level-1 and so on, each twice as fine as the one before, and
    looks where its measures tend to.

    `what` names the words that are refined, as `plan` has it, and `measures` what is measured, as `value` has it. `resume`
    keeps levels that were finished, `overwrite` replaces them. `warn` is told, before anything is simulated, which levels have
    steps that are too long by estimate: code, path and message of each. `prepare` is called with the world of each level and
    gives it custom forces and integrators. Raises SceneError if the scene, a path or a measure is
    wrong.
    """
    levels = whole(levels, "levels", 3)
    refined, notes = plan(scene, levels, what)
    goal = Path(folder)
    scenes = [scene.replace(*(word.at(k) for word in refined)) for k in range(levels)]
    names = list(dict.fromkeys(measures))
    if names:
        start = World(scene, threads)
        for name in names:
            _measured(name, dict.fromkeys(LEDGER, np.zeros(1)), start.frame)
    divided = _divided(scene.to_dict(), refined)
    for name in names:
        thing = next((thing for thing in divided if name.startswith(f"{thing}.")), None)
        if thing is not None and re.search(r"@[0-9]+$", name):
            raise wrong(
                name,
                f'"{thing}" is refined, so that an index is another place at each level; expected max, min or mean',
            )
    # All levels must be possible before the first is simulated.
    doubts: list[dict[str, str]] = []
    for k, finer in enumerate(scenes):
        try:
            too_long = _too_long(World(finer, threads))
        except SceneError as error:
            if k == 0:
                raise
            raise wrong(f"level {k}", str(error)) from error
        doubts += [{"code": "long-steps", "path": f"level {k}", "message": text} for text in too_long]
    if warn is not None:
        warn(doubts)
    if overwrite:
        _drop_levels(goal, levels)
    runs: list[Run | None] = []
    failures: dict[int, str] = {}
    for k, finer in enumerate(scenes):
        place = goal / f"level-{k}"
        try:
            shown = progress(f"level {k}") if progress else None
            world: World | Scene = finer
            if prepare is not None:
                world = World(finer, threads)
                prepare(world)
            own = threads if prepare is None else None
            done = simulate(world, place, resume=resume, threads=own, progress=shown, overwrite=overwrite, cures=False)
            runs.append(done)
        except StepError as error:
            failures[k] = str(error).splitlines()[0]
            runs.append(None)
    if not names:
        names = [name for name in _DEFAULTS if any(run is not None and value(run, name) != 0.0 for run in runs)]
    ulp = float(np.finfo(np.float32 if scene.to_dict()["precision"] == "single" else np.float64).eps)
    found = [Measure(name, [math.nan if run is None else value(run, name) for run in runs]) for name in names]
    for measure in found:
        measure.judge(ulp)
    return Study(scene, goal, refined, notes, runs, failures, found)


def _divided(tree: Mapping[str, Any], refined: Sequence[Refined]) -> list[str]:
    """The names of things that have other elements at each level."""
    words = [(word.path.split(".", 2)) for word in refined]
    return [tree[kind][int(i)]["name"] for kind, i, word in words if _WORDS.get(kind) == word]


def _drop_levels(goal: Path, levels: int) -> None:
    """Takes away the levels of an earlier study that went further."""
    for place in goal.glob("level-*"):
        number = place.name.removeprefix("level-")
        if number.isdigit() and int(number) >= levels and RunFolder(place).is_run():
            with alone(place):
                RunFolder(place).clear()


def _too_long(world: World) -> list[str]:
    """Systems whose steps are longer than what is usable by estimate."""
    found = []
    names = [system["name"] for system in world.scene.to_dict()["system"]]
    for about in world.stability():
        k = names.index(about["system"])
        usable = next(
            (float(at["usable"]) for at in about["limits"] if at["integrator"] == about["integrator"]), math.inf
        )
        if float(about["step"]) > usable:
            found.append(
                f'system "{about["system"]}" takes steps of {about["step"]:.3g} s, usable are {usable:.3g} s by estimate: '
                "it is likely to fail. Half the spacing needs half the step, with internal damping a quarter: use more "
                f"substeps, or refine them with --what system.{k}.substeps*4"
            )
    return found


# Refined keys


def plan(scene: Scene, levels: int, what: Sequence[str] = ()) -> tuple[list[Refined], list[dict[str, str]]]:
    """The words that are refined, with their values at each level, and warnings of what is not: code, path and message.

    `what` are paths such as "system.0.substeps" or "rope.rope.segments". Counts are doubled; masses along the sides of
    sheets and blocks are 2 n - 1, so that their distances are halved; lengths, times and tolerances are halved.
    "system.0.substeps*4" and "system.0.step/4" say another factor. Without it: how finely each thing is divided, and the
    given steps of each system; where there is nothing of that, the sub-steps.
    Raises SceneError.
    """
    tree = scene.to_dict()
    if what:
        return [_refined(scene, tree, path.strip(), levels) for path in dict.fromkeys(what)], []
    paths = [
        f"{kind}.{i}.{word}"
        for kind, word in _WORDS.items()
        for i, thing in enumerate(tree.get(kind, ()))
        if _at(thing, word)
    ]
    notes = []
    own = []
    for i, system in enumerate(tree["system"]):
        given = next((word for word in ("substeps", "step") if system.get(word)), None)
        if given:
            paths.append(f"system.{i}.{given}")
        else:
            own.append((i, system))
    if not paths:
        adaptive = [i for i, system in own if system["integrator"] in ADAPTIVE]
        if adaptive:
            cure = f"--what system.{adaptive[0]}.adaptive.tolerance refines it"
            raise wrong(
                f"system.{adaptive[0]}", f"its steps follow a tolerance, which is not refined by default; {cure}"
            )
        paths = [f"system.{i}.substeps" for i in range(len(tree["system"]))]
    else:
        notes = [
            {
                "code": "unrefined-steps",
                "path": f'system "{system["name"]}"',
                "message": f"its steps are the same at every level; --what system.{i}.substeps refines them, too",
            }
            for i, system in own
        ]
    return [_refined(scene, tree, path, levels) for path in paths], notes


def _refined(scene: Scene, tree: Mapping[str, Any], text: str, levels: int) -> Refined:
    path, times, number = (re.fullmatch(r"(.*?)(?:([*/])([0-9.]+))?", text) or _never()).groups()
    try:
        factor = float(number) if number else 0.0
    except ValueError:
        factor = math.nan
    if number and not 1.0 < factor < 1e6:
        raise wrong(text, f"a factor of {number}, expected more than 1")
    place = _named(tree, path)
    start = _at(tree, place)
    if start is None and place.endswith(".substeps"):
        start = _own_substeps(scene, tree, place)
    values = [start]
    for _ in range(levels - 1):
        values.append(_scaled(values[-1], times, factor, text) if number else _finer(place, values[-1], text))
    return Refined(place, values)


def _scaled(value: Any, times: str, factor: float, told: str) -> Any:
    """A number times a factor that was given, or divided by it."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise wrong(told, f"{value!r}, expected a number to refine by a factor")
    new = value * factor if times == "*" else value / factor
    if isinstance(value, int) and new != round(new):
        raise wrong(told, f"{value} is a count, and {new:g} is none")
    return int(new) if isinstance(value, int) else new


def _never() -> re.Match[str]:
    raise AssertionError("any text matches")


def _finer(path: str, value: Any, told: str) -> Any:
    """The value at the next level."""
    kind, word = path.split(".")[0], path.rsplit(".", 1)[-1]
    masses = kind in ("sheet", "block") and word == "resolution"
    match value:
        case bool():
            pass
        case int():
            return 2 * value
        case float() if word in _SHORTER:
            return value / 2.0
        case list() if value and all(isinstance(n, int) for n in value):
            return [2 * n - 1 if masses else 2 * n for n in value]
    text = f"{value!r}, expected a count, or a length, time or tolerance ({', '.join(_SHORTER)}) to refine"
    raise wrong(told, text)


def _named(tree: Mapping[str, Any], path: str) -> str:
    """A path with indices in place of names. Raises SceneError where it leads nowhere."""
    node: Any = tree
    words: list[str] = []
    for word in path.split("."):
        so_far = ".".join(words)
        if isinstance(node, Mapping):
            if word not in node:
                raise wrong(path, unknown(f"key{f' of {so_far}' if so_far else ''}", word, node))
            node = node[word]
        elif isinstance(node, list):
            names = [item.get("name") if isinstance(item, Mapping) else None for item in node]
            index = names.index(word) if word in names else int(word) if word.isdigit() else len(node)
            if index >= len(node):
                raise wrong(path, unknown(so_far, word, [str(name) for name in names if name]))
            node, word = node[index], str(index)
        else:
            raise wrong(path, f"{so_far} is {node!r}, there is nothing in it")
        words.append(word)
    return ".".join(words)


def _at(tree: Any, path: str) -> Any:
    for word in path.split("."):
        if isinstance(tree, list):
            tree = tree[int(word)] if int(word) < len(tree) else None
        else:
            tree = tree.get(word) if isinstance(tree, Mapping) else None
    return tree


def _own_substeps(scene: Scene, tree: Mapping[str, Any], path: str) -> int:
    """How many sub-steps a system takes that may choose."""
    index = int(path.split(".")[1])
    name = tree["system"][index]["name"]
    interval = 1.0 / tree["time"]["fps"] / tree["time"]["exchanges"]
    steps = [float(about["step"]) for about in World(scene).stability() if about["system"] == name]
    return max(1, math.ceil(interval / steps[0] - 1e-6)) if steps and steps[0] > 0.0 else 1


# Measures


_OVER_TIME: dict[str, Callable[["npt.NDArray[np.float64]"], Any]] = {
    "end": lambda curve: curve[-1],
    # Of the frames in which it is measured.
    "max": np.fmax.reduce,
    "min": np.fmin.reduce,
    "mean": lambda curve: np.mean(curve[~np.isnan(curve)]) if not np.isnan(curve).all() else np.nan,
}
_OVER_ELEMENTS: dict[str, Callable[["npt.NDArray[np.float64]"], Any]] = {"max": np.max, "min": np.min, "mean": np.mean}


def value(run: Run, measure: str) -> float:
    """A measure of a run: `COLUMN@HOW` of the ledger, where HOW is end (as without it), max, min or mean over the frames; or
    `OBJECT.COLUMN@HOW`, `OBJECT.COLUMN.x@HOW` of the last frame, where HOW is mean (as without it), max or min over the
    elements, or the index of one. Raises SceneError."""
    return _measured(measure, run.ledger, run.frame(-1) if "." in measure.partition("@")[0] else {})


def _measured(measure: str, ledger: Mapping[str, "npt.NDArray[np.float64]"], columns: Columns) -> float:
    name, _, how = measure.partition("@")
    if "." in name:
        return _of_object(columns, measure, name, how or "mean")
    how = how or "end"
    known = [column for column in LEDGER if column not in ("frame", "hash")]
    if name not in known:
        raise wrong(measure, f"{unknown('column of the ledger', name, known)}; or OBJECT.COLUMN")
    if how not in _OVER_TIME:
        raise wrong(measure, unknown("such value over time", how, _OVER_TIME))
    return float(_OVER_TIME[how](ledger[name]))


def _of_object(columns: Columns, measure: str, name: str, how: str) -> float:
    thing = next((known for known in columns if name.startswith(f"{known}.")), None)
    if thing is None:
        raise wrong(measure, unknown("object", name.partition(".")[0], columns))
    column, _, axis = name.removeprefix(f"{thing}.").partition(".")
    if column not in columns[thing]:
        raise wrong(measure, unknown(f'kept column of "{thing}"', column, columns[thing]))
    array = np.asarray(columns[thing][column], dtype=np.float64)
    if axis:
        if axis not in list("xyzw"[: array.shape[-1]]) or array.ndim < 2:
            raise wrong(measure, f'"{axis}" is no part of {column}, which is {array.shape}')
        array = array[..., "xyzw".index(axis)]
    elif array.ndim == 2 and array.shape[1] <= 4:
        array = np.linalg.norm(array, axis=1)
    if re.fullmatch(r"[0-9]+", how):
        if not array.size:
            return math.nan
        if int(how) >= array.size:
            raise wrong(measure, f"element {how}, expected < {array.size}")
        return float(array.reshape(-1)[int(how)])
    if how not in _OVER_ELEMENTS:
        raise wrong(measure, f'"{how}", expected {", ".join(_OVER_ELEMENTS)} or the index of an element')
    return float(_OVER_ELEMENTS[how](array)) if array.size else math.nan


def _in_a_row(values: Sequence[float]) -> list[float]:
    """The finest three or more neighbouring levels that did not break, with those before them; or what there is."""
    rows: list[list[float]] = [[]]
    for number in values:
        if math.isfinite(number):
            rows[-1].append(number)
        else:
            rows.append([])
    return next((row for row in reversed(rows) if len(row) >= 3), rows[-1])


def _order(before: float, after: float, factor: float) -> float:
    """The order that two neighbouring differences show (refinement.2)."""
    if before == 0.0 or after == 0.0 or not math.isfinite(ratio := before / after) or ratio <= 0.0:
        return math.nan
    return math.log(ratio) / math.log(factor)


# Output


def write(found: Study) -> Path:
    """Writes the table into the folder of the study. Raises ExportError."""
    header = ["measure", *(f"level_{k}" for k in range(found.levels)), "order", "limit", "error", "verdict"]
    lines = [header]
    for m in found.measures:
        numbers = [*m.values, m.order, m.limit, m.error]
        lines.append([m.name, *map(cell, numbers), '"' + m.verdict + '"'])
    table = found.folder / "convergence.csv"
    write_whole(table, "".join(",".join(line) + "\n" for line in lines).encode())
    return table
