r"""Voltage and vars: the law (14), (15) on the plant's own sensitivities, found by moving one V_set after the other.

With q = S V_set and v = H V_set around an operating point (droops included, all filters at rest) the law's step is

.. math:: M = 1 - a (1 - D^{-1} A) m_q S - g b H, \qquad
          a_i = \tfrac12 (1 - e^{-2 \beta_i d_i T_c / k_q}), \quad b = 1 - e^{-\alpha T_c / k_q}

The beta part is a consensus on m_q q through S; alpha couples it to the voltages of the GFM. The eigenvalues of M are
those of a plant without lags. The GFM's voltage controllers and the GFL's volt-var lag (0.1 s each) are as slow as the
fast modes, so only the slow ones can be believed. MQSI over time is not predicted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from agents.law import towards
from plant.build import build_plant
from plant.dynamics import PlantError
from plant.equipment import Feeder
from plant.feeder import Plant
from scenarios.predict.closed_form import settling
from scenarios.predict.fleet import Fleet
from scenarios.predict.loads import LoadError
from scenarios.results.history import Floats
from scenarios.spec import Scenario
from scenarios.spec.configs import configs

STEP = 0.002
"""By how much a V_set is moved (pu): far above rounding, far below where loads and droops bend."""

REST = 2.0
"""Time given to the plant to come to rest (s); on droop alone its slowest part has a time constant of 0.1 s."""


@dataclass(frozen=True, kw_only=True)
class Sensitivity:
    """How q and v of each inverter (row) answer to V_set of each (column), pu of own rating and nominal voltage."""

    names: tuple[str, ...]
    """Order of rows and columns."""
    S: Floats
    """dq / dV_set (pu per pu)."""
    H: Floats
    """dv / dV_set (pu per pu)."""


def sensitivity(scenario: Scenario, feeder: Feeder) -> Sensitivity:
    """Sensitivities of the plant on droop alone at the end of the first event's window.

    Raises
    ------
    LoadError
        If the plant has no solution there.
    """
    config, agents = configs(scenario, feeder, next(iter(scenario.cases)))
    rated = {agent.name: agent.P_rated for agent in agents}
    nominal = {agent.name: agent.V_nom for agent in agents}
    names = config.agents
    end = scenario.events[1].t_s if len(scenario.events) > 1 else scenario.time.end_s
    try:
        plant = build_plant(config)
        _rest(plant, math.floor(end / config.T_c + 1e-9) - plant.tick)
        columns = []
        for name in names:
            here = plant.measure()[name]
            sides = []
            for sign in (1.0, -1.0):
                plant.hold(name, here.P_set, here.V_set + sign * STEP * nominal[name])
                _rest(plant, round(REST / config.T_c))
                read = plant.measure()
                sides.append([[read[of].Q / rated[of], read[of].V / nominal[of]] for of in names])
            plant.hold(name, here.P_set, here.V_set)
            columns.append((np.array(sides[0]) - np.array(sides[1])) / (2.0 * STEP))
    except PlantError as error:
        raise LoadError(f"on droop alone: {error}") from error
    return Sensitivity(names=names, S=np.array(columns)[:, :, 0].T, H=np.array(columns)[:, :, 1].T)


def _rest(plant: Plant, ticks: int) -> None:
    for _ in range(ticks):
        plant.advance()


@dataclass(frozen=True, kw_only=True)
class VarModes:
    """Modes of V_set under the law, on a plant without lags."""

    slowest_s: float
    """Time (s) to 2 % of the slowest mode; infinite if one never decays."""
    spectral_radius: float
    """Largest magnitude of an eigenvalue of M (1)."""
    fastest_s: float
    """Time constant of the fastest mode (s). Below the plant's lags, 0.1 s, that mode is not to be believed."""


def var_modes(fleet: Fleet, plant: Sensitivity) -> VarModes:
    """Modes of the var and voltage law of a fleet.

    Raises
    ------
    ValueError
        If an inverter of the fleet is not among the sensitivities.

    Examples
    --------
    Two stiff terminals whose vars answer to the difference of their set-points:

    >>> pair = Fleet(names=("a", "b"), GFM=np.array([True, False]), A=1.0 - np.eye(2))
    >>> stiff = Sensitivity(names=("a", "b"), S=np.array([[5.0, -5.0], [-5.0, 5.0]]), H=np.full((2, 2), 0.5))
    >>> var_modes(pair, stiff).spectral_radius < 1.0
    True
    """
    unknown = [name for name in fleet.names if name not in plant.names]
    if unknown:
        raise ValueError(f"no sensitivity of {', '.join(unknown)}; there are {', '.join(plant.names)}")
    at = [plant.names.index(name) for name in fleet.names]
    S, H, gains, T = plant.S[np.ix_(at, at)], plant.H[np.ix_(at, at)], fleet.gains, fleet.T_c
    beta = np.where(fleet.GFM, gains.beta_GFM, gains.beta_GFL)
    pairs = zip(beta.tolist(), fleet.degree.tolist(), strict=True)
    a = np.array([towards(rate / gains.k_q, d, T) for rate, d in pairs])
    disagreement = np.eye(fleet.n) - fleet.heard / np.maximum(fleet.degree, 1.0)[:, None]
    b = np.where(fleet.leads, 1.0 - math.exp(-gains.alpha * T / gains.k_q), 0.0)
    M = np.eye(fleet.n) - a[:, None] * (disagreement @ (fleet.m_q[:, None] * S)) - b[:, None] * H
    sizes = np.abs(np.linalg.eigvals(M[np.ix_(fleet.acts, fleet.acts)]))
    largest, smallest = float(sizes.max()), max(float(sizes.min()), 1e-12)
    return VarModes(
        slowest_s=settling(-math.log(largest) / T) if largest > 0.0 else 0.0,
        spectral_radius=largest,
        fastest_s=-T / math.log(smallest) if smallest < 1.0 else math.inf,
    )
