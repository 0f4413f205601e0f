"""The loads of a feeder as people set them while a run goes on."""

from __future__ import annotations

from plant.equipment.named_loads import FACTOR, load_name, named_loads, with_powers
from plant.network import Network
from wire.messages import LoadSetting, PlantEvent
from wire.schema.plausible import Plausible

MOST = 10.0
"""Greatest power of one load, as a multiple of all loads of the feeder, or of its inverters' ratings if more."""


class LoadBoard:
    """The powers of a feeder's loads at nominal voltage, and those that they are to have from the next step on.

    Parameters
    ----------
    network
        The feeder's network as the run began.
    """

    def __init__(self, network: Network) -> None:
        self._network, self._loads = network, named_loads(network.feeder)
        whole = sum(abs(load.S) for load in self._loads.values())
        self._most = MOST * max(whole, sum(unit.P_rated for unit in network.inverters)) / 1e3
        self._set: dict[str, complex] = {}
        self._coming: dict[str, complex] = {}

    @property
    def changed(self) -> dict[str, complex]:
        """Power (VA, nominal) of each load that has another one than in the feeder's tables now."""
        return dict(self._set)

    @property
    def waits(self) -> bool:
        """Whether a load is to change."""
        return bool(self._coming)

    def put(self, text: str, setting: LoadSetting) -> str:
        """Have a load take another power at nominal voltage from the next step on; return it in words.

        Parameters
        ----------
        text
            Name of the load, or of its bus.
        setting
            Its power; what is None stays as it is.

        Raises
        ------
        ValueError
            If there is no such load, or a number makes no sense.
        """
        name = load_name(self._loads, text)
        table = self._loads[name].S
        if (setting.factor is None) == (setting.P is None and setting.Q is None):
            raise ValueError(f"load {name}: takes either a factor, or real or reactive power")
        if setting.factor is not None:
            _refuse_unless_plausible(name, FACTOR, setting.factor, "")
            S = setting.factor * table
        else:
            low = 0.0 if table.real >= 0.0 else -self._most
            before = self._coming.get(name, self._set.get(name, table))
            P = before.real if setting.P is None else setting.P
            Q = before.imag if setting.Q is None else setting.Q
            _refuse_unless_plausible(name, Plausible("the real power of a load", low, self._most), P / 1e3, "kW")
            around = Plausible("the reactive power of a load", -self._most, self._most)
            _refuse_unless_plausible(name, around, Q / 1e3, "kvar")
            S = complex(P, Q)
        self._coming[name] = S
        return f"load {name}: {_words(S)}{_beside(S, table)}"

    def apply(self, t: float) -> tuple[Network, list[PlantEvent]]:
        """Change the loads that are to change at t (s); return the network with them, and an event of each."""
        events = []
        for name, S in self._coming.items():
            table = self._loads[name].S
            text = f"load {name} set to {_words(S)}{_beside(S, table)}"
            events.append(PlantEvent(t=t, kind="load", subject=name, text=text))
            if table == S:
                self._set.pop(name, None)
            else:
                self._set[name] = S
        self._coming = {}
        return self._network.with_loads(with_powers(self._network.feeder, self._set)), events


def _refuse_unless_plausible(name: str, plausible: Plausible, value: float, unit: str) -> None:
    if objection := plausible.objection(value, unit):
        raise ValueError(f"load {name}: {objection}")


def _words(S: complex) -> str:
    return f"{S.real / 1e3:.6g} kW and {S.imag / 1e3:.6g} kvar at nominal voltage"


def _beside(S: complex, table: complex) -> str:
    """Return how a power is beside that of the tables, "" if that is no factor."""
    if not table:
        return ""
    factor = (S / table).real
    if abs(S - factor * table) > 1e-9 * abs(table):
        return ""
    return ", as in its table" if factor == 1.0 else f", {factor:.4g} times its table"
