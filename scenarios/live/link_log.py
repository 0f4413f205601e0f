"""Commands to the emulated links of a live run, and the scenario that replays them."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import msgspec

from gridpeers.agents.agent_config import MAX_AGE
from gridpeers.netem.fault_schedule import Change, replayed
from gridpeers.netem.schema.netem import Netem
from gridpeers.plant.equipment import Feeder
from gridpeers.scenarios.emulation.link_command import LinkCommand
from gridpeers.scenarios.live.run_address import UsageError
from gridpeers.scenarios.record.record_info import LIVE
from gridpeers.scenarios.results.run_files import shown, write_whole
from gridpeers.scenarios.schema import ScenarioModel
from gridpeers.scenarios.schema.netem_tables import netem_of
from gridpeers.scenarios.schema.participants import inverters_of
from gridpeers.scenarios.schema.scenario_writing import toml_lines
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.messages import LinkRequest
from gridpeers.wire.timing import rounded_up

LINKS_ALONE = (
    "A live run's links, which people changed: agents, switches and loads that they changed are not in it (events.csv)."
)
"""For the head of the file."""

COMMANDS_PER_NEW_ONE = 10
"""The file is written anew once a new command has come for every ten that it has, so after each of the first twenty: to
write it takes as long as there are commands, of which an hour has hundreds."""


class LinkLog:
    """Keep the link commands of a run of one case, and write the scenario that replays them.

    The file `replay` is written at the end in any case, and now and then before; `replay_if_changed` only once there is
    a link command.
    """

    def __init__(
        self, *, scenario: ScenarioModel, feeder: Feeder, replay: Path | None, replay_if_changed: Path | None
    ) -> None:
        self._scenario, self._feeder = scenario, feeder
        self._replay, self._replay_if_changed = replay, replay_if_changed
        self._commands: dict[int, Change] = {}
        self._due = 1
        """Number of commands with which the file is next written."""
        self._closed = False

    @contextmanager
    def claimed(self) -> Iterator[None]:
        """Make the file of `--record` for a run, so that no other takes it; remove it again if the run does not begin.

        It is a scenario from the beginning, for a run that is killed. UsageError if it exists, or cannot be made.
        """
        file, begun = self._replay, False
        if file is None:
            yield
            return
        try:
            with _writable(file):
                file.touch(exist_ok=False)
                begun = True
                self._write_replay(0.0)
            yield
        except BaseException:
            if begun and not (self._closed or self._commands):
                file.unlink(missing_ok=True)
            raise

    @property
    def changes(self) -> tuple[Change, ...]:
        """Changes by commands, in their order."""
        return tuple(change for _, change in sorted(self._commands.items()))

    def __call__(self, message: LinkRequest) -> None:
        """Take a command to links."""
        self._commands[message.seq] = LinkCommand.of_tree(message.link_command).at(message.t)
        count = len(self._commands)
        if count >= self._due:
            self._due = count + max(1, count // COMMANDS_PER_NEW_ONE)
            self._write_replay(message.t)

    def close(self, t: float) -> list[str]:
        """Write the scenario at the end of a run that reached t (s); return lines for the terminal."""
        self._write_replay(t)
        self._closed = True
        file = self._replay or (self._replay_if_changed if self._commands else None)
        return [] if file is None else [f"the links as they were: {command_line('run', shown(file))}"]

    def _write_replay(self, t: float) -> None:
        for file in filter(None, [self._replay, self._replay_if_changed if self._commands else None]):
            write_whole(file, replay_lines(self._scenario, self._feeder, self.changes, t))


def replay_lines(scenario: ScenarioModel, feeder: Feeder, changes: Sequence[Change], t: float) -> Iterator[str]:
    """Yield the lines of the scenario whose links change by schedule as they did by command until t (s).

    It leaves out agents that the scenario lacks. An age that the live run had by default is written out, as there is no
    such default in simulated time.
    """
    ((name, case),) = scenario.cases.items()
    microgrids = {row.name: row.microgrid for row in inverters_of(scenario, feeder)}
    ages = case.degraded_communication
    ages = msgspec.structs.replace(ages, max_age=ages.max_age or MAX_AGE)
    T_c = scenario.time.T_c_s
    needed = max([t, *(change.from_s + T_c for change in changes)])
    end = max(scenario.time.end_s, rounded_up(needed, T_c))
    netem = netem_of(scenario, name)
    by_island = tuple(part for part in netem.partitions if part.by == "island")
    replay = msgspec.structs.replace(
        scenario,
        name="",
        paper="",
        time=msgspec.structs.replace(scenario.time, end_s=end),
        netem=msgspec.structs.replace(netem, links=(), partitions=by_island),
        cases={name: msgspec.structs.replace(case, netem=Netem(), degraded_communication=ages)},
    )
    as_run = {"driver": LIVE, "python": platform.python_version()}
    return toml_lines(replay, as_run, [LINKS_ALONE], links=replayed(netem, changes, microgrids))


def check_new(file: Path | None) -> None:
    """Raise UsageError if the file of `--record` is there already, or cannot be made where it is to be."""
    if file is None:
        return
    with _writable(file):
        if os.path.lexists(file):
            raise FileExistsError
        if not file.absolute().parent.is_dir():
            raise UsageError(f"--record {file}: there is no folder {file.parent}; make it first")
        with suppress(FileExistsError):  # what another run was killed at
            trial = file.with_name(f"{file.name}.partial")
            trial.touch(exist_ok=False)
            trial.unlink()


@contextmanager
def _writable(file: Path) -> Iterator[None]:
    """Raise UsageError for what the system says of a file that is to be made."""
    try:
        yield
    except FileExistsError:
        raise UsageError(f"--record {file}: is there already; move it, or give another name") from None
    except OSError as error:
        raise UsageError(f"--record {file}: cannot be written: {error.strerror}; give another name") from None
