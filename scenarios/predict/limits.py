"""Limits of delay of law and plant in discrete time, by the eigenvalues of `scenarios.predict.model`."""

from __future__ import annotations

import math

import numpy as np

from scenarios.predict.closed_form import Kind
from scenarios.predict.fleet import Fleet
from scenarios.predict.model import Loop, Ticks
from scenarios.predict.response import PlantModel, response

ANGLES = 400
"""Angles at which delay-independence is tried, between 1e-3 rad and pi, evenly in their logarithm."""


def delay_limit(case: Fleet, kind: Kind | str, *, plant: PlantModel = "lagged", longest_s: float = 3.0) -> float:
    """Longest delay (s), the same for all, up to which the loop in discrete time is stable.

    Parameters
    ----------
    case : Fleet
        From `fleet_of`.
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
        comes. Infinite if none was found: for "neighbours" at any delay (`delay_independent`), else up to `longest_s`.
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
    if not Loop(fleet=case, plant=plant).stable:
        return math.nan
    if kind == "neighbours" and delay_independent(case, plant=plant):
        return math.inf
    unmoved = 1 if kind != "local loop" else 0  # every state takes one period in any case
    for n in range(1, round(longest_s / case.T_c) + 1):
        if not Loop(fleet=case, ticks=ticks[kind](n), plant=plant).stable:
            return (n - 1 + unmoved) * case.T_c
    return math.inf


def delay_independent(case: Fleet, *, plant: PlantModel = "lagged") -> bool:
    r"""Whether no delay of the neighbours' states, the same on all links, can destabilise the loop.

    With own values apart from the neighbours' the loop is F(z) y = a A/d z^{-n} y; a mode can reach \|z\| = 1 with some
    n only where the spectral radius of F^{-1} a A/d reaches 1 there. It is tried on `ANGLES` angles.

    References
    ----------
    Chen, Latchman, IEEE Trans. Autom. Control 40(9), 1995: frequency sweeping tests, in continuous time.
    """
    acts = case.acts
    n, z_plant = case.n, response(case, plant)
    a, b = Loop(fleet=case).gains
    share = (a / np.maximum(case.degree, 1.0))[:, None] * case.heard
    for theta in np.geomspace(1e-3, math.pi, ANGLES):
        z = np.exp(1j * theta)
        x = np.linalg.solve(np.eye(len(z_plant.A)) - z_plant.A / z, z_plant.B)
        G = z_plant.C @ x + z_plant.D
        F = (z - 1.0) * np.eye(n) + np.diag(a) + np.outer(b, G)
        reach = np.linalg.solve(F[np.ix_(acts, acts)], share[np.ix_(acts, acts)])
        if np.abs(np.linalg.eigvals(reach)).max() >= 1.0:
            return False
    return True
