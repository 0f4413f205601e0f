"""From a checked scenario to the configurations of its plant and agents, with certificates too, and to its feeder."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

import msgspec

from gridpeers.agents.agent_config import MAX_AGE, AgentConfig, Control
from gridpeers.plant.equipment import Tables
from gridpeers.plant.equipment.derived_feeders import changed
from gridpeers.plant.inverters.inverter_registry import given
from gridpeers.plant.plant_config import (
    FeederChanges,
    InverterChange,
    PlantConfig,
    PlantSettings,
    PowerLimit,
    SwitchEvent,
)
from gridpeers.scenarios.schema import participants
from gridpeers.scenarios.schema.plugin_keys import graph_of, law_of
from gridpeers.scenarios.schema.scenario_model import ScenarioModel
from gridpeers.scenarios.schema.supply import load_events


def configs(
    scenario: ScenarioModel, feeder: Tables, case: str, endpoint: str = "", *, real_nodes: bool = False
) -> tuple[PlantConfig, tuple[AgentConfig, ...]]:
    """Return the configurations of the plant and of every agent for one case of a checked scenario, later joiners last.

    `endpoint` is where the plant listens. With `real_nodes` processes really are killed and paused, as in real time.
    """
    run, endpoints = f"{scenario.name}-{case}", (endpoint,) if endpoint else ()
    time, rule = scenario.time, scenario.cases[case]
    graph, own_graph = graph_of(rule)
    inverters, present = participants.inverters_of(scenario, feeder), participants.with_agent(scenario, feeder, case)
    netem = participants.netem_of(scenario, case)
    setup = participants.setup_of(netem, scenario, feeder, real_nodes=real_nodes)
    links = {} if participants.is_calm(netem) else setup.to_tree()
    rates = {node.name: node.skew.factor for node in netem.nodes if node.skew is not None}
    control = Control(
        secondary=rule.secondary,
        graph=graph,
        own_graph=own_graph,
        links=rule.links,
        without=rule.without,
        gains=rule.gains,
        degraded_communication=rule.degraded_communication,
        law=law_of(scenario, case),
    )
    plant = PlantConfig(
        run=run,
        settings=PlantSettings(
            simulator=scenario.plant.simulator,
            simulators={name: msgspec.to_builtins(table) for name, table in scenario.plant.simulators.items()},
            feeder=scenario.plant.feeder,
            load_set=scenario.plant.load_set,
            h=time.h_s,
            method=time.method,
            P_set0=scenario.plant.P_set0_pu,
            V_set0=scenario.plant.V_set0_pu,
            gfm=scenario.plant.gfm,
            gfl=scenario.plant.gfl,
            protection=scenario.protection,
            events=_switch_events(scenario),
            sync_check=scenario.plant.sync_check,
            limits=limits_of(scenario, case),
            loads=load_events(scenario),
            changes=changes_of(scenario),
            spares=tuple(row.name for row in inverters if row.spare),
        ),
        agents=tuple(row.name for row in present if not row.spare),
        schedule=(*participants.schedule_of(scenario), *(() if real_nodes else participants.deaths_of(netem))),
        T_c=time.T_c_s,
        end=time.end_s,
        record_step=time.record_s,
        deadline=scenario.processes.deadline_s,
        listen=endpoints,
        links=links,
        max_age=rule.degraded_communication.max_age or MAX_AGE,
        on_law_failure=scenario.on_law_failure,
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


def secured(
    plant: PlantConfig,
    agents: Sequence[AgentConfig],
    folder: Path,
    *,
    started: Collection[str],
    inverters: Sequence[str],
) -> tuple[PlantConfig, tuple[AgentConfig, ...], tuple[str, ...]]:
    """Return configurations with certificates, and a note on each that ends soon.

    The keys of the agents that are `started` from here must be in the folder; access rules name the agents of all
    `inverters`. KeysError has every problem of a certificate, a line each.
    """
    from gridpeers.wire.trust.key_folder import KeysError, open_credentials  # ssl, which a run without keys has not

    every = tuple(inverters)
    credentials, note = open_credentials(folder, ("plant",))
    problems, notes = [], [note]
    secured_agents = []
    for agent in agents:
        own = None
        if agent.name in started:
            try:
                own, note = open_credentials(folder, ("agent",), agent.name)
                notes.append(note)
            except KeysError as error:
                problems.append(str(error))
        secured_agents.append(msgspec.structs.replace(agent, inverters=every, credentials=own))
    if problems:
        raise KeysError("\n".join(problems))
    handed_out = {name: {**tree, "inverters": list(every)} for name, tree in plant.agent_configs.items()}
    plant = msgspec.structs.replace(plant, credentials=credentials.knowing(every), agent_configs=handed_out)
    return plant, tuple(secured_agents), tuple(filter(None, notes))


def limits_of(scenario: ScenarioModel, case: str) -> tuple[PowerLimit, ...]:
    """Return the power that inverters have available in one case, whose own numbers replace an event's."""
    own = scenario.cases[case].P_max_kW
    return tuple(
        PowerLimit(t=event.t_s, inverter=name, P_max=1e3 * kW)
        for event in scenario.events
        for name, kW in (event.P_max_kW | own.get(event.label, {})).items()
    )


def changes_of(scenario: ScenarioModel) -> FeederChanges:
    plant = scenario.plant
    return FeederChanges(
        f_nom=plant.f_nom_Hz,
        load_factor=plant.load_factor,
        m_p_factor=plant.m_p_factor,
        m_q_factor=plant.m_q_factor,
        inverters={
            name: InverterChange(
                m_p=table.m_p_pu,
                m_q=table.m_q_pu,
                P_rated=None if table.P_rated_kW is None else 1e3 * table.P_rated_kW,
                parameters=table.parameters,
                own=given(table.own),
            )
            for name, table in plant.inverter.items()
        },
    )


def as_in(scenario: ScenarioModel, feeder: Tables) -> Tables:
    return changed(feeder, changes_of(scenario))


def _switch_events(scenario: ScenarioModel) -> tuple[SwitchEvent, ...]:
    events = []
    for event in scenario.events:
        t, waits = event.t_s, event.synchronised
        events += [SwitchEvent(t=t, switch=name, action="open") for name in event.open]
        events += [SwitchEvent(t=t, switch=name, action="close", synchronised=waits) for name in event.close]
    return tuple(events)
