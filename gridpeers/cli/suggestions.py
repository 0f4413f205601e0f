"""Errors of the command line in one line each, with the nearest word; typer prints three lines."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from typer import BadParameter
from typer.core import TyperGroup

from gridpeers.cli.usage import BAD_INPUT, fail
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.wording import suggestion

_UsageError: type[BaseException] = BadParameter.__mro__[1]
"""Base of all problems on a command line; releases of typer keep it in different modules."""


class Commands(TyperGroup):
    """Commands that report mistyped words in one line."""

    def make_context(self, *words: Any, **extra: Any) -> Any:  # noqa: D102
        with _in_one_line():
            return super().make_context(*words, **extra)

    def invoke(self, ctx: Any) -> Any:  # noqa: D102
        with _in_one_line():
            return super().invoke(ctx)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:  # noqa: D102
        if not args[0].startswith("-") and self.get_command(ctx, args[0]) is None:
            fail([f'no command "{args[0]}"; {suggestion(args[0], self.list_commands(ctx), "commands")}'], BAD_INPUT)
        return super().resolve_command(ctx, args)


@contextmanager
def _in_one_line() -> Iterator[None]:
    try:
        yield
    except _UsageError as error:
        if type(error).__name__ == "NoArgsIsHelpError":  # the help is all that it says
            raise
        fail([_line(error)], BAD_INPUT)


def _line(error: Any) -> str:
    """Return a problem in one line: where it is, what it is, and what would be right."""
    message = error.format_message().rstrip(".")
    words: list[str] = []
    ctx = error.ctx
    while ctx is not None and ctx.parent is not None:
        words, ctx = [ctx.info_name, *words], ctx.parent
    more = command_line(*words, "-h")
    param, kind = getattr(error, "param", None), type(error).__name__
    if kind == "NoSuchOption":
        params = error.ctx.command.get_params(error.ctx)
        if re.match(r"-[\d.]", error.option_name) and any(each.metavar == "TIME" for each in params):
            return 'TIME: must be at least 0 s, where a run begins, as 4.3; a word that begins with "-" is an option'
        known = [name for each in params for name in each.opts if name[:2] == "--"]
        return f'no option "{error.option_name}"; {suggestion(error.option_name, known, "options")}'
    if kind == "BadOptionUsage":
        return f"{error.option_name}: {'needs a value' if 'requires' in message else 'takes no value'}"
    if extra := re.search(r"unexpected extra arguments?(?:\(s\))? \((.*)\)", message):
        return f'too much was typed: "{extra[1]}"; {more} shows what is expected'
    if param is None:
        return f"{message[:1].lower()}{message[1:]}; {more} shows what can be given"
    name = param.metavar if param.metavar and param.metavar.isupper() else str(param.name).upper()
    if param.param_type_name == "option":
        name = str(max(param.opts, key=len))
    if kind == "MissingParameter":
        return f"{name} is missing; {more} shows what it is"
    return f"{name}: {_wrong_value(error, message)}"


def _wrong_value(error: Any, message: str) -> str:
    text = message.partition(": ")[2]
    value, *choices = re.findall(r"'([^']*)'", text) or [""]
    ctx: dict[str, Any] = {}
    if details := getattr(error.__cause__, "errors", None):  # typer has values checked by pydantic since 0.29
        first = details()[0]
        value, ctx = first["input"], first.get("ctx", {})
    if choices:
        return f'there is no "{value}"; {suggestion(value, choices, "choices")}'
    if "ge" in ctx:
        return f"must be at least {ctx['ge']}, got {value}"
    if "integer" in message:
        return f'must be a whole number, got "{value}"'
    if "number" in message or "float" in message:
        return f'must be a number, got "{value}"'
    text = text or message
    return text[:1].lower() + text[1:]
