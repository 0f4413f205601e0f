"""What the plant and the agents of one case are started with."""

from __future__ import annotations

from typing import Literal

from agents.agent_config import MAX_AGE, AgentConfig, Control
from plant.equipment import Feeder
from plant.plant_config import PlantConfig, PlantSettings, SwitchEvent
from scenarios.schema.graph import graph_of
from scenarios.schema.law_choice import law_of
from scenarios.schema.netem_tables import deaths_of, is_calm, netem_of, setup_of
from scenarios.schema.participants import inverters_of, schedule_of, with_agent
from scenarios.schema.power_limits import limits_of
from scenarios.schema.scenario_changes import changes_of
from scenarios.schema.scenario_model import Event, ScenarioModel


def configs(
    scenario: ScenarioModel, feeder: Feeder, case: str, endpoint: str = "", *, real_nodes: bool = False
) -> tuple[PlantConfig, tuple[AgentConfig, ...]]:
    """Configurations of the plant and of every agent for one case, those that join later last.

    Parameters
    ----------
    scenario : ScenarioModel
        A checked scenario.
    feeder : Feeder
        Its feeder; it gives the agents their nameplates.
    case : str
        Name of the case.
    endpoint : str, optional
        Where the plant listens and agents connect, e.g. "tcp/127.0.0.1:7447"; the in-process driver needs none.
    real_nodes : bool, optional
        Whether processes really are killed and paused, as the driver of wall-clock time does; else it is emulated.

    Examples
    --------
    >>> from scenarios.schema import load_scenario
    >>> plant, agents = configs(*load_scenario("islanding"), "IV")
    >>> plant.end, agents[0].name, agents[0].control.graph
    (7.0, 'inv1', 'full')
    """
    run = f"{scenario.name}-{case}"
    endpoints = (endpoint,) if endpoint else ()
    time, rule = scenario.time, scenario.cases[case]
    graph, own_graph = graph_of(rule)
    inverters, present = inverters_of(scenario, feeder), with_agent(scenario, feeder, case)
    netem = netem_of(scenario, case)
    links = {} if is_calm(netem) else setup_of(netem, scenario, feeder, real_nodes=real_nodes).to_tree()
    rates = {node.name: node.skew.factor for node in netem.nodes if node.skew is not None}
    control = Control(
        secondary=rule.secondary,
        graph=graph,
        own_graph=own_graph,
        links=rule.links,
        without=rule.without,
        gains=rule.gains,
        handling=rule.handling,
        law=law_of(scenario, case),
    )
    plant = PlantConfig(
        run=run,
        settings=PlantSettings(
            feeder=scenario.plant.feeder,
            load_set=scenario.plant.load_set,
            h=time.h_s,
            P_set0=scenario.plant.P_set0_pu,
            V_set0=scenario.plant.V_set0_pu,
            gfm=scenario.plant.gfm,
            gfl=scenario.plant.gfl,
            protection=scenario.protection,
            events=_switch_events(scenario),
            sync_check=scenario.plant.sync_check,
            limits=limits_of(scenario, case),
            changes=changes_of(scenario),
            spares=tuple(row.name for row in inverters if row.spare),
        ),
        agents=tuple(row.name for row in present if not row.spare),
        schedule=(*schedule_of(scenario), *(() if real_nodes else deaths_of(netem))),
        T_c=time.T_c_s,
        end=time.end_s,
        record_step=time.record_s,
        deadline=scenario.processes.deadline_s,
        listen=endpoints,
        links=links,
        max_age=rule.handling.max_age or MAX_AGE,
    )
    agents = tuple(
        AgentConfig(
            run=run,
            name=row.name,
            kind=row.kind,
            microgrid=row.microgrid,
            P_rated=row.P_rated,
            V_nom=row.V_nom,
            f_nom=feeder.f_nom,
            m_p=row.m_p,
            m_q=row.m_q,
            T_c=time.T_c_s,
            control=control,
            deadline=scenario.processes.deadline_s,
            connect=endpoints,
            links=links,
            clock_rate=rates.get(row.name, 1.0),
        )
        for row in present
    )
    return plant, agents


def _switch_events(scenario: ScenarioModel) -> tuple[SwitchEvent, ...]:
    return tuple(
        SwitchEvent(t=event.t_s, switch=switch, action=action, synchronised=event.synchronised and action == "close")
        for event in scenario.events
        for action, switches in _actions(event)
        for switch in switches
    )


def _actions(event: Event) -> tuple[tuple[Literal["open", "close"], tuple[str, ...]], ...]:
    return ("open", event.open), ("close", event.close)
