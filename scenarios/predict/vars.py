r"""Voltage and vars: the law (14), (15) on the plant's own sensitivities, without lags, with delays in ticks.

With q = S V_set and v = H V_set around an operating point (droops included, all filters at rest) and the factors a_i,
b_i of `agents.laws.consensus.V_factors` the law is

.. math:: V(k) = V(k-1) - a \big(m_q S\, V(k-1-l) - D^{-1} A\, m_q S\, V(k-2-l-n)\big) - b H\, V(k-1-l)

where l is the delay of the local loop (measurement or set-point) and n that of the links: a neighbour's var is always
one period older than the own, as it is measured at its sender's tick. The beta part is a consensus on m_q q through S;
alpha couples it to the voltages of the GFM. The plant's lags (0.1 s for the GFM's voltage controller and the GFL's
volt-var) are left out, so its fast modes are rough; MQSI over time is not predicted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from agents.laws.consensus import V_factors
from scenarios.predict.closed_form import settling
from scenarios.predict.inverter_group import Fleet
from scenarios.predict.linear_model import AT_REST
from scenarios.predict.sensitivity import Sensitivity
from scenarios.results.history import Floats


@dataclass(frozen=True, kw_only=True)
class VarModes:
    """Modes of V_set under the law."""

    settling_s: float
    """Time (s) to 2 % of the slowest mode; infinite if one does not decay."""
    spectral_radius: float
    """Largest magnitude of an eigenvalue (1), those of what never moves left out; below 1 it is stable."""


def var_modes(fleet: Fleet, plant: Sensitivity, *, local: int = 0, link: int = 0) -> VarModes:
    """Modes of the law for voltage and vars.

    Parameters
    ----------
    fleet : Fleet
        Its inverters must be among those of the sensitivities.
    plant : Sensitivity
        From `scenarios.predict.sensitivity.sensitivity`.
    local, link : int, optional
        Delays in control periods: of measurement or set-point, and of the links beyond the one period they always take.

    Raises
    ------
    ValueError
        If an inverter is not among the sensitivities.

    Examples
    --------
    Two terminals whose vars answer to the difference of their set-points:

    >>> pair = Fleet(names=("a", "b"), GFM=np.array([True, False]), A=1.0 - np.eye(2))
    >>> plant = Sensitivity(names=("a", "b"), S=np.array([[5.0, -5.0], [-5.0, 5.0]]), H=np.full((2, 2), 0.5))
    >>> var_modes(pair, plant).spectral_radius < 1.0 < var_modes(pair, plant, local=50).spectral_radius
    True
    """
    values = np.linalg.eigvals(_map(fleet, plant, local, link))
    at_rest = np.eye(int(fleet.acts.sum())) - _map(fleet, plant, -1, 0)
    unmoved = int((np.linalg.svd(at_rest, compute_uv=False) < AT_REST).sum())
    values = values[np.argsort(np.abs(values - 1.0))][unmoved:]
    largest = float(np.abs(values).max(initial=0.0))
    slowest = settling(-math.log(largest) / fleet.T_c) if largest > 0.0 else 0.0
    return VarModes(settling_s=slowest, spectral_radius=largest)


def var_delay_limit(fleet: Fleet, plant: Sensitivity, *, longest_s: float = 1.0) -> float:
    """Longest delay (s) of measurements or set-points up to which the law for voltage and vars is stable.

    A multiple of T_c; infinite if none up to `longest_s` makes it unstable, not a number if it is unstable without.
    """
    for n in range(round(longest_s / fleet.T_c) + 1):
        if var_modes(fleet, plant, local=n).spectral_radius >= 1.0 - 1e-12:
            return (n - 1) * fleet.T_c if n else math.nan
    return math.inf


def factors(fleet: Fleet) -> tuple[Floats, Floats]:
    """Factors of z - z_bar and of v - 1 of each inverter, by the law itself, alpha in full."""
    gains, T, each = fleet.gains, fleet.T_c, zip(fleet.GFM, fleet.leads, fleet.degree.tolist(), strict=True)
    weights = [(gains.alpha * leads, gains.beta_GFM if GFM else gains.beta_GFL, d) for GFM, leads, d in each]
    a, b = np.array([V_factors(alpha, beta, d, k_q=gains.k_q, T=T) for alpha, beta, d in weights]).T
    return a, b


def _map(fleet: Fleet, plant: Sensitivity, local: int, link: int) -> Floats:
    """Map of V(k-1), V(k-2), ... of those that run the law to V(k), V(k-1), ...; of V alone as if `local` were -1."""
    unknown = [name for name in fleet.names if name not in plant.names]
    if unknown:
        raise ValueError(f"no sensitivity of {', '.join(unknown)}; there are {', '.join(plant.names)}")
    at = [plant.names.index(name) for name in fleet.names]
    S, H = plant.S[np.ix_(at, at)], plant.H[np.ix_(at, at)]
    a, b = factors(fleet)
    z = fleet.m_q[:, None] * S
    own = a[:, None] * z + b[:, None] * H
    others = a[:, None] * (fleet.heard / np.maximum(fleet.degree, 1.0)[:, None]) @ z
    free = np.ix_(fleet.acts, fleet.acts)
    n, depth = int(fleet.acts.sum()), local + link + 2
    if local < 0:  # everybody at once: what rests there rests under any delay
        return np.asarray(np.eye(n) - own[free] + others[free])
    blocks = np.zeros((depth, n, n))
    blocks[0] += np.eye(n)
    blocks[local] -= own[free]
    blocks[local + 1 + link] += others[free]
    whole = np.eye(n * depth, k=-n)
    whole[:n] = np.hstack(list(blocks))
    return whole
