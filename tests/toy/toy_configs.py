"""Configurations of a short run of the toy plant."""

from __future__ import annotations

from typing import Literal

from gridpeers.agents.agent_config import AgentConfig, Control
from gridpeers.plant.plant_config import PlantConfig, PlantSettings, ScheduledAction
from tests.toy.toy_plant import F_NOM, M_P, P_RATED, V_NOM

Schedule = tuple[tuple[float, str, Literal["leave", "join"]], ...]
"""Time (s), inverter, and whether it leaves or joins."""

ALL_FULL = Control(secondary="all", graph="full")  # Case IV


def agent_config(name: str, control: Control = ALL_FULL, *, deadline: float = 10.0, run: str = "toy") -> AgentConfig:
    """One agent; every third, from inv1 on, is a GFM, and three make a microgrid."""
    number = int(name.removeprefix("inv")) - 1
    return AgentConfig(
        run=run,
        name=name,
        kind="GFL" if number % 3 else "GFM",
        microgrid=f"mg{number // 3 + 1}",
        P_rated=P_RATED,
        V_nom=V_NOM,
        f_nom=F_NOM,
        m_p=M_P,
        m_q=0.05,
        T_c=0.02,
        control=control,
        deadline=deadline,
        connect=(),
    )


def toy_configs(
    n: int = 9,
    control: Control = ALL_FULL,
    *,
    end: float = 0.4,
    deadline: float = 10.0,
    P_set0: float = 0.5,
    run: str = "toy",
    schedule: Schedule = (),
    spares: tuple[str, ...] = (),
) -> tuple[PlantConfig, tuple[AgentConfig, ...]]:
    """Plant of n inverters, and their agents; the schedule is of (t in s, inverter, action), spares off at first."""
    names = tuple(f"inv{i + 1}" for i in range(n))
    plant = PlantConfig(
        run=run,
        settings=PlantSettings(feeder=f"toy{n}", P_set0=P_set0, spares=spares),
        agents=tuple(name for name in names if name not in spares),
        schedule=tuple(ScheduledAction(t=t, inverter=name, action=action) for t, name, action in schedule),
        T_c=0.02,
        end=end,
        record_step=0.02,
        deadline=deadline,
        listen=(),
    )
    return plant, tuple(agent_config(name, control, deadline=deadline, run=run) for name in names)
