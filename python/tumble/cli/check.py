"""`tumble check`: is the scene valid, and are its steps stable?"""

import math
import time
from collections.abc import Container
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tumble.bundled import scene_file
from tumble.cli import find
from tumble.cli.console import counted, say, seconds, size, warn_of

if TYPE_CHECKING:
    from tumble import Scene, World
    from tumble.emitters import Forecast

_SAFETY = 0.7
"""Recommended fraction of the largest stable step of an explicit integrator."""

_WORK = 1e6
"""Limit of frames times masses, cells and particles simulated to judge the stability of emitted particles."""

_PATIENCE = 5.0
"""Time limit in seconds, for expensive forces."""


def check(
    scene: find.SceneArgument,
    set: find.SetOption = None,
    threads: Annotated[int | None, typer.Option(min=1, metavar="N", help="Processor cores to use.")] = None,
    repair: Annotated[
        bool, typer.Option("--repair", help="Repair the scene's mesh files into new files beside them.")
    ] = False,
    bake: Annotated[
        bool,
        typer.Option("--bake", help="Write the motion of animated USD files as meshes, and a scene that uses them."),
    ] = False,
    camera: Annotated[
        str | None, typer.Option(metavar="FILE[:PRIM]", help="Look with a camera of a USD file; print its lines.")
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="With --repair or --bake: overwrite files of an earlier one.")
    ] = False,
    json: find.JsonOption = False,
) -> None:
    """Check a scene, and estimate which steps are stable.

    A scene with emitters is simulated, for a few seconds at most, until many particles are alive. Exits with code 1 if
    a system is predicted to explode, or does, 2 if the scene is invalid.

    --repair mends defective meshes: coincident rims (up to rounding) are sewn; duplicate and zero-area triangles and
    unused vertices are dropped; triangles are oriented consistently, outward if the mesh is closed; edges of more than
    two triangles are split. NAME.ply becomes NAME.repaired.obj beside it, the scene lines to change are printed, and the
    scene is checked with them. The original meshes and the scene file are not modified; holes stay open.

    --bake writes the motion of colliders from animated USD files (points, transforms, skeletons, blend shapes) as one mesh
    per frame of the file, NAME.usd as NAME.baked/000000.obj and so on, and SCENE.baked.toml, which uses them and is checked:
    for other programs, and with --repair, which mends the meshes all alike.

    \b
    Examples:
      tumble check my.toml
      tumble check my.toml --set system.soft.integrator=forward_euler
      tumble check my.toml --repair
      tumble check my.toml --bake
      tumble check my.toml --camera shot.usda:/cameras/main
      tumble check my.toml --json
    """
    from tumble import World
    from tumble.emitters import forecast
    from tumble.expect import probes

    with find.told_as_json(json):
        checked = find.scene(scene, set)
        done: Container[str] = ()
        if bake or repair:
            from tumble.cli import bake as baking

            # Frames are mended all alike, in files.
            if bake or baking.has_frames(checked):
                moving, done = baking.bake(scene_file(scene), checked, force, repair)
                scene = str(moving)
                checked = find.scene(scene, set)
        if camera is not None:
            from tumble.cli.bake import look_with

            set = [*(set or ()), *look_with(camera)]
            checked = find.scene(scene, set)
        if repair:
            from tumble.cli.repair import mend

            set = [*(set or ()), *mend(scene_file(scene), checked, force, done)]
            checked = find.scene(scene, set)
        with find.naming(scene_file(scene), scene=checked):
            world = World(checked, threads)
            probes(world, checked.to_dict())
    tree = checked.to_dict()
    expected = forecast(tree)
    if not json:
        say(_contents(checked, world, expected))
    estimates = world.stability()
    judged, fault = _judge(tree, world, expected, estimates)
    cures = [cure for estimate in estimates if predict(estimate)[0] == 2 for cure in _cures(tree, estimate)]
    if json:
        find.say_json(_as_tree(scene, world, estimates, judged, fault, cures))
        warn_of(world.warnings)
        raise typer.Exit(1 if cures or fault is not None else 0)
    for estimate in estimates:
        say()
        say(_table(checked, estimate, judged.get(estimate["system"])))
    without = [name for name in world.systems if name not in {e["system"] for e in estimates}]
    if without:
        say(f"\nno estimate for: {', '.join(without)}")
    say()
    warn_of(world.warnings)
    if fault is not None:
        say(f"will break down {fault}\n{find.command('run', scene, set)} searches for changes that help")
    if cures:
        say("will explode. By the estimate, any of these helps:")
        for cure in cures:
            say(f"  {find.command('run', scene, [*find.without(set or (), cure, world.systems), *cure])}")
    if cures or fault is not None:
        raise typer.Exit(1)
    blind = [system for system, when in judged.items() if not when.judged]
    word = f"not judged ({', '.join(blind)})" if blind else "fine"
    say(f"{word}: {find.command('run', scene, set)}")


