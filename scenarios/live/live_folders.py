"""Folders of a live run: a run folder on request, with the scenario as long as the run was, else a temporary one."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.netem.schema.netem import Netem
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.record.record_info import LIVE, RecordInfo
from gridpeers.scenarios.results.run_files import (
    FolderError,
    new_folder,
    refusal,
    set_broken,
    set_complete,
    write_whole,
)
from gridpeers.scenarios.schema.scenario_model import LONGEST_RUN, Case, ScenarioModel
from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.scenarios.versions import versions
from gridpeers.wire.timing import rounded_up


def ended_scenario(scenario: ScenarioModel, ended: float) -> tuple[ScenarioModel, tuple[str, ...]]:
    """Return the scenario of a live run of one case with its true end (s), and sentences for the head of its file.

    What would come at or after the end is left out, as no scenario may have it: events, and faults of links and nodes.
    """
    begun = scenario.time.end_s
    end = min(rounded_up(ended, scenario.time.T_c_s), LONGEST_RUN)
    reached = tuple(event for event in scenario.events if event.t_s < end)
    missed = [f'"{event.label}" at {event.t_s:g} s' for event in scenario.events[len(reached) :]]
    labels = {event.label for event in reached}
    cases = {name: _case(case, end, labels) for name, case in scenario.cases.items()}
    changed = replace(
        scenario,
        time=replace(scenario.time, end_s=end),
        events=reached,
        netem=_netem(scenario.netem, end),
        cases=cases,
    )
    remarks = [f"A live run: what people did in it is in events.csv and run.mcap. It lasted {ended:.2f} s."]
    if end != begun:
        remarks.append(f"So end_s is {end:g}, where the scenario it began with had {begun:g}.")
    if ended > LONGEST_RUN:
        remarks.append(f"No scenario may be longer than {LONGEST_RUN:g} s.")
    if missed:
        remarks.append(f"Events that it did not reach are left out: {', '.join(missed)}.")
    if changed.netem != scenario.netem or any(cases[name].netem != case.netem for name, case in scenario.cases.items()):
        remarks.append("Faults of links and nodes that it did not reach are left out.")
    return changed, tuple(remarks)


def _case(case: Case, end: float, labels: set[str]) -> Case:
    """Return a case without what its scenario's events that are left out, and late faults, need."""
    available = {label: powers for label, powers in case.P_max_kW.items() if label in labels}
    return replace(case, P_max_kW=available, netem=_netem(case.netem, end))


def _netem(netem: Netem, end: float) -> Netem:
    """Return the entries that begin before the end (s)."""
    return replace(
        netem,
        links=tuple(each for each in netem.links if each.from_s < end),
        partitions=tuple(each for each in netem.partitions if each.from_s < end),
        nodes=tuple(each for each in netem.nodes if each.from_s < end),
    )


@dataclass(frozen=True)
class Folders:
    """Folders of a live run."""

    logs: Path
    """For the logs of processes."""
    record: Path | None = None
    """For the files of the record, a folder in the run folder; None if nothing is recorded."""
    whole: Path | None = None
    """The run folder; None if there is none."""

    def complete(self, *missing: str) -> None:
        """Write to status.txt that the folder is complete, and sentences on what is missing beside."""
        if self.whole is not None:
            set_complete(self.whole, filter(None, missing))

    def write_end(self, scenario: ScenarioModel, ended: float) -> None:
        """Write the scenario anew, as long as the run was, which ended at a run time (s)."""
        if self.whole is not None:
            _write_scenario(self.whole, *ended_scenario(scenario, ended))

    def broken(self, why: str) -> None:
        """Write to status.txt why the folder is not complete."""
        if self.whole is not None:
            set_broken(self.whole, why)


AS_BEGUN = "A live run begins with it; how long it lasted, and what people did, is in events.csv and run.mcap."
"""For the head of its scenario, until it has ended."""


@contextmanager
def folders(out: Path | None, scenario: ScenarioModel) -> Iterator[Folders]:
    """Make the folders of a run, as `--out` says.

    FolderError if the folder has something in it, is a file, or cannot be made or written.
    """
    if out is None:
        with tempfile.TemporaryDirectory(prefix="gridpeers-") as logs:
            yield Folders(Path(logs))
        return
    whole = new_folder(out, scenario.name, datetime.now().astimezone())
    try:
        _write_scenario(whole, scenario, [AS_BEGUN])
        (whole / "log").mkdir()
    except OSError as error:
        why = refusal(whole, error)
        set_broken(whole, why)
        raise FolderError(why) from None
    (case,) = scenario.cases
    yield Folders(whole / "log", whole / case, whole)


def _write_scenario(folder: Path, scenario: ScenarioModel, remarks: Iterable[str]) -> None:
    write_whole(folder / "scenario.toml", to_toml(scenario, {"driver": LIVE} | versions(), remarks))


def live_record(
    scenario: ScenarioModel, plant: PlantConfig, agents: tuple[AgentConfig, ...], inverters: tuple[str, ...]
) -> RecordInfo:
    """Return what the record of a live run says about it; the scenario has the one case that runs."""
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
