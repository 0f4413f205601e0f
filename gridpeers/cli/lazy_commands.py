"""The commands of `gridpeers` as typer sees them: each is imported when it is called, so that help comes at once."""

from __future__ import annotations

from typing import Any

import typer

from gridpeers.cli.contributed import COMMANDS, command_of
from gridpeers.cli.own_commands import OWN_COMMANDS
from gridpeers.cli.suggestions import Commands


class LazyCommands(Commands):
    """All commands by their names; the help reads the line of each from `OWN_COMMANDS`."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names: gridpeers' own first."""
        return list(COMMANDS.names)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Import a command; None if there is none of this name."""
        if cmd_name not in self.commands and (cmd_name in COMMANDS.own or cmd_name in COMMANDS.names):
            self.commands[cmd_name] = _as_typer_has_it(cmd_name, command_of(cmd_name))
        return self.commands.get(cmd_name)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the names and what each command does."""
        rows = []
        for name in self.list_commands(ctx):
            own = OWN_COMMANDS.get(name)
            rows.append((name, own.summary if own else self.get_command(ctx, name).get_short_help_str(60)))
        with formatter.section("Commands"):
            formatter.write_dl(rows)


def _as_typer_has_it(name: str, found: Any) -> Any:
    """Return the command of a function, or of a `typer.Typer` with commands of its own."""
    holder = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    holder.callback()(_nothing)  # so that a single command keeps its name
    if isinstance(found, typer.Typer):
        holder.add_typer(found, name=name)
    else:
        holder.command(name)(found)
    group: Any = typer.main.get_command(holder)
    return group.commands[name]


def _nothing() -> None:
    """Do nothing before the command."""