def _as_tree(
    scene: str,
    world: "World",
    estimates: list[dict[str, Any]],
    judged: "dict[str, _When]",
    fault: str | None,
    cures: list[list[str]],
) -> dict[str, Any]:
    """What is printed, for programs: `systems` are the estimates of `World.stability`, each with a verdict."""
    systems = []
    for estimate in estimates:
        level, verdict = predict(estimate)
        when = judged.get(estimate["system"])
        told = {"level": ("ok", "gains energy", "explodes")[level], "verdict": verdict}
        systems.append(estimate | told | ({"judged": when.judged, "particles": when.text} if when else {}))
    return {
        "ok": not cures and fault is None,
        "file": scene_file(scene),
        "title": world.scene.to_dict()["title"],
        "systems": systems,
        "fault": fault,
        "cures": cures,
        "warnings": world.warnings,
    }


@dataclass
class _When:
    """Time at which the stability of a system with emitters was judged."""

    judged: bool
    text: str


def _judge(
    tree: dict[str, Any], world: "World", expected: "list[Forecast]", estimates: list[dict[str, Any]]
) -> "tuple[dict[str, _When], str | None]":
    """Steps the world until many particles of each system are alive, within the limit of work, and replaces the initial
    estimates by the worst on the way. Returns when systems with emitters were judged, and the failure, if any."""
    import numpy as np

    from tumble import StepError

    whose = {e["name"]: e["system"] for e in tree["emitter"]}
    held = {e["system"]: [f for f in expected if whose[f.name] == e["system"]] for e in estimates}
    held = {system: own for system, own in held.items() if own}
    if not held:
        return {}, None
    last, fps = tree["time"]["frames"], tree["time"]["fps"]
    times = np.arange(last + 1) / fps
    goals = {system: np.sum([f.at(times) for f in own], axis=0) for system, own in held.items()}
    # Frames at which to judge: the first with any, and those where 1/8, 1/4, 1/2 and all of the most are there.
    look = {0}
    for counts in goals.values():
        for share in (0.0, 0.125, 0.25, 0.5, 1.0):
            look.update(np.flatnonzero((counts > 0.5) & (counts >= share * counts.max()))[:1].tolist())
    seen: dict[str, list[tuple[int, int]]] = {system: [] for system in held}
    work, fault, begin = 0.0, None, time.monotonic()
    others = sum(len(t.get("mass", ())) for t in world.topology.values()) + _cells(tree)
    while True:
        frame = world.frame_index
        if frame in look or not all(seen.values()):
            there = {name: len(table["id"]) for name, table in world.columns("id").items()}
            present = {system: sum(there.get(f.name, 0) for f in own) for system, own in held.items()}
            new = [s for s, n in present.items() if n and (frame in look or not seen[s])]
            if new:
                _take_worse(estimates, [e for e in world.stability() if e["system"] in new])
            for system in new:
                seen[system].append((frame, present[system]))
        work += others + sum(float(f.at(times[frame])) for f in expected)
        if frame >= max(look | ({last} if not all(seen.values()) else set())) or work > _WORK:
            break
        if time.monotonic() - begin > _PATIENCE:
            break
        try:
            world.step()
        except StepError as error:
            fault = f"in frame {frame + 1}, {error}"
            break
    return {system: _when(seen[system], goals[system], held[system], fps) for system in held}, fault


def _when(seen: list[tuple[int, int]], counts: Any, own: "list[Forecast]", fps: float) -> _When:
    if not seen:
        if counts.max() < 0.5 and all(f.known for f in own):
            return _When(False, "no particle is born within the duration of the scene")
        return _When(False, "cannot be judged: no particle was born in the frames tried")
    frame, n = seen[-1]
    most = max(n, math.floor(float(counts.max()) + 0.01))
    share = "" if n >= most else f" of about {most} expected"
    return _When(True, f"judged up to frame {frame} (t = {frame / fps:.4g} s), with {counted(n, 'particle')}{share}")


def _take_worse(estimates: list[dict[str, Any]], others: list[dict[str, Any]]) -> None:
    def badness(estimate: dict[str, Any]) -> tuple[float, float]:
        return predict(estimate)[0], max(estimate["frequency"], estimate["damping_max"])

    for other in others:
        for i, estimate in enumerate(estimates):
            if estimate["system"] == other["system"] and badness(other) > badness(estimate):
                estimates[i] = other


