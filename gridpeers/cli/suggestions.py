"""How a command ends that was typed wrong, or given what cannot be used: with a line for each problem."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from typer import BadParameter
from typer.core import TyperGroup

from gridpeers.cli.usage import fail, refuse
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.wording import InputError, suggestion

_UsageError: type[BaseException] = BadParameter.__mro__[1]
"""Base of all problems on a command line; releases of typer keep it in different modules."""


class Commands(TyperGroup):
    """Commands that report mistyped words in one line, where typer prints three."""

    def make_context(self, *words: Any, **extra: Any) -> Any:  # noqa: D102
        with _in_one_line():
            return super().make_context(*words, **extra)

    def invoke(self, ctx: Any) -> Any:  # noqa: D102
        with _in_one_line():
            return super().invoke(ctx)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:  # noqa: D102
        if not args[0].startswith("-") and self.get_command(ctx, args[0]) is None:
            fail(f'no command "{args[0]}"; {suggestion(args[0], self.list_commands(ctx), "commands")}')
        return super().resolve_command(ctx, args)


@contextmanager
def _in_one_line() -> Iterator[None]:
    try:
        yield
    except _UsageError as error:
        if type(error).__name__ == "NoArgsIsHelpError":  # the help is all that it says
            raise
        fail(_line(error))
    except InputError as error:
        refuse(error)


def _line(error: Any) -> str:
    """Return a problem in one line, in typer's words, with the command that shows what would be right."""
    message = " ".join(error.format_message().split()).rstrip(".").replace("Value error, ", "")
    words: list[str] = []
    ctx = error.ctx
    while ctx is not None and ctx.parent is not None:
        words, ctx = [ctx.info_name, *words], ctx.parent
    return f"{message[:1].lower()}{message[1:]}; {command_line(*words, '-h')} shows what can be given"
