"""Before a live run, `plant` and `up` check its options, and make its configurations, its folder and its record."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

import msgspec
from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.plant.equipment import Tables
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.live.feeder_map import feeder_map
from gridpeers.scenarios.live.run_address import (
    LONGEST_TIME,
    Access,
    RunAddress,
    UsageError,
    check_duration,
    check_wait,
)
from gridpeers.scenarios.live.run_client import RunClient
from gridpeers.scenarios.record.record_info import LIVE, RecordInfo
from gridpeers.scenarios.results.run_files import FolderError, new_folder, refusal, set_broken, write_whole
from gridpeers.scenarios.run_request import SPEEDS
from gridpeers.scenarios.schema.configs import as_in, configs
from gridpeers.scenarios.schema.participants import netem_of, setup_of
from gridpeers.scenarios.schema.scenario_model import NEEDS_KEYS, ScenarioModel
from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.scenarios.versions import versions
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.journal import RecordLevel
from gridpeers.wire.trust.credentials import Credentials
from gridpeers.wire.wording import suggestion

LOOKING = 1.5


def check_alone(
    run: str, beyond: tuple[str, ...], credentials: Credentials | None = None, access: Access | None = None
) -> None:
    """Raise UsageError if the endpoints `beyond`, to which the plant will connect, already have a plant of this run."""
    if not beyond:
        return
    there = RunAddress(run=run, connect=beyond, credentials=credentials, access=access or Access())
    with RunClient(there) as client:
        if client.until(lambda: client.plant, LOOKING):
            raise UsageError(
                f"--run: a plant of run {run} already exists, at {', '.join(beyond)}; end it "
                f"({command_line('down', *there.words)}), or give this run another name"
            )


def chosen_case(scenario: ScenarioModel, case: str) -> str:
    """Return the given case, or the last one; UsageError if there is no such case."""
    if case and case not in scenario.cases:
        raise UsageError(f'--case: no case "{case}"; {suggestion(case, scenario.cases, "cases")}')
    return case or list(scenario.cases)[-1]


def configure(
    scenario: ScenarioModel,
    feeder: Tables,
    listen: str,
    beyond: tuple[str, ...] = (),
    *,
    run: str,
    case: str = "",
    speed: float = 1.0,
    wait: float = 30.0,
    duration: float | None = None,
    recorded: bool = False,
    secured: bool = False,
    strict: bool = False,
) -> tuple[PlantConfig, tuple[AgentConfig, ...]]:
    """Return the configurations of the plant and of all agents of a checked scenario, spare ones last.

    The plant connects to the endpoints `beyond` itself, e.g. a Zenoh router. It waits for its agents for `wait` (s);
    the run ends after `duration` (s of run time). `speed` is run time (s) per s; a `strict` run breaks when the
    plant cannot keep pace. UsageError if an option cannot be used.
    """
    least, greatest = SPEEDS
    if not least <= speed <= greatest:
        raise UsageError(f"--speed: must be from {least:g} to {greatest:g} (1 is real time), got {speed:g}")
    check_wait(wait)
    check_duration(duration)
    if scenario.plant.simulator != "gridpeers":
        raise UsageError(
            f'plant.simulator = "{scenario.plant.simulator}": cannot run in real time; use {command_line("run")}, '
            'or "gridpeers"'
        )
    if scenario.security == "mtls" and not secured:
        raise UsageError(NEEDS_KEYS)
    case = chosen_case(scenario, case)
    plant, agents = configs(scenario, feeder, case, listen, real_nodes=True)
    # links are emulated even without a fault: gridpeers link may set one during the run
    links = plant.links or setup_of(netem_of(scenario, case), scenario, feeder, real_nodes=True).to_tree()
    level: RecordLevel = scenario.record if recorded else "physics"
    live = {"run": run, "clock": "realtime", "speed": speed, "links": links, "record": level}
    first = [replace(agent, **live, deadline=0.0) for agent in agents if agent.name in plant.agents]
    nameplate = ("name", "kind", "microgrid", "P_rated", "V_nom", "m_p", "m_q")
    spares = (replace(first[0], **{name: getattr(row, name) for name in nameplate}) for row in feeder.spares)
    everyone = (*first, *spares)
    end = None if duration is None else max(1, round(duration / plant.T_c)) * plant.T_c
    diagram = replace(feeder_map(as_in(scenario, feeder)), scenario=scenario.name, case=case)
    plant = replace(
        plant,
        **live,
        settings=replace(plant.settings, spares=tuple(row.name for row in feeder.spares)),
        schedule=(),  # in a live run, people let agents leave and join
        end=end,
        connect=beyond,
        wait_for_agents=min(wait, LONGEST_TIME),  # JSON has no infinity
        strict=strict,
        feeder_map=msgspec.to_builtins(diagram),
        agent_configs={agent.name: msgspec.json.decode(msgspec.json.encode(agent)) for agent in everyone},
    )
    return plant, everyone


class Folders(NamedTuple):
    logs: Path
    """A temporary folder without `--out`; the caller removes it unless it has named a log there."""
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
    begun = "The start of a live run. events.csv and run.mcap have its length and the commands of people."
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
