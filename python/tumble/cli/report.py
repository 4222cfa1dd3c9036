"""Reports as text: the summary of a finished run, the failure report of a broken one."""

import math
import sys
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from tumble.cli.console import counted, seconds, size
from tumble.cli.find import command, settings, without

if TYPE_CHECKING:
    from tumble import Run, StepError

_NO_GAIN = 0.1
"""Energy growth relative to its scale below which a change counts as gaining none."""

_MOST = 0.5
"""Growth or loss of the energy over its scale beyond which a trial is not recommended, unless something in the scene may add or
remove that much."""

_EMPTY: Mapping[str, Any] = {}

_RESULTS = ["film.mp4", "scene.usda", "ply", "energy.png", "stills"]


def summary(run: "Run") -> str:
    """The location and cost of the results."""
    from tumble import expect

    ledger, last = run.ledger, run.n_frames - 1
    data = sum(f.stat().st_size for f in (run.folder / "frames").glob("*.npz"))
    steps = counted(int(ledger["steps"].sum()), "step")
    took = f"{run.time(last):.6g} s simulated in {run.manifest['timings']['simulate']:.3g} s, {steps}"
    lines = [f"{run.folder}: {counted(run.n_frames, 'frame')} ({size(data)}), {took}, hash {run.hashes[last]}"]
    lines += _particles(run)
    lines += [
        f"  {run.folder / name}{_pace(run) if name == 'film.mp4' else ''}"
        for name in _RESULTS
        if (run.folder / name).exists()
    ]
    broken = len(run.manifest["expectations"])
    if last < run.manifest["frames"]:
        lines.append(
            f"  expectations: {broken} violated; the run ends there, at frame {last} of {run.manifest['frames']}"
        )
    elif asked := expect.count(run.scene) - expect.skipped(run):
        lines.append(f"  expectations: {asked - broken} of {asked} met")
    return "\n".join(lines)


def as_tree(run: "Run", failures: Sequence[Exception] = ()) -> dict[str, Any]:
    """A run for programs: where it is, how it ended, what is doubtful, broken or failed, and what was written."""
    manifest, last = run.manifest, run.n_frames - 1
    return {
        "ok": manifest["status"] == "finished" and not manifest["expectations"] and not failures,
        "folder": run.folder,
        "status": manifest["status"],
        "frames": run.n_frames,
        "time": run.time(last),
        "hash": run.hashes[last],
        "warnings": manifest["warnings"],
        "expectations": manifest["expectations"],
        "failure": manifest["failure"],
        "errors": [{"path": "", "line": None, "message": str(failure)} for failure in failures],
        "timings": manifest["timings"],
        "files": [run.folder / name for name in _RESULTS if (run.folder / name).exists()],
    }


def _pace(run: "Run") -> str:
    """Playback speed of the film relative to the run."""
    from tumble.film import rate

    faster = rate(run) / float(run.scene["time"]["fps"])
    if faster == 1.0:
        return ""
    return f" (time lapse, {faster:.3g} times)" if faster > 1.0 else f" (slow motion, {1 / faster:.3g} times)"


def _particles(run: "Run") -> list[str]:
    """Numbers of particles per emitter."""
    from tumble.emitters import born

    counts = born(run)
    each = [f'"{name}" {born} born, {alive} alive' for name, (born, alive) in counts.items()]
    if len(each) > 4:
        born_in_all, alive_in_all = (sum(numbers) for numbers in zip(*counts.values(), strict=True))
        never = [f', "{name}" never' for name, (born, _) in counts.items() if not born]
        each = [f"of {len(each)} emitters {born_in_all} born{''.join(never)}, {alive_in_all} alive"]
    return [f"  particles: {'; '.join(each)} at the end"] if each else []


def failure(
    run: "Run",
    error: "StepError",
    scene: str,
    overrides: Sequence[str],
    again: Sequence[str] = (),
    verb: str = "run",
) -> str:
    """The failure: what, where and when, the step against its limit, and the trials. The command to copy begins with `verb`
    and ends with `again`."""
    report = getattr(error, "report", {})
    trouble = run.manifest["failure"]
    cures = _ranked(trouble["cures"])
    best = next((cure for cure in cures if cure["survived"] and _keeps_energy(cure, run.scene)), None)
    lines = [f"{_headline(report)}, after frame {run.n_frames - 1}"]
    if "index" in report:
        lines += _place(report, run.scene)
    else:
        lines.append(f"  {error}")
    if likely := trouble.get("causes"):
        lines.append("Likely causes, most likely first:")
        lines += [f"  {i}. {text}" for i, text in enumerate(likely, 1)]
    if cures:
        # Trials begin at the start of the scene, not at that of a branch.
        lines.append("Trials, from the start of the changed scene:" if verb == "branch" else "Trials:")
    for cure in sorted(cures, key=lambda cure: cure is not best):
        change = " ".join(settings(cure["set"].split()))
        growth = float(cure["energy_ratio"])
        what = f"energy {growth:+.2g} of its scale" if math.isfinite(growth) else ""
        fine = cure["survived"] and _keeps_energy(cure, run.scene)
        word = "helped" if fine else "lasted" if cure["survived"] else "failed"
        mark = "  <- recommended" if cure is best else ", wrong" if word == "lasted" else ""
        lines.append(f"  {word}  {change:56} {what}{mark}".rstrip())
    if small := trouble.get("minimal"):
        path = run.folder / small
        lines.append(
            f"A minimal scene that fails in the same way ({trouble['smaller']}):\n  {command('run', str(path))}"
        )
    kept = f"Kept: {counted(run.n_frames, 'frame')} in {run.folder}"
    if best is not None:
        changes = best["set"].split()
        systems = [system["name"] for system in run.scene["system"]]
        sets = [*without(overrides, changes, systems), *changes]
        lines.append(f"{kept}. Try\n  {command(verb, scene, sets, *again, '--force')}")
    elif cures:
        lines.append(f"{kept}. None of these helped: {_advice(run.scene, report)}")
    else:
        lines.append(f"{kept}.")
    return "\n".join(lines)


