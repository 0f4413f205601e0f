"""Runs with a record, by any driver, for tests."""

from __future__ import annotations

from math import inf
from pathlib import Path

import pytest
from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.drivers.process_driver import run_processes
from gridpeers.scenarios.record.record_info import RecordInfo
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.results.record import Recorder
from gridpeers.scenarios.schema import load_scenario
from gridpeers.scenarios.schema.configs import configs
from gridpeers.scenarios.schema.participants import inverters_of
from gridpeers.wire.journal import RecordLevel


def toy_info(plant: PlantConfig, agents: tuple[AgentConfig, ...], *, level: RecordLevel = "all") -> RecordInfo:
    """What a record says of a run of the toy plant in one process."""
    return RecordInfo(
        level=level, scenario="toy", case="case", toml="", seed=1, driver="inprocess", versions={},
        inverters=tuple(agent.name for agent in agents), plant=plant, agents=agents,
    )  # fmt: skip


def recorded_run(
    scenario: str | Path,
    case: str,
    folder: Path,
    *,
    messages: bool = False,
    processes: bool = False,
    level: RecordLevel = "all",
) -> RunRecord:
    """Run a case in one process, with or without messages, or in many; return its record."""
    model, feeder = load_scenario(scenario)
    plant, agents = configs(model, feeder, case, "tcp/127.0.0.1:0" if processes else "")
    plant, agents = replace(plant, record=level), tuple(replace(agent, record=level) for agent in agents)
    info = RecordInfo(
        level=level,
        scenario=model.name,
        case=case,
        toml="",
        seed=model.seed,
        driver="processes" if processes else "inprocess",
        versions={"gridpeers": "0.1.0"},
        inverters=tuple(row.name for row in inverters_of(model, feeder)),
        plant=plant,
        agents=agents,
    )
    with Recorder(folder, record=info) as recorder:
        if processes:
            logs = folder / "log"
            outcome = run_processes(plant, agents, logs, recorder, on_other=recorder, shared=3)
        else:
            outcome = run_inprocess(plant, agents, recorder, on_other=recorder, messages=messages)
        assert outcome.broke == ""
        recorder.finish(model.time.end_s, model.time.record_s)
    return RunRecord.open(folder)


def recorded_in_chunks(text: str, folder: Path, case: str = "case", *, chunk: int = 5_000) -> RunRecord:
    """Run a case of a scenario file with this text in one process; a chunk of its record has about so many bytes."""
    file = folder / "scenario.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("gridpeers.scenarios.record.record_writer.CHUNK", chunk)
        patch.setattr("gridpeers.scenarios.record.record_writer.PERIOD", inf)  # on a busy machine too
        return recorded_run(file, case, folder / case)
