"""Commands that come from outside of the command line."""

import pytest

from gridpeers.cli.contributed import COMMANDS, contributed


def test_the_papers_commands_are_there() -> None:
    """`reproduce` and `experiment` come with gridpeers, and are known without a paper in the command line."""
    assert {"reproduce", "experiment"} <= {name for name, _ in contributed()}


def test_a_command_that_cannot_be_imported_leaves_the_others_alone(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It says why when it is called, with exit code 2; the command line starts."""
    monkeypatch.setitem(COMMANDS.own, "mine", "no_such_module:command")
    commands = dict(contributed())

    with pytest.raises(SystemExit) as ended:
        commands["mine"]()

    assert ended.value.code == 2
    assert 'there is no module "no_such_module"' in capsys.readouterr().err
    assert "reproduce" in commands
