"""Commands to the emulated links of a live run, and the scenario that replays them."""

from __future__ import annotations

import contextlib
import platform
from collections.abc import Sequence
from pathlib import Path

import msgspec

from agents.agent_config import MAX_AGE
from netem.schema.change import Change, replayed
from netem.schema.netem import Netem
from plant.equipment import Feeder
from scenarios.emulation.link_command import LinkCommand
from scenarios.live.client.run_address import UsageError
from scenarios.record.record_info import LIVE
from scenarios.results.run_files import shown, write_whole
from scenarios.schema import ScenarioModel
from scenarios.schema.netem_tables import netem_of
from scenarios.schema.participants import inverters_of
from scenarios.schema.scenario_writing import to_toml
from wire.driver.command_line import command_line
from wire.messages import LinkRequest
from wire.timing.clock import rounded_up

LINKS_ALONE = (
    "A live run's links, which people changed: agents, switches and loads that they changed are not in it (events.csv)."
)
"""For the head of the file."""


class LinkLog:
    """Keep the link commands of a run, and write the scenario that replays them.

    Parameters
    ----------
    scenario : ScenarioModel
        As run, with its one case.
    feeder : Feeder
        Its feeder.
    replay : Path or None
        File of the scenario that replays the run's links: written in any case, and anew with every link command.
    replay_if_changed : Path or None
        The same, but only written once there is a link command.
    """

    def __init__(
        self, *, scenario: ScenarioModel, feeder: Feeder, replay: Path | None, replay_if_changed: Path | None
    ) -> None:
        self._scenario, self._feeder = scenario, feeder
        self._replay, self._replay_if_changed = replay, replay_if_changed
        self._commands: dict[int, Change] = {}

    @property
    def changes(self) -> tuple[Change, ...]:
        """Changes by commands, in their order."""
        return tuple(change for _, change in sorted(self._commands.items()))

    def __call__(self, message: LinkRequest) -> None:
        """Take a command to links."""
        self._commands[message.seq] = LinkCommand.of_tree(message.link_command).at(message.t)
        self._write_replay(message.t)

    def close(self, t: float) -> list[str]:
        """Write the scenario at the end of a run that reached t (s); return lines for the terminal."""
        self._write_replay(t)
        file = self._replay or (self._replay_if_changed if self._commands else None)
        return [] if file is None else [f"the links as they were: {command_line('run', shown(file))}"]

    def _write_replay(self, t: float) -> None:
        files = [self._replay, self._replay_if_changed if self._commands else None]
        text = to_toml(
            replay_of(self._scenario, self._feeder, self.changes, t),
            {"driver": LIVE, "python": platform.python_version()},
            [LINKS_ALONE],
        )
        for file in files:
            if file is not None:
                write_whole(file, text)


def replay_of(scenario: ScenarioModel, feeder: Feeder, changes: Sequence[Change], t: float) -> ScenarioModel:
    """Return the scenario whose links change by schedule as they did by command; it leaves out agents that it lacks.

    An age that the live run had by default is written out, as there is no such default in simulated time.

    Parameters
    ----------
    scenario : ScenarioModel
        As run, with its one case.
    feeder : Feeder
        Its feeder.
    changes : Sequence[Change]
        The link commands.
    t : float
        How far the run came (s): the scenario ends there, if it does not end later anyway.
    """
    ((name, case),) = scenario.cases.items()
    microgrids = {row.name: row.microgrid for row in inverters_of(scenario, feeder)}
    ages = case.degraded_communication
    ages = msgspec.structs.replace(ages, max_age=ages.max_age or MAX_AGE)
    T_c = scenario.time.T_c_s
    needed = max([t, *(change.from_s + T_c for change in changes)])
    end = max(scenario.time.end_s, rounded_up(needed, T_c))
    return msgspec.structs.replace(
        scenario,
        name="",
        paper="",
        time=msgspec.structs.replace(scenario.time, end_s=end),
        netem=replayed(netem_of(scenario, name), changes, microgrids),
        cases={name: msgspec.structs.replace(case, netem=Netem(), degraded_communication=ages)},
    )


def check_new(option: str, file: Path | None) -> None:
    """Raise UsageError if a file is there already, or cannot be made where it is to be."""
    if file is None:
        return
    try:
        if file.exists():
            raise UsageError(f"{option} {file}: is there already; move it, or give another name")
        if not file.absolute().parent.is_dir():
            raise UsageError(f"{option} {file}: there is no folder {file.parent}; make it first")
        with contextlib.suppress(FileExistsError):  # what another run was killed at
            trial = file.with_name(f"{file.name}.partial")
            trial.touch(exist_ok=False)
            trial.unlink()
    except OSError as error:
        raise UsageError(f"{option} {file}: cannot be written: {error.strerror}; give another name") from None
