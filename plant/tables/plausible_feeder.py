"""Which numbers make sense in a feeder's tables, and what was probably meant by one that does not.

A range is wide: it holds every value that a distribution feeder may have, and none that only a lost unit explains.
"""

from __future__ import annotations

import math

from wire.plausible import Plausible

NOMINAL_FREQUENCY = Plausible("a nominal frequency", 16.0, 400.0)
BUS_VOLTAGE = Plausible("a nominal voltage", 0.1, 150.0)
LENGTH = Plausible("the length of a line", 0.1, 1e5)
SELF_R = Plausible("the resistance of a line", 1e-3, 20.0)
SELF_X = Plausible("the reactance of a line", 1e-3, 20.0)
MUTUAL = Plausible("a mutual impedance", -10.0, 10.0)
SHUNT = Plausible("the susceptance of a line", -2000.0, 2000.0)
R_PERCENT = Plausible("the resistance of a transformer", 0.0, 20.0)
X_PERCENT = Plausible("the reactance of a transformer", 0.1, 40.0)
SOURCE_VOLTAGE = Plausible("the voltage of the substation", 0.8, 1.2)
SOURCE_ANGLE = Plausible("the angle of the substation", -360.0, 360.0)
P_F_DROOP = Plausible("a P-f droop", 0.001, 0.2)
Q_V_DROOP = Plausible("a Q-V droop", 0.001, 0.5)
RATIO = Plausible("the ratio of a regulator", 0.8, 1.25)

BRANCH_CURRENT = 2000.0
"""Largest current of one load or capacitor bank (A per phase); conductors of a distribution feeder carry less."""
RATED_CURRENT = 5000.0
"""Largest rated current of an inverter or transformer (A per phase)."""
TIMES_THE_LOAD = 50.0
"""Largest rating of one inverter beside the total real power of the feeder's loads."""


def power_of(what: str, V_nom: float, current: float, phases: int) -> Plausible:
    """Range of a power (kW, kvar, kVA) whose current (A per phase) stays below a bound at a nominal voltage (V, L-N).

    Examples
    --------
    >>> power_of("a load", 2400.0, 2000.0, 1)
    Plausible(what='a load on a phase of 4.16 kV', low=-4800.0, high=4800.0, above_zero=False, hint='')
    """
    if math.isnan(V_nom):  # the bus has its own error
        return Plausible(what, -math.inf, math.inf)
    high = phases * V_nom * current / 1e3
    where = f"{what} {'on a phase of' if phases == 1 else 'at'} {V_nom * 3.0**0.5 / 1e3:.3g} kV"
    return Plausible(where, -high, high)


def positive_definite(matrix: tuple[tuple[float, ...], ...]) -> bool:
    """Whether a symmetric matrix of up to three rows is positive definite, by its leading minors.

    Examples
    --------
    >>> positive_definite(((2.0, 1.0), (1.0, 2.0))), positive_definite(((1.0, 2.0), (2.0, 1.0)))
    (True, False)
    """
    (a, *ab), rest = matrix[0], matrix[1:]
    if a <= 0.0:
        return False
    schur = tuple(tuple(x - row[0] * ab[k] / a for k, x in enumerate(row[1:])) for row in rest)
    return not schur or positive_definite(schur)
