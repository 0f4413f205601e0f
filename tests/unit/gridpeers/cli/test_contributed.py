"""Commands that come from outside of the command line, and those that are imported when they are called."""

from typing import Any

import pytest
import typer

from gridpeers.cli.root import COMMANDS, OWN_COMMANDS, app
from tests.command_line import invoke


@pytest.mark.parametrize("name", OWN_COMMANDS)
def test_the_help_of_all_commands_has_the_first_sentence_of_each(name: str) -> None:
    """The line that is known without the command's module is the one that the module has."""
    group: Any = typer.main.get_command(app)

    assert group.get_command(None, name).get_short_help_str(200).startswith(OWN_COMMANDS[name].summary)


def test_a_command_that_cannot_be_imported_leaves_the_others_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """It says why when it is called, with exit code 2; the command line starts, and lists it."""
    monkeypatch.setitem(COMMANDS.own, "mine", "no_such_module:command")

    code, text = invoke("mine")

    assert code == 2
    assert 'there is no module "no_such_module"' in text
    assert {"mine", "reproduce"} <= {line.split()[0] for line in invoke("--help")[1].splitlines() if line.strip()}
