"""Small circuits for the plant's checks: a stiff bus, a lone inverter, two inverters."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from gridpeers.plant.dynamics import Circuit, Dynamics, Inverter
from gridpeers.plant.dynamics.circuit import LoadLaw
from gridpeers.plant.dynamics.kernel.compiled import Complex
from gridpeers.plant.inverters.gfl import Gfl
from gridpeers.plant.inverters.gfm_droop import GfmDroop
from gridpeers.plant.inverters.inverter_model import InverterModel, Method

S_B = 200e3
V_B = 277.1363
Z_B = V_B**2 / (S_B / 3.0)
A = np.exp(2j * np.pi / 3.0)
BALANCED = np.array([1.0, A**2, A])

GFM_D = GfmDroop(R_f=0.01, X_f=0.15, P_max=1.5, k_ip=30.0)  # GridLAB-D's defaults
GFM_A = GfmDroop(R_f=0.014, X_f=0.1636, P_max=1.5, k_ip=30.0)  # The same with the autotest's filter
GFL_D = Gfl(
    F_current=0.0, frequency_watt=False, volt_var=False, T_ff=0.1, T_pf=0.5, T_vf=0.05, T_qf=0.2, S_max=1.0, i_max=1.0
)
"""GridLAB-D's defaults."""

NONE = np.zeros(0, np.complex128)


def inverter(parameters: InverterModel, *, m_p: float = 0.01, m_q: float = 0.05) -> Inverter:
    """Make an inverter of 200 kVA."""
    return Inverter(
        name=parameters.kind, kind=parameters.kind, S_b=S_B, V_b=V_B, m_p=m_p, m_q=m_q, parameters=parameters
    )


def circuit(
    Y: NDArray[np.complex128], terminals: list[list[int]], *, source: NDArray[np.complex128] | None = None
) -> Circuit:
    """Make a circuit without load branches; `source` holds nodes 0 to 2."""
    n = Y.shape[0]
    return Circuit(
        Y=sp.csc_array(Y),
        sources=np.arange(3 if source is not None else 0),
        source_voltage=NONE if source is None else source,
        terminals=np.array(terminals, np.int64),
        C=sp.csc_array((n, 0)),
        loads=LoadLaw(S=NONE, I0=NONE),
        V_branch=NONE,
    )


def on_stiff_bus(
    parameters: InverterModel, *, h: float = 0.002, method: Method = "first-order", **droops: float
) -> Dynamics:
    """One inverter at an infinite bus of 1 pu, at rest at p = q = 0."""
    bus = circuit(np.zeros((3, 3), complex), [[0, 1, 2]], source=V_B * BALANCED)
    return at_rest(bus, parameters, h=h, method=method, **droops)


def lone(parameters: GfmDroop, p: float, *, h: float = 0.002) -> Dynamics:
    """One GFM with a resistive load of p at 1 pu, at rest."""
    return at_rest(loaded(p), parameters, h=h)


def loaded(p: float) -> Circuit:
    """One terminal with a resistive load of p at 1 pu."""
    return circuit(np.eye(3, dtype=complex) * p / Z_B, [[0, 1, 2]])


def at_rest(
    network: Circuit, parameters: InverterModel, *, h: float, method: Method = "first-order", **droops: float
) -> Dynamics:
    dynamics = Dynamics(network, (inverter(parameters, **droops),), h, method=method)
    dynamics.start(np.zeros(1), np.zeros(1))
    return dynamics


def move_source(dynamics: Dynamics, source: NDArray[np.complex128]) -> None:
    """Let the stiff bus jump to other phasors (V)."""
    dynamics.connect(replace(dynamics.network.circuit, source_voltage=source))


def pair(first: GfmDroop, second: GfmDroop, load: float) -> Dynamics:
    """Two GFM joined by 0.0002 + j0.0004 pu, resistive load in the middle, at rest."""
    y = 1.0 / ((0.0001 + 0.0002j) * Z_B)
    Y = np.zeros((9, 9), complex)
    for phase in range(3):
        a, b, c = phase, 3 + phase, 6 + phase
        for end in (a, b):
            Y[end, end] += y
            Y[c, c] += y
            Y[end, c] -= y
            Y[c, end] -= y
        Y[c, c] += load / Z_B
    network = circuit(Y, [[0, 1, 2], [3, 4, 5]])
    dynamics = Dynamics(network, (inverter(first), inverter(second)), 0.002)
    dynamics.start(np.full(2, load / 2.0), np.zeros(2))
    return dynamics


def by_name(record: NDArray[np.void]) -> SimpleNamespace:
    """Return a record's values as attributes: a pass of a model takes them, called as a function of Python."""
    return SimpleNamespace(**{name: record[name].item() for name in record.dtype.names or ()})


def at_terminal(V: Complex, J: Complex, y_f: complex, P_set: float, V_set: float, Q_set: float) -> SimpleNamespace:
    """Return what a pass finds at a terminal of V (V) and J (A), of `S_B` and `V_B`; set-points in pu."""
    I = J - y_f * V  # noqa: E741
    S = np.sum(V * np.conj(I)) / S_B
    phases = {
        f"{q}_{phase}": complex(x)
        for q, of in (("V", V), ("I", I), ("J", J))
        for phase, x in zip("ABC", of, strict=True)
    }
    set_points = {"P_set": P_set, "V_set": V_set, "Q_set": Q_set}
    return SimpleNamespace(P=S.real, Q=S.imag, V=float(np.mean(np.abs(V))) / V_B, **set_points, **phases)


def injections(t: SimpleNamespace) -> Complex:
    return np.array([t.J_A, t.J_B, t.J_C])
