"""A small scene that breaks as a given one does, found by leaving things out and trying: delta debugging.

A change is kept if the first that breaks is still the same (breakdown.4). What is tried is counted, in trials and in work, and
never timed: the same scene gives the same answer on any machine. Source: [zeller2002].
"""

import json
import math
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from tumble._engine import Scene, SceneError, StepError, World
from tumble.columns import KINDS, OBJECTS, on_grids
from tumble.folder import write_whole
from tumble.toml import toml

T = TypeVar("T")
Tree = dict[str, Any]
Unit = tuple[str, int]
"""A table of a list of the scene: the list's name and the index in the scene that broke."""

FILE = "minimal.toml"
"""Its name in the folder of the run."""

TRIALS = 24
"""Scenes that are simulated at most."""

BUDGET = (2.0, 2e6)
"""Work of all trials: so many times that of the run until it broke, and so much more [sub-steps times elements]."""

_OVERHEAD = 100
"""Elements that a sub-step costs beside those that there are."""

_STEEPER = 4.0
"""Trials whose sub-steps are estimated to be more than so many times those of the run are left out."""

_LISTS = (*KINDS, "anchor", "field", "force", "system")

_TOLD = ("title", "output", "camera", "expect")
"""Keys without effect on the simulation."""

_PAINT = ("color", "trail")

_NAMES = ("on", "from", "bodies", "predators", "sheet", "collider", "object", "of", "system", "between")
"""Words that name other things."""

_COUNTS = {
    kind.name: (*kind.amounts, *([kind.resolution] if kind.resolution else []))
    for kind in KINDS.values()
    if kind.amounts or kind.resolution
}
"""Counts that are lowered."""

_SCHEME = ("name", "system", "kind", "method", "integrator", "scheme", "substeps", "step")
"""Words that are never left out: with them it would be another scheme that breaks."""

_SHARES = (0.5, 0.75, 0.85, 1.0)
"""Of all trials, what may be used after leaving out things, lowering counts, thinning lists, and leaving out words."""


@dataclass(frozen=True)
class Minimal:
    """The smallest scene that was found."""

    tree: Tree
    folder: str
    report: Mapping[str, Any]
    """Of its breakdown."""
    trials: int
    sizes: dict[str, tuple[int, int]]
    """Reductions: objects, elements and frames as (now, before)."""

    @property
    def text(self) -> str:
        """How much smaller it is, in words."""
        parts = [f"{now} of {before} {what}" for what, (now, before) in self.sizes.items() if before]
        return f"{', '.join(parts)}; {self.trials} trial{'s' if self.trials != 1 else ''}"


class _Enough(Exception):
    """Trials or work are used up."""


def minimize(
    scene: Scene,
    report: Mapping[str, Any],
    frame: int,
    steps: float,
    sure: bool = True,
    threads: int | None = None,
    trials: int = TRIALS,
) -> Minimal | None:
    """The smallest scene that breaks as `report` says, at the latest in `frame`, counted from 1; `scene` took so many sub-steps
    for the frames before. With `sure`, it is known that it does so from its start. None if it does not."""
    search = _Search(scene, report, frame, steps, threads, trials)
    if sure:
        search.tried[_key(search.scene(search.full))] = True
    elif not search.does(search.full, set()):
        return None
    phases = (search.leave_out_things, search.lower_counts, search.thin_lists, search.leave_out_words)
    for phase, share in zip(phases, _SHARES, strict=True):
        search.most = min(trials, max(1, round(share * trials)))
        with suppress(_Enough):
            phase()
    return search.found()


def write(found: Minimal, path: Path, command: str) -> None:
    """Writes it as a scene whose paths hold from where it lies. Raises ExportError, and SceneError if what would be read back
    is another scene."""
    tree = _moved(found.tree, Path(found.folder), path.parent)
    whole = Scene(tree, path.parent).to_dict()
    for form in (slim(_without_systems(tree)), slim(tree), _without_nulls(tree)):
        text = f"# `{command}` {_one_line(told(found.report))}\n{toml(form)}"
        write_whole(path, text.encode())
        with suppress(SceneError):
            if Scene.load(path).to_dict() == whole:
                return
    path.unlink()
    raise SceneError(f"{path}: reads as another scene")


