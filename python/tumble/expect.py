"""The bounds of a scene's [expect] table, checked against what a run wrote."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from tumble._engine import SceneError, World

if TYPE_CHECKING:
    from tumble.run import Run

Curve = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Broken:
    """An expectation that a run broke."""

    name: str
    """The key in [expect]."""
    frame: int
    """The first frame that broke it."""
    value: float
    """The worst value in any frame."""
    bound: float
    unit: str
    text: str
    """All of that in a sentence."""

    def to_dict(self) -> dict[str, Any]:
        return asdict(self)


_UNITS = {
    "max_stretch": "",
    "max_penetration": "m",
    "max_intersections": "",
    "max_speed": "m/s",
    "max_energy_drift": "",
    "max_energy_growth": "",
    "max_final_kinetic": "J",
    "max_mass_error": "",
    "max_momentum_change": "kg m/s",
    "max_angular_momentum_change": "kg m²/s",
    "max_volume_error": "",
    "max_divergence": "1/s",
    "max_heat_error": "",
    "broken_links": "",
}


def count(scene: Mapping[str, Any]) -> int:
    """How many expectations a resolved scene has."""
    expect = scene.get("expect", {})
    return sum(expect.get(name) is not None for name in _UNITS) + len(expect.get("probe", ()))


def energy_changes(ledger: Mapping[str, npt.NDArray[Any]]) -> Curve:
    """(E - E_0) over the largest kinetic or elastic energy, or change of external energy, of any frame so far."""
    change = ledger["energy"] - ledger["energy"][:1]
    external = np.abs(ledger["external"] - ledger["external"][:1])
    scale = np.maximum.accumulate(np.maximum(np.maximum(ledger["kinetic"], np.abs(ledger["elastic"])), external))
    # Without any energy there is nothing to drift from.
    relative: Curve = np.divide(change, scale, out=np.zeros_like(change), where=scale != 0.0)
    return relative


def relative_error(column: npt.NDArray[Any]) -> Curve:
    """|a - a_0| over |a_0|."""
    error: Curve = np.abs(column - column[:1]) / max(float(np.abs(column[0])), 1e-300)
    return error


def change(ledger: Mapping[str, npt.NDArray[Any]], name: str) -> Curve:
    """|a - a_0| of a vector in three columns."""
    vectors = np.stack([ledger[f"{name}_{axis}"] for axis in "xyz"], axis=1)
    length: Curve = np.linalg.norm(vectors - vectors[:1], axis=1)
    return length


def heat_error(ledger: Mapping[str, npt.NDArray[Any]]) -> Curve:
    """|heat gained - heat that came in| over the largest of both in any frame so far."""
    gained, came = ledger["heat"], ledger["heat_in"]
    scale = np.maximum.accumulate(np.maximum(np.abs(gained), np.abs(came)))
    error: Curve = np.divide(np.abs(gained - came), scale, out=np.zeros_like(gained), where=scale != 0.0)
    return error


def check(run: "Run") -> list[Broken]:
    """The expectations that a finished run broke, in the order of the table."""
    expect = run.scene.get("expect", {})
    ledger = run.ledger
    if not run.n_frames:
        return []
    curves: dict[str, Curve] = {
        "max_stretch": ledger["stretch"],
        "max_penetration": ledger["penetration"],
        "max_intersections": ledger["intersections"],
        "max_speed": ledger["speed"],
        "max_energy_drift": np.abs(energy_changes(ledger)),
        "max_energy_growth": energy_changes(ledger),
        "max_mass_error": relative_error(ledger["mass"]),
        "max_momentum_change": change(ledger, "momentum"),
        "max_angular_momentum_change": change(ledger, "angular_momentum"),
        "max_volume_error": relative_error(ledger["volume"]),
        "max_divergence": ledger["divergence"],
        "max_heat_error": heat_error(ledger),
    }
    broken = [_over(name, curve, expect[name]) for name, curve in curves.items() if expect.get(name) is not None]
    return [b for b in [*broken, *_at_the_end(run, expect)] if b is not None]


def _over(name: str, curve: Curve, bound: float, start: int = 0) -> Broken | None:
    """Whether a curve exceeds its bound; nan does."""
    over = np.flatnonzero(~(curve <= bound))
    if over.size == 0:
        return None
    first, worst = int(over[0]), float(np.max(curve))
    unit = _UNITS[name] and f" {_UNITS[name]}"
    text = f"{name}: {worst:.6g}{unit}, expected at most {bound:.6g}{unit}; first broken at frame {start + first}"
    return Broken(name, start + first, worst, bound, _UNITS[name], text)


def _at_the_end(run: "Run", expect: Mapping[str, Any]) -> list[Broken | None]:
    last = run.n_frames - 1
    broken: list[Broken | None] = []
    if (bound := expect.get("max_final_kinetic")) is not None:
        broken.append(_over("max_final_kinetic", run.ledger["kinetic"][-1:], bound, last))
    if (bound := expect.get("broken_links")) is not None:
        links = int(run.ledger["broken"][-1])
        if links != bound:
            text = f"broken_links: {links} by frame {last}, expected {bound}"
            broken.append(Broken("broken_links", last, links, bound, "", text))
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
        elif index >= len(table[name][column]):
            issues.append(f'{path}.index: {index}, expected < {len(table[name][column])}, the length of "{name}"')
        else:
            found.append([float(x) for x in np.atleast_1d(table[name][column][index])])
    if issues:
        error = SceneError("\n".join(issues))
        error.issues = [{"path": i.split(":")[0], "line": None, "message": i.split(": ", 1)[1]} for i in issues]
        raise error
    return found
