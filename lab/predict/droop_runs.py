r"""Runs of the scenario's own plant on droop alone: the load of each event, and the law (14), (15) on its vars.

**Loads of events** (`load_steps`). Without agents and messages the plant runs through the events once (a second or
so). At the end of each window its inverters deliver the load that control has to share. It is the load at the voltages
of droop, a percent or two off the load at restored voltages.

**Voltage and vars** (`var_response`): q and v of every inverter, tick by tick for 2 s, after a step of each V_set. With
the factors a_i, b_i of `gridpeers.agents.laws.consensus.V_factors` two questions are asked of it.

**Modes**, as if the plant were at rest at once (`var_spectral_radius`, `var_delay_limit`). With q = S V_set and
v = H V_set at the end of the response the law is

.. math:: V(k) = V(k-1) - a \big(m_q S\, V(k-1-l) - D^{-1} A\, m_q S\, V(k-2-l)\big) - b H\, V(k-1-l)

where l is the delay of the local loop (measurement or set-point): a neighbour's var is always one period older than the
own, as it is measured at its sender's tick. The beta part is a consensus on m_q q through S;
alpha couples it to the voltages of the GFM. Right for limits of the local loop (0.06 to 0.1 s).

**Growth** with the plant's lags (`var_growth`). Over late links the few tenths of a second decide that the GFM's
voltage controllers and the GFL's volt-var take. So the law

.. math:: V(k) = V(k-1) - a \big(z(k) - D^{-1} A\, z(k-1-n)\big) - b\, v(k), \quad z = m_q q

with n ticks of link delay is followed from a random start on the plant's tick-by-tick response; the last seconds show
its slowest mode.
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass

import numpy as np

from gridpeers.agents.laws.consensus import V_factors
from gridpeers.lab.predict.inverter_group import InverterGroup
from gridpeers.lab.predict.linear_model import AT_REST
from gridpeers.lab.predict.times import LoadStep
from gridpeers.plant.build import build_plant
from gridpeers.plant.equipment import Tables
from gridpeers.plant.feeder import GRID, Plant, raise_for_trip
from gridpeers.scenarios.results.history import Floats
from gridpeers.scenarios.schema import ScenarioModel
from gridpeers.scenarios.schema.configs import configs
from gridpeers.scenarios.schema.participants import inverters_of

STEP = 0.002  # By how much a V_set is moved (pu): far above rounding, far below where loads and droops bend
LENGTH = 2.0  # Length of a response (s). After it a tenth of the slowest inverter's change is left, and slow.
FOLLOWED = 20.0  # Time for which the law is followed (s); its rate is that of the last half


@dataclass(frozen=True, kw_only=True)
class VarResponse:
    """How q and v of each inverter (row) answer to a pulse of V_set of each (column), at the ticks 1, 2, ... after."""

    names: tuple[str, ...]
    q: Floats
    """pu per pu, shape (K, N, N)."""
    v: Floats
    """pu per pu, shape (K, N, N)."""

    @property
    def S(self) -> Floats:
        """Dq / dV_set (pu per pu), N x N, with the plant at rest."""
        return np.asarray(self.q.sum(axis=0))

    @property
    def H(self) -> Floats:
        """Dv / dV_set (pu per pu), N x N, with the plant at rest."""
        return np.asarray(self.v.sum(axis=0))


def var_response(scenario: ScenarioModel, feeder: Tables) -> VarResponse:
    """Return the response of the plant on droop alone at the end of the first event's window."""
    config, _ = configs(scenario, feeder, next(iter(scenario.cases)))
    end = scenario.events[1].t_s if len(scenario.events) > 1 else scenario.time.end_s
    names, count = tuple(row.name for row in feeder.inverters), round(LENGTH / config.T_c)
    scale = np.array([[row.P_rated, row.V_nom] for row in feeder.inverters])
    steps = np.zeros((count + 1, len(names), 2, len(names)))
    plant = build_plant(config)
    _advance(plant, math.floor(end / config.T_c + 1e-9) - plant.tick)
    for column, name in enumerate(names):
        for sign in (1.0, -1.0):
            moved = copy.deepcopy(plant)
            here = moved.measure()[name]
            moved.hold(name, here.P_set, here.V_set + sign * STEP * scale[column, 1])
            for k in range(1, count + 1):
                _advance(moved, 1)
                read = moved.measure()
                outputs = np.array([[read[of].Q, read[of].V] for of in names]) / scale
                steps[k, :, :, column] += sign * outputs / (2.0 * STEP)
    pulses = np.diff(steps, axis=0)
    return VarResponse(names=names, q=pulses[:, :, 0], v=pulses[:, :, 1])


def _advance(plant: Plant, ticks: int) -> None:
    for _ in range(ticks):
        plant.advance()
    raise_for_trip(plant.take_events())