def told(report: Mapping[str, Any]) -> str:
    """The failure, in one line."""
    kind = str(report.get("kind", "")).replace("_", " ")
    where = f'{report["column"]} of "{report["object"]}"' if "object" in report else f'system "{report.get("system")}"'
    when = f" at t = {report['time']:.6g} s" if isinstance(report.get("time"), float) else ""
    return f"breaks as the run in this folder did: {where}, {kind}{when}"


class _Search:
    """The scene so far, and what is known of the break that it must show."""

    def __init__(
        self, scene: Scene, report: Mapping[str, Any], frame: int, steps: float, threads: int | None, trials: int
    ) -> None:
        self.folder, self.threads = scene.folder, threads
        full = scene.to_dict()
        world = World(scene, threads)
        size = _elements(world, full)
        self.before = _sizes(full, size, full["time"]["frames"])
        full["time"]["frames"] = frame
        self.after = _sizes(full, size, frame)
        for key in _TOLD:
            full.pop(key, None)
        for kind in _LISTS:
            for thing in full[kind]:
                for key in _PAINT if kind != "emitter" else ():  # Which draws them at random.
                    thing.pop(key, None)
        self.full: Tree = full
        self.gone: set[Unit] = set()
        self.report = report
        self.fault = self._fault(report, full)
        self.frame = frame
        self.trials, self.most = 0, trials
        self.per_frame = max(_steps(report, full), _expected(world, full), steps / max(frame - 1, 1))
        self.work = (steps + self.per_frame) * (size + _OVERHEAD)
        """Of the smallest so far."""
        self.left = BUDGET[0] * self.work + BUDGET[1]
        self.tried: dict[str, bool] = {}
        self.kept = {
            (kind, i) for kind in OBJECTS for i, o in enumerate(full[kind]) if o["name"] == report.get("object")
        }
        self.kept |= {("system", i) for i, s in enumerate(full["system"]) if s["name"] == report.get("system")}

    # Trials

    def leave_out_things(self) -> None:
        """All but the culprit and its system; else halves, quarters and so on of the rest."""
        rest = [(kind, i) for kind in _LISTS for i in range(len(self.full[kind])) if (kind, i) not in self.kept]
        self._thin(rest, lambda units: self.does(self.full, self.gone | set(units)))

    def lower_counts(self) -> None:
        """To an eighth as long as that does, then to halves; where coarser does not, smaller of the same fineness."""
        for kind, i in self._here(_COUNTS):
            for word in _COUNTS[kind]:
                for factor, how in ((8, _coarser), (8, _smaller), (2, _coarser), (2, _smaller)):
                    while (thing := how(kind, word, self.full[kind][i], factor)) is not None:
                        changed = {**self.full, kind: list(self.full[kind])}
                        changed[kind][i] = thing
                        if not self.does(changed, self.gone):
                            break

    def thin_lists(self) -> None:
        """Particles that are listed, then springs, pins, regions, sources and such."""
        for kind, i in self._here(("particles",)):
            thing = self.full[kind][i]
            count = len(thing["position"])
            own = thing["name"] == self.report.get("object") and self.report.get("id") is None
            one = int(self.report.get("index", 0)) if own else 0
            if count < 2 or one >= count:
                continue
            # Those that nothing binds to the culprit go first.
            bound = _bound(thing, one)
            without = self._without_particles(kind, i)
            self._thin([j for j in range(count) if j not in bound], without)
            self._thin([j for j in sorted(bound) if j != one], without)
        for kind, i in self._here(_LISTS):
            thing = self.full[kind][i]
            nested = [f"{key}.{word}" for key, table in thing.items() if isinstance(table, dict) for word in table]
            for key in [*thing, *nested]:
                value = _at(thing, key)
                if key in _NAMES or not isinstance(value, list) or len(value) < 2:
                    continue
                if all(isinstance(item, dict) or (key == "pin" and isinstance(item, str)) for item in value):
                    self._thin_list(kind, i, key)

    def leave_out_words(self) -> None:
        """Words that have defaults."""
        words: list[tuple[Unit | None, str]] = []
        for kind, i in self._here(_LISTS):
            thing = self.full[kind][i]
            words += [((kind, i), key) for key in _optional(thing, kind) if key not in _SCHEME]
        words += [(None, key) for key in ("world", "seed", "bits") if key in _optional(self.full, None)]
        words += [(None, "time.exchanges")] * (self.full["time"]["exchanges"] != 1)

        def without(some: Sequence[tuple[Unit | None, str]]) -> bool:
            changed = deepcopy(self.full)
            for unit, key in some:
                if unit is not None:
                    changed[unit[0]][unit[1]].pop(key, None)
                elif key == "time.exchanges":
                    changed["time"].pop("exchanges", None)
                else:
                    changed.pop(key, None)
            return self.does(changed, self.gone)

        # One that must be there, as this or that it is made of, would spoil all others.
        self._thin([word for word in words if self._possible(word)], without)

    def _possible(self, word: tuple[Unit | None, str]) -> bool:
        unit, key = word
        if unit is None:
            return True
        changed = deepcopy(self.full)
        changed[unit[0]][unit[1]].pop(key, None)
        try:
            self.scene(self._without(changed, set(self.gone)))
        except SceneError:
            return False
        return True

    def _here(self, kinds: Sequence[str] | Mapping[str, Any]) -> list[Unit]:
        """The things that are left, the culprit first."""
        found = [(kind, i) for kind in kinds for i in range(len(self.full[kind])) if (kind, i) not in self.gone]
        return sorted(found, key=lambda unit: unit not in self.kept)

    def _without_particles(self, kind: str, i: int) -> Callable[[Sequence[int]], bool]:
        """Tries to leave out more and more of what particles there are now, by their indices."""
        whole = deepcopy(self.full[kind][i])
        kept = set(range(len(whole["position"])))

        def without(some: Sequence[int]) -> bool:
            changed = deepcopy(self.full)
            changed[kind][i] = _some(whole, sorted(kept - set(some)))
            if not self.does(changed, self.gone):
                return False
            kept.difference_update(some)
            return True

        return without

    def _thin_list(self, kind: str, i: int, key: str) -> None:
        whole = list(_at(self.full[kind][i], key))
        kept = set(range(len(whole)))

        def without(some: Sequence[int]) -> bool:
            changed = deepcopy(self.full)
            _put(changed[kind][i], key, [whole[j] for j in sorted(kept - set(some))])
            if not self.does(changed, self.gone):
                return False
            kept.difference_update(some)
            return True

        self._thin(range(len(whole)), without)

    def _thin(self, parts: Sequence[T], without: Callable[[Sequence[T]], bool]) -> None:
        """Leaves out as many of the parts as it can: all, halves, quarters, ..., single ones."""
        left, size = list(parts), len(parts)
        while left and size >= 1:
            for chunk in list(_chunks(left, size)):
                if self.trials >= self.most:
                    return
                if without(chunk):
                    left = [part for part in left if part not in chunk]
            size //= 2

    # Trying

    def does(self, full: Tree, gone: set[Unit]) -> bool:
        """Whether the scene without some things breaks as it must; then it is the smallest so far. Raises _Enough."""
        gone = set(gone)
        found = self._build(full, gone)
        if found is None:
            return False
        tree, scene = found
        key = _key(scene)
        if key not in self.tried:
            self.tried[key] = False
            report = self._simulate(scene, tree)
            if report is None:
                return False
            self.tried[key] = True
        elif not self.tried[key]:
            return False
        self.full, self.gone = full, gone
        return True

    def _build(self, full: Tree, gone: set[Unit]) -> tuple[Tree, Scene] | None:
        """The scene without some things, and without what cannot be without them, which join the set; None if there is none."""
        for _ in range(5):
            tree = self._without(full, gone)
            try:
                return tree, self.scene(tree)
            except SceneError as error:
                there = {k: [i for i in range(len(full[k])) if (k, i) not in gone] for k in _LISTS}
                more = {u for issue in error.issues if (u := _unit(str(issue["path"]), full, there)) is not None}
                more -= self.kept
                if not more:
                    return None
                gone |= more
        return None

    def scene(self, tree: Tree) -> Scene:
        return Scene(tree, self.folder)

    def _without(self, full: Tree, gone: set[Unit]) -> Tree:
        """The tree without some things, and without what names them; what nothing is left of joins them."""
        while True:
            lost = {full[kind][i]["name"] for kind, i in gone if kind in (*KINDS, "system") and "name" in full[kind][i]}
            tree = {key: value for key, value in full.items() if key not in _LISTS}
            more: set[Unit] = set()
            for kind in _LISTS:
                tree[kind] = []
                for i, thing in enumerate(full[kind]):
                    if (kind, i) in gone:
                        continue
                    scrubbed = _scrubbed(thing, lost) if lost else deepcopy(thing)
                    if scrubbed is None and (kind, i) not in self.kept:
                        more.add((kind, i))
                    else:
                        tree[kind].append(scrubbed if scrubbed is not None else deepcopy(thing))
            if not more:
                return tree
            gone |= more

    def _simulate(self, scene: Scene, tree: Tree) -> Mapping[str, Any] | None:
        """The report of the break, if it is the same."""
        if self.trials >= self.most or self.left <= 0.0:
            raise _Enough
        try:
            world = World(scene, self.threads)
        except SceneError:
            return None
        finally:
            self.trials += 1  # Building takes its time, too.
        if _expected(world, tree) > _STEEPER * self.per_frame:
            return None
        size = _elements(world, tree) + _OVERHEAD
        most, work = min(self.left, self.work), 0.0
        try:
            while world.frame_index < self.frame and work <= most:
                if tree["emitter"]:
                    size = _elements(world, tree) + _OVERHEAD
                work += max(1, int(world.step()["steps"])) * size
        except StepError as error:
            report: Mapping[str, Any] = error.report
            work += _steps(report, tree) * size
            if self._fault(report, tree) != self.fault:
                return None
            self.report, self.frame, self.work = report, world.frame_index + 1, min(work, self.work)
            self.after = _sizes(tree, size - _OVERHEAD, self.frame)
            return report
        finally:
            self.left -= work
        return None

    def _fault(self, report: Mapping[str, Any], tree: Tree) -> tuple[Any, ...]:
        """Invariants of a failure (breakdown.4)."""
        step, stable = float(report.get("step") or 0.0), float(report.get("stable_step", math.inf))
        long = step > stable
        cause = report.get("cause") or report.get("message") or ""

        def whole(match: re.Match[str]) -> str:
            things = tree.get(match[1], [])
            return json.dumps(things[int(match[2])], sort_keys=True) if int(match[2]) < len(things) else match[0]

        # Indices change with what is left out, places with what is coarser.
        reason = re.sub(r"(force|field)\[(\d+)\]", whole, str(cause))
        reason = re.sub(r" at \[.*?\]| at t = \S+ s", "", reason)
        keys = ("kind", "system", "object", "column")
        return (*(report.get(key) for key in keys), long, reason)

    def found(self) -> Minimal:
        tree = self._without(self.full, set(self.gone))
        tree["time"]["frames"] = self.frame
        sizes = {key: (self.after[key], self.before[key]) for key in self.before}
        return Minimal(tree, self.folder, self.report, self.trials, sizes)


