"""Graphs of the islanding scenario that theory predicts, and runs on the real plant with delays in ticks."""

from __future__ import annotations

from dataclasses import dataclass

import msgspec
import numpy as np

from gridpeers.agents.agent import Agent
from gridpeers.lab.predict.inverter_group import InverterGroup, inverter_group_of
from gridpeers.plant.build import build_plant
from gridpeers.plant.equipment import F_NOM, Tables
from gridpeers.plant.plant_stepper import measurement_of
from gridpeers.scenarios.results.history import Floats
from gridpeers.scenarios.results.metrics import F_BAND, MPSI_BAND, sharing_index
from gridpeers.scenarios.schema import ScenarioModel, load_scenario
from gridpeers.scenarios.schema.configs import configs
from gridpeers.wire.messages import State

N = tuple(f"inv{i}" for i in range(1, 10))
RING = tuple((N[i], N[(i + 1) % 9]) for i in range(9))
FULL = tuple((a, b) for i, a in enumerate(N) for b in N[i + 1 :])
REDUCED = tuple((a, b) for a, b in FULL if (int(a[3]) - 1) // 3 == (int(b[3]) - 1) // 3 or {a, b} <= {*N[::3]})
GRAPHS = {
    "full": FULL,
    "full less 4-7": tuple(link for link in FULL if link != ("inv4", "inv7")),
    "reduced": REDUCED,
    "reduced less 4-7": tuple(link for link in REDUCED if link != ("inv4", "inv7")),
    "ring": RING,
    "star": tuple(("inv1", other) for other in N[1:]),
    "star around inv2": tuple(("inv2", other) for other in N if other != "inv2"),
    "path": RING[:-1],
}
"""Undirected links; GFM, the leaders, are inv1, inv4 and inv7. The star's hub is a leader, inv2 is not."""


def scenario_of(
    graph: str, *, kappa: float | None = None, still_voltage: bool = False, end_s: float = 7.0
) -> tuple[ScenarioModel, Tables]:
    """Islanding alone, case "x" with this graph; kappa (1/s) instead of the scenario's 14.3; V_set left where it is."""
    scenario, feeder = load_scenario("islanding")
    case = scenario.cases["IV"]
    gains = case.gains if kappa is None else msgspec.structs.replace(case.gains, k_p=0.01 / kappa)
    if still_voltage:
        gains = msgspec.structs.replace(gains, k_q=1e5)
    case = msgspec.structs.replace(case, graph="links", links=GRAPHS[graph], gains=gains)
    time = msgspec.structs.replace(scenario.time, end_s=end_s)
    return msgspec.structs.replace(scenario, cases={"x": case}, events=scenario.events[:1], time=time), feeder


def inverters(graph: str, *, kappa: float | None = None) -> InverterGroup:
    return inverter_group_of(*scenario_of(graph, kappa=kappa), "x")


@dataclass(frozen=True)
class Run:
    """A case on the real plant, at its ticks."""

    t: Floats
    """Since islanding (s)."""
    f_error: Floats
    """Largest abs(f - 60) of the GFM (Hz)."""
    MPSI: Floats
    V: Floats
    """Mean terminal voltage (pu)."""

    @property
    def restored(self) -> float | None:
        """Time to 0.01 Hz and MPSI 0.01 for good (s)."""
        failing = np.flatnonzero((self.f_error >= F_BAND) | (self.MPSI >= MPSI_BAND))
        return None if failing[-1] + 1 == self.t.size else float(self.t[failing[-1] + 1])


def on_the_plant(
    graph: str, *, link: int = 0, setpoint: int = 0, still_voltage: bool = False, end_s: float = 7.0
) -> Run:
    """The real agents on the real plant, with delays in ticks: `gridpeers.lab.predict.linear_model.Ticks`."""
    scenario, feeder = scenario_of(graph, still_voltage=still_voltage, end_s=end_s)
    plant_config, agent_configs = configs(scenario, feeder, "x")
    plant = build_plant(plant_config)
    agents = {config.name: Agent(config) for config in agent_configs}
    roster, T = tuple(agents), plant_config.T_c
    for agent in agents.values():
        for other in agents.values():
            agent.meet(other.nameplate)
    said: list[dict[str, State]] = []
    readings = [plant.measure()]
    for k in range(round(end_s / T)):
        states = {}
        for name, agent in agents.items():
            neighbours = agent.in_neighbours(roster)
            if k - 1 - link >= 0:
                for other in neighbours:
                    agent.hear(said[k - 1 - link][other])
            measured = measurement_of(name, readings[k][name], epoch=1, tick=k, t=k * T, roster=roster)
            states[name] = agent.tick(measured, neighbours)
        said.append(states)
        for name, late_state in said[max(k - setpoint, 0)].items():
            plant.hold(name, late_state.P_set, late_state.V_set)
        plant.advance()
        readings.append(plant.measure())
    after = readings[round(scenario.events[0].t_s / T) + 1 :]
    f = np.array([[reading[name].f for name in N[::3]] for reading in after])
    P = np.array([[reading[name].P for name in N] for reading in after])
    V = np.array([np.mean([reading[row.name].V / row.V_nom for row in feeder.inverters]) for reading in after])
    rows = {row.name: row for row in feeder.inverters}
    s, m_p = np.array([rows[name].P_rated for name in N]), np.array([rows[name].m_p for name in N])
    return Run(np.arange(1.0, len(after) + 1.0) * T, np.abs(f - F_NOM).max(axis=1), sharing_index(P, s, m_p), V)
