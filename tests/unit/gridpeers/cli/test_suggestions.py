"""What is typed wrong is told in one line, in the words of the house; the help has every command."""

from __future__ import annotations

from typing import Any

import pytest
import typer
import typer.main

from gridpeers.cli.root import COMMANDS, SUMMARIES, app
from gridpeers.lab.commands import CHANGES, replay
from tests.command_line import invoke


@pytest.mark.parametrize("words", [(), ("link",)])
def test_a_command_alone_shows_its_help(words: tuple[str, ...]) -> None:
    """A command without arguments shows its help."""
    assert "Commands:" in invoke(*words)[1]


def test_a_replay_without_a_change_names_every_option_that_changes_something() -> None:
    """All of its options but those that say which case, from when, and where to."""
    app = typer.Typer(add_completion=False)
    app.command()(replay)
    options = {max(each.opts, key=len) for each in typer.main.get_command(app).params if each.opts[0][:2] == "--"}

    assert options - {"--case", "--from", "--out", "--help"} == set(CHANGES.replace(" or ", ", ").split(", "))


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
