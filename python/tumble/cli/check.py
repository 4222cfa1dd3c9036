"""`tumble check`: is the scene right, and will its steps be stable?"""

import math
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tumble.cli import find
from tumble.cli.console import counted, say, seconds, size, warn

if TYPE_CHECKING:
    from tumble import Scene, World

_SAFETY = 0.7
"""Of its largest stable step, what an explicit integrator is advised to take."""


def check(
    scene: find.SceneArgument,
    set: find.SetOption = None,
    threads: Annotated[int | None, typer.Option(min=1, metavar="N", help="Processor cores to use.")] = None,
) -> None:
    """Check a scene, and estimate which steps are stable.

    Ends with code 1 if a system is predicted to explode, 2 if the scene is wrong.

    \b
    Examples:
      tumble check my.toml
      tumble check my.toml --set system.soft.integrator=forward_euler
    """
    from tumble import World
    from tumble.expect import probes

    checked = find.scene(scene, set)
    with find.naming(find.scene_file(scene)):
        world = World(checked, threads)
        probes(world, checked.to_dict())
    say(_contents(checked, world))
    estimates = world.stability()
    cures: list[list[str]] = []
    for estimate in estimates:
        say()
        say(_table(checked, estimate))
        if predict(estimate)[0] == 2:
            cures += _cures(checked.to_dict(), estimate)
    without = [name for name in world.systems if name not in {e["system"] for e in estimates}]
    if without:
        say(f"\nno estimate for: {', '.join(without)}")
    say()
    for text in world.warnings:
        warn(text)
    if cures:
        say("will explode. Any of these helps, by the estimate:")
        for cure in cures:
            say(f"  {find.command('run', scene, [*find.without(set or (), cure, world.systems), *cure])}")
        raise typer.Exit(1)
    say(f"fine: {find.command('run', scene, set)}")


def _contents(scene: "Scene", world: "World") -> str:
    tree = scene.to_dict()
    time = tree["time"]
    lines = [
        f'scene      "{tree["title"]}", {tree["precision"]} precision, seed {tree["seed"]}',
        f"time       {time['frames']} frames at {time['fps']:.6g} per second = {time['frames'] / time['fps']:.6g} s",
    ]
    words = {"mass": "mass", "links": "link", "triangles": "triangle", "pinned": "pin"}
    solid = {collider["name"] for collider in tree["collider"]}
    topology, positions = world.topology, world.columns("position")
    for name, table in topology.items():
        parts = [counted(len(table[key]), word) for key, word in words.items() if key in table]
        if "position" in positions.get(name, {}) and "mass" not in table and name not in solid:
            parts.insert(0, counted(len(positions[name]["position"]), "tracer"))
        lines.append(f'{"collider" if name in solid else "object":10} "{name}": {", ".join(parts) or "no mesh"}')
    for anchor in tree["anchor"]:
        lines.append(f'anchor     "{anchor["name"]}": from {" to ".join(anchor["between"])}')
    masses, links = (sum(len(t.get(key, ())) for t in topology.values()) for key in ("mass", "links"))
    frame = sum(array.nbytes for table in world.frame.values() for array in table.values())
    totals = [counted(masses, "mass"), counted(links, "link"), counted(len(world.systems), "system")]
    lines.append(f"in all     {', '.join(totals)}")
    taken = _memory()
    memory = f"{size(taken)} in use, " if taken else ""
    lines.append(
        f"memory     {memory}limit {tree['world']['memory_limit']:.3g} GiB; "
        f"a frame takes {size(frame)} on disk, the run {size(frame * (time['frames'] + 1))}"
    )
    return "\n".join(lines)


def _memory() -> float:
    """Largest memory that this process has had so far, in bytes; 0 where the system does not tell."""
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
        return 2, "will explode: no step is stable, and this one gains energy fast"
    return 2, f"will explode: {step / stable:.3g} times the largest stable step"


def _table(scene: "Scene", estimate: dict[str, Any]) -> str:
    step, frequency = estimate["step"], estimate["frequency"]
    frame = 1.0 / scene.to_dict()["time"]["fps"]
    where = f', most at particle {estimate["culprit"][1]} of "{estimate["culprit"][0]}"' if estimate["culprit"] else ""
    period = f" (period {seconds(2 * math.pi / frequency)})" if frequency > 0 else ""
    fixed = estimate["integrator"] in _limits(estimate)
    steps = f"{seconds(step)}, {round(frame / step)} per frame" if fixed else "chosen as it goes"
    lines = [
        f'system "{estimate["system"]}"',
        f"  integrator      {estimate['integrator']}",
        f"  step            {steps}",
        f"  stiffest mode   {frequency:.4g} rad/s{period}{where}",
        f"  damping         {estimate['damping']:.4g} 1/s of that mode, {estimate['damping_max']:.4g} 1/s at most",
        f"  verdict         {predict(estimate)[1]}",
        "",
        f"    {'integrator':18} {'largest stable':>15} {'largest usable':>15}  at {seconds(step)}",
    ]
    for name, (stable, usable) in _limits(estimate).items():
        verdict = ("ok", "gains energy slowly", "explodes")[_verdict(step, stable, usable)[0]]
        mark = ">" if name == estimate["integrator"] else " "
        lines.append(f"  {mark} {name:18} {seconds(stable):>15} {seconds(usable):>15}  {verdict}")
    if not fixed:
        lines.append(f"  > {estimate['integrator']:18} {'chooses its own steps':>31}  ok")
    return "\n".join(lines)


def _cures(tree: dict[str, Any], estimate: dict[str, Any]) -> list[list[str]]:
    """Changes that the estimate finds stable: of the step alone, where that is enough, or of the integrator."""
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
