"""Commands that come from outside of the command line, and those that are imported when they are called."""

from typing import Any

import pytest
import typer

from gridpeers.cli.root import COMMANDS, SUMMARIES, app
from tests.command_line import invoke


def test_the_help_of_all_commands_has_the_first_sentence_of_each() -> None:
    """The line that is known without the command's module is the one that the module has, with an example below."""
    group: Any = typer.main.get_command(app)
    commands = {name: group.get_command(None, name) for name in SUMMARIES}

    found = {name: command.get_short_help_str(200) for name, command in commands.items()}
    assert [name for name, text in found.items() if not text.startswith(SUMMARIES[name])] == []
    lacking = [name for name, command in commands.items() if f"Example:  gridpeers {name}" not in command.help]
    assert lacking == ["feeder"]  # a group


def test_a_command_that_cannot_be_imported_leaves_the_others_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """It says why when it is called, with exit code 2; the command line starts, and lists it."""
    monkeypatch.setitem(COMMANDS.own, "mine", "no_such_module:command")

    code, text = invoke("mine")

    assert code == 2
    assert 'there is no module "no_such_module"' in text
    assert {"mine", "reproduce"} <= {line.split()[0] for line in invoke("--help")[1].splitlines() if line.strip()}