def _cells(tree: dict[str, Any]) -> float:
    """Work of all grid cells, each equal to several masses."""
    from tumble.columns import on_grids

    total = 0.0
    for _, thing in on_grids(tree):
        box = thing["box"]
        edges = sorted(box["size"])[1 if tree["dimension"] == 2 else 0 :]
        total += 20.0 * math.prod(edge / edges[-1] * box["resolution"] for edge in edges)
    return total


def _holds(expected: "Forecast", duration: float) -> str:
    """Expected numbers of an emitter."""
    words = expected.words
    source = words["from"].get("particles")
    parts = []
    if source:
        parts.append(f'children of "{source["of"]}"')
    if expected.total or expected.known:
        parts.append(f"{'' if expected.known else 'about '}{expected.total} born in {duration:.6g} s")
        if expected.total:
            parts.append(f"up to {expected.largest} at once")
    if not expected.known:
        more = "bounce" if source and source["at"] == "bounce" else "death"
        count = sum(burst["count"] for burst in words["burst"])
        parts.append(f"{count} at each {more}" if count else "number not known in advance")
    if words["most"] is not None:
        parts.append(f"at most {words['most']}")
    if words["kill"] and expected.total:
        parts.append("fewer by its kill rules")
    if expected.known and not expected.total and not source:
        first = min(
            [burst["time"] for burst in words["burst"]] + ([words["start"]] if words["rate"] else []), default=None
        )
        parts.append("neither rate nor burst" if first is None else f"the first after {first:.6g} s")
    return ", ".join(parts)


def _contents(scene: "Scene", world: "World", expected: "list[Forecast]") -> str:
    from tumble import methods

    tree = scene.to_dict()
    span = tree["time"]
    lines = [
        f'scene      "{tree["title"]}", {tree["precision"]} precision, seed {tree["seed"]}',
        f"time       {span['frames']} frames at {span['fps']:.6g} per second = {span['frames'] / span['fps']:.6g} s",
    ]
    words = {"mass": "mass", "links": "link", "triangles": "triangle", "pinned": "pin"}
    solid = {collider["name"] for collider in tree["collider"]}
    born = {f.name for f in expected}
    topology, positions = world.topology, world.columns("position")
    for name, table in topology.items():
        if name in born:
            continue
        method = methods.of_object(tree, name)
        noun = method.noun if method else "mass"
        if any(plan["name"] == name for plan in tree["plan"]):
            noun = "corner"
        own = words | {"mass": "rigid body" if "vertices" in table else noun}
        parts = [counted(len(table[key]), word) for key, word in own.items() if key in table]
        if "position" in positions.get(name, {}) and "mass" not in table and name not in solid:
            parts.insert(0, counted(len(positions[name]["position"]), noun))
        lines.append(f'{"collider" if name in solid else "object":10} "{name}": {", ".join(parts) or "no mesh"}')
    duration = span["frames"] / span["fps"]
    for f in expected:
        method = methods.of_object(tree, f.name)
        kind = f" ({method.noun}s)" if method and method.is_carried else ""
        lines.append(f'emitter    "{f.name}"{kind}: {_holds(f, duration)}')
    for anchor in tree["anchor"]:
        lines.append(f'anchor     "{anchor["name"]}": from {" to ".join(anchor["between"])}')
    masses, links = (sum(len(t.get(key, ())) for t in topology.values()) for key in ("mass", "links"))
    totals = [counted(masses, "mass"), counted(links, "link"), counted(len(world.systems), "system")]
    if most := sum(f.largest for f in expected):
        totals.insert(1, f"up to {counted(most, 'emitted particle')}")
    lines.append(f"total      {', '.join(totals)}")
    taken = _memory()
    memory = f"{size(taken)} in use, " if taken else ""
    lines.append(
        f"memory     {memory}limit {tree['world']['memory_limit']:.3g} GiB; "
        f"{_disk(world, expected, span['frames'], span['fps'])}"
    )
    return "\n".join(lines)


def _disk(world: "World", expected: "list[Forecast]", frames: int, fps: float) -> str:
    """Disk space of the frames."""
    import numpy as np

    born = {f.name for f in expected}
    columns = world.frame
    still = sum(a.nbytes for name, table in columns.items() for a in table.values() if name not in born)
    sizes = np.full(frames + 1, float(still))
    for f in expected:
        each = sum(a.itemsize * math.prod(a.shape[1:]) for a in columns.get(f.name, {}).values())
        sizes += each * f.at(np.arange(frames + 1) / fps)
    if all(f.known for f in expected):
        return f"a frame takes {'up to ' if born else ''}{size(sizes.max())} on disk, the run {size(sizes.sum())}"
    blind = ", ".join(f'"{f.name}"' for f in expected if not f.known)
    return f"a frame takes {size(sizes.max())} on disk, the run {size(sizes.sum())}, without {blind}"


