"""The command `gridpeers` as typer has it. A command is imported when it is called, so that help comes at once.

Installed distributions add commands by entry points of the group "gridpeers.commands": functions that typer can read.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

import typer

from gridpeers.cli.usage import Commands, fail
from gridpeers.wire.plugins.registry import PluginError, Registry

_PAPER = "gridpeers.papers.singhal2022"

_OWN: dict[str, tuple[tuple[str, str, str], ...]] = {
    "Start": (
        ("run", "run_command:run", "Run a scenario and print its results."),
        ("list", "show:list_", "List the scenarios that come with gridpeers."),
        ("init", "init:init", "Start a project: a law of your own, or an islanding of your feeder."),
        ("check", "show:check", "Check a scenario file and its feeder for problems."),
        ("doc", "show:doc", "Print a reference page that is made from the code."),
        ("docs", "", "Show the documentation in the browser, offline."),
    ),
    "Study": (
        ("sweep", "sweep_command:sweep", "Run a scenario many times over values of its keys."),
        ("compare", "show:compare", "Compare two runs: scenarios, metrics, and one figure of both."),
        ("export", "show:export", "Write a run's tables as CSV, Parquet, MATLAB or Excel files."),
        ("predict", "", "Predict the behaviour of a scenario from theory."),
        ("chaos", "", "Disturb a scenario at random, and shrink the failures."),
        ("experiment", f"{_PAPER}.experiment_command:experiment", "Run an experiment on late, lossy or broken links."),
        ("reproduce", f"{_PAPER}.reproduce.reproduce_command:reproduce", "Reproduce the paper, and write one report."),
    ),
    "Live": (
        ("up", "start_commands:up", "Run the plant and all its agents, in real time."),
        ("plant", "start_commands:plant", "Run the plant of a scenario in this terminal, in real time."),
        ("agent", "live_commands:agent", "Run the agent of an inverter, or of several, in this terminal."),
        ("link", "link:link", "Impair and heal links of a live run."),
        ("event", "live_commands:event", "Open or close a switch of a running plant."),
        ("load", "live_commands:load", "Set a load of a running plant."),
        ("stop", "live_commands:stop", "Make an agent leave: its inverter is switched off."),
        ("down", "live_commands:down", "End a run: its agents leave, its plant ends."),
        ("keys", "keys_command:app", "Make, issue and revoke the certificates of a site."),
    ),
    "Inspect": (
        ("status", "live_commands:status", "Show a run once: time, pace, agents, latest events."),
        ("watch", "live_commands:watch", "Watch a run as a live table, until Ctrl-C."),
        ("view", "", "Show a run in the browser: feeder, links, strips and agents."),
        ("why", "", "Explain a decision of an agent, term by term."),
        ("replay", "", "Replay a recorded run, unchanged or with a change."),
        ("trace", "", "Write a run's messages as a Perfetto trace."),
    ),
    "Feeder": (("feeder", "feeder_commands:app", "Import, check and solve feeders."),),
}
"""Commands in the order of the help: name, function (none where a room brings it), first sentence of its docstring."""

SUMMARIES = {name: summary for group in _OWN.values() for name, _, summary in group}

COMMANDS: Registry[Callable[..., None]] = Registry(
    "command",
    "commands",
    lambda it: "" if callable(it) else "it is no function",
    own={
        name: reference if "." in reference else f"gridpeers.cli.commands.{reference}"
        for group in _OWN.values()
        for name, reference, _ in group
        if reference
    },
)
"""Functions of all commands, or a `typer.Typer`, by name."""


class LazyCommands(Commands):
    """All commands by name; the help shows the summaries of our own without importing their modules."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names: gridpeers' own first."""
        there = COMMANDS.names
        return [name for name in dict.fromkeys((*SUMMARIES, *there)) if name in there]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Import a command, one that says so when it is called if it cannot be; None if there is none of this name."""
        if cmd_name not in self.commands and (cmd_name in COMMANDS.own or cmd_name in COMMANDS.names):
            try:
                found = COMMANDS.resolve(cmd_name)
            except PluginError as error:
                found = _broken(str(error))
            self.commands[cmd_name] = _as_typer_has_it(cmd_name, found)
        return self.commands.get(cmd_name)

    def groups(self, ctx: Any) -> dict[str, list[str]]:
        """Return the names in the groups of the help; commands that others bring come last."""
        there = self.list_commands(ctx)
        own = {title: [name for name, *_ in of if name in there] for title, of in _OWN.items()}
        return own | {"Plug-ins": [name for name in there if name not in SUMMARIES]}

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the names and what each command does, in groups."""
        for title, names in self.groups(ctx).items():
            if names:
                texts = (SUMMARIES.get(name) or self.get_command(ctx, name).get_short_help_str(60) for name in names)
                with formatter.section(title):
                    formatter.write_dl(list(zip(names, texts, strict=True)))


def _broken(why: str) -> Callable[..., None]:
    def command() -> None:
        """Cannot be imported."""
        fail(why)

    return command


def _as_typer_has_it(name: str, found: Any) -> Any:
    holder = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
    holder.callback()(lambda: None)  # so that a single command keeps its name
    if isinstance(found, typer.Typer):
        holder.add_typer(found, name=name)
    else:
        holder.command(name)(found)
    group: Any = typer.main.get_command(holder)
    return group.commands[name]


app = typer.Typer(
    cls=LazyCommands,
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


def _version(asked: bool) -> None:
    if asked:
        from gridpeers.scenarios.versions import commit, version_of  # it loads the package email: few commands need it

        typer.echo(f"gridpeers {version_of('gridpeers')}" + (f" ({built_from})" if (built_from := commit()) else ""))
        raise typer.Exit


@app.callback()
def gridpeers(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version, and end.")
    ] = False,
) -> None:
    """Peer-to-peer consensus control of microgrid inverters: a plant process and one process per inverter, over Zenoh.

    Exit codes: 0 success; 1 a claim, a law, a chaos run or a required check failed, or a replay differs; 2 wrong
    options, a bad file, or no run found; 3 a run broke, or a process did not answer; 130 Ctrl-C; 143 SIGTERM.

    Example:  gridpeers run islanding
    """
