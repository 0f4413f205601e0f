"""Limits of delay, law and plant in discrete time, by the eigenvalues of `gridpeers.lab.predict.linear_model`."""

from __future__ import annotations

import math

import numpy as np

from gridpeers.lab.predict.closed_form import DelayKind
from gridpeers.lab.predict.inverter_group import InverterGroup
from gridpeers.lab.predict.linear_model import Loop, Ticks
from gridpeers.lab.predict.response import PlantModel, response

ANGLES = 600
"""Angles at which delay-independence is tried, between 1e-3 rad and pi, evenly in their logarithm."""


def delay_limit(
    inverters: InverterGroup, kind: DelayKind | str, *, plant: PlantModel = "lagged", longest_s: float = 3.0
) -> float:
    """Return the longest delay (s), the same for all, up to which the loop in discrete time is stable.

    Parameters
    ----------
    inverters : InverterGroup
        From `inverter_group_of`.
    kind : str
        "neighbours": agent to agent, own value fresh. "disagreement": own value as late as the neighbours'. "local
        loop": plant to agent, or agent to plant, which are the same to the loop.
    plant : {"lagged", "quasi-steady"}, optional
        As for `predicted_times`.
    longest_s : float, optional
        Delays tried (s).

    Returns
    -------
    float
        A multiple n T_c (s): stable with it, unstable with any more, as the next tick is then the first to use what
        comes. Infinite if none was found up to `longest_s`, which for "neighbours" is mostly at any
        delay (`first_crossing`).
        Not a number if the loop is unstable without delay.

    Raises
    ------
    ValueError
        If there is no such kind.
    """
    ticks = {
        "neighbours": lambda n: Ticks(link=n),
        "disagreement": lambda n: Ticks(link=n, own=n),
        "local loop": lambda n: Ticks(measurement=n),
    }
    if kind not in ticks:
        raise ValueError(f'no kind of delay "{kind}"; kinds are {", ".join(ticks)}')
    if not Loop(inverters=inverters, plant=plant).stable:
        return math.nan
    if kind != "local loop" and not inverters.heard.any():
        return math.inf
    first = 1.0
    if kind == "neighbours":  # long delays make large matrices: begin where the sweep says that something happens
        first = max(1.0, 0.9 * first_crossing(inverters, plant=plant) - 1.0)
    unmoved = 1 if kind != "local loop" else 0  # every state takes one period in any case
    last = round(longest_s / inverters.T_c)
    for n in range(math.floor(min(first, last + 1.0)), last + 1):
        if not Loop(inverters=inverters, ticks=ticks[kind](n), plant=plant).stable:
            return (n - 1 + unmoved) * inverters.T_c
    return math.inf


def first_crossing(inverters: InverterGroup, *, plant: PlantModel = "lagged") -> float:
    """Return shortest delay (control periods) of the neighbours' states, the same on all links, at which a mode stays.

    With own values apart from the neighbours' the loop is F(z) y = z^{-n} S y. A mode can stand on the unit circle, z =
    exp(j theta), only where an eigenvalue of F^{-1} S has magnitude 1; its angle then is n theta. Infinite if there is
    none on `ANGLES` angles: then no delay destabilises the loop.

    References
    ----------
    Chen, Latchman, IEEE Trans. Autom. Control 40(9), 1995: frequency sweeping tests, in continuous time.
    """
    acts, n, held = inverters.acts, inverters.n, response(inverters, plant)
    a, b = Loop(inverters=inverters).gains
    share = (a / np.maximum(inverters.degree, 1.0))[:, None] * inverters.heard
    shortest, before = math.inf, np.zeros(int(acts.sum()))
    for theta in np.geomspace(1e-3, math.pi, ANGLES):
        z = np.exp(1j * theta)
        x = np.linalg.solve(np.eye(len(held.A)) - held.A / z, held.B)
        F = (z - 1.0) * np.eye(n) + np.diag(a) + np.outer(b, held.C @ x + held.D)
        reach = np.linalg.eigvals(np.linalg.solve(F[np.ix_(acts, acts)], share[np.ix_(acts, acts)]))
        reach = reach[np.argsort(np.abs(reach))]
        crossed = (np.abs(reach) >= 1.0) != (before >= 1.0)
        turns = np.mod(np.angle(reach[crossed]), 2.0 * math.pi) / theta
        shortest = min(shortest, float(turns.min(initial=math.inf)))
        before = np.abs(reach)
    return shortest
