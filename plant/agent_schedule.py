"""The scheduled joins, leaves and deaths of agents, by tick. The same in both kinds of time."""

from __future__ import annotations

from typing import NamedTuple

from gridpeers.plant.plant_config import PlantConfig


class TickActions(NamedTuple):
    """Scheduled joins, leaves and deaths of one tick."""

    leave: tuple[str, ...] = ()
    """Inverters whose agents leave."""
    join: tuple[str, ...] = ()
    """Inverters whose agents join."""
    die: tuple[str, ...] = ()
    """Inverters whose agents die."""


class AgentSchedule:
    """Scheduled joins, leaves and deaths of a run, by tick.

    Parameters
    ----------
    config : PlantConfig
        Has the schedule and the control period.
    inverters : tuple[str, ...]
        The plant's inverters.

    Raises
    ------
    ValueError
        If an action names no inverter of the plant, or its time is no tick after 0.

    Examples
    --------
    >>> from gridpeers.plant.plant_config import PlantSettings, ScheduledAction
    >>> leave = ScheduledAction(t=2.0, inverter="inv2", action="leave")
    >>> config = PlantConfig(run="demo", settings=PlantSettings(), agents=("inv1", "inv2"), T_c=0.02, end=5.0,
    ...     record_step=0.01, deadline=10.0, listen=(), schedule=(leave,))
    >>> AgentSchedule(config, ("inv1", "inv2")).take(100)
    TickActions(leave=('inv2',), join=(), die=())
    """

    def __init__(self, config: PlantConfig, inverters: tuple[str, ...]) -> None:
        self._at: dict[int, TickActions] = {}
        for action in config.schedule:
            if action.inverter not in inverters:
                raise ValueError(f'schedule: no inverter "{action.inverter}"; inverters are {", ".join(inverters)}')
            tick = round(action.t / config.T_c)
            if tick < 1 or abs(tick * config.T_c - action.t) > 1e-9 * max(1.0, action.t):
                raise ValueError(
                    f"schedule: {action.inverter} must {action.action} at a positive multiple of the control period "
                    f"{config.T_c:g} s, got {action.t:g} s"
                )
            actions = self._at.get(tick, TickActions())
            names = (*getattr(actions, action.action), action.inverter)
            self._at[tick] = actions._replace(**{action.action: names})

    @property
    def joiners(self) -> frozenset[str]:
        """Names of the agents that are yet to join."""
        return frozenset(name for actions in self._at.values() for name in actions.join)

    def take(self, tick: int) -> TickActions:
        """Return the actions of a tick, and forget them."""
        return self._at.pop(tick, TickActions())