# Parts of scenes


def _key(scene: Scene) -> str:
    return json.dumps(scene.to_dict(), sort_keys=True)


def _sizes(tree: Tree, elements: int, frames: int) -> dict[str, int]:
    things = sum(len(tree[kind]) for kind in _LISTS if kind != "system")
    return {"things": things, "masses and cells": elements, "frames": frames}


def _elements(world: World, tree: Tree) -> int:
    """Masses, particles and cells that are there now."""
    columns = world.columns("position")
    names = [thing["name"] for kind in OBJECTS for thing in tree[kind]]
    masses = sum(len(columns[name]["position"]) for name in names if "position" in columns.get(name, {}))
    boxes = [thing["box"] for _, thing in on_grids(tree)]
    across = "xyz".index(next(axis for axis in "xyz" if axis not in tree["plane"])) if tree["dimension"] == 2 else None
    cells = 0
    for box in boxes:
        sides = [side for axis, side in enumerate(box["size"]) if axis != across]
        dx = max(sides) / box["resolution"]
        cells += math.prod(max(1, round(side / dx)) for side in sides)
    return masses + cells


def _expected(world: World, tree: Tree) -> float:
    """The sub-steps that a frame takes by estimate."""
    return sum(1.0 / float(tree["time"]["fps"] * about["step"]) for about in world.stability() if about["step"] > 0.0)


