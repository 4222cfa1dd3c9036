"""`tumble lab`: experiments on the behaviour of the methods, as HTML pages."""

from pathlib import Path
from typing import Annotated

import typer

from tumble.bundled import scene_file, unknown
from tumble.cli import find
from tumble.cli.console import Progress, say
from tumble.cli.verbs import Verb, Verbs

app = typer.Typer(cls=Verbs, no_args_is_help=True, rich_markup_mode=None)

OutOption = Annotated[Path | None, typer.Option(metavar="DIR", help="Folder of the page.", show_default="out/lab/...")]


@app.callback()
def lab() -> None:
    """Experiments on the numerical methods, as HTML pages.

    \b
    Examples:
      tumble lab integrators integrators/spiral
      tumble lab structures
      tumble lab operators
      tumble lab compressible
      tumble lab pressure
      tumble lab positions
      tumble lab fabric denim
      tumble lab contact
      tumble lab dam
    """


@app.command(cls=Verb)
def integrators(
    scene: find.SceneArgument,
    set: find.SetOption = None,
    integrator: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Only this one. Repeatable.", show_default="all applicable")
    ] = None,
    step: Annotated[
        list[float] | None,
        typer.Option(metavar="S", help="A sub-step to try [s]. Repeatable.", show_default="around the limits"),
    ] = None,
    duration: Annotated[
        float | None, typer.Option(metavar="S", help="Simulated time for the comparison of errors [s].")
    ] = None,
    budget: Annotated[
        float, typer.Option(metavar="S", help="Time after which longer experiments are skipped [s].")
    ] = 45.0,
    out: OutOption = None,
) -> None:
    """Run a scene with every integrator: order, energy, cost.

    \b
    Examples:
      tumble lab integrators integrators/spiral
      tumble lab integrators my.toml --integrator rk4 --integrator verlet
    """
    for name, values in {"--step": step or (), "--duration": [duration], "--budget": [budget]}.items():
        if any(value is not None and not 0 < value < float("inf") for value in values):
            raise typer.BadParameter("expected > 0 s", param_hint=name)
    checked = find.scene(scene, set)
    folder = out or find.OUT / "lab" / f"integrators-{scene_file(scene).stem}"
    from tumble.lab.integrators import page
    from tumble.lab.schemes import BY_WORD

    for name in integrator or ():
        if name not in BY_WORD:
            raise typer.BadParameter(unknown("integrator", name, BY_WORD), param_hint="--integrator")
    with Progress("lab") as progress:
        written = page(
            checked,
            folder,
            steps=step or None,
            integrators=integrator or None,
            duration=duration,
            progress=progress,
            budget=budget,
        )
    say(written)


@app.command(cls=Verb)
def structures(out: OutOption = None) -> None:
    """Pull on sheets and blocks with different families of links.

    \b
    Example:
      tumble lab structures
    """
    from tumble.lab.structures import page

    with Progress("lab") as progress:
        written = page(out or find.OUT / "lab" / "structures", progress=progress)
    say(written)


@app.command(cls=Verb)
def operators(out: OutOption = None) -> None:
    """Show each grid operator, and why velocities are stored on faces.

    \b
    Example:
      tumble lab operators
    """
    from tumble.lab.operators import page

    say(page(out or find.OUT / "lab" / "operators"))


@app.command(cls=Verb)
def compressible(out: OutOption = None) -> None:
    """Show the largest step of the bad solver, and Stable Fluids at a hundred times that.

    \b
    Example:
      tumble lab compressible
    """
    from tumble.lab.compressible import page

    say(page(out or find.OUT / "lab" / "compressible"))


@app.command(cls=Verb)
def positions(out: OutOption = None) -> None:
    """Show how fast position-based dynamics converges to a given stiffness, by sub-steps and by sweeps.

    \b
    Example:
      tumble lab positions
    """
    from tumble.lab.positions import page

    say(page(out or find.OUT / "lab" / "positions"))


@app.command(cls=Verb)
def fabric(
    fabrics: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[NAME|FILE]...", help="Bundled fabrics or record files.", show_default="all bundled ones"
        ),
    ] = None,
    out: OutOption = None,
) -> None:
    """Pull, hang and drape measured fabrics, and compare with their records.

    Each fabric takes minutes: strips and a disk of 15 cm radius are simulated until they rest. Name one to run only that.

    \b
    Examples:
      tumble lab fabric
      tumble lab fabric denim mine.json
    """
    from tumble.lab.fabric import SHIPPED, page

    with Progress("lab") as progress:
        written, text = page(out or find.OUT / "lab" / "fabric", fabrics or list(SHIPPED), progress=progress)
    say(text)
    say(written)


@app.command(cls=Verb)
def pressure(
    cells: Annotated[int, typer.Option(metavar="N", min=16, max=256, help="Cells along a side of the cube.")] = 48,
    single: Annotated[bool, typer.Option("--single", help="Use single precision, as scenes do by default.")] = False,
    budget: Annotated[float, typer.Option(metavar="S", help="Time after which a method is stopped [s].")] = 20.0,
    out: OutOption = None,
) -> None:
    """Compare pressure solvers: residuals against time and iterations.

    \b
    Examples:
      tumble lab pressure
      tumble lab pressure --cells 96 --budget 60
    """
    if not 0.1 <= budget < float("inf"):
        raise typer.BadParameter(f"{budget:g} s, expected 0.1 s or more", param_hint="--budget")
    from tumble.lab.pressure import page

    with Progress("lab") as progress:
        written = page(
            out or find.OUT / "lab" / "pressure", cells, budget, "single" if single else "double", progress=progress
        )
    say(written)


@app.command(cls=Verb)
def contact(
    case: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Only this experiment. Repeatable.", show_default="all")
    ] = None,
    out: OutOption = None,
) -> None:
    """Compare rigid bodies and grains with exact and measured figures.

    Blocks and balls on slopes, Newton's cradle, a bouncing ball, a card house, a stone arch, a tumbling wing nut, a hopper and
    a column that collapses. It takes about a minute. The last line says how many figures hold, and which do not.

    \b
    Examples:
      tumble lab contact
      tumble lab contact --case arch --case cards
    """
    from tumble.lab.contact import CASES, page

    for name in case or ():
        if name not in CASES:
            raise typer.BadParameter(unknown("case", name, CASES), param_hint="--case")
    with Progress("lab") as progress:
        written, text = page(out or find.OUT / "lab" / "contact", case or (), progress=progress)
    say(written)
    say(text)


@app.command(cls=Verb)
def dam(
    cells: Annotated[int, typer.Option(metavar="N", min=16, max=512, help="Cells along the tank.")] = 64,
    out: OutOption = None,
) -> None:
    """Break the same dam by every method for liquids: pictures, front against the experiment, energy, volume, cost.

    PIC, FLIP and APIC, which are particles and a grid, and position-based particles by themselves. It takes about half a
    minute.

    \b
    Examples:
      tumble lab dam
      tumble lab dam --cells 96
    """
    from tumble.lab.dam import page

    with Progress("lab") as progress:
        written = page(out or find.OUT / "lab" / "dam", cells, progress)
    say(written)
