"""The same bodies with one process and with many: if both pass, the network code decides nothing."""

from __future__ import annotations

import hashlib
import random
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace
from threadpoolctl import threadpool_limits

from gridpeers.agents.agent_config import AgentConfig, Control, GraphRule
from gridpeers.plant.feeder import Plant
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantConfig, PlantSettings, SwitchEvent
from gridpeers.plant.tables import read_feeder
from gridpeers.scenarios.drivers.free_endpoint import local_endpoint
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.drivers.process_driver import run_processes
from gridpeers.scenarios.run_request import Outcome
from gridpeers.scenarios.schema import Event, load_scenario
from gridpeers.scenarios.schema.configs import configs
from gridpeers.scenarios.schema.scenario_model import LoadChange
from tests.toy.toy_configs import Schedule, toy_configs
from tests.toy.toy_plant import ToyPlant
from tests.toy.toy_runs import ProcessRun, Rows, first_difference


@dataclass
class Ran:
    """Result of a driver."""

    outcome: Outcome
    rows: Rows = field(default_factory=list)


Driver = Callable[[PlantConfig, tuple[AgentConfig, ...]], Ran]


def in_one_process(plant: PlantConfig, agents: tuple[AgentConfig, ...]) -> Ran:
    """Run the toy, or the feeder if the configuration names one, by `gridpeers.scenarios.drivers.inprocess`."""
    rows: Rows = []
    toy = ToyPlant(plant) if plant.settings.feeder.startswith("toy") else None
    return Ran(run_inprocess(plant, agents, lambda telemetry: rows.extend(telemetry.rows), plant=toy), rows)


@pytest.fixture(params=["inprocess", "processes"])
def driver(request: pytest.FixtureRequest, tmp_path: Path) -> Driver:
    def with_processes(plant: PlantConfig, agents: tuple[AgentConfig, ...]) -> Ran:
        run = ProcessRun(plant, agents, tmp_path)
        return Ran(run(), run.rows)

    return in_one_process if request.param == "inprocess" else with_processes


def test_a_run_ends_in_order(driver: Driver) -> None:
    """The last tick is reported, nothing is dropped, and islanding is an event."""
    ran = driver(*toy_configs(4))

    assert ran.outcome.broke == ""
    assert ran.outcome.reproducible
    assert ran.outcome.ticks == 20
    assert ran.outcome.notes == ()
    assert [(event.kind, event.t) for event in ran.outcome.events] == [("switch", 0.1)]
    assert [row[0] for row in ran.rows] == [round(0.02 * k, 9) for k in range(21)]


@pytest.mark.parametrize(("processes", "graph"), [(1, "ring"), (4, "full"), (6, "clustered")])
def test_agents_find_the_same_neighbours_in_any_processes(processes: int, graph: GraphRule, tmp_path: Path) -> None:
    """The distribution of agents over processes decides nothing; discovery finds all neighbours."""
    plant, agents = toy_configs(6, Control(secondary="all", graph=graph))
    run = ProcessRun(plant, agents, tmp_path)

    outcome = run(shared=processes)

    assert (outcome.broke, outcome.notes) == ("", ())
    assert len(run.pids) == 1 + processes
    assert first_difference(in_one_process(plant, agents).rows, run.rows) == ""


def test_a_plant_without_solution_breaks_the_run(driver: Driver) -> None:
    """The outcome is the plant's message; the rows until then are kept."""
    ran = driver(*toy_configs(2, P_set0=1.5))

    assert ran.outcome.broke == "no solution at t = 0.1 s: P_set0 is 1.5 pu"
    assert not ran.outcome.reproducible
    assert ran.rows[-1][0] == 0.1


