"""Certificates for the processes of a run, all from one folder, before any of them starts."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

from msgspec.structs import replace

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.wire.trust.key_folder import KeysError, open_credentials


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
        secured_agents.append(replace(agent, inverters=every, credentials=own))
    if problems:
        raise KeysError("\n".join(problems))
    handed_out = {name: {**tree, "inverters": list(every)} for name, tree in plant.agent_configs.items()}
    plant = replace(plant, credentials=credentials.knowing(every), agent_configs=handed_out)
    return plant, tuple(secured_agents), tuple(filter(None, notes))
