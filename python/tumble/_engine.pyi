"""The engine. All quantities in SI units, z up; arrays are row by row, one row per mass."""

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, overload

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]
Columns = dict[str, dict[str, Array]]
"""Object name -> column name -> array."""

Path = str | os.PathLike[str]

version: str
instructions: str
"""The widest instructions of this machine that are used: bits = "native" holds for machines with the same."""
"""Version of tumble."""

class TumbleError(Exception):
    """Anything that tumble reports."""

class SceneError(TumbleError):
    """The input is wrong. Its text names every place and its cure."""

    issues: list[dict[str, Any]]
    """One dict per problem: path, line (or None), message."""

class StepError(TumbleError):
    """The simulation failed; the world stands at its last good frame."""

    report: dict[str, Any]
    """kind (not_finite, exploded, solve, step_too_small, user); for the first two also system, object, column, index,
    time [s], integrator, step [s], stable_step [s], energy_ratio."""

class ExportError(TumbleError):
    """A result could not be written or drawn."""

class Scene:
    """A checked scene: what is there, how it moves, what is written out."""

    def __init__(self, tree: Mapping[str, Any], folder: Path = ".") -> None:
        """A scene from a dict; mesh files are looked for in `folder`. Raises SceneError."""

    @staticmethod
    def load(path: Path, set: Sequence[str] = ()) -> Scene:
        """Reads a .toml or .json file. `set` overrides keys: "time.fps=30", "sheet.flag.size=[1, 2]". Raises SceneError."""

    def replace(self, *overrides: str) -> Scene:
        """A copy with keys overridden, as in `load`. Raises SceneError."""

    def to_dict(self) -> dict[str, Any]:
        """The resolved scene: every default written out, systems included, mesh files with the hash of their content."""

    @property
    def memory(self) -> float:
        """An upper estimate of the bytes that its world takes. Above `world.memory_limit` it is refused."""

    @property
    def folder(self) -> str:
        """Folder in which mesh files are looked for."""

    @property
    def mesh_files(self) -> list[tuple[str, int | None, str]]:
        """The mesh files that it names: place of the name in the scene, its line or None, and the path as it stands there.
        Files of figures are left out."""

    @staticmethod
    def schema() -> dict[str, Any]:
        """JSON Schema of a scene; units are under "x-unit"."""

class World:
    """A scene in motion."""

    def __init__(self, scene: Scene | Mapping[str, Any], threads: int | None = None) -> None:
        """Builds the scene at t = 0. `threads` limits the processor cores used; the bits do not depend on it.
        Raises SceneError."""

    @property
    def scene(self) -> Scene: ...
    @property
    def time(self) -> float:
        """Simulated time [s]."""

    @property
    def frame_index(self) -> int:
        """Frames simulated so far."""

    @property
    def systems(self) -> list[str]:
        """Names of the systems."""

    @property
    def warnings(self) -> list[dict[str, str]]:
        """Warnings about the scene: code (as listed in docs/warnings.md), path and message of each."""

    def step(self, frames: int = 1) -> dict[str, Any]:
        """Simulates frames; returns what they took: steps, rejected, step_range [s], newton, linear, residual, unconverged,
        broken, clamped [J], trials (of adaptive integrators: time, step, error, accepted; the first 65536). Releases the GIL;
        Ctrl-C goes back to the last frame and raises KeyboardInterrupt. Raises StepError."""

    @property
    def frame(self) -> Columns:
        """The columns that the scene's `output.columns` names, of every object that has them."""

    def columns(self, *names: str) -> Columns:
        """The named columns: position [m] n x 3, velocity [m/s] n x 3, orientation n x 4 (x, y, z, w), angular_velocity
        [rad/s] n x 3, link_strain n."""

    def inside(self, substeps: int, *names: str) -> tuple[Columns, dict[str, Any]] | None:
        """The named columns after so many sub-steps of the next frame, all systems in turn; the world itself stays where it
        is. Systems whose turn has not come are still at the start of their interval. Returns (columns, about) with about:
        system and step [s] of the last sub-step, time [s], ledger; None where the frame has no more sub-steps. Raises
        StepError for a sub-step that breaks."""

    @property
    def units(self) -> dict[str, dict[str, str]]:
        """Units of all columns: object -> column -> SI unit."""

    @property
    def topology(self) -> Columns:
        """Constant columns. Objects: mass [kg] n, pinned (indices), triangles m x 3, links l x 2, curve (indices in
        order), radius [m] 1. Colliders: position [m] n x 3, triangles m x 3; of moving ones frames hold
        translation [m] 3 and turn 4, x = turn p + translation, or position of vertices that move by themselves."""

    @property
    def ledger(self) -> dict[str, Any]:
        """The books: time, mass, momentum (3), angular_momentum (3), kinetic, elastic, external, energy [J], stretch,
        penetration [m], intersections (0 where neither self_contact nor expect.max_intersections asks for them), speed [m/s],
        contacts, broken, heat and heat_in [J], volume [m³], divergence [1/s]."""

    def account(self) -> dict[str, Any]:
        """Breakdown of the ledger, and the places of its worst numbers: `systems` as (name, ledger), `shares` with system,
        object and ledger, `worst` with measure (a number of the ledger), value, object, other, particles, id, cell. For the
        moment when a bound is broken: it takes longer than the ledger."""

    def hash(self) -> str:
        """Hash of everything that the next step depends on, 16 hexadecimal digits."""

    def save(self, path: Path) -> None:
        """Writes a checkpoint (safetensors, the scene inside). Raises ExportError, whose cause is the system's OSError."""

    @staticmethod
    def restore(path: Path, threads: int | None = None) -> World:
        """The world of a checkpoint. Raises SceneError."""

    def load(self, path: Path) -> None:
        """Goes to a checkpoint of the same scene. Raises SceneError; the world then stays as it was."""

    def reconsider(self) -> None:
        """After the state of another scene was loaded: what was chosen from that scene, as how many sub-steps an interval
        gets and what energies are measured against, is chosen anew from the state as it is now."""

    def stability(self) -> list[dict[str, Any]]:
        """For each system, from its stiffest mode as it is now: system, integrator, step [s], frequency [rad/s], damping,
        damping_max [1/s], culprit (object, index), limits (integrator, stable [s], usable [s])."""

    def cures(self) -> list[dict[str, Any]]:
        """After a StepError: changes that were tried from the last good frame: set, survived, energy_ratio."""

    def add_force(
        self, force: Callable[[float, Array, Array, Array], npt.ArrayLike], system: str | None = None
    ) -> None:
        """Adds a force: force(t, x, v, mass) -> n x 3 [N], from x [m] and v [m/s], n x 3, and mass [kg], n."""

    def set_integrator(
        self,
        step: Callable[
            [float, float, Array, Array, Callable[[float, Array, Array], Array]], tuple[npt.ArrayLike, npt.ArrayLike]
        ],
        system: str | None = None,
    ) -> None:
        """Steps with step(t, h, x, v, acceleration) -> (x, v), where acceleration(t, x, v) -> n x 3 [m/s²]."""

    def write(self, object: str, column: str, values: npt.ArrayLike) -> None:
        """Sets position [m] or velocity [m/s], n x 3, of an object. Raises SceneError."""

