"""The command line: `tumble VERB`, one file per verb.

Exit codes: 0 fine, 1 the simulation failed or broke an expectation, 2 the input is wrong, 130 stopped with Ctrl-C, 143
stopped by a signal to terminate.
"""

from collections.abc import Sequence
from typing import Annotated

import typer

from tumble.cli import (
    bottlenecks,
    branch,
    check,
    diff,
    export,
    lab,
    plot,
    refine,
    render,
    run,
    scenes,
    schema,
    sweep,
    view,
)
from tumble.cli.console import heed_termination, lost_frames_told, survive_narrow_streams
from tumble.cli.verbs import Root, Verb


def _version(asked: bool) -> None:
    if asked:
        from tumble import __version__

        print(f"tumble {__version__}")
        raise typer.Exit()


def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Simulates masses, springs, cloth, ropes and solids.

    \b
    First steps:
      tumble scenes                     list the bundled scenes
      tumble check sheet-on-bunny       is the step small enough?
      tumble run sheet-on-bunny         simulate into out/sheet-on-bunny
      tumble render sheet-on-bunny      draw the last frame
      tumble view sheet-on-ball         explore it in a browser

    \b
    Exit codes: 0 success; 1 the simulation failed or violated an expectation;
    2 invalid input; 130 stopped by Ctrl-C, 143 by SIGTERM.
    """


def application() -> typer.Typer:
    """All verbs."""
    app = typer.Typer(
        name="tumble",
        cls=Root,
        callback=_root,
        no_args_is_help=True,
        rich_markup_mode=None,  # rich would take longer to load than everything else
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    for verb in (
        run.run,
        check.check,
        refine.refine,
        sweep.sweep,
        bottlenecks.bottlenecks,
        render.render,
        export.export,
        plot.plot,
        branch.branch,
        diff.diff,
        scenes.scenes,
        schema.schema,
        view.view,
    ):
        app.command(cls=Verb)(verb)
    app.add_typer(lab.app, name="lab")
    return app


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line and exits."""
    survive_narrow_streams()
    heed_termination()
    with lost_frames_told():
        application()(args=arguments, prog_name="tumble")
