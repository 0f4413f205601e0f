"""The power that a person gives a load, checked before anything is sent."""

from __future__ import annotations

from math import isfinite

from gridpeers.plant.equipment.named_loads import FACTOR
from gridpeers.scenarios.live.client.run_address import UsageError
from gridpeers.wire.messages import LoadSetting

MOST = 1e8
"""Largest number (kW or kvar) that is sent; what is plausible the plant knows, as it knows the feeder."""


def load_setting(factor: float | None, P_kW: float | None, Q_kvar: float | None) -> LoadSetting:
    """Return the power of a load in the units of messages.

    Parameters
    ----------
    factor
        Factor on its real and reactive power.
    P_kW, Q_kvar
        Real (kW) and reactive power (kvar) at nominal voltage.

    Raises
    ------
    UsageError
        If nothing is given, too much, or no number.

    Examples
    --------
    >>> load_setting(None, 210.0, None)
    LoadSetting(factor=None, P=210000.0, Q=None)
    """
    for option, value in (("--factor", factor), ("--P", P_kW), ("--Q", Q_kvar)):
        if value is not None and not (isfinite(value) and abs(value) <= MOST):
            raise UsageError(f"{option}: must be a finite number, at most {MOST:g}, got {value:g}")
    if factor is not None and (objection := FACTOR.objection(factor)):
        raise UsageError(f"--factor: {objection}")
    if factor is not None and (P_kW is not None or Q_kvar is not None):
        raise UsageError("--factor: goes with neither --P nor --Q; give the factor, or the power")
    if factor is None and P_kW is None and Q_kvar is None:
        raise UsageError("nothing is to be set; give --factor, or one or both of --P (kW) and --Q (kvar)")
    return LoadSetting(
        factor=factor, P=None if P_kW is None else 1e3 * P_kW, Q=None if Q_kvar is None else 1e3 * Q_kvar
    )
