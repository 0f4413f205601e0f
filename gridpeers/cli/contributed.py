"""Commands from outside of the command line: those of the papers, and of installed distributions.

A command is a function that typer can read. It is added by an entry point of the group "gridpeers.commands".
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from wire.plugins.registry import PluginError, Registry

Command = Callable[..., None]


def _objection(it: Any) -> str:
    return "" if callable(it) else "it is no function"


COMMANDS: Registry[Command] = Registry(
    "command",
    "commands",
    _objection,
    own={
        "reproduce": "papers.singhal2022.reproduce.reproduce_command:reproduce",
        "experiment": "papers.singhal2022.experiments.experiment_command:experiment",
    },
)
"""Commands by name; those that come with gridpeers are references."""


def contributed() -> Iterator[tuple[str, Command]]:
    """Yield the name and the function of each; one that cannot be imported says so when it is called."""
    for name in COMMANDS.names:
        try:
            yield name, COMMANDS.resolve(name)
        except PluginError as error:
            yield name, _broken(str(error))


def _broken(why: str) -> Command:
    def command() -> None:
        """Cannot be imported."""
        from gridpeers.cli.usage import BAD_INPUT, fail

        fail([why], BAD_INPUT)

    return command
