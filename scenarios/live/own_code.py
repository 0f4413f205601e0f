"""Find code that an agent would import or run because a plant on another host names it."""

from __future__ import annotations

from collections.abc import Iterator

from agents.agent_config import AgentConfig
from scenarios.emulation.emulation_config import EmulationConfig


def own_code(config: AgentConfig) -> tuple[str, ...]:
    """Return what the configuration names beside gridpeers' own and installed plug-ins, in words.

    Examples
    --------
    >>> from agents.agent_config import Control, LawChoice
    >>> control = Control(secondary="all", graph="full", law=LawChoice(command=("./mylaw",)))
    >>> own_code(AgentConfig(run="demo", name="inv1", kind="GFM", microgrid="mg1", P_rated=6e5, V_nom=277.0, f_nom=60.0,
    ...     m_p=0.01, m_q=0.05, T_c=0.02, control=control, deadline=10.0, connect=()))
    ('the law ./mylaw',)
    """
    return tuple(_named(config))


def _named(config: AgentConfig) -> Iterator[str]:
    law, graph = config.control.law, config.control.own_graph
    if law.command or law.fmu or ":" in law.use:
        yield f"the law {law.name}"
    if graph is not None and ":" in graph.use:
        yield f"the graph {graph.use}"
    if config.links:
        for fault in EmulationConfig.of_tree(config.links).netem.links:
            yield from (f"the link fault {plugin.use}" for plugin in fault.own if ":" in plugin.use)