def write_vdb(volumes: Sequence[Mapping[str, Any]], zip: bool) -> bytes:
    """The bytes of a VDB file. Each volume is a dict: name, unit, class ("unknown", "fog volume" or "staggered"), values
    (float32, x fastest, those of a vector together), width, points, corner, spacing [m], origin [m], background, tolerance,
    half. Raises ExportError."""

def load_fabric(fabric: str) -> dict[str, Any]:
    """The record of a shipped fabric by name, or of a .toml or .json file: name, composition, source, density [kg/m²],
    stretching [N/m] and bending [N m]. Raises SceneError."""

def load_mesh(path: Path) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.uint32]]:
    """Vertices [file units] n x 3 and triangles m x 3 of an OBJ, PLY, STL, GLB or USD file. Raises SceneError."""

def repair_mesh(path: Path) -> tuple[str | None, dict[str, int]]:
    """The mesh of a file mended, as the text of an OBJ file, or None if nothing had to be done; counts of vertices welded,
    triangles repeated, degenerate and turned, edges split, vertices unused, and of edges that are still open or odd. Raises
    SceneError if it cannot be read or nothing is left."""

Side = Literal["closed"] | tuple[Literal["slope", "value", "ghost"], float]
"""Beyond a wall: no slope, a slope along the outward normal, a value at the wall, a value at the points beyond."""

Vectors = Sequence[Field]
"""The components, in the order of axes, each on the faces of its axis or on the edges along it."""

class Grid:
    """A box of cubic cells, with two numbers of cells in a plane, with three in space. Lengths in metres."""

    def __init__(
        self,
        cells: Sequence[int],
        spacing: float,
        origin: Sequence[float] | None = None,
        plane: Literal["xy", "xz", "yz"] = "xy",
        periodic: str = "",
    ) -> None:
        """`periodic` names axes, as in "xy". Raises TumbleError."""

    @property
    def cells(self) -> tuple[int, ...]:
        """Cells along each axis."""

    @property
    def spacing(self) -> float:
        """Length of a cell's sides [m]."""

    def shape(self, place: str = "cell") -> tuple[int, ...]:
        """How many points a place has along each axis: the shape of its arrays."""

    def points(self, place: str = "cell") -> tuple[npt.NDArray[np.float64], ...]:
        """The coordinates [m] of the points of a place: one array for each axis."""

    def field(
        self,
        values: npt.ArrayLike | Callable[..., npt.ArrayLike],
        place: str = "cell",
        unit: str = "",
        sides: Side | Mapping[str, Side] | None = None,
    ) -> Field:
        """A field from an array, a number or a function of the coordinates. `sides`: what is beyond the walls, one for all
        or a dict: "x" both sides, "x-" the lower, "x+" the upper. Raises TumbleError."""

