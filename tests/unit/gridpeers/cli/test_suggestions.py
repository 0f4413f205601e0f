"""What is typed wrong is told in one line, in the words of the house."""

import pytest
import typer.main

from gridpeers.lab.commands import CHANGES, replay
from tests.command_line import invoke


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["rnu"], 'no command "rnu"; did you mean "run"?'),
        (["link", "sett"], 'no command "sett"; did you mean "set"? The commands are set, cut, heal, show'),
        (
            ["run", "x", "--driver", "inproces"],
            '--driver: there is no "inproces"; did you mean "inprocess"? The choices',
        ),
        (["doc", "key"], 'TOPIC: there is no "key"; did you mean "keys"? The choices are keys, messages, scenario'),
        (["run", "x", "--speed", "fast"], '--speed: must be a number, got "fast"'),
        (["run", "x", "--seed", "1.5"], '--seed: must be a whole number, got "1.5"'),
        (["run", "x", "--seed", "-1"], "--seed: must be at least 0, got -1"),
        (
            ["run", "x", "--spede", "2"],
            'no option "--spede"; did you mean "--speed"? The options are --driver, --clock,',
        ),
        (["why", "x", "inv2", "-1"], "TIME: must be at least 0 s, where a run begins, as 4.3;"),
        (["why", "x", "inv2", "-.5"], "TIME: must be at least 0 s, where a run begins, as 4.3;"),
        (["event", "open", "-1"], 'no option "-1"; the options are --sync'),
        (["run", "x", "--case"], "--case: needs a value"),
        (["run", "x", "--strict=yes"], "--strict: takes no value"),
        (["run", "x", "y"], 'too much was typed: "y"; '),
        (["link", "cut", "inv1", "inv4", "--for", "long"], '--for: must be a number, got "long"'),
        (["event", "open"], "SWITCH is missing; gridpeers event -h shows what it is"),
    ],
)
def test_a_mistyped_word_is_one_line(words: list[str], line: str) -> None:
    """Where, what, and what was probably meant; no usage, no jargon of a library."""
    code, text = invoke(*words)

    assert code == 2
    assert text.startswith(f"gridpeers: {line}")
    assert text.count("\n") == 1


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
