"""The power that a load of a feeder can be given, by a person or by a scenario, and in words. Pure."""

from __future__ import annotations

import re

from gridpeers.plant.equipment.equipment import Feeder
from gridpeers.plant.equipment.named_loads import FACTOR, load_name, named_loads
from gridpeers.wire.messages import LoadSetting
from gridpeers.wire.schema.plausible import Plausible

MOST = 10.0
"""Greatest power of one load, as a multiple of all loads of the feeder, or of its inverters' ratings if more."""

_POWER = re.compile(r"\bset to (\S+) kW and (\S+) kvar at nominal voltage")


class LoadPowers:
    """The loads of a feeder by name, and the powers at nominal voltage that each can have.

    Parameters
    ----------
    feeder
        The feeder, with the powers of its tables.
    P_rated
        Ratings of its inverters together (W).
    """

    def __init__(self, feeder: Feeder, P_rated: float) -> None:
        self._loads = named_loads(feeder)
        self._most = MOST * max(sum(abs(load.S) for load in self._loads.values()), P_rated) / 1e3

    def name(self, text: str) -> str:
        """Return the name of a load by its name, or by its bus; see `load_name`."""
        return load_name(self._loads, text)

    def table(self, name: str) -> complex:
        """Return the power (VA) of a load, by its name, in the feeder's tables."""
        return self._loads[name].S

    def power(self, name: str, setting: LoadSetting, before: complex) -> complex:
        """Return the power (VA) of a load after a setting.

        Parameters
        ----------
        name
            Name of the load.
        setting
            Its new power; what is None stays as it is.
        before
            Its power until then (VA).

        Raises
        ------
        ValueError
            If a number makes no sense; the message says what would be right, and does not name the load.
        """
        table = self._loads[name].S
        if (setting.factor is None) == (setting.P is None and setting.Q is None):
            raise ValueError("takes either a factor, or real or reactive power")
        if setting.factor is not None:
            _refuse_unless_plausible(FACTOR, setting.factor, "")
            return setting.factor * table
        low = 0.0 if table.real >= 0.0 else -self._most
        P = before.real if setting.P is None else setting.P
        Q = before.imag if setting.Q is None else setting.Q
        _refuse_unless_plausible(Plausible("the real power of a load", low, self._most), P / 1e3, "kW")
        around = Plausible("the reactive power of a load", -self._most, self._most)
        _refuse_unless_plausible(around, Q / 1e3, "kvar")
        return complex(P, Q)

    def words(self, name: str, S: complex) -> str:
        """Return a power (VA) of a load in words, beside that of its table."""
        return f"{S.real / 1e3:.6g} kW and {S.imag / 1e3:.6g} kvar at nominal voltage{_beside(S, self.table(name))}"


def set_power(text: str) -> complex | None:
    """Return the power (VA, to six digits) that an event of the plant says a load was set to; None if it says none.

    Examples
    --------
    >>> set_power("load 48 set to 315 kW and -22.5 kvar at nominal voltage, 1.5 times its table")
    (315000-22500j)
    """
    match = _POWER.search(text)
    return complex(1e3 * float(match[1]), 1e3 * float(match[2])) if match else None


def _refuse_unless_plausible(plausible: Plausible, value: float, unit: str) -> None:
    if objection := plausible.objection(value, unit):
        raise ValueError(objection)


def _beside(S: complex, table: complex) -> str:
    """Return how a power is beside that of the tables, "" if that is no factor."""
    if not table:
        return ""
    factor = (S / table).real
    if abs(S - factor * table) > 1e-9 * abs(table):
        return ""
    return ", as in its table" if factor == 1.0 else f", {factor:.4g} times its table"
