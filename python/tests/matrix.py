"""The determinism matrix: the scenes that ship on 1, 2 and 8 threads, restored again and again, and as WebAssembly.

    python python/tests/matrix.py            the ten of `make test`
    python python/tests/matrix.py --all      every scene, as `make validate` does
    python python/tests/matrix.py gas/fire --frames 75
    python python/tests/matrix.py --bits native      forces between all masses, in the fastest arithmetic of the machine

Prints a line per scene and ends with 1 where one state differs in one bit. States are compared by hash at every frame.
"""

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path

from counts import note

from tumble import Scene, StepError, World, bundled
from tumble.cli.view import mesh_paths

ROOT = Path(__file__).parents[2]
STATES = ROOT / "web" / "tests" / "states.mjs"
WASM = [ROOT / "web" / "src" / "engine" / "pkg" / f"{precision}_bg.wasm" for precision in ("single", "double")]


@dataclass(frozen=True)
class Case:
    """A scene, how far it goes, and after how many frames each time it is restored."""

    name: str
    frames: int
    every: int = 10
    overrides: tuple[str, ...] = ()
    bits: str = "portable"


IMPLICIT = ("system.0.method=dynamics", "system.0.integrator=implicit_euler", "system.0.substeps=16")

TEN = {
    "particles": Case("particles/fountain", 12, 4),
    "cloth": Case("cloth/twist", 5, 2),
    "rods": Case("structures/rod", 12, 4),
    "solids": Case("structures/blocks", 5, 2, IMPLICIT),
    "gas": Case("gas/ball_in_a_tank", 5, 2),
    "fire": Case("gas/fire", 3, 2),
    "heat": Case("heat/finned_plate", 5, 2),
    "gravity": Case("gravity/galaxy", 2, 1, ("galaxy.0.stars=5000",)),
    "flock": Case("particles/flock", 12, 4),
    "hair": Case("cloth/hair-on-bunny", 3, 2, ("hair.0.count=300",)),
}
"""One for each kind of thing, cheap ones: `make test`."""

NATIVE = [
    Case("gravity/galaxy", 3, 1, ("galaxy.0.stars=4000",), "native"),
    Case("gravity/encounter", 3, 1, ("galaxy.0.stars=2000", "galaxy.1.stars=2000"), "native"),
    Case("gravity/figure-of-eight", 61, bits="native"),
]
"""Scenes with bits of their own under `bits = "native"`: `make validate`."""

SLOW = {
    "cloth/drapes",
    "cloth/dress",
    "cloth/funnel",
    "cloth/hair-on-bunny",
    "cloth/pile",
    "cloth/torn-flag",
    "cloth/twist",
    "cloth/washing-line",
    "gas/ball_in_a_tank",
    "gas/fire",
    "gas/flag_in_a_jet",
    "gas/plume",
    "gas/vortex_street",
    "particles/pool",
}
"""Scenes of more than a tenth of a second a frame: 21 frames of them, 61 of the others."""


def every_scene() -> list[Case]:
    return [Case(name, 21 if name in SLOW else 61) for name in bundled.shipped()]


def scene_of(case: Case) -> Scene:
    """The scene as it ships, on the tier of the case: portable bits are promised everywhere."""
    return Scene.load(bundled.scene_file(case.name), _overrides(case))


def _overrides(case: Case) -> list[str]:
    return [f'bits="{case.bits}"', *case.overrides]


def states(world: World, frames: int, visit: Callable[[World], None] = lambda _: None) -> list[str]:
    """The hashes from where a world stands up to a frame; a failure is the last of them."""
    hashes = [world.hash()]
    while world.frame_index < frames:
        try:
            world.step()
        except StepError as error:
            return [*hashes, f"broke: {error}; {world.hash()}"]
        hashes.append(world.hash())
        visit(world)
    return hashes


@dataclass
class Row:
    """Findings of a scene: the reference states, and where another way to compute them differs."""

    case: Case
    reference: list[str]
    ways: dict[str, str] = field(default_factory=dict)

    def note(self, way: str, hashes: Sequence[str], first: int = 0) -> None:
        """Compares the states from frame `first` on."""
        wanted = self.reference[first:]
        odd = next((i for i, (a, b) in enumerate(zip(hashes, wanted, strict=False)) if a != b), None)
        if odd is None and len(hashes) != len(wanted):
            odd = min(len(hashes), len(wanted))
        if self.ways.get(way, "same") == "same":
            self.ways[way] = "same" if odd is None else f"differs at frame {first + odd}"

    @property
    def good(self) -> bool:
        return len(set(self.reference)) > 1 and all(found == "same" for found in self.ways.values())

    def __str__(self) -> str:
        moved = "" if len(set(self.reference)) > 1 else "  DOES NOT MOVE"
        ways = "  ".join(f"{way}: {found}" for way, found in self.ways.items())
        return f"{self.case.name:24} {len(self.reference) - 1:4} frames  {self.reference[-1][-16:]}  {ways}{moved}"


