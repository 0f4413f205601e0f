"""Files of a live run: its folder, with the scenario that it began with, and what its record says of it."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.record.record_info import LIVE, RecordInfo
from gridpeers.scenarios.results.run_files import FolderError, new_folder, refusal, set_broken, write_whole
from gridpeers.scenarios.schema.scenario_model import ScenarioModel
from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.scenarios.versions import versions


class Folders(NamedTuple):
    logs: Path
    """Without `--out` a temporary folder, which the caller removes unless it has named a log there."""
    record: Path | None = None
    """For the files of the record, a folder in the run folder; None if nothing is recorded."""
    whole: Path | None = None


@contextmanager
def folders(out: Path | None, scenario: ScenarioModel) -> Iterator[Folders]:
    """Make the folders of a run, as `--out` says; FolderError if the folder is not new, or cannot be written."""
    if out is None:
        yield Folders(Path(tempfile.mkdtemp(prefix="gridpeers-")))
        return
    whole = new_folder(out, scenario.name, datetime.now().astimezone())  # noqa: TID251  # folders are named by the day
    begun = "A live run begins with it; how long it lasted, and what people did, is in events.csv and run.mcap."
    try:
        write_whole(whole / "scenario.toml", to_toml(scenario, {"driver": LIVE} | versions(), [begun]))
        (whole / "log").mkdir()
    except OSError as error:
        why = refusal(whole, error)
        set_broken(whole, why)
        raise FolderError(why) from None
    (case,) = scenario.cases
    yield Folders(whole / "log", whole / case, whole)


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
        started=datetime.now().astimezone().isoformat(timespec="milliseconds"),  # noqa: TID251  # the record says when a run began
    )
