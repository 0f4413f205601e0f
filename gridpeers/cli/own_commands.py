"""The commands that come with gridpeers, in the order of the help. Their modules are imported when they are called."""

from __future__ import annotations

from typing import NamedTuple


class OwnCommand(NamedTuple):
    """One command, without its module."""

    reference: str
    """`module:name` of a function that typer can read, or of a `typer.Typer` with commands below this one."""
    summary: str
    """Its line in the help of `gridpeers`: the first sentence of its docstring."""


_HERE = "gridpeers.cli.commands"

OWN_COMMANDS = {
    name: OwnCommand(reference if reference.startswith("gridpeers.papers.") else f"{_HERE}.{reference}", summary)
    for name, reference, summary in (
        ("run", "run_command:run", "Run a scenario and show its results, beside published ones."),
        ("list", "show:list_", "List the scenarios that come with gridpeers."),
        ("check", "show:check", "Check a scenario file and its feeder for problems."),
        ("doc", "show:doc", "Print a reference page that is made from the code."),
        ("sweep", "sweep_command:sweep", "Run a scenario many times over values of its keys."),
        ("compare", "results_commands:compare", "Compare two runs: scenarios, metrics, and one figure of both."),
        ("metrics", "results_commands:metrics", "Measure a run from its record, also one that was killed."),
        ("init", "init:init", "Make a project of your own, or an islanding of your feeder."),
        (
            "reproduce",
            "gridpeers.papers.singhal2022.reproduce.reproduce_command:reproduce",
            "Run all experiments of the paper, and write one report.",
        ),
        (
            "experiment",
            "gridpeers.papers.singhal2022.experiment_command:experiment",
            "Run an experiment on late, lossy or broken links.",
        ),
        ("plant", "start_commands:plant", "Run the plant of a scenario in this terminal, in real time."),
        ("agent", "start_commands:agent", "Run the agent of an inverter, or of several, in this terminal."),
        ("up", "start_commands:up", "Run the plant and all its agents at once, in real time."),
        ("down", "live_commands:down", "End a run: its agents leave, its plant ends."),
        ("status", "live_commands:status", "Look once at a run: time, pacing, agents, latest events."),
        ("watch", "live_commands:watch", "Watch a run as a live table; q quits."),
        ("stop", "live_commands:stop", "Have an agent leave properly: its inverter is switched off."),
        ("event", "live_commands:event", "Open or close a switch of a running plant."),
        ("load", "live_commands:load", "Set a load of a running plant."),
        ("link", "link:link", "Hurt and heal links while a run goes on."),
        ("keys", "keys_command:app", "Make, issue and revoke the certificates of a site."),
        ("feeder", "feeder_commands:app", "Import, check, solve, draw and export feeders."),
    )
}
"""All of them, by name."""
