"""Who leaves, dies and joins at which tick, as the scenario says. The same in both kinds of time."""

from __future__ import annotations

from typing import NamedTuple

from plant.plant_config import PlantConfig


class Moves(NamedTuple):
    """The moves of one tick."""

    leave: tuple[str, ...] = ()
    """Inverters whose agents leave."""
    join: tuple[str, ...] = ()
    """Inverters whose agents join."""
    die: tuple[str, ...] = ()
    """Inverters whose agents die."""


class Schedule:
    """All moves of a run.

    Parameters
    ----------
    config : PlantConfig
        Names the moves and the control period.
    inverters : tuple[str, ...]
        The plant's inverters.

    Raises
    ------
    ValueError
        If a move names no inverter of the plant, or its time is no tick after 0.

    Examples
    --------
    >>> from plant.plant_config import Move, PlantSettings
    >>> config = PlantConfig(run="demo", settings=PlantSettings(), agents=("inv1", "inv2"), T_c=0.02, end=5.0,
    ...     record_step=0.01, deadline=10.0, listen=(), moves=(Move(t=2.0, inverter="inv2", action="leave"),))
    >>> Schedule(config, ("inv1", "inv2")).take(100)
    Moves(leave=('inv2',), join=(), die=())
    """

    def __init__(self, config: PlantConfig, inverters: tuple[str, ...]) -> None:
        self._at: dict[int, Moves] = {}
        for move in config.moves:
            if move.inverter not in inverters:
                raise ValueError(f'moves: no inverter "{move.inverter}"; inverters are {", ".join(inverters)}')
            tick = round(move.t / config.T_c)
            if tick < 1 or abs(tick * config.T_c - move.t) > 1e-9 * max(1.0, move.t):
                raise ValueError(
                    f"moves: {move.inverter} must {move.action} at a positive multiple of the control period "
                    f"{config.T_c:g} s, got {move.t:g} s"
                )
            moves = self._at.get(tick, Moves())
            names = (*getattr(moves, move.action), move.inverter)
            self._at[tick] = moves._replace(**{move.action: names})

    @property
    def joiners(self) -> frozenset[str]:
        """Everybody who is yet to join."""
        return frozenset(name for moves in self._at.values() for name in moves.join)

    def take(self, tick: int) -> Moves:
        """Moves of a tick; once."""
        return self._at.pop(tick, Moves())
