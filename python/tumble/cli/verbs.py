"""Verbs and groups of verbs: how what was typed is read, and what is said where it cannot be."""

import errno
import sys
from collections.abc import Collection, Iterator, Sequence
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from tumble.bundled import unknown
from tumble.cli.console import complain, stopped

_MOST = 8
"""Mistakes of one command line that are told."""

_LONGEST = 200
"""Characters of a line of help, which is wrapped rather than cut."""


class Verb(TyperCommand):
    """Tells all mistakes of its options at once."""

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        left, mistakes = list(args), list[str]()
        while True:
            try:
                context = super().make_context(info_name, list(left), parent, **extra)
            except typer.BadParameter as error:
                error.message = _told(error)
                mistakes.append(error.format_message())
                fewer = list(_without(left, getattr(error.param, "opts", ())))
                if len(fewer) < len(left) and len(mistakes) < _MOST:
                    left = fewer
                    continue
                if error.ctx is None:
                    raise
                error.ctx.fail("\n".join(mistakes))
            if mistakes:
                context.fail("\n".join(mistakes))
            return context

    def get_short_help_str(self, limit: int = _LONGEST) -> str:
        return super().get_short_help_str(_LONGEST)


def _told(error: typer.BadParameter) -> str:
    """What is wrong with a number, in our words: those of the library that reads it are for programmers."""
    try:
        first = error.__cause__.errors()[0]  # type: ignore[union-attr]
    except (AttributeError, LookupError, TypeError):
        return error.message
    match first:
        case {"type": "greater_than_equal", "ctx": {"ge": least}}:
            expected = f">= {least}"
        case {"type": "less_than_equal", "ctx": {"le": most}}:
            expected = f"<= {most}"
        case {"type": kind} if str(kind).startswith("int"):
            expected = "a whole number"
        case {"type": kind} if str(kind).startswith("float"):
            expected = "a number"
        case _:
            expected = "something else; see --help"
    return f"{str(first.get('input'))!r}, expected {expected}"


def _without(arguments: Sequence[str], options: Collection[str]) -> Iterator[str]:
    """The arguments without these options and their values."""
    words = iter(arguments)
    for word in words:
        if word in options:
            next(words, None)
        elif word.split("=", 1)[0] not in options:
            yield word


class Verbs(TyperGroup):
    """Names the nearest verbs, and all there are, where one is mistyped."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        if not args[0].startswith("-") and self.get_command(ctx, args[0]) is None:
            known = self.list_commands(ctx)
            text, there = unknown("command", args[0], known), f"there are {', '.join(known)}"
            ctx.fail(text if there in text else f"{text}\n{there}")
        return super().resolve_command(ctx, args)

    def get_short_help_str(self, limit: int = _LONGEST) -> str:
        return super().get_short_help_str(_LONGEST)


class Root(Verbs):
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
            complain(told(error))
            raise typer.Exit(2 if isinstance(error, engine.SceneError) else 1) from None


def told(error: Exception) -> str:
    """An error of the engine, with overrides as they were typed."""
    lines = str(error).split("\n")
    for issue in getattr(error, "issues", ()):
        begin = f"set {issue['set']}: " if "set" in issue else None
        lines = [f"--{line}" if begin and line.startswith(begin) else line for line in lines]
    return "\n".join(lines)
