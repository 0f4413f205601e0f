"""Driver without processes and without messages, for runs in which messages decide nothing.

Each tick is three lines: the plant measures, all agents decide, and the plant holds their set-points and advances. The
decisions are those of the same cores, so the result is that of the bus and of the processes, byte by byte.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from gridpeers.agents.agent_config import AgentConfig
from gridpeers.agents.agent_group import AgentGroup
from gridpeers.agents.laws.law import Law
from gridpeers.plant.direct_plant import DirectPlant
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.plant_interface import PlantLike
from gridpeers.wire.messages import Journal, Telemetry


def messages_decide(plant: PlantConfig, agents: Sequence[AgentConfig]) -> bool:
    """Return whether a message may miss its receiver: by an emulated link, or as an agent joins, leaves or dies."""
    emulated = plant.links or any(config.links for config in agents)
    return bool(emulated or plant.schedule or {config.name for config in agents} != set(plant.agents))


def run_direct(
    config: PlantConfig,
    agents: Sequence[AgentConfig],
    laws: Sequence[Law],
    plant: PlantLike,
    on_telemetry: Callable[[Telemetry], None],
    on_journal: Callable[[Journal], None] = lambda journal: None,
) -> DirectPlant:
    """Run to the end; return the plant's core.

    Parameters
    ----------
    config : PlantConfig
        The plant.
    agents : Sequence[AgentConfig]
        The agents.
    laws : Sequence[Law]
        Law of each.
    plant : PlantLike
        The plant at t = 0.
    on_telemetry : Callable[[Telemetry], None]
        Takes the plant's telemetry.
    on_journal : Callable[[Journal], None], optional
        Takes the journals, if the configurations ask for them.
    """
    core = DirectPlant(config, plant, on_telemetry, on_journal)
    place = {name: i for i, name in enumerate(config.agents)}
    order = sorted(range(len(agents)), key=lambda i: place[agents[i].name])
    group = AgentGroup([agents[i] for i in order], [laws[i] for i in order])
    while not core.finished:
        core.end_tick(group.tick(core.begin_tick()))
        for journal in group.take_journals():
            on_journal(journal)
        core.take_actions()  # words to agents, who are not there to hear them
    return core
