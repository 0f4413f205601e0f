"""GridLAB-D as the plant of a run: the paper's result, our plant's numbers, and the same bytes from either driver."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest
from msgspec.structs import replace

import gridpeers as gp
from gridpeers.papers.singhal2022.tables import TABLE
from gridpeers.plant.build import start_plant
from gridpeers.plant.feeder import Plant
from gridpeers.plant.network import Network
from gridpeers.runs.result import Result
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.schema.configs import configs

pytestmark = pytest.mark.skipif(find_spec("gridlabd") is None, reason="the extra gridlabd is not installed")

UNIT = {"f": 1.0, "P": 350e3, "Q": 350e3, "V": 2401.8, "P_set": 350e3, "V_set": 2401.8}
"""What is 1 Hz, or 1 pu at the smallest inverter, by quantity."""


@pytest.fixture(scope="module")
def islanding() -> gp.Scenario:
    """The paper's experiment up to its second event, the first one early."""
    event = {"label": "event1", "t_s": 0.1, "open": ["13-152"]}
    changes = {"plant.simulator": "gridlabd", "event": [event], "time.end_s": 1.1, "processes.deadline_s": 100.0}
    return gp.load("islanding").replace(changes | {"paper": ""})


@pytest.fixture(scope="module")
def case_IV(islanding: gp.Scenario) -> Result:
    return islanding.run("IV")


@pytest.fixture(scope="module")
def three_islands() -> gp.Scenario:
    """A grid that falls apart, with other loads and another inverter than the tables have, and a cloud."""
    return gp.Scenario(
        name="apart",
        time={"end_s": 0.2},
        processes={"deadline_s": 100.0},
        plant={
            "simulator": "gridlabd",
            "load_factor": 0.9,
            "inverter": {"inv3": {"P_rated_kW": 300.0, "m_q_pu": 0.04}},
        },
        event=[
            {"label": "islanding", "t_s": 0.04, "open": ["13-152"]},
            {"label": "apart", "t_s": 0.1, "open": ["sw1_2", "sw2_3"], "P_max_kW": {"inv2": 150.0}},
        ],
        case={"IV": {"secondary": "all", "graph": "full"}},
    )


def test_full_coordination_restores_frequency_and_sharing_on_gridlabd(case_IV: Result) -> None:
    """After the event abs(f - 60 Hz) and MPSI are Table I's 0.00, within the tolerances by which ours are judged."""
    for quantity in ("f_error_Hz", "MPSI"):
        assert 0.0 <= case_IV.metrics.loc["event1", quantity] <= TABLE["I", quantity].value, quantity


def test_gridlabd_gives_the_numbers_of_our_plant(islanding: gp.Scenario, case_IV: Result) -> None:
    """As both plants are shipped, every row of case IV agrees to 1e-8 Hz and pu."""
    assert largest_difference(islanding, case_IV) < 1e-8


def test_switches_of_one_event_follow_each_other_step_by_step(three_islands: gp.Scenario) -> None:
    """GridLAB-D loses an island if two switches open in one step: the second opens a step later, and a warning says so.

    Islands and available power are those of our plant, to which the same happens.
    """
    ran = three_islands.run("IV", "processes")

    warnings = ran.events[ran.events.kind == "warning"]
    assert list(warnings.text) == ["GridLAB-D operates one switch a step: sw2_3 (97s-97) follows 2 ms later"]
    islands = ran.events[ran.events.kind == "island"]
    last = dict(zip(islands.subject, islands.text, strict=True))
    assert list(last.values()) == [f"island of inv{i}, inv{i + 1}, inv{i + 2}" for i in (1, 4, 7)]
    assert "inv2 has 150 kW available" in set(ran.events.text)
    assert largest_difference(three_islands, ran, later={"sw2_3": 0.002}) < 1e-8
    assert three_islands.run("IV").sha256 == ran.sha256, "the same bytes by either driver"


def test_set_points_beyond_an_inverters_bounds_are_limited_on_gridlabd(three_islands: gp.Scenario) -> None:
    """GridLAB-D bounds neither P_set of a GFM nor V_set; the plant does, as ours, and ignores what is no number."""
    config, _ = configs(three_islands.spec, three_islands.feeder, "IV")
    plant = start_plant(config)
    try:
        before = plant.measure()["inv3"]
        plant.hold("inv1", 10e6, 5e3)
        plant.hold("inv2", 1e6, 2.4e3)
        plant.hold("inv3", float("nan"), 2.4e3)
        plant.advance()
        held = plant.measure()
        texts = [event.text for event in plant.take_events()]
    finally:
        plant.close()

    V_nom = three_islands.feeder.inverters[0].V_nom
    assert (held["inv1"].P_set, held["inv1"].V_set) == pytest.approx((3 * 600e3, 1.2 * V_nom))
    assert (held["inv2"].P_set, held["inv2"].V_set) == pytest.approx((350e3, 2.4e3))
    assert (held["inv3"].P_set, held["inv3"].V_set) == (before.P_set, before.V_set)
    assert [text.partition(",")[0] for text in texts] == [
        "inv1 gets P_set 10000 kW",
        "inv1 gets V_set 5000 V",
        "inv2 gets P_set 1000 kW",
        "inv3 gets set-points that are not finite numbers; it keeps the present ones",
    ]


def test_an_inverter_without_rest_is_a_warning_on_either_plant(islanding: gp.Scenario) -> None:
    """inv6 hunts on the edge of its dead band from the start; the events of both plants say so."""
    hunting = islanding.replace({"plant.gfl.db_UV_pu": 0.005, "plant.gfl.db_OV_pu": 0.005})
    config, _ = configs(hunting.spec, hunting.feeder, "IV")
    texts = []
    for simulator in ("gridlabd", "gridpeers"):
        plant = start_plant(replace(config, settings=replace(config.settings, simulator=simulator)))
        texts.append([event.text for event in plant.take_events()])
        plant.close()

    assert texts[0] == texts[1]
    assert [text.partition(":")[0] for text in texts[0]] == ["inv6 has no steady state at t = 0"]


def largest_difference(scenario: gp.Scenario, ran: Result, later: dict[str, float] | None = None) -> float:
    """Run our plant through the same, some switches later (s), and return the largest difference (Hz, pu)."""
    config, agents = configs(scenario.spec, scenario.feeder, "IV")
    events = tuple(replace(it, t=it.t + (later or {}).get(it.switch, 0.0)) for it in config.settings.events)
    settings = replace(config.settings, simulator="gridpeers", events=events)
    ours = Plant(Network(scenario.feeder), settings, config.T_c, config.record_step)
    rows: list[tuple[float, ...]] = []
    run_inprocess(config, agents, lambda telemetry: rows.extend(telemetry.rows), plant=ours)
    ours_by_column = np.array(rows)[:, 1:]
    units = [UNIT[quantity] for _, quantity in ran.history.columns]
    return float((np.abs(ours_by_column - ran.history.to_numpy()) / units).max())
