"""The paper's scenarios give the same bytes with one process and with many, whatever happens in them."""

from pathlib import Path

from msgspec.structs import replace

from gridpeers.scenarios.drivers.free_endpoint import local_endpoint
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.drivers.process_driver import run_processes
from gridpeers.scenarios.schema import Event, load_scenario
from gridpeers.scenarios.schema.configs import configs
from gridpeers.scenarios.schema.scenario_model import LoadChange
from tests.toy.toy_runs import Rows, first_difference


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
