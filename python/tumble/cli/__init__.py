"""The command line: `tumble VERB`, one file per verb.

Exit codes: 0 fine, 1 the simulation failed or broke an expectation, 2 the input is wrong, 130 stopped with Ctrl-C, 143
stopped by a signal to terminate.
"""

import errno
import sys
from collections.abc import Sequence
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from tumble.cli import branch, check, diff, export, lab, plot, refine, render, run, scenes, view
from tumble.cli.console import complain, heed_termination, lost_frames_told, stopped, survive_narrow_streams


class Verbs(TyperGroup):
    """Turns any exception of a verb into one clear message and an exit code."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as stop:
            complain("stopped")
            raise typer.Exit(stopped(stop)) from None
        except MemoryError:
            complain("out of memory: the scene needs more than this machine has; lower its resolution")
            raise typer.Exit(1) from None
        except OSError as error:
            if error.errno == errno.EPIPE:
                raise
            where = f"{error.filename}: " if error.filename else ""
            complain(f"{where}{error.strerror or error}")
            raise typer.Exit(1) from None
        except Exception as error:
            # The engine is not loaded for `--help`; its errors can only come from it.
            engine = sys.modules.get("tumble._engine")
            if engine is None or not isinstance(error, engine.TumbleError):
                raise
            complain(str(error))
            raise typer.Exit(2 if isinstance(error, engine.SceneError) else 1) from None


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
        cls=Verbs,
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
        render.render,
        export.export,
        plot.plot,
        branch.branch,
        diff.diff,
        scenes.scenes,
        view.view,
    ):
        app.command()(verb)
    app.add_typer(lab.app, name="lab")
    return app


def main(arguments: Sequence[str] | None = None) -> None:
    """Runs the command line and exits."""
    survive_narrow_streams()
    heed_termination()
    with lost_frames_told():
        application()(args=arguments, prog_name="tumble")
