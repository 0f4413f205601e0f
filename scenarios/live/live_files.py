"""Files of a live run: its folder, with the scenario as long as the run was, and its link commands as a scenario."""

from __future__ import annotations

import os
import platform
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

from msgspec.structs import replace

from gridpeers.agents.agent_config import MAX_AGE, AgentConfig
from gridpeers.netem.fault_schedule import Change, replayed
from gridpeers.netem.schema.netem import Netem
from gridpeers.plant.equipment import Feeder
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.emulation.link_data import LinkCommand
from gridpeers.scenarios.live.run_address import UsageError
from gridpeers.scenarios.record.record_info import LIVE, RecordInfo
from gridpeers.scenarios.results.run_files import FolderError, new_folder, refusal, set_broken, shown, write_whole
from gridpeers.scenarios.schema.participants import LISTS, inverters_of, netem_of
from gridpeers.scenarios.schema.scenario_model import LONGEST_RUN, ScenarioModel
from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.scenarios.versions import versions
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.messages import LinkRequest
from gridpeers.wire.timing import rounded_up


def ended_scenario(scenario: ScenarioModel, ended: float) -> tuple[ScenarioModel, tuple[str, ...]]:
    """Return the scenario of a live run of one case with its true end (s), and sentences for the head of its file.

    Events and faults that would come at or after the end are left out, as no scenario may have them.
    """
    end = min(rounded_up(ended, scenario.time.T_c_s), LONGEST_RUN)
    reached = tuple(event for event in scenario.events if event.t_s < end)
    labels = {event.label for event in reached}

    def begun_by_then(netem: Netem) -> Netem:
        entries = {one.name: tuple(it for it in getattr(netem, one.name) if it.from_s < end) for one in LISTS}
        return replace(netem, **entries)

    ((name, case),) = scenario.cases.items()
    P_max_kW = {label: powers for label, powers in case.P_max_kW.items() if label in labels}
    now = replace(case, P_max_kW=P_max_kW, netem=begun_by_then(case.netem))
    changed = replace(
        scenario,
        time=replace(scenario.time, end_s=end),
        events=reached,
        netem=begun_by_then(scenario.netem),
        cases={name: now},
    )
    remarks = [f"A live run: what people did in it is in events.csv and run.mcap. It lasted {ended:.2f} s."]
    if end != scenario.time.end_s:
        remarks.append(f"So end_s is {end:g}, where the scenario it began with had {scenario.time.end_s:g}.")
    if missed := [f'"{event.label}" at {event.t_s:g} s' for event in scenario.events[len(reached) :]]:
        remarks.append(f"Events that it did not reach are left out: {', '.join(missed)}.")
    if (changed.netem, now.netem) != (scenario.netem, case.netem):
        remarks.append("Faults of links and nodes that it did not reach are left out.")
    return changed, tuple(remarks)


class Folders(NamedTuple):
    logs: Path
    record: Path | None = None
    """For the files of the record, a folder in the run folder; None if nothing is recorded."""
    whole: Path | None = None


@contextmanager
def folders(out: Path | None, scenario: ScenarioModel) -> Iterator[Folders]:
    """Make the folders of a run, as `--out` says; FolderError if the folder is not new, or cannot be written."""
    if out is None:
        with tempfile.TemporaryDirectory(prefix="gridpeers-") as logs:
            yield Folders(Path(logs))
        return
    whole = new_folder(out, scenario.name, datetime.now().astimezone())
    begun = "A live run begins with it; how long it lasted, and what people did, is in events.csv and run.mcap."
    try:
        write_scenario(whole, scenario, [begun])
        (whole / "log").mkdir()
    except OSError as error:
        why = refusal(whole, error)
        set_broken(whole, why)
        raise FolderError(why) from None
    (case,) = scenario.cases
    yield Folders(whole / "log", whole / case, whole)


def write_scenario(folder: Path, scenario: ScenarioModel, remarks: Iterable[str]) -> None:
    write_whole(folder / "scenario.toml", to_toml(scenario, {"driver": LIVE} | versions(), remarks))


def live_record(
    scenario: ScenarioModel, plant: PlantConfig, agents: tuple[AgentConfig, ...], inverters: tuple[str, ...]
) -> RecordInfo:
    (case,) = scenario.cases
    return RecordInfo(
        level=plant.record,
        scenario=scenario.name,
        case=case,
        toml=to_toml(scenario, {"driver": LIVE} | versions()),
        seed=scenario.seed,
        driver=LIVE,
        versions=versions(),
        inverters=inverters,
        plant=replace(plant, agent_configs={}),
        agents=agents,
        started=datetime.now().astimezone().isoformat(timespec="milliseconds"),
    )


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
        """Number of commands with which the file is next written: to write it takes as long as there are commands."""

    @property
    def changes(self) -> tuple[Change, ...]:
        return tuple(change for _, change in sorted(self._commands.items()))

    def __call__(self, message: LinkRequest) -> None:
        self._commands[message.seq] = LinkCommand.of_tree(message.link_command).at(message.t)
        count = len(self._commands)
        if count >= self._due:
            self._due = count + max(1, count // 10)
            self._write(message.t)

    def close(self, t: float) -> list[str]:
        files = self._write(t)
        return [f"the links as they were: {command_line('run', shown(files[0]))}"] if files else []

    def _write(self, t: float) -> list[Path]:
        files = list(filter(None, [self._replay, self._replay_if_changed if self._commands else None]))
        for file in files:
            write_whole(file, replay_toml(self._scenario, self._feeder, self.changes, t))
        return files


def replay_toml(scenario: ScenarioModel, feeder: Feeder, changes: Sequence[Change], t: float) -> str:
    """Return the scenario whose links change by schedule as they did by command until t (s).

    It leaves out agents that the scenario lacks. An age that the live run had by default is written out, as there is no
    such default in simulated time.
    """
    ((name, case),) = scenario.cases.items()
    microgrids = {row.name: row.microgrid for row in inverters_of(scenario, feeder)}
    ages = case.degraded_communication
    ages = replace(ages, max_age=ages.max_age or MAX_AGE)
    T_c = scenario.time.T_c_s
    needed = max([t, *(change.from_s + T_c for change in changes)])
    end = max(scenario.time.end_s, rounded_up(needed, T_c))
    netem = netem_of(scenario, name)
    by_island = tuple(part for part in netem.partitions if part.by == "island")
    replay = replace(
        scenario,
        name="",
        paper="",
        time=replace(scenario.time, end_s=end),
        netem=replace(netem, links=(), partitions=by_island),
        cases={name: replace(case, netem=Netem(), degraded_communication=ages)},
    )
    as_run = {"driver": LIVE, "python": platform.python_version()}
    links_alone = (
        "A live run's links, which people changed: agents, switches and loads that they changed are not in it "
        "(events.csv)."
    )
    return to_toml(replay, as_run, [links_alone], links=replayed(netem, changes, microgrids))


def check_new(file: Path | None) -> None:
    if file is None:
        return
    folder = file.absolute().parent
    if file.exists():
        raise UsageError(f"--record {file}: already exists; move it, or give another name")
    if not folder.is_dir():
        raise UsageError(f"--record {file}: there is no folder {file.parent}; make it first")
    if not os.access(folder, os.W_OK):
        raise UsageError(f"--record {file}: cannot be written: {file.parent} is not yours; give another name")