def test_neither_start_order_nor_hash_seed_matter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Processes started in another order, the plant in between, with another PYTHONHASHSEED, give the same rows."""
    plant, agents = toy_configs(9)
    order = ["plant", *(agent.name for agent in agents)]
    random.Random(1).shuffle(order)
    monkeypatch.setenv("PYTHONHASHSEED", "1")
    run = ProcessRun(plant, agents, tmp_path)
    outcome = run(start_order=order)

    assert outcome.broke == "", f"order {order}"
    assert first_difference(in_one_process(plant, agents).rows, run.rows) == "", f"order {order}"


def test_leaving_and_returning_give_the_same_rows(driver: Driver) -> None:
    """The start-up time of a returning agent or of a joining spare changes no row."""
    schedule: Schedule = ((0.2, "inv2", "leave"), (0.3, "inv2", "join"), (0.3, "inv4", "join"))
    plant, agents = toy_configs(4, schedule=schedule, spares=("inv4",))
    expected, ran = in_one_process(plant, agents), driver(plant, agents)

    assert ran.outcome.broke == ""
    assert ran.outcome.reproducible
    assert ran.outcome.notes == ()
    assert ran.outcome.events == expected.outcome.events
    assert first_difference(expected.rows, ran.rows) == ""


def test_plug_n_play_gives_the_same_history_with_processes(tmp_path: Path) -> None:
    """Case IV of the paper's experiment, moved to the first tenths of a second: the same rows to the last bit."""
    scenario, feeder = load_scenario("plug-n-play")
    plant, agents = configs(scenario, feeder, "IV")
    sooner = tuple(msgspec.structs.replace(action, t=action.t / 10) for action in plant.schedule)
    events = (SwitchEvent(t=0.1, switch="13-152", action="open"),)
    plant = msgspec.structs.replace(
        plant, end=0.4, schedule=sooner, settings=msgspec.structs.replace(plant.settings, events=events)
    )
    expected = in_one_process(plant, agents)
    run = ProcessRun(plant, agents, tmp_path)
    outcome = run(plant_command=("-m", "gridpeers.plant"))

    assert outcome.broke == ""
    assert outcome.reproducible
    assert first_difference(expected.rows, run.rows) == ""
    assert outcome.events == expected.outcome.events


def test_both_drivers_record_the_same_rows(tmp_path: Path) -> None:
    """Islands seen by frequency, available power, another load: the same history to the last bit."""
    scenario, feeder = load_scenario("unheard-switches")
    events: tuple[Event, ...] = tuple(replace(event, t_s=0.1 + 0.1 * i) for i, event in enumerate(scenario.events[:2]))
    events += (Event(label="cloud", t_s=0.32, P_max_kW={"inv2": 200.0}),)
    events += (Event(label="load", t_s=0.354, load={"48": LoadChange(factor=1.5), "65": LoadChange(P_kW=0.0)}),)
    short = replace(scenario, events=events, time=replace(scenario.time, end_s=0.6))
    plant, agents = configs(short, feeder, "frequency", local_endpoint(0))
    rows: dict[str, Rows] = {"alone": [], "together": []}
    alone = run_inprocess(plant, agents, lambda telemetry: rows["alone"].extend(telemetry.rows))
    together = run_processes(plant, agents, tmp_path, lambda telemetry: rows["together"].extend(telemetry.rows))

    assert not alone.broke
    assert not together.broke
    assert together.events == alone.events
    assert [event.subject for event in alone.events if event.kind == "load"] == ["48", "65"]
    assert first_difference(rows["alone"], rows["together"]) == ""


def digest(threads: int) -> str:
    """Hash of a short run that is islanded on the way."""
    with threadpool_limits(threads):
        events = (SwitchEvent(t=0.1, switch="13-152", action="open"),)
        plant = Plant(Network(read_feeder("microgrid123", "main")), PlantSettings(events=events), 0.02, 0.02)
        for _ in range(20):
            plant.advance()
    return hashlib.sha256(repr(plant.take_rows()).encode()).hexdigest()


def test_the_bytes_do_not_depend_on_the_number_of_threads() -> None:
    """A run on a machine with more cores gives the same rows to the last bit."""
    assert digest(3) == digest(1)
