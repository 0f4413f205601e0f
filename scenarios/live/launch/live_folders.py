"""Folders of a live run: a run folder on request, else a temporary one for its logs."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.live.launch.ended_scenario import ended_scenario
from gridpeers.scenarios.record.record_info import LIVE, RecordInfo
from gridpeers.scenarios.results.run_files import (
    FolderError,
    new_folder,
    refusal,
    set_broken,
    set_complete,
    write_whole,
)
from gridpeers.scenarios.schema import ScenarioModel
from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.scenarios.versions import versions


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

    Raises
    ------
    FolderError
        If the folder has something in it, is a file, or cannot be made or written.
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
