"""Energy that a run gained from nowhere, and what in a scene may give or take energy."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from tumble._engine import Scene, SceneError, StepError, World
from tumble.columns import BOUND, on_grids

if TYPE_CHECKING:
    from tumble.reader import Run

Floats = npt.NDArray[np.float64]
Tree = Mapping[str, Any]

TOO_MUCH = 1.0
"""Growth of the energy beyond its scale that is worth a warning: all that moved has been doubled by errors."""

NOISE = 1e-3
"""Of the largest energy of a kind, what may be gained by rounding."""

LOADED = ("particles", "rope", "sheet", "block", "net", "cloth")
"""Kinds of objects that can be loaded."""

_GIVE = {"wind", "air", "flock", "acceleration", "electric", "vortex", "turbulence", "propulsion"}
_ALIVE = {"animated_mesh", "character", "mannequin"}
_TAKE = {"drag", "wind", "air", "viscosity", "flock", "propulsion"}


def sources(scene: Tree) -> list[str]:
    """Possible sources of energy besides springs, gravity and mutual forces, which are in the ledger."""
    found = [f"force.{i} ({f['kind']})" for i, f in enumerate(scene["force"]) if f["kind"] in _GIVE or _open(f)]
    found += [f'collider "{c["name"]}"' for c in scene["collider"] if _moves(c)]
    found += [f'emitter "{e["name"]}"' for e in scene["emitter"]]
    found += [f'gas "{g["name"]}"' for g in scene["gas"] if g.get("bodies") or g.get("sheet")]
    # The energy of a surface under tension is not in the ledger, and what comes in brings its own.
    found += [f'liquid "{f["name"]}"' for f in scene["liquid"] if f["surface_tension"] or f["inflow"]]
    found += [f"{kind} {thing['name']}" for kind, thing in _things(scene) if _inflates(thing.get("pressure"))]
    return found + _driven(scene)


def _driven(scene: Tree) -> list[str]:
    """What has another potential at another time."""
    gravity = ["world.gravity"] if _changes(scene["world"]["gravity"]) else []
    loaded = [(kind, thing) for kind in LOADED for thing in scene[kind]]
    loads = [
        f'{kind} "{thing["name"]}"'
        for kind, thing in loaded
        if any(_changes([load["force"]]) for load in thing["load"])
    ]
    return (
        gravity
        + loads
        + [f'anchor "{a["name"]}"' for a in scene["anchor"] if _changes([a["stiffness"], a["rest_length"]])]
    )


def _inflates(pressure: Tree | None) -> bool:
    """Whether a closed surface is kept at another volume than it starts with, by a constraint that has no potential or one that
    changes in time."""
    if pressure is None:
        return False
    volume = pressure["volume"]
    return not isinstance(volume, (int, float)) or (pressure["stiffness"] is None and volume != 1.0)


def joined(scene: Tree) -> bool:
    """Whether anchors join systems, or masses touch rigid bodies more rarely than they should."""
    rarely = scene["time"]["fps"] * scene["time"]["exchanges"] < 240
    return len(scene["system"]) > 1 and bool(scene["anchor"] or (scene["body"] and rarely))


def sinks(scene: Tree) -> list[str]:
    """Sinks of energy."""
    found = [f"force.{i} ({f['kind']})" for i, f in enumerate(scene["force"]) if f["kind"] in _TAKE or _open(f)]
    found += _driven(scene)
    found += [f'collider "{c["name"]}"' for c in scene["collider"]]
    found += [f'emitter "{e["name"]}"' for e in scene["emitter"] if e["lifetime"] is not None or e["kill"]]
    found += [f"{kind} {thing['name']}" for kind, thing in _things(scene) if _damped(thing)]
    return found + [f'anchor "{a["name"]}"' for a in scene["anchor"] if a["damping"]]


def has_springs(scene: Tree) -> bool:
    """Whether anything in it is a spring or an elastic solid."""
    bound = any(kind != "particles" or thing["spring"] for kind, thing in _things(scene))
    return bound or bool(scene["anchor"])


def unsoftened(scene: Tree) -> list[int]:
    """The forces that grow without bound as masses come near, and have no softening."""
    found = []
    for i, force in enumerate(scene["force"]):
        steep = force["kind"] in ("gravitation", "electrostatics")
        steep = steep or (force["kind"] == "attraction" and force["power"] > 0)
        if steep and not force["softening"]:
            found.append(i)
    return found


def _things(scene: Tree) -> list[tuple[str, Tree]]:
    return [(kind, thing) for kind in BOUND for thing in scene[kind]]


def _damped(value: Any) -> bool:
    """Whether there is a damping, or anything that breaks, anywhere within."""
    if isinstance(value, Mapping):
        words = ("damping", "break_strain", "rod", "material")
        return any(key in words and bool(v) for key, v in value.items()) or any(map(_damped, value.values()))
    return isinstance(value, list) and any(map(_damped, value))


def _open(force: Tree) -> bool:
    """Whether a force has no potential in the books: it changes in time, fades out, or is not felt in return."""
    return _changes(force) or bool(force.get("from")) or (force["kind"] == "attraction" and force["radius"] is not None)


def _changes(value: Any) -> bool:
    """Whether a force changes in time or has a formula."""
    if isinstance(value, Mapping):
        return "keys" in value or any(_changes(v) for key, v in value.items() if key not in ("kind", "on", "from"))
    if isinstance(value, list):
        return any(map(_changes, value))
    return isinstance(value, str)


def _moves(collider: Tree) -> bool:
    return bool(collider["motion"]) or any(collider["belt"]) or not _ALIVE.isdisjoint(collider["shape"])


@dataclass(frozen=True)
class Growth:
    """Energy gained from nowhere, between births and deaths."""

    times: float
    """The gain over what kinetic, elastic or external energy there was beside it, at most."""
    frame: int
    """The first frame that has a gain beyond TOO_MUCH; the last, without."""


def growth(ledger: Mapping[str, Floats]) -> Growth:
    """(E - E_0) over the larger of |external_0| and max(kinetic, elastic, |external - external_0|) - (E - E_0)^+ of any frame
    so far.

    As where a breakdown is looked for, what came from nowhere is no scale. E_0 is that of the first frame with the mass of
    this one: where particles are born and die, energy comes and goes with them.
    """
    energy, external, mass = ledger["energy"], ledger["external"], ledger["mass"]
    # Frames between which the mass stays the same.
    cuts = np.flatnonzero(np.abs(np.diff(mass)) > 1e-9 * np.maximum(mass[1:], mass[:-1])) + 1
    worst, first = 0.0, len(energy) - 1
    for begin, end in zip([0, *cuts], [*cuts, len(energy)], strict=True):
        there = slice(begin, end)
        gain = np.maximum(energy[there] - energy[begin], 0.0)
        kinds = np.stack([ledger["kinetic"][there], np.abs(ledger["elastic"][there]), np.abs(external[there])])
        noise = NOISE * kinds.max(initial=0.0)
        kinds[2] = np.abs(external[there] - external[begin])
        scale = np.maximum.accumulate(np.maximum(kinds.max(axis=0) - gain, abs(external[begin])))
        times = np.divide(gain, scale, out=np.zeros_like(gain), where=scale > 0.0)
        times[gain <= noise] = 0.0
        if worst <= TOO_MUCH and (late := np.flatnonzero(times > TOO_MUCH)).size:
            first = begin + int(late[0])
        worst = max(worst, float(times.max(initial=0.0)))
    return Growth(worst, first)


def from_nowhere(run: "Run") -> Growth | None:
    """The growth of a run's energy, if it is too much and nothing in the scene gives any."""
    scene = run.scene
    fluids = bool(on_grids(scene))
    steady = [e for e in scene["emitter"] if not _changes([e["velocity"], e["path"], e["rate"]])]
    given = sources({**scene, "emitter": [e for e in scene["emitter"] if e not in steady]})
    if fluids or given or run.n_frames < 2 or not run.ledger["mass"].any():
        return None
    # Energy given to a branch at its start is not growth.
    start = run.descent[-1]["frame"] if run.descent else 0
    found = growth({name: column[start:] for name, column in run.ledger.items()})
    found = Growth(found.times, start + found.frame)
    return found if found.times > TOO_MUCH else None