def var_spectral_radius(inverters: InverterGroup, plant: VarResponse, *, local: int = 0) -> float:
    """Return the largest magnitude of an eigenvalue (1) of the law for voltage and vars; below 1 it is stable.

    `local` is the delay of measurement or set-point (control periods). Eigenvalues of set-points that the law never
    moves are left out.
    """
    at, free = [plant.names.index(name) for name in inverters.names], np.ix_(inverters.acts, inverters.acts)
    S, H = plant.S[np.ix_(at, at)], plant.H[np.ix_(at, at)]
    a, b = _factors(inverters)
    z = inverters.m_q[:, None] * S
    own = (a[:, None] * z + b[:, None] * H)[free]
    others = (a[:, None] * _mean_of_neighbours(inverters) @ z)[free]
    n, depth = len(own), local + 2
    blocks = np.zeros((depth, n, n))
    blocks[0] += np.eye(n)
    blocks[local] -= own
    blocks[local + 1] += others
    past = np.eye(n * depth, k=-n)  # V(k-1), V(k-2), ... of those that run the law
    past[:n] = np.hstack(list(blocks))
    values = np.linalg.eigvals(past)
    unmoved = int((np.linalg.svd(own - others, compute_uv=False) < AT_REST).sum())
    return float(np.abs(values[np.argsort(np.abs(values - 1.0))][unmoved:]).max(initial=0.0))


def var_delay_limit(inverters: InverterGroup, plant: VarResponse, *, longest_s: float = 1.0) -> float:
    """Return the longest delay (s) of measurements or set-points up to which the law for voltage and vars is stable.

    A multiple of T_c; infinite if none up to `longest_s` makes it unstable, not a number if it is unstable without.
    """
    for n in range(round(longest_s / inverters.T_c) + 1):
        if var_spectral_radius(inverters, plant, local=n) >= 1.0 - 1e-12:
            return (n - 1) * inverters.T_c if n else math.nan
    return math.inf


def _factors(inverters: InverterGroup) -> tuple[Floats, Floats]:
    """Return the factors of z - z_bar and of v - 1 of each inverter, by the law itself, alpha in full."""
    gains, T = inverters.gains, inverters.T_c
    each = zip(inverters.GFM, inverters.leads, inverters.degree.tolist(), strict=True)
    weights = [(gains.alpha * leads, gains.beta_GFM if GFM else gains.beta_GFL, d) for GFM, leads, d in each]
    a, b = np.array([V_factors(alpha, beta, d, k_q=gains.k_q, T=T) for alpha, beta, d in weights]).T
    return a, b


def _mean_of_neighbours(inverters: InverterGroup) -> Floats:
    return np.asarray(inverters.heard / np.maximum(inverters.degree, 1.0)[:, None])


def var_growth(inverters: InverterGroup, plant: VarResponse, *, link_delay_s: float = 0.0) -> float:
    """Return the rate (1/s) at which the law for voltage and vars grows over late links; negative where it decays."""
    at = [plant.names.index(name) for name in inverters.names]
    n, K, T = inverters.n, len(plant.q), inverters.T_c
    late = max(0, math.ceil(link_delay_s / T - 1e-9) - 1)  # a state takes one period in any case
    z_of, v_of = (
        np.moveaxis(x[:, at][:, :, at] * by, 0, 1).reshape(n, K * n)
        for x, by in ((plant.q, inverters.m_q[None, :, None]), (plant.v, 1.0))
    )
    a, b = (np.where(inverters.acts, factor, 0.0) for factor in _factors(inverters))
    mean = _mean_of_neighbours(inverters)
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


# -------------------------------------------------------------------- the load of each event


@dataclass(frozen=True, kw_only=True)
class IslandStep:
    label: str
    t_s: float
    roster: tuple[str, ...]
    members: tuple[str, ...]
    load: LoadStep | None


def load_steps(scenario: ScenarioModel, feeder: Tables) -> tuple[IslandStep, ...]:
    """Return the islands without the grid after each event, and their steps of load; PlantError if it has none."""
    config, _ = configs(scenario, feeder, next(iter(scenario.cases)))
    rating = {row.name: row.P_rated for row in inverters_of(scenario, feeder)}
    plant, T = build_plant(config), scenario.time.T_c_s
    on = set(plant.inverters) - set(config.settings.spares)
    ends = [event.t_s for event in scenario.events[1:]] + [scenario.time.end_s]
    before, found = _carried(plant, rating, on), []
    for event, end in zip(scenario.events, ends, strict=True):
        while (plant.tick + 1) * T <= end + 1e-9:
            if plant.tick == round(event.t_s / T):
                for name in (*event.leave, *event.join):
                    plant.connect(name, name in event.join)
                on = (on - set(event.leave)) | set(event.join)
            plant.advance()
        raise_for_trip(plant.take_events())
        after = _carried(plant, rating, on)
        roster = tuple(name for name in plant.inverters if name in on)
        for members, (load, connected) in after.items():
            if connected:
                continue
            former = [names for names in before if set(members) & set(names)]
            step = None
            if len(former) == 1:
                start, fed = before[former[0]]
                new = fed or former[0][0] != members[0]  # an island is known by its first inverter
                step = LoadStep(start_pu=start, load_pu=load, islanding=new, joining=event.join)
            found.append(IslandStep(label=event.label, t_s=event.t_s, roster=roster, members=members, load=step))
        before = after
    return tuple(found)


def _carried(plant: Plant, rating: dict[str, float], on: set[str]) -> dict[tuple[str, ...], tuple[float, bool]]:
    islands: dict[str, dict[str, float]] = {}
    for name, reading in plant.measure().items():
        if name in on:
            islands.setdefault(reading.island, {})[name] = reading.P
    return {
        tuple(P): (sum(P.values()) / sum(rating[name] for name in P), island == GRID) for island, P in islands.items()
    }
