r"""Voltage and vars with the plant's own lags: its answer to a step of each V_set, and whether the law grows on it.

`vars` takes the plant as at rest at once, which is right for limits of the local loop (0.06 to 0.1 s) and wrong for
late links: there what decides are a few tenths of a second that the GFM's voltage controllers and the GFL's volt-var
take. So here the answer of q and v to V_set is the plant's own, tick by tick for 2 s, and the law

.. math:: V(k) = V(k-1) - a \big(z(k) - D^{-1} A\, z(k-1-n)\big) - b\, v(k), \quad z = m_q q

is followed from a random start; what is left after a while is its slowest mode, and its rate is told.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass

import numpy as np

from plant.dynamics import PlantError
from plant.equipment import Feeder
from plant.feeder import raise_for_trip
from scenarios.predict.inverter_group import InverterGroup
from scenarios.predict.load_steps import LoadError
from scenarios.predict.vars import STEP, factors, plant_in_first_window
from scenarios.results.history import Floats
from scenarios.schema import ScenarioModel
from scenarios.schema.configs import configs

LENGTH = 2.0
"""How long an answer is followed (s). What is left then is one in ten of the slowest inverter's, and slow."""

FOLLOWED = 20.0
"""How long the law is followed (s); its rate is that of the last half."""


@dataclass(frozen=True, kw_only=True)
class VarResponse:
    """How q and v of each inverter (row) answer to a pulse of V_set of each (column), at the ticks 1, 2, ... after."""

    names: tuple[str, ...]
    """Order of rows and columns."""
    q: Floats
    """pu per pu, shape (K, N, N)."""
    v: Floats
    """pu per pu, shape (K, N, N)."""


def var_response(scenario: ScenarioModel, feeder: Feeder) -> VarResponse:
    """Return the answers of the plant on droop alone, as it is at the end of the first event's window.

    Raises
    ------
    LoadError
        If the plant has no solution there.
    """
    config, _ = configs(scenario, feeder, next(iter(scenario.cases)))
    names, count = tuple(row.name for row in feeder.inverters), round(LENGTH / config.T_c)
    scale = {row.name: (row.P_rated, row.V_nom) for row in feeder.inverters}
    steps = np.zeros((count + 1, 2, len(names), len(names)))
    try:
        plant = plant_in_first_window(scenario, config)
        for column, name in enumerate(names):
            for sign in (1.0, -1.0):
                moved = copy.deepcopy(plant)
                here = moved.measure()[name]
                moved.hold(name, here.P_set, here.V_set + sign * STEP * scale[name][1])
                for k in range(1, count + 1):
                    moved.advance()
                    read = moved.measure()
                    told = [[read[of].Q / scale[of][0], read[of].V / scale[of][1]] for of in names]
                    steps[k, :, :, column] += sign * np.array(told).T / (2.0 * STEP)
                raise_for_trip(moved.take_events())
    except PlantError as error:
        raise LoadError(f"on droop alone: {error}") from error
    pulses = np.diff(steps, axis=0)
    return VarResponse(names=names, q=pulses[:, 0], v=pulses[:, 1])


def var_growth(fleet: InverterGroup, plant: VarResponse, *, link_delay_s: float = 0.0) -> float:
    """Rate (1/s) at which the law for voltage and vars grows, negative where it decays, over links that are late.

    Parameters
    ----------
    fleet : InverterGroup
        Its inverters must be among those of the answers.
    plant : VarResponse
        From `var_response`.
    link_delay_s : float, optional
        Delay of all agent-agent links (s).

    Raises
    ------
    ValueError
        If an inverter is not among the answers.

    Examples
    --------
    Two terminals whose vars answer at once to the difference of their set-points agree:

    >>> pair = InverterGroup(names=("a", "b"), GFM=np.array([True, False]), A=1.0 - np.eye(2))
    >>> at_once = np.zeros((100, 2, 2))
    >>> at_once[0] = 5.0 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    >>> var_growth(pair, VarResponse(names=("a", "b"), q=at_once, v=0.1 * np.abs(at_once))) < 0.0
    True
    """
    unknown = [name for name in fleet.names if name not in plant.names]
    if unknown:
        raise ValueError(f"no answer of {', '.join(unknown)}; there are {', '.join(plant.names)}")
    at = [plant.names.index(name) for name in fleet.names]
    n, K, T = fleet.n, len(plant.q), fleet.T_c
    late = max(0, math.ceil(link_delay_s / T - 1e-9) - 1)  # a state takes one period in any case
    z_of, v_of = (
        np.moveaxis(x[:, at][:, :, at] * by, 0, 1).reshape(n, K * n)
        for x, by in ((plant.q, fleet.m_q[None, :, None]), (plant.v, 1.0))
    )
    a, b = (np.where(fleet.acts, factor, 0.0) for factor in factors(fleet))
    mean = fleet.heard / np.maximum(fleet.degree, 1.0)[:, None]
    ticks = round(FOLLOWED / T)
    V, z = np.zeros((K + ticks + 1, n)), np.zeros((K + ticks + 1, n))
    V[K] = np.random.default_rng(1).normal(size=n)
    for k in range(K + 1, K + ticks + 1):
        past = V[k - K : k][::-1].ravel()
        z[k] = z_of @ past
        others = mean @ z[k - 1 - late] if k > late else 0.0
        V[k] = V[k - 1] - a * (z[k] - others) - b * (v_of @ past)
    moved = np.abs(np.diff(V[K:], axis=0)).max(axis=1)
    quarter = len(moved) // 4
    before, after = moved[quarter : 2 * quarter].max(), moved[3 * quarter :].max()
    return float(math.log(after / before) / (2 * quarter * T)) if after > 0.0 else -math.inf