def _memory() -> float:
    """Peak memory of this process in bytes; 0 if the system does not provide it."""
    try:
        import resource
    except ImportError:
        return 0.0
    import sys

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return float(peak if sys.platform == "darwin" else peak * 1024)


def predict(estimate: dict[str, Any]) -> tuple[int, str]:
    """The verdict on a system: 0 ok, 1 gains energy slowly, 2 will explode; and why."""
    limit = _limits(estimate).get(estimate["integrator"])
    return _verdict(estimate["step"], *limit) if limit else (0, "ok: chooses its own steps")


def _limits(estimate: dict[str, Any]) -> dict[str, tuple[float, float]]:
    return {limit["integrator"]: (limit["stable"], limit["usable"]) for limit in estimate["limits"]}


def _verdict(step: float, stable: float, usable: float) -> tuple[int, str]:
    if step <= stable:
        return 0, "ok: stable" if math.isinf(stable) else f"ok: {step / stable:.0%} of the largest stable step"
    if step <= usable:
        return 1, "gains energy, but slowly: by less than 1000 times in 100 periods of the stiffest mode"
    if stable == 0.0:
        return 2, "will explode: no step is stable, and this one gains energy quickly"
    return 2, f"will explode: {step / stable:.3g} times the largest stable step"


def _table(scene: "Scene", estimate: dict[str, Any], when: _When | None = None) -> str:
    step, frequency = estimate["step"], estimate["frequency"]
    frame = 1.0 / scene.to_dict()["time"]["fps"]
    where = f', most at particle {estimate["culprit"][1]} of "{estimate["culprit"][0]}"' if estimate["culprit"] else ""
    period = f" (period {seconds(2 * math.pi / frequency)})" if frequency > 0 else ""
    fixed = estimate["integrator"] in _limits(estimate)
    steps = f"{seconds(step)}, {round(frame / step)} per frame" if fixed else "adaptive"
    level, verdict = predict(estimate)
    if when is not None and not when.judged and level < 2:
        verdict = "not judged"
    lines = [
        f'system "{estimate["system"]}"',
        f"  integrator      {estimate['integrator']}",
        f"  step            {steps}",
        f"  stiffest mode   {frequency:.4g} rad/s{period}{where}",
        f"  damping         {estimate['damping']:.4g} 1/s of that mode, {estimate['damping_max']:.4g} 1/s at most",
        f"  verdict         {verdict}",
        *([f"  particles       {when.text}"] if when is not None else []),
        "",
        f"    {'integrator':18} {'largest stable':>15} {'largest usable':>15}  at {seconds(step)}",
    ]
    for name, (stable, usable) in _limits(estimate).items():
        seen = ("ok", "gains energy slowly", "explodes")[_verdict(step, stable, usable)[0]]
        mark = ">" if name == estimate["integrator"] else " "
        lines.append(f"  {mark} {name:18} {seconds(stable):>15} {seconds(usable):>15}  {seen}")
    if not fixed:
        lines.append(f"  > {estimate['integrator']:18} {'chooses its own steps':>31}  ok")
    return "\n".join(lines)


def _cures(tree: dict[str, Any], estimate: dict[str, Any]) -> list[list[str]]:
    """Changes that are stable by the estimate: of the step alone, if that suffices, or of the integrator."""
    limits, system = _limits(estimate), estimate["system"]
    plan: dict[str, Any] = next((s for s in tree["system"] if s["name"] == system), {})
    interval = 1.0 / tree["time"]["fps"] / tree["time"]["exchanges"]

    def shorter(stable: float) -> dict[str, str]:
        best = _SAFETY * stable
        return {"substeps": str(math.ceil(interval / best))} if plan.get("substeps") else {"step": f"{best:.1e}"}

    own = estimate["integrator"]
    changes = [shorter(limits[own][0])] if limits[own][0] > 0.0 else []
    if plan.get("clamp") is None:
        for name in ("symplectic_euler", "implicit_euler"):
            if name in limits and name != own and limits[name][0] > 0.0:
                enough = estimate["step"] <= limits[name][0]
                changes.append({"integrator": name} | ({} if enough else shorter(limits[name][0])))
    return [[f"system.{system}.{key}={value}" for key, value in change.items()] for change in changes]
