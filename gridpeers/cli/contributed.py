"""Commands from outside of gridpeers: those of installed distributions.

A command is a function that typer can read. It is added by an entry point of the group "gridpeers.commands".
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from gridpeers.cli.own_commands import OWN_COMMANDS
from gridpeers.wire.plugins.registry import PluginError, Registry

Command = Callable[..., None]


def _objection(it: Any) -> str:
    return "" if callable(it) else "it is no function"


COMMANDS: Registry[Command] = Registry(
    "command", "commands", _objection, own={name: command.reference for name, command in OWN_COMMANDS.items()}
)
"""Commands by name."""


def command_of(name: str) -> Command:
    """Return the function of a command, or its `typer.Typer`; one that cannot be imported says so when it is called."""
    try:
        return COMMANDS.resolve(name)
    except PluginError as error:
        return _broken(str(error))


def _broken(why: str) -> Command:
    def command() -> None:
        """Cannot be imported."""
        from gridpeers.cli.usage import BAD_INPUT, fail

        fail([why], BAD_INPUT)

    return command