class Field:
    """Numbers at one place of a grid."""

    @property
    def array(self) -> npt.NDArray[np.float64]:
        """The numbers; the first index is that of the first axis."""

    @property
    def place(self) -> str:
        """ "cell", "face x", "edge x" (or y, z) or "node"."""

    @property
    def unit(self) -> str:
        """SI unit."""

    @property
    def grid(self) -> Grid:
        """Its grid."""

def gradient(field: Field) -> tuple[Field, ...]:
    """The gradient of a field of cells, on faces."""

def divergence(vectors: Vectors) -> Field:
    """The divergence of vectors on faces, at cells."""

@overload
def curl(vectors: Field) -> tuple[Field, ...]: ...
@overload
def curl(vectors: Vectors) -> Any:
    """The curl of vectors on faces, on edges (in the plane: one field at nodes), or the other way."""

@overload
def laplacian(field: Field) -> Field: ...
@overload
def laplacian(field: Vectors) -> tuple[Field, ...]:
    """The Laplacian of a field or of each component of vectors, at its own place."""

def directional(velocity: Vectors, field: Field) -> Field:
    """The directional derivative: velocity . grad field, at the place of the field."""

def average(field: Field, place: str) -> Field:
    """The field at another place: the mean of the nearest points there."""

def sample(
    field: Field, points: npt.ArrayLike, interpolation: Literal["linear", "cubic", "monotone"] = "linear"
) -> npt.NDArray[np.float64]:
    """The values at points, n x 2 or n x 3 [m]."""

@overload
def advect(
    field: Field,
    velocity: Vectors,
    h: float,
    trace: Literal["euler", "rk2", "rk3"] = "rk2",
    substeps: int = 1,
    interpolation: Literal["linear", "cubic", "monotone"] = "linear",
    corrected: bool = False,
    turning: bool = False,
) -> Field: ...
@overload
def advect(
    field: Vectors,
    velocity: Vectors,
    h: float,
    trace: Literal["euler", "rk2", "rk3"] = "rk2",
    substeps: int = 1,
    interpolation: Literal["linear", "cubic", "monotone"] = "linear",
    corrected: bool = False,
    turning: bool = False,
) -> tuple[Field, ...]:
    """A field, or vectors on faces, advected by a velocity for h seconds. `trace` is how paths are followed,
    in `substeps` pieces; `corrected` adds MacCormack's correction, limited; `turning` turns vectors with the fluid."""

@overload
def diffuse(field: Field, kappa: float, duration: float) -> Field: ...
@overload
def diffuse(field: Vectors, kappa: float, duration: float) -> tuple[Field, ...]:
    """A field, or each component of vectors, diffused for a duration [s] with kappa [m²/s], in as many
    explicit steps as it takes."""

def diffusion_limit(grid: Grid, kappa: float) -> float:
    """The largest explicit step of diffusion [s] that does not grow."""

class Projection:
    """A velocity without divergence, the nearest to the given one, and how it was found."""

    @property
    def velocity(self) -> tuple[Field, ...]:
        """The velocity that is left, on faces."""

    @property
    def potential(self) -> Field:
        """The potential of the removed gradient: the step times the pressure over the density [m²/s]."""

    @property
    def residuals(self) -> Array:
        """The largest |div u| dx over the largest |u| before the projection: at the start, and after each iteration."""

    @property
    def times(self) -> Array:
        """When that was [s], from the start of the solution."""

    @property
    def set_up(self) -> float:
        """Time [s] for all that depends on the grid and its solids alone."""

    @property
    def iterations(self) -> int: ...
    @property
    def refinements(self) -> int:
        """How often what was left was evaluated anew and solved for."""

    @property
    def converged(self) -> bool: ...
    @property
    def pockets(self) -> int:
        """Spaces that no open face joins to the largest one."""

def project(
    velocity: Vectors,
    open: Vectors | None = None,
    method: Literal[
        "jacobi",
        "gauss_seidel",
        "sor",
        "conjugate_gradients",
        "incomplete_cholesky",
        "modified_incomplete_cholesky",
        "multigrid",
        "multigrid_gradients",
        "cosine",
    ] = "multigrid_gradients",
    tolerance: float = 1e-5,
    iterations: int = 1000,
    precision: Literal["single", "double"] = "double",
) -> Projection:
    """The velocity without divergence that is nearest to a given one, on faces between walls at rest; `open` are the shares of
    faces that no solid covers, in steps of 1/127. Stops at the tolerance on max |div u| dx/max |u|. Raises TumbleError."""
