r"""The plant as the secondary law feels it: one frequency per island, droops, and the lags between them. Linear.

Everything is a pu frequency: set-points y = m_p P_set, powers pi = m_p p, the load l = P_load / sum (s_i/m_i). With w_i
as `InverterGroup.weight`, the GFM (set F) share the rest of the load so that all have the same frequency:

.. math:: w_F e = \sum_F w_i y_i - u, \qquad T_p \dot u = l - \sum_{GFL} w_j \pi_j - u

where u is what the GFM's filtered powers add up to. A GFL sees e through its PLL and its frequency filter, and its
power lags (inverter-models.md sections 3 and 4):

.. math:: \dot\delta = e - f, \quad f = k_p \delta + \zeta, \quad \dot\zeta = k_i \delta, \quad
          T_{ff} \dot\phi = f - \phi, \quad T_{pf} \dot\pi_j = y_j - \phi - \pi_j

Left out: power limits, voltages (loads are constant power), the angles' swing among the GFM, current controllers,
dead bands. Without the lags ("quasi-steady") e = sum w_i y_i - l, docs/theory.md's plant.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import expm

from gridpeers.lab.predict.inverter_group import InverterGroup
from gridpeers.plant.equipment.inverter_parameters import GfmParameters
from gridpeers.scenarios.results.history import Floats

PlantModel = Literal["lagged", "quasi-steady"]


@dataclass(frozen=True, kw_only=True)
class Response:
    """Plant between two ticks: x(k+1) = A x(k) + B u(k) + E l, and at tick k e = C x + D u + F l with u of before.

    Powers: pi = C_p x + D_p u + F_p l in the same way. With N inverters and n states, A is n x n, B n x N, C_p N x n.
    """

    A: Floats
    B: Floats
    E: Floats
    C: Floats
    D: Floats
    F: float
    C_p: Floats
    D_p: Floats
    F_p: Floats

    def rest(self, u: Floats, load: float) -> Floats:
        """Return the state in which the plant stands still under set-points u and a load (both pu frequency)."""
        return np.asarray(np.linalg.solve(np.eye(len(self.A)) - self.A, self.B @ u + self.E * load))


def response(inverters: InverterGroup, plant: PlantModel = "lagged") -> Response:
    if not inverters.GFM.any():
        raise ValueError(f"no GFM among {', '.join(inverters.names)}: their island has no voltage; give it one")
    return _quasi_steady(inverters) if plant == "quasi-steady" else _lagged(inverters)


def _quasi_steady(inverters: InverterGroup) -> Response:
    n, w = inverters.n, inverters.weight
    droops = [isinstance(it, GfmParameters) or it.frequency_watt for it in inverters.parameters]
    follows = np.array(droops, float)
    stiffness = float(w @ follows)
    D, F = w / stiffness, -1.0 / stiffness
    return Response(
        A=np.zeros((0, 0)),
        B=np.zeros((0, n)),
        E=np.zeros(0),
        C=np.zeros(0),
        D=D,
        F=F,
        C_p=np.zeros((n, 0)),
        D_p=np.eye(n) - np.outer(follows, D),
        F_p=-follows * F,
    )


def _lagged(inverters: InverterGroup) -> Response:
    n, w, gfl = inverters.n, inverters.weight, inverters.gfl
    forming, following = np.flatnonzero(inverters.GFM), np.flatnonzero(~inverters.GFM)
    w_F = float(w[forming].sum())
    locks = dict.fromkeys((it.k_pPLL, it.k_iPLL, it.T_ff) for it in gfl)  # GFL with equal ones see the same
    phi_of = {lock: 3 + 3 * k for k, lock in enumerate(locks)}
    u, first = 0, 1 + 3 * len(locks)
    size = first + following.size
    powers = first + np.arange(following.size)

    C, D = np.zeros(size), np.zeros(n)
    C[u], D[forming] = -1.0 / w_F, w[forming] / w_F

    A, B, E = np.zeros((size, size)), np.zeros((size, n)), np.zeros(size)
    A[u, u], A[u, powers], E[u] = -1.0, -w[following], 1.0
    A[u], E[u] = A[u] / inverters.T_p, E[u] / inverters.T_p
    for (k_p, k_i, T_ff), phi in phi_of.items():
        delta, zeta = phi - 2, phi - 1
        A[delta], B[delta] = C, D
        A[delta, delta] -= k_p
        A[delta, zeta] -= 1.0
        A[zeta, delta] = k_i
        A[phi, [delta, zeta, phi]] = k_p / T_ff, 1.0 / T_ff, -1.0 / T_ff
    for power, unit, it in zip(powers, following, gfl, strict=True):
        A[power, phi_of[it.k_pPLL, it.k_iPLL, it.T_ff]] = -1.0 / it.T_pf if it.frequency_watt else 0.0
        A[power, power] = -1.0 / it.T_pf
        B[power, unit] = 1.0 / it.T_pf

    whole = np.zeros((size + n + 1, size + n + 1))
    whole[:size] = np.hstack([A, B, E[:, None]])
    held = expm(whole * inverters.T_c)[:size]

    C_p, D_p = np.zeros((n, size)), np.zeros((n, n))
    C_p[forming], D_p[forming] = -C, -D
    D_p[forming, forming] += 1.0
    C_p[following, powers] = 1.0
    return Response(
        A=held[:, :size],
        B=held[:, size:-1],
        E=held[:, -1],
        C=C,
        D=D,
        F=0.0,
        C_p=C_p,
        D_p=D_p,
        F_p=np.zeros(n),
    )
