"""Files of a live run: its folder, with the scenario as long as the run was."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.netem.schema.netem import Netem
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.record.record_info import LIVE, RecordInfo
from gridpeers.scenarios.results.run_files import FolderError, new_folder, refusal, set_broken, write_whole
from gridpeers.scenarios.schema.participants import LISTS
from gridpeers.scenarios.schema.scenario_model import LONGEST_RUN, ScenarioModel
from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.scenarios.versions import versions
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