def _steps(report: Mapping[str, Any], tree: Tree) -> float:
    """The sub-steps of the frame that broke."""
    step = float(report.get("step") or 0.0)
    return max(1.0, 1.0 / tree["time"]["fps"] / step) if step > 0.0 else 1.0


def _scrubbed(thing: Any, lost: set[str]) -> Any:
    """A table without what names lost things; None if it is nothing without them."""
    found: Tree = {}
    for key, value in thing.items():
        if isinstance(value, dict):
            value = _scrubbed(value, lost)
            if value is None:
                return None
        elif isinstance(value, list):
            tables = [_scrubbed(item, lost) if isinstance(item, dict) else item for item in value]
            if key == "between" and any(isinstance(item, str) and item.rpartition(" ")[0] in lost for item in value):
                return None
            gone = lost if key in _NAMES else set()
            value = [item for item in tables if item is not None and not (isinstance(item, str) and item in gone)]
            if tables and not value and key in ("on", "from"):
                return None
        elif key in _NAMES and isinstance(value, str) and value in lost:
            return None
        found[key] = value
    return found


def _unit(path: str, full: Tree, there: Mapping[str, Sequence[int]]) -> Unit | None:
    """The thing that an issue of a scene is about; `there` are the indices of those that the scene has."""
    match = re.match(r'(\w+)(?:\[(\d+)\]|\.(\d+)| "(.*?)")', path)
    if match is None or match[1] not in there:
        return None
    kind, number = match[1], match[2] or match[3]
    if number is not None:
        return (kind, there[kind][int(number)]) if int(number) < len(there[kind]) else None
    return next(((kind, i) for i in there[kind] if full[kind][i].get("name") == match[4]), None)


