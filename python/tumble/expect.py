"""The bounds of a scene's [expect] table: those on curves are looked at in every frame, the others at the end of a run."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from tumble import measures
from tumble._engine import SceneError, World
from tumble.folder import LEDGER

Curve = npt.NDArray[np.float64]
Row = Mapping[str, Any]
"""The numbers of a frame in ledger.csv."""


class Recorded(Protocol):
    """What is judged of a run."""

    @property
    def manifest(self) -> Mapping[str, Any]:
        """What run.json says."""

    @property
    def scene(self) -> Mapping[str, Any]:
        """The resolved scene."""

    @property
    def n_frames(self) -> int:
        """Frames there are; frame 0 is the start."""

    @property
    def ledger(self) -> Mapping[str, npt.NDArray[Any]]:
        """Books, one row per frame."""


@dataclass(frozen=True)
class Broken:
    """An expectation that a run broke."""

    name: str
    """The key in [expect]."""
    frame: int
    """The first frame that broke it."""
    value: float
    """The value there."""
    bound: float
    unit: str
    text: str
    """All of that in a sentence, with the culprit."""
    culprit: dict[str, Any] = field(default_factory=dict)
    """The violator, as far as known: system, object, other, particles, id, cell."""

    def to_dict(self) -> dict[str, Any]:
        return asdict(self)


_BOUNDS = {bound.name: bound for bound in measures.BOUNDS}

_COLUMNS = {measure.name: measure.columns for measure in measures.LEDGER}

_WORST = [bound.measure for bound in measures.BOUNDS if bound.how == "value"]
"""Numbers of the ledger that are those of the worst element."""

_KEPT = {
    bound.name: bound.measure
    for bound in measures.BOUNDS
    if bound.how in ("change", "error", "drift", "growth", "balance")
}
"""Conserved quantities, and their numbers in the ledger."""


def count(scene: Mapping[str, Any]) -> int:
    """How many expectations a resolved scene has."""
    expect = scene.get("expect", {})
    return sum(expect.get(name) is not None for name in _BOUNDS) + len(expect.get("probe", ()))


def numbers(row: Sequence[str]) -> Row:
    """A row of ledger.csv without its hash."""
    return {name: float(text) for name, text in zip(LEDGER[:-1], row, strict=False)}


class _Relative:
    """Changes over the largest size in any frame so far."""

    def __init__(self) -> None:
        self.size = 0.0

    def __call__(self, change: float, *sizes: float) -> float:
        self.size = max(self.size, *map(abs, sizes))
        # Without any size there is nothing to drift from.
        return change / self.size if self.size > 0.0 else (0.0 if change == 0.0 else math.nan)


class Measures:
    """Values of the bounded curves, frame by frame."""

    def __init__(self) -> None:
        self._first: Row | None = None
        self._energy, self._heat = _Relative(), _Relative()

    def energy(self, row: Row) -> float:
        """(E - E_0) over the largest kinetic or elastic energy, or change of external energy, of any frame so far."""
        first = self._first = self._first or row
        return self._energy(
            row["energy"] - first["energy"], row["kinetic"], row["elastic"], row["external"] - first["external"]
        )

    def add(self, row: Row) -> dict[str, float]:
        """The bounded values at the next frame; nan of what is not measured there."""
        growth = self.energy(row)
        first = self._first or row
        found: dict[str, float] = {}
        for bound in measures.BOUNDS:
            columns = _COLUMNS[bound.measure]
            now, start = ([float(frame[column]) for column in columns] for frame in (row, first))
            measured = not any(map(math.isnan, now))
            found[bound.name] = self._value(bound.how, now, start, growth, row) if measured else math.nan
        return found

    def _value(self, how: str, now: Sequence[float], start: Sequence[float], growth: float, row: Row) -> float:
        match how:
            case "change":
                return math.dist(now, start)
            case "error":
                return abs(now[0] - start[0]) / max(abs(start[0]), 1e-300)
            case "drift":
                return abs(growth)
            case "growth":
                return growth
            case "balance":
                # |heat gained - heat that came in| over the largest of both.
                return self._heat(abs(row["heat"] - row["heat_in"]), row["heat"], row["heat_in"])
            case _:
                return now[0]


def energy_changes(ledger: Mapping[str, npt.NDArray[Any]]) -> Curve:
    """`Measures.energy` of every frame."""
    measures = Measures()
    names = ("energy", "kinetic", "elastic", "external")
    columns = [ledger[name].tolist() for name in names]
    return np.array([measures.energy(dict(zip(names, row, strict=True))) for row in zip(*columns, strict=True)])


class Bounds:
    """The bounds on curves that a run has to keep to in every frame."""

    def __init__(self, expect: Mapping[str, Any]) -> None:
        self._bounds = {
            name: float(limit)
            for name, limit in expect.items()
            if name in _BOUNDS and _BOUNDS[name].how not in ("last", "exact") and limit is not None
        }
        self._idle = set(self._bounds)
        self._measures = Measures()
        self._frame = -1
        self.broken: list[Broken] = []
        """Those that are broken, each by the first frame that does."""

    def add(self, row: Row) -> None:
        """Looks at the next frame."""
        self._frame += 1
        if not self._bounds:
            return
        values = self._measures.add(row)
        self._idle -= {name for name, value in values.items() if not math.isnan(value)}
        for name, value in values.items():
            bound = self._bounds.get(name)
            # A number that is none breaks the bound, unless there never was one.
            if bound is None or value <= bound or name in self._idle or any(b.name == name for b in self.broken):
                continue
            unit = _unit(name)
            text = f"{name}: {value:.6g}{unit} at frame {self._frame}, expected at most {bound:.6g}{unit}"
            self.broken.append(Broken(name, self._frame, value, bound, unit.strip(), text))

    @property
    def idle(self) -> list[Broken]:
        """Those on what nothing has measured so far."""
        return [_idle(name, self._frame, self._bounds[name]) for name in sorted(self._idle)]


def _unit(name: str) -> str:
    """The unit of a bound behind its number."""
    unit = _BOUNDS[name].unit
    return "" if unit == "1" else f" {unit}"


def _idle(name: str, frame: int, bound: float) -> Broken:
    text = f"{name} bounds nothing here: {_BOUNDS[name].measure} was not measured"
    return Broken(name, frame, math.nan, bound, _unit(name).strip(), text)


def check(run: Recorded) -> list[Broken]:
    """The expectations that a run broke: by its frames, and if it went on to its last one, there."""
    expect = run.scene.get("expect", {})
    if not run.n_frames:
        return []
    bounds = Bounds(expect)
    for row in zip(*(run.ledger[name].tolist() for name in LEDGER[:-1]), strict=True):
        bounds.add(dict(zip(LEDGER, row, strict=False)))
    whole = run.n_frames > run.manifest["frames"] and ends_as_meant(run.manifest)
    return [*bounds.broken, *bounds.idle, *(b for b in (_at_the_end(run, expect) if whole else []) if b is not None)]


def ends_as_meant(manifest: Mapping[str, Any]) -> bool:
    """Whether a run is to end with the frame that expectations at the end are meant for, and not earlier or later."""
    frames = manifest.get("frames")
    return bool(frames == manifest.get("whole_frames", frames))


def skipped(run: Recorded) -> int:
    """How many expectations at the end are not looked at, because the run was asked to end elsewhere."""
    if ends_as_meant(run.manifest):
        return 0
    expect = run.scene.get("expect", {})
    ends = [bound.name for bound in measures.BOUNDS if bound.how in ("last", "exact")]
    return sum(expect.get(name) is not None for name in ends) + len(expect.get("probe", ()))


def blamed(broken: Broken, world: World) -> Broken:
    """The same with who broke it, in a world that is at that frame."""
    name = broken.name.removeprefix("max_")
    try:
        if name in _WORST:
            culprit = _worst(world.account(), name)
        elif broken.name in _KEPT:
            culprit = _changed(world.account(), World(world.scene).account(), _KEPT[broken.name])
        else:
            return broken
    except SceneError:
        # A file of the scene is there no more.
        return broken
    return replace(broken, culprit=culprit, text=f"{broken.text}{_told(culprit)}") if culprit else broken


def _worst(account: Mapping[str, Any], name: str) -> dict[str, Any]:
    """The element with the worst number; where that is not known, the object or system."""
    found = [worst for worst in account["worst"] if worst["measure"] == name]
    if found:
        worst = max(found, key=lambda worst: worst["value"])
        return {
            key: worst[key] for key in ("object", "other", "particles", "id", "cell") if worst[key] not in (None, [])
        }
    return _most(account, lambda ledger, _: abs(ledger[name] or 0.0), account)


def _changed(account: Mapping[str, Any], start: Mapping[str, Any], name: str) -> dict[str, Any]:
    """The object, or system, of which most has gone or come since the start."""

    def amount(ledger: Mapping[str, Any]) -> Any:
        if name == "energy":
            return ledger["kinetic"] + ledger["elastic"] + ledger["external"]
        if name == "heat":
            return (ledger["heat"] or 0.0) - (ledger["heat_in"] or 0.0)
        return 0.0 if ledger[name] is None else np.array(ledger[name])

    def change(now: Mapping[str, Any], before: Mapping[str, Any] | None) -> float:
        return float(np.linalg.norm(np.atleast_1d(amount(now) - (amount(before) if before else 0.0))))

    if name != "energy":
        return _most(account, change, start)
    # Anchors between objects and forces on them belong to the system.
    culprit = _most({**account, "shares": []}, change, start)
    fastest = _worst(account, "speed")
    return culprit | {"fastest": fastest} if culprit and fastest else culprit


def _most(account: Mapping[str, Any], size: Any, start: Mapping[str, Any]) -> dict[str, Any]:
    """The object, or where there are none the system, of the largest size of its ledger beside that at the start."""
    shares = [({"system": s["system"], "object": s["object"]}, s["ledger"]) for s in account["shares"]]
    before = {(s["system"], s["object"]): s["ledger"] for s in start["shares"]}
    if not shares:
        shares = [({"system": name}, ledger) for name, ledger in account["systems"]]
        before = {(name, None): ledger for name, ledger in start["systems"]}
    sizes = [size(ledger, before.get((who["system"], who.get("object")))) for who, ledger in shares]
    most = max(range(len(sizes)), key=sizes.__getitem__, default=None)
    return shares[most][0] if most is not None and sizes[most] > 0.0 else {}


def _told(culprit: Mapping[str, Any]) -> str:
    """The culprit in words."""
    words = f', by "{culprit["object"]}"' if "object" in culprit else f', by system "{culprit["system"]}"'
    if "id" in culprit:
        words += f", the particle with id {culprit['id']}"
    elif particles := culprit.get("particles"):
        words += f", particle{'s' if len(particles) > 1 else ''} {' and '.join(map(str, particles))}"
    if "cell" in culprit:
        words += f", cell {tuple(culprit['cell'])}"
    if "other" in culprit:
        words += f', through "{culprit["other"]}"'
    if "fastest" in culprit:
        words += f"; fastest there{_told(culprit['fastest'])[4:]}"
    return words


def _at_the_end(run: Recorded, expect: Mapping[str, Any]) -> list[Broken | None]:
    last = run.n_frames - 1
    broken: list[Broken | None] = []
    for name, how in ((b.name, b.how) for b in measures.BOUNDS if b.how in ("last", "exact")):
        if (bound := expect.get(name)) is None:
            continue
        value, unit = float(run.ledger[_COLUMNS[_BOUNDS[name].measure][0]][-1]), _unit(name)
        if math.isnan(value):
            broken.append(_idle(name, last, bound))
        elif how == "last" and not value <= bound:
            text = f"{name}: {value:.6g}{unit} at frame {last}, expected at most {bound:.6g}{unit}"
            broken.append(Broken(name, last, value, bound, unit.strip(), text))
        elif how == "exact" and value != bound:
            text = f"{name}: {value:.0f}{unit} by frame {last}, expected {bound}{unit}"
            broken.append(Broken(name, last, value, bound, unit.strip(), text))
    probes = expect.get("probe", ())
    return broken + [_probe(p, v, last) for p, v in zip(probes, run.manifest.get("probes", ()), strict=False)]


def _probe(probe: Mapping[str, Any], value: Sequence[float], last: int) -> Broken | None:
    """Whether a mass is elsewhere than it should be."""
    found = np.array([float(x) for x in value])
    off = float(np.linalg.norm(found - np.resize(probe["value"], found.shape)))
    if off <= probe["tolerance"]:
        return None
    name = f'probe "{probe["object"]}".{probe["column"]}[{probe["index"]}]'
    numbers = ", ".join(f"{x:.6g}" for x in found)
    expected = ", ".join(f"{x:.6g}" for x in probe["value"])
    text = (
        f"{name}: ({numbers}) at frame {last}, {off:.3g} off the expected ({expected}), "
        f"where {probe['tolerance']:.3g} is allowed"
    )
    return Broken(name, last, off, probe["tolerance"], "", text)


def probes(world: World, scene: Mapping[str, Any]) -> list[list[float]]:
    """The values that the scene's probes look at, now; of particles that come and go, `index` is the id, and of one
    that is not there nan. Raises SceneError where there is nothing to look at."""
    found, issues = [], []
    topology = world.topology
    for i, probe in enumerate(scene.get("expect", {}).get("probe", ())):
        column, name, index = probe["column"], probe["object"], probe["index"]
        table = world.columns(column, "id") if column != "id" else world.columns("id")
        table = {name: columns for name, columns in table.items() if column in columns}
        path = f"expect.probe[{i}]"
        if name in table and (axes := len(topology.get(name, {}).get("grid_cells", ()))):
            # The rows of a grid, its first axis fastest.
            on_grid = table[name][column]
            width = on_grid.shape[axes:]
            table[name] = {column: on_grid.reshape((-1, *width), order="F")}
        if name not in table:
            known = ", ".join(f'"{n}"' for n in table) or "none"
            issues.append(f'{path}: no object "{name}" has a column "{column}"; those that have one: {known}')
        elif "id" in table[name]:
            rows = table[name][column][table[name]["id"] == index]
            found.append([float(x) for x in np.atleast_1d(rows[0])] if len(rows) else [np.nan])
        elif index >= (most := max(len(table[name][column]), len(topology.get(name, {}).get("mass", ())))):
            issues.append(f'{path}.index: {index}, expected < {most}, the length of "{name}"')
        elif index >= len(table[name][column]):
            # A body that is still to be born.
            found.append([np.nan])
        else:
            found.append([float(x) for x in np.atleast_1d(table[name][column][index])])
    if issues:
        error = SceneError("\n".join(issues))
        error.issues = [{"path": i.split(":")[0], "line": None, "message": i.split(": ", 1)[1]} for i in issues]
        raise error
    return found