# Masses that come near each other or a centre of attraction

ADAPTIVE = ("adaptive_euler", "dormand_prince")
"""Integrators that choose their steps."""

ANGLE = 0.5
"""Of an orbit at the softening length, what a step may take [rad]."""

MANY = 2000
"""Masses of which all distances are looked at."""


@dataclass(frozen=True)
class Encounter:
    """Masses so near that a force without softening outgrows the steps."""

    force: int
    kind: str
    distance: float
    """The least distance [m]."""
    softening: float
    """A softening that helps [m]: where orbits take steps of ANGLE, but no more than a tenth of the whole."""
    step: float | None
    """The step [s] that goes with it, if it is shorter than the one that was used."""


def encounters(run: "Run", frames: Iterable[int], step: float) -> list[Encounter]:
    """Masses that came too near for a given step, in some frames of a run."""
    found: dict[int, Encounter] = {}
    columns = [run.frame(i) for i in frames if 0 <= i < run.n_frames]
    for i in unsoftened(run.scene):
        for table in columns:
            one = _encounter(run, i, table, step)
            if one is not None and (i not in found or one.distance < found[i].distance):
                found[i] = one
    return list(found.values())


def _encounter(run: "Run", i: int, columns: Mapping[str, Mapping[str, Any]], step: float) -> Encounter | None:
    force = run.scene["force"][i]
    names = [n for n in _masses(run) if "position" in columns.get(n, {}) and (not force["on"] or n in force["on"])]
    if not names:
        return None
    x = np.concatenate([columns[n]["position"] for n in names]).astype(float)
    mass = np.concatenate([np.broadcast_to(_masses(run)[n], len(columns[n]["position"])) for n in names])
    if "velocity" in columns[names[0]]:
        v = np.concatenate([columns[n]["velocity"] for n in names if "velocity" in columns[n]]).astype(float)
    else:
        v = np.zeros_like(x)
    if len(x) == 0 or len(v) != len(x):
        return None
    if force["kind"] == "attraction":
        if _changes({"center": force["center"], "gm": force["gm"]}):
            return None
        strength, power = abs(float(force["gm"])), float(force["power"])
        away = np.linalg.norm(x - np.array(force["center"]), axis=1)
        passing = np.linalg.norm(v, axis=1) * step
        size = float(np.median(away))
    else:
        x, v = x[:MANY], v[:MANY]
        if len(x) < 2:
            return None
        heaviest = float(np.sort(mass)[-2:].sum())
        strength, power = abs(float(force["constant"])) * heaviest, 2.0
        if force["kind"] == "electrostatics":
            charge = max((abs(q) for e in _charged(run) for q in e), default=0.0)
            strength = abs(float(force["constant"])) * charge**2 * 2.0 / max(float(mass.min()), 1e-300)
        pairs = np.sqrt(np.sum((x[:, None] - x[None]) ** 2, axis=2)) + np.diag(np.full(len(x), np.inf))
        nearest = pairs.argmin(axis=1)
        away = pairs[np.arange(len(x)), nearest]
        passing = np.linalg.norm(v - v[nearest], axis=1) * step
        size = float(np.median(np.linalg.norm(x - x.mean(axis=0), axis=1)))
    if strength <= 0.0 or not np.isfinite(away).all():
        return None
    # A circle of radius s is run through at the rate w with w^2 = strength/s^(power + 1).
    needed = (strength * step**2 / ANGLE**2) ** (1.0 / (power + 1.0))
    if (away > needed + passing).all():
        return None
    softening = min(needed, 0.1 * size) if size > 0.0 else needed
    shorter = ANGLE * (softening ** (power + 1.0) / strength) ** 0.5
    return Encounter(
        i, str(force["kind"]), float(away.min()), _rounded(softening), shorter if shorter < 0.999 * step else None
    )