def _coarser(kind: str, word: str, thing: Tree, factor: int) -> Tree | None:
    """A thing with a count that is lower by a factor; None if it has none."""
    less = _fewer(kind, word, _at(thing, word), factor)
    if less is None:
        return None
    changed = deepcopy(thing)
    _put(changed, word, less)
    return changed


def _smaller(kind: str, word: str, thing: Tree, factor: int) -> Tree | None:
    """The same, but made smaller by as much, so that it is as fine as before; None if there is no such thing."""
    changed = _coarser(kind, word, thing, factor)
    if changed is None:
        return None
    before, after = _at(thing, word), _at(changed, word)
    if kind in ("sheet", "block"):
        changed["size"] = [s * (b - 1) / (a - 1) for s, b, a in zip(thing["size"], after, before, strict=True)]
    elif word == "box.resolution":
        changed["box"]["size"] = [s * after / before for s in thing["box"]["size"]]
    elif (kind, word) == ("rope", "segments"):
        ends = zip(thing["from"], thing["to"], strict=True)
        changed["to"] = [a + (b - a) * after / before for a, b in ends]
    else:
        return None
    return changed


def _fewer(kind: str, word: str, value: Any, factor: int) -> Any:
    """A count that is lower by a factor; None if there is none."""
    lattice = kind in ("sheet", "block")
    match value:
        case bool() | None:
            return None
        case int():
            less: Any = value // factor
            return less if less >= 1 else None
        case float():  # A length of edges.
            return value * factor if word == "resolution" and value * factor < 100.0 else None
        case [*boxes] if word == "fluid.fill":
            return [{**box, "size": [side / factor for side in box["size"]]} for box in boxes]
        case [*numbers] if numbers and all(isinstance(n, int) for n in numbers):
            less = [max(2, (n - 1) // factor + 1) if lattice else max(1, n // factor) for n in numbers]
            return less if less != numbers and max(numbers) >= factor else None
    return None


def _bound(thing: Tree, one: int) -> set[int]:
    """The particles that springs join to one, and itself."""
    found, edge = {one}, [one]
    while edge:
        here = edge.pop()
        for spring in thing["spring"]:
            a, b = spring["between"]
            for other in (b,) if a == here else (a,) if b == here else ():
                if other not in found:
                    found.add(other)
                    edge.append(other)
    return found


def _some(thing: Tree, keep: Sequence[int]) -> Tree:
    """Listed particles, but only some of them."""
    found, count = deepcopy(thing), len(thing["position"])
    new = {old: i for i, old in enumerate(keep)}
    for key in ("position", "velocity", "mass", "charge"):
        if len(thing[key]) == count:
            found[key] = [thing[key][i] for i in keep]
    found["spring"] = [
        {**spring, "between": [new[i] for i in spring["between"]]}
        for spring in thing["spring"]
        if all(i in new for i in spring["between"])
    ]
    found["pin"] = []
    for pin in thing["pin"]:
        match = re.fullmatch(r"vertex (\d+)", pin) if isinstance(pin, str) else None
        if match is None:
            found["pin"].append(pin)
        elif int(match[1]) in new:
            found["pin"].append(f"vertex {new[int(match[1])]}")
    return found


def _chunks(parts: Sequence[T], size: int) -> Iterator[list[T]]:
    for begin in range(0, len(parts), size):
        yield list(parts[begin : begin + size])


def _at(tree: Any, path: str) -> Any:
    for word in path.split("."):
        tree = tree.get(word) if isinstance(tree, Mapping) else None
    return tree


def _put(tree: Tree, path: str, value: Any) -> None:
    *way, last = path.split(".")
    for word in way:
        tree = tree[word]
    tree[last] = value


# The shortest way to write a scene


def slim(tree: Tree) -> Tree:
    """A resolved scene without what is as the schema says that it is without a word."""
    slimmed: Tree = _slim(tree, Scene.schema())
    return slimmed


def _slim(value: Any, node: Mapping[str, Any]) -> Any:
    node = _meant(node, value)
    if isinstance(value, dict):
        properties, needed = node.get("properties", {}), node.get("required", ())
        found = {}
        for key, item in value.items():
            own = properties.get(key, {})
            if item is None or (key not in needed and "default" in own and own["default"] == item):
                continue
            slimmed = _slim(item, own)
            # A table of defaults is itself one, if that is what it is without words.
            if key not in needed and slimmed == {} and isinstance(own.get("default"), dict):
                continue
            found[key] = slimmed
        return found
    if isinstance(value, list):
        return [_slim(item, node.get("items", {})) for item in value]
    return value


def _meant(node: Mapping[str, Any], value: Any) -> Mapping[str, Any]:
    """The part of the schema that a value follows."""
    if "$ref" in node:
        return _meant(Scene.schema()["$defs"][node["$ref"].rpartition("/")[2]], value)
    for variant in (*node.get("oneOf", ()), *node.get("anyOf", ())):
        meant = _meant(variant, value)
        properties = meant.get("properties")
        if isinstance(value, dict) and properties is not None and set(value) <= set(properties):
            if all("const" not in p or p["const"] == value.get(k) for k, p in properties.items()):
                return meant
        elif isinstance(value, list) and "items" in meant:
            return meant
    return node


def _optional(thing: Tree, kind: str | None) -> list[str]:
    """The words of a table of a list, or of the scene, that are other than without them."""
    schema = Scene.schema()
    node = _meant(schema["properties"][kind]["items"] if kind else schema, thing)
    properties, needed = node.get("properties", {}), node.get("required", ())
    return [k for k, v in thing.items() if k in properties and k not in needed and v != properties[k].get("default")]


def _without_systems(tree: Tree) -> Tree:
    """The same, its systems left to defaults."""
    kept = {key: value for key, value in tree.items() if key != "system"}
    return kept | {
        kind: [{key: value for key, value in thing.items() if key != "system"} for thing in tree.get(kind, ())]
        for kind in OBJECTS
    }


def _without_nulls(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_nulls(item) for key, item in value.items() if item is not None}
    return [_without_nulls(item) for item in value] if isinstance(value, list) else value


def _moved(value: Any, source: Path, goal: Path) -> Any:
    """The same with paths that lead from `goal` where they led from `source`."""
    if isinstance(value, list):
        return [_moved(item, source, goal) for item in value]
    if not isinstance(value, dict):
        return value
    found = {key: _moved(item, source, goal) for key, item in value.items()}
    if "hash" in found and isinstance(found.get("path"), str) and not Path(found["path"]).is_absolute():
        path = (source / found["path"]).resolve()
        try:
            found["path"] = Path(os.path.relpath(path, goal.resolve())).as_posix()
        except ValueError:  # On another drive.
            found["path"] = str(path)
    return found


def _one_line(text: str) -> str:
    return "".join(c if c.isprintable() else " " for c in text)