def native(case: Case, folder: Path) -> tuple[Row, list[Path]]:
    """A scene on 1, 2 and 8 threads, and restored after every so many frames; and its checkpoints."""
    scene = scene_of(case)
    checkpoints: list[Path] = []

    def save(world: World) -> None:
        if world.frame_index % case.every == 0 and world.frame_index < case.frames:
            checkpoints.append(folder / f"{case.name.replace('/', '-')}-{world.frame_index}.safetensors")
            world.save(checkpoints[-1])

    # Saving does not disturb: the reference is the run that is never saved.
    row = Row(case, states(World(scene, threads=1), case.frames))
    row.note("2 threads", states(World(scene, threads=2), case.frames, save))
    row.note("8 threads", states(World(scene, threads=8), case.frames))
    for i, checkpoint in enumerate(checkpoints):
        # A world made of the checkpoint alone, on other threads each time, up to where the next one takes over.
        world = World.restore(checkpoint, threads=(1, 2, 8)[i % 3])
        first = world.frame_index
        last = first + case.every if i + 1 < len(checkpoints) else case.frames
        hashes = states(world, last)
        row.note("restored", hashes if hashes[-1].startswith("broke") else [*hashes, *row.reference[last + 1 :]], first)
    if not checkpoints:
        row.ways["restored"] = "same" if row.reference[-1].startswith("broke") else "NEVER"
    return row, checkpoints


def why_no_wasm() -> str | None:
    """Obstacle to the columns of WebAssembly."""
    if shutil.which("node") is None:
        return "no Node here"
    if not all(file.is_file() for file in WASM):
        return "the engine is not built for the browser: make web"
    # As make sees it.
    sources = [
        ROOT / "Cargo.toml",
        ROOT / "Cargo.lock",
        *ROOT.glob("crates/*/Cargo.toml"),
        *ROOT.glob("crates/**/*.rs"),
    ]
    if max(file.stat().st_mtime for file in sources) > min(file.stat().st_mtime for file in WASM):
        return "the engine for the browser is older than its source: make web"
    return None


def wasm(rows: Sequence[tuple[Row, list[Path]]]) -> None:
    """The same in WebAssembly, from the start and from the last native checkpoint."""
    jobs = []
    for row, checkpoints in rows:
        scene = scene_of(row.case)
        job = {
            "name": row.case.name,
            "text": bundled.scene_file(row.case.name).read_text(encoding="utf-8"),
            "overrides": _overrides(row.case),
            "files": {path: str(Path(scene.folder) / path) for path in mesh_paths(scene)},
            "frames": row.case.frames,
        }
        jobs.append(job | ({"checkpoint": str(checkpoints[-1])} if checkpoints else {}))
    done = subprocess.run(
        ["node", str(STATES)], input=json.dumps(jobs), stdout=subprocess.PIPE, encoding="utf-8", check=True
    )
    for (row, checkpoints), line in zip(rows, done.stdout.splitlines(), strict=True):
        found = json.loads(line)
        assert found["name"] == row.case.name
        row.note("wasm", found["hashes"])
        if checkpoints:
            row.note("native to wasm", found["restored"], int(checkpoints[-1].stem.rpartition("-")[2]))


def table(cases: Sequence[Case], with_wasm: bool) -> Iterator[Row]:
    """A row per case, in order. Two scenes at a time: most of what is computed of one is on one thread."""

    def row_of(case: Case) -> Row:
        with tempfile.TemporaryDirectory() as folder:
            row, checkpoints = native(case, Path(folder))
            if with_wasm:
                wasm([(row, checkpoints)])
        return row

    with ThreadPoolExecutor(2) as pool:
        yield from pool.map(row_of, cases)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="scenes, as row/name")
    parser.add_argument("--all", action="store_true", help="every scene that ships")
    parser.add_argument("--frames", type=int, help="instead of 21 of slow scenes and 61 of others")
    parser.add_argument(
        "--bits", choices=["portable", "native"], default="portable", help="native: without WebAssembly"
    )
    asked = parser.parse_args()
    cases = (
        every_scene()
        if asked.all
        else [Case(name, 21 if name in SLOW else 61) for name in asked.names]
        or (list(TEN.values()) if asked.bits == "portable" else NATIVE)
    )
    cases = [replace(case, bits=asked.bits, frames=asked.frames or case.frames) for case in cases]
    lacking = why_no_wasm() if asked.bits == "portable" else "bits are native"
    rows = []
    for row in table(cases, lacking is None):
        rows.append(row)
        print(row, flush=True)
    bad = [row.case.name for row in rows if not row.good]
    print(f"{len(rows)} scenes, {sum(len(row.reference) for row in rows)} states: {'; '.join(bad) or 'the same bits'}")
    count = sum(len(row.reference) for row in rows)
    ways = ", ".join(dict.fromkeys(way for row in rows for way in row.ways))
    note(
        "states",
        f"matrix, {asked.bits}, {len(rows)} scenes",
        cases=count,
        differ="; ".join(bad) or "none",
        ways=ways or "none",
    )
    if lacking is not None:
        print(f"not compared with WebAssembly: {lacking}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
