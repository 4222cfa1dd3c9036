"""Subject of the lab: a scene whose integrator, step and length can be changed at will."""

import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tumble import methods
from tumble._engine import Scene, SceneError, World
from tumble.columns import on_grids
from tumble.lab import exact
from tumble.lab.exact import Floats, Linear, Tree
from tumble.lab.schemes import BY_WORD, Scheme

GROWTH = 1000.0
"""Growth of the energy that counts as a blow-up."""

CROWD = 100
"""Birds of a cloud that take part."""

PRODUCTS = 60
"""Products of a vector with the stiffness matrix by which the stiffest mode is found, about."""

PERIODS = 100.0
"""Periods of the stiffest mode within which it counts."""


def rms(a: Floats) -> float:
    """Root mean square of the lengths of rows."""
    return float(np.sqrt(np.mean(np.sum(a * a, axis=1)))) if len(a) else 0.0


@dataclass
class Limits:
    """Predicted limits of the steps of one integrator [s]; zero: none will do, infinite: any will."""

    stable: float
    usable: float


@dataclass
class Subject:
    """A scene under test, in double precision."""

    tree: Tree
    folder: str
    massless: bool
    """Whether it is velocity fields, not forces, that move it."""
    rate: float
    """Highest rate of anything in it, max(w, c) of the stiffest and the most damped mode [rad/s]; 0 without any."""
    frequency: float
    damping: float
    culprit: tuple[str, int] | None
    limits: dict[str, Limits]
    solution: Linear | None
    start: Floats
    """Positions at the start [m], n x 3."""
    threads: int | None
    notes: list[str] = field(default_factory=list)

    @property
    def duration(self) -> float:
        """Length of the scene [s]."""
        return float(self.tree["time"]["frames"]) / float(self.tree["time"]["fps"])

    @property
    def discontinuous(self) -> bool:
        """Whether something in it happens at the end of a step only: contact, breaking, pulls between systems."""
        links = [
            thing.get("links") or {} for kind in ("rope", "sheet", "block", "net", "cloth") for thing in self.tree[kind]
        ]
        laws = [law for of in links for law in of.values() if isinstance(law, dict)]
        laws += [spring for thing in self.tree["particles"] for spring in thing["spring"]]
        return self.coupled or bool(self.tree["collider"]) or any(law.get("break_strain") for law in laws)

    @property
    def flock(self) -> bool:
        """Whether it steers, which no energy drives and no energy tells about."""
        return not self.massless and any(force["kind"] == "flock" for force in self.tree["force"])

    @property
    def crowded(self) -> bool:
        """Whether many push each other at short range: paths that begin close do not stay so."""
        kinds = {"flock", "lennard_jones", "repulsion", "cohesion"}
        return not self.massless and any(force["kind"] in kinds for force in self.tree["force"])

    def consider(self, world: World, patience: float = np.inf) -> None:
        """Lets the state that a run has come to count for the limits, too. Raises TimeoutError after `patience` [s]."""
        _mass_limits(self, [s for s in world.stability(patience) if float(s["frequency"]) > self.frequency])

    @property
    def coupled(self) -> bool:
        """Whether its systems pull or push each other."""
        return len(self.tree["system"]) > 1 and bool(self.tree["anchor"] or self.tree["body"])

    @property
    def limited(self) -> bool:
        """Whether something in it pulls back or brakes, so that a step can be too long."""
        if self.massless:
            return self.rate > 0
        things = [kind for kind in ("rope", "sheet", "block", "net", "cloth", "anchor") if self.tree[kind]]
        springs = any(thing["spring"] for thing in self.tree["particles"])
        hold = {"drag", "lennard_jones", "repulsion", "cohesion", "viscosity"}
        forces = any(force["kind"] in hold for force in self.tree["force"])
        return self.rate > 0 and not self.flock and bool(things or springs or forces)

    def world(
        self, scheme: Scheme, interval: float, frames: int, substeps: int | None = None, tolerance: float | None = None
    ) -> World:
        """The scene under an integrator, in frames of `interval` [s]."""
        exchanges = self._exchanges(interval, None if scheme.adaptive else substeps)
        if substeps is not None:
            substeps = self.taken(interval, substeps) // exchanges
        systems = []
        for system in self.tree["system"]:
            own = dict(system)
            method = methods.of_system(own)
            if method.own_scheme is None and method.is_carried == self.massless:
                own |= {"integrator": scheme.word, "substeps": substeps, "step": None}
                if scheme.adaptive:
                    own |= {
                        "substeps": None,
                        "adaptive": {**own["adaptive"], "tolerance": tolerance, "smallest": 1e-12},
                    }
                if scheme.word not in ("modified_euler", "verlet", "position_based"):
                    own["clamp"] = None
            systems.append(own)
        time = {"fps": 1.0 / interval, "frames": frames, "exchanges": exchanges}
        return World(Scene({**self.tree, "time": time, "system": systems}, self.folder), self.threads)

    def taken(self, interval: float, substeps: int) -> int:
        """Sub-steps that a frame really takes: a multiple of its exchanges."""
        exchanges = self._exchanges(interval, substeps)
        return -(-substeps // exchanges) * exchanges

    def _exchanges(self, interval: float, substeps: int | None) -> int:
        """Exchanges in a frame: systems pull on each other as often as in the scene, but not within a step."""
        if not self.coupled:
            return 1
        time = self.tree["time"]
        wanted = max(1, round(interval * float(time["fps"]) * int(time["exchanges"])))
        return min(wanted, substeps or wanted, 100_000)

    @property
    def extent(self) -> float:
        """Size of the thing at the start [m]."""
        if not len(self.start):
            return 1.0
        return rms(self.start - self.start.mean(axis=0)) or rms(self.start) or 1.0

    def objects(self, world: World) -> list[str]:
        """Names of the objects under test."""
        topology = world.topology
        return [name for name in world.columns("position") if ("mass" in topology.get(name, {})) != self.massless]

    def positions(self, world: World) -> Floats:
        """Positions [m] of all that is under test, n x 3."""
        return self._all(world, "position")

    def velocities(self, world: World) -> Floats:
        """Velocities [m/s] of all that is under test, n x 3."""
        return self._all(world, "velocity")

    def _all(self, world: World, column: str) -> Floats:
        columns = world.columns(column)
        own = [columns[name][column] for name in self.objects(world)]
        return np.concatenate(own).astype(float) if own else np.zeros((0, 3))

    def write(self, world: World, column: str, values: Floats) -> None:
        """Sets positions or velocities of all that is under test."""
        columns, done = world.columns(column), 0
        for name in self.objects(world):
            n = len(columns[name][column])
            world.write(name, column, values[done : done + n])
            done += n


_INSTEAD = {
    "gas": "`tumble lab pressure` compares its solvers, and `tumble refine` shows how a scene converges",
    "heat": "its schemes are heat.0.scheme=explicit, implicit and trapezoid; `tumble refine` shows how they converge",
}
"""What to do with grids, which are stepped by schemes of their own."""


def _refuse(tree: Tree) -> None:
    """Refuses what has no integrators to compare, and says what to look at instead."""
    title = f"“{tree['title']}”" if tree["title"] else "this scene"
    for kind, thing in on_grids(tree):
        instead = _INSTEAD.get(kind, f"see `tumble lab {kind}`")
        raise SceneError(
            f'{title} has {kind} "{thing["name"]}", which is stepped by a scheme of its own: the lab compares the integrators '
            f"of masses and tracers, and takes scenes of nothing else; {instead}"
        )
    if why := next(filter(None, (methods.of_system(system).own_scheme for system in tree["system"])), None):
        raise SceneError(f"{title}: {why}; there is nothing to compare. `tumble refine` shows how a scene converges")
    if liquid := next((thing["name"] for thing in tree["particles"] if thing.get("fluid")), None):
        raise SceneError(
            f'{title} has a liquid, particles "{liquid}", which position-based dynamics alone can move: no other integrator is '
            "there to compare; `tumble lab positions` shows how that one converges, and `tumble refine` how a scene does"
        )


def subject(scene: Scene, patience: float = np.inf) -> Subject:
    """Makes a scene ready for testing; its limits are looked for no longer than `patience` [s]. Raises SceneError for one
    without integrators to compare."""
    tree = scene.to_dict()
    _refuse(tree)
    if tree["emitter"]:
        raise SceneError(
            f'emitter "{tree["emitter"][0]["name"]}": the lab compares paths and energies of masses that are there from '
            "start to end, and emitted particles are not; put [[particles]] with a cloud in the place of emitters, or "
            "compare runs of `tumble run` with --set system.0.integrator=..."
        )
    tree["precision"] = "double"
    tree["output"] = {"columns": ["position"], "plot": False}
    tree["expect"] = {}
    stepped = {methods.of_system(system).is_carried for system in tree["system"]}
    massless = stepped == {True}
    notes = _thin(tree)
    if stepped == {True, False}:
        notes.append("Tracers move as the scene says; what is compared here are the masses.")
    if any(system.get("clamp") for system in tree["system"]):
        notes.append(
            "The position clamp goes with modified_euler, verlet and position_based only; the others run without it."
        )
    bare = Subject(tree, scene.folder, massless, 0.0, 0.0, 0.0, None, {}, None, np.zeros((0, 3)), None, notes)
    try:
        world = bare.world(BY_WORD["rk4"], 1.0 / float(tree["time"]["fps"]), 1, substeps=1)
    except SceneError as error:
        World(scene)  # Where it is wrong anyway, that is what is to be said.
        raise SceneError(
            f"this scene runs under no integrator but its own, so that there is nothing to compare ({error}); `tumble refine` "
            "shows how it converges"
        ) from error
    bare.start = bare.positions(world)
    bare.threads = 1 if len(bare.start) <= 4096 else None
    if massless:
        bare.solution = exact.carried(tree["field"], bare.start)
        _tracer_limits(bare)
    else:
        bare.solution = exact.springs(tree, world)
        try:
            # A product of its matrix takes about as long as an evaluation of forces, and is not interrupted.
            if len(bare.start) > CROWD:
                begin = time.perf_counter()
                bare.world(BY_WORD["rk4"], 1e-9, 1, substeps=1).step(patience=patience)
                if PRODUCTS / 4 * (time.perf_counter() - begin) > patience:
                    raise TimeoutError
            _mass_limits(bare, world.stability(patience))
        except TimeoutError:
            notes.append(
                "There was no time to find the stiffest mode, and so no limits of steps are predicted or measured."
            )
        # Elements that are constraints have no mode that could grow.
        bare.limits["position_based"] = Limits(np.inf, np.inf)
    return bare


def _thin(tree: Tree) -> list[str]:
    """Leaves of the clouds of a flock no more than CROWD, at the same density: what is to be seen of integrators few birds
    show as well as many."""
    if not any(force["kind"] == "flock" for force in tree["force"]):
        return []
    notes = []
    for thing in tree["particles"]:
        cloud = thing.get("cloud")
        if not cloud or cloud["count"] <= CROWD:
            continue
        across = sum(size > 0 for size in cloud["size"])
        factor = (CROWD / cloud["count"]) ** (1.0 / max(1, across))
        notes.append(f"Of the {cloud['count']} particles of “{thing['name']}” {CROWD} take part, at the same density.")
        thing["cloud"] = {**cloud, "count": CROWD, "size": [factor * size for size in cloud["size"]]}
        for key in ("mass", "velocity", "charge"):
            thing[key] = thing[key][:CROWD]
    return notes


def _mass_limits(subject: Subject, systems: list[dict[str, Any]]) -> None:
    if not systems:
        return
    stiffest = max(systems, key=lambda s: float(s["frequency"]))
    subject.frequency, subject.damping = float(stiffest["frequency"]), float(stiffest["damping"])
    subject.rate = max(subject.rate, *(max(float(s["frequency"]), float(s["damping_max"])) for s in systems))
    culprit = stiffest["culprit"]
    subject.culprit = (str(culprit[0]), int(culprit[1])) if culprit else None
    for system in systems:
        for limit in system["limits"]:
            known = subject.limits.setdefault(limit["integrator"], Limits(np.inf, np.inf))
            known.stable = min(known.stable, float(limit["stable"]))
            known.usable = min(known.usable, float(limit["usable"]))


_STAGES = {"forward_euler": 1, "midpoint": 2, "heun": 2, "rk4": 4}


def _growth(word: str, z: complex) -> float:
    """|y| after one step of y' = lambda y from |y| = 1, z = h lambda."""
    if word in _STAGES:
        terms = np.cumprod([1.0 + 0j] + [z / k for k in range(1, _STAGES[word] + 1)])
        return float(abs(terms.sum()))
    if word == "implicit_euler":
        return float(1.0 / abs(1.0 - z))
    if word == "implicit_midpoint":
        return float(abs((1.0 + z / 2) / (1.0 - z / 2)))
    return float(max(abs(np.roots([1.0 - 2.0 / 3.0 * z, -4.0 / 3.0, 1.0 / 3.0]))))


def _tracer_limits(subject: Subject) -> None:
    """Limits from the eigenvalues of the field: a step multiplies an eigenvector by R(h lambda), and squared distances
    must not grow a thousandfold within a hundred turns, as energies must not (integrators.35)."""
    matrix = exact.field_matrix(subject.tree["field"])
    if matrix is None:
        return
    values = [complex(v) for v in np.linalg.eigvals(matrix[0]) if abs(v) > 1e-12]
    subject.rate = max((abs(v) for v in values), default=0.0)
    subject.frequency = max((abs(v.imag) for v in values), default=0.0)
    subject.damping = max((-v.real for v in values), default=0.0)
    if not values or max(v.real for v in values) > 1e-12 * subject.rate:
        if values:
            subject.notes.append("The field itself drives particles apart, so growth says nothing about the steps.")
            subject.rate = 0.0
        return

    def fine(word: str, h: float, usable: bool) -> bool:
        def one(v: complex) -> bool:
            log = float(np.log(max(_growth(word, h * v), 1e-300)))
            steps = 2.0 * np.pi * PERIODS / (abs(v) * h)
            return 2.0 * log * steps <= np.log(GROWTH) if usable else log <= 1e-12

        return all(one(v) for v in values)

    for word in [*_STAGES, "implicit_euler", "implicit_midpoint", "bdf2"]:
        found = []
        for usable in (False, True):
            tried = np.geomspace(1e-3, 1e3, 97) / subject.rate
            bad = next((k for k, h in enumerate(tried) if not fine(word, float(h), usable)), None)
            if bad is None or bad == 0:
                found.append(np.inf if bad is None else 0.0)
                continue
            low, high = float(tried[bad - 1]), float(tried[bad])
            for _ in range(40):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if fine(word, middle, usable) else (low, middle)
            found.append(low)
        subject.limits[word] = Limits(*found)