def changes(scene: Tree, met: Sequence[Encounter], system: int) -> list[str]:
    """Overrides that soften what came too near, and shorten the steps of a system where that alone is not enough."""
    sets = [f"force.{one.force}.softening={one.softening:g}" for one in met]
    plan: Tree = scene["system"][system] if system < len(scene["system"]) else {}
    steps = [one.step for one in met if one.step is not None]
    if steps and plan.get("integrator") not in ADAPTIVE:
        interval = 1.0 / scene["time"]["fps"] / scene["time"]["exchanges"]
        n = math.ceil(interval / min(steps))
        sets.append(f"system.{system}.step={min(steps):.2g}" if plan.get("step") else f"system.{system}.substeps={n}")
    return sets


def attempt(scene: Scene, sets: Sequence[str], frames: int) -> dict[str, Any]:
    """A change, tried for so many frames: set, survived, energy_ratio as of `World.cures`; nan where particles are born, which
    bring energy."""
    cure: dict[str, Any] = {"set": " ".join(sets), "survived": False, "energy_ratio": math.nan}
    try:
        world = World(scene.replace(*sets))
        start = world.ledger
        scale = max(start["kinetic"], start["elastic"])
        for _ in range(frames):
            world.step()
            now = world.ledger
            scale = max(scale, now["kinetic"], now["elastic"], abs(now["external"] - start["external"]))
    except (SceneError, StepError):
        return cure
    if not scene.to_dict()["emitter"]:
        cure["energy_ratio"] = (world.ledger["energy"] - start["energy"]) / scale if scale > 0.0 else 0.0
    return cure | {"survived": True}


def told(one: Encounter) -> str:
    """The near masses, as text."""
    whom = "its centre" if one.kind == "attraction" else "each other"
    return f"force.{one.force} ({one.kind}) has no softening, and masses came within {one.distance:.2g} m of {whom}"


def _masses(run: "Run") -> dict[str, Any]:
    """Masses of each object, of emitters the largest that there can be."""
    own = {name: table["mass"] for name, table in run.static.items() if "mass" in table}
    return own | {e["name"]: e["mass"] * (1.0 + e["mass_spread"]) for e in run.scene["emitter"]}


def _charged(run: "Run") -> list[Any]:
    return [np.ravel(t["charge"]) for kind in ("particles", "emitter") for t in run.scene[kind]]


def _rounded(length: float) -> float:
    """Up to two digits."""
    return float(f"{length:.1e}") if length > 0.0 else length
