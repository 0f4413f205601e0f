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
from plant.build import build_plant
from plant.dynamics import PlantError
from plant.equipment import Feeder
from plant.feeder import Plant, raise_for_trip
from plant.plant_config import PlantConfig
from scenarios.predict.closed_form import settling
from scenarios.predict.inverter_group import InverterGroup
from scenarios.predict.linear_model import AT_REST
from scenarios.predict.load_steps import LoadError
from scenarios.results.history import Floats
from scenarios.schema import ScenarioModel
from scenarios.schema.configs import configs

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


def sensitivity(scenario: ScenarioModel, feeder: Feeder) -> Sensitivity:
    """Return the sensitivities of the plant on droop alone at the end of the first event's window.

    Raises
    ------
    LoadError
        If the plant has no solution there.
    """
    config, _ = configs(scenario, feeder, next(iter(scenario.cases)))
    rated = {row.name: row.P_rated for row in feeder.inverters}
    nominal = {row.name: row.V_nom for row in feeder.inverters}
    names = tuple(row.name for row in feeder.inverters)
    try:
        plant = plant_in_first_window(scenario, config)
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


def plant_in_first_window(scenario: ScenarioModel, config: PlantConfig) -> Plant:
    """Return the plant on droop alone, gone on to the last tick before the second event, or to the end of the run.

    Raises
    ------
    PlantError
        If it has no solution on the way.
    """
    end = scenario.events[1].t_s if len(scenario.events) > 1 else scenario.time.end_s
    plant = build_plant(config)
    _rest(plant, math.floor(end / config.T_c + 1e-9) - plant.tick)
    return plant


def _rest(plant: Plant, ticks: int) -> None:
    for _ in range(ticks):
        plant.advance()
    raise_for_trip(plant.take_events())


@dataclass(frozen=True, kw_only=True)
class VarModes:
    """Modes of V_set under the law."""

    settling_s: float
    """Time (s) to 2 % of the slowest mode; infinite if one does not decay."""
    spectral_radius: float
    """Largest magnitude of an eigenvalue (1), those of what never moves left out; below 1 it is stable."""


def var_modes(fleet: InverterGroup, plant: Sensitivity, *, local: int = 0, link: int = 0) -> VarModes:
    """Return the modes of the law for voltage and vars.

    Parameters
    ----------
    fleet : InverterGroup
        Its inverters must be among those of the sensitivities.
    plant : Sensitivity
        From `scenarios.predict.vars.sensitivity`.
    local, link : int, optional
        Delays in control periods: of measurement or set-point, and of the links beyond the one period they always take.

    Raises
    ------
    ValueError
        If an inverter is not among the sensitivities.

    Examples
    --------
    Two terminals whose vars answer to the difference of their set-points:

    >>> pair = InverterGroup(names=("a", "b"), GFM=np.array([True, False]), A=1.0 - np.eye(2))
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


def var_delay_limit(fleet: InverterGroup, plant: Sensitivity, *, longest_s: float = 1.0) -> float:
    """Return the longest delay (s) of measurements or set-points up to which the law for voltage and vars is stable.

    A multiple of T_c; infinite if none up to `longest_s` makes it unstable, not a number if it is unstable without.
    """
    for n in range(round(longest_s / fleet.T_c) + 1):
        if var_modes(fleet, plant, local=n).spectral_radius >= 1.0 - 1e-12:
            return (n - 1) * fleet.T_c if n else math.nan
    return math.inf


def factors(fleet: InverterGroup) -> tuple[Floats, Floats]:
    """Return the factors of z - z_bar and of v - 1 of each inverter, by the law itself, alpha in full."""
    gains, T, each = fleet.gains, fleet.T_c, zip(fleet.GFM, fleet.leads, fleet.degree.tolist(), strict=True)
    weights = [(gains.alpha * leads, gains.beta_GFM if GFM else gains.beta_GFL, d) for GFM, leads, d in each]
    a, b = np.array([V_factors(alpha, beta, d, k_q=gains.k_q, T=T) for alpha, beta, d in weights]).T
    return a, b


def _map(fleet: InverterGroup, plant: Sensitivity, local: int, link: int) -> Floats:
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