def _keeps_energy(cure: Mapping[str, Any], scene: Mapping[str, Any]) -> bool:
    """Whether the energy change of a trial is plausible."""
    from tumble import energy

    growth = float(cure["energy_ratio"])
    if not math.isfinite(growth) or abs(growth) <= _MOST:
        return True
    if growth < 0.0:
        return bool(energy.sinks(scene))
    # Births bring energy; but so do masses that come too near.
    return bool(energy.sources(scene)) and not energy.unsoftened(scene)


def _advice(scene: Mapping[str, Any], report: Mapping[str, Any] = _EMPTY) -> str:
    """Advice if no change of the steps helps."""
    from tumble import energy

    if _on_grid(scene, report):
        return f'look at the sources and formulas of "{report["object"]}"'
    if found := energy.unsoftened(scene):
        which = ", ".join(f"force.{i}" for i in found)
        return f"{which} grows without bound as masses approach; give it a softening"
    if energy.has_springs(scene):
        return "look for masses that are much too light or springs that are much too stiff"
    return "take much smaller steps, or look for forces that are much too strong for such light masses"


def gained(run: "Run", scene: str, overrides: Sequence[str], again: Sequence[str] = ()) -> str | None:
    """The command to try the advice of the warning about energy growth, if there is one."""
    from tumble.doubts import remedy

    if (found := remedy(run)) is None:
        return None
    names = [plan["name"] for plan in run.scene["system"]]
    sets = [*without(overrides, found.changes, names), *found.changes]
    return f"To try a change that conserves energy:\n  {command('run', scene, sets, *again, '--force')}"


def _headline(report: Mapping[str, Any]) -> str:
    what = {
        "not_finite": "a number stopped being finite",
        "exploded": "the energy exploded",
        "solve": "the solver did not converge",
        "step_too_small": "the required step became too small",
        "user": "a custom force or integrator raised an error",
    }.get(str(report.get("kind")), "the simulation broke")
    when = f" at t = {report['time']:.6g} s" if isinstance(report.get("time"), float) else ""
    return f"FAILED: {what}{when}"


def _on_grid(scene: Mapping[str, Any], report: Mapping[str, Any]) -> bool:
    """Whether it broke in a cell."""
    from tumble.columns import on_grids

    return any(thing["name"] == report.get("object") for _, thing in on_grids(scene))


def _place(report: Mapping[str, Any], scene: Mapping[str, Any]) -> list[str]:
    integrator, stable = report["integrator"], float(report["stable_step"])
    if stable == 0.0:
        limit = f"none: {integrator} gains energy on this system at any step"
    elif stable == float("inf"):
        limit = "any, by the linear estimate"
    else:
        limit = (
            f"{seconds(stable)} by estimate, damping included; the step used is {report['step'] / stable:.3g} x that"
        )
    number = report.get("id")
    what = "cell" if _on_grid(scene, report) else "particle"
    whose = f"{what} {report['index']}" if number is None else f"the particle with id {number}"
    lines = [
        f'  system       "{report["system"]}", {integrator}',
        f'  first bad    {report["column"]} of {whose} of "{report["object"]}"',
        f"  step used    {seconds(report['step'])}",
        f"  stable step  {limit}",
    ]
    if report.get("cause"):
        lines.insert(2, f"  because      {report['cause']}")
    if report.get("energy_ratio") is not None:
        lines.append(f"  energy       {float(report['energy_ratio']):.3g} times its scale")
    return lines


def _ranked(cures: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Best first: trials that helped and gained no energy, in order of the attempts."""

    def rank(cure: Mapping[str, Any]) -> float:
        growth = float(cure["energy_ratio"])
        if not cure["survived"]:
            return math.inf
        if ".softening=" in cure["set"] and not abs(growth) > _MOST:
            return -1.0  # The fault of the scene; other changes only find steps that happen to survive.
        return max(growth, _NO_GAIN) if math.isfinite(growth) else sys.float_info.max

    return sorted(cures, key=rank)
