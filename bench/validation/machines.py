"""The four diesel machines of GridLAB-D's secondary-control autotest.

The plant has no machines. GridLAB-D simulates them (`diesel_dg`); for the plant each is its Norton equivalent: the
admittance behind its subtransient reactances, and an injection that is replayed from GridLAB-D's run.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from plant.gridlabd.model.glm_block import block

RATED_V = 4156.0
"""V, line-to-line."""

Z_0, Z_2 = 0.005 + 0.05j, 0.0072 + 0.254j
"""Impedances of zero and negative sequence (pu), those of the class."""

PHASES = np.exp(-2j * np.pi / 3.0 * np.arange(3))

Properties = dict[str, str | float]

MACHINE: Properties = {
    "flags": "DELTAMODE",
    "Rated_V": RATED_V,
    "overload_limit": 1.0,
    "Gen_type": "DYN_SYNCHRONOUS",
    "rotor_speed_convergence": 1e-12,
    "inertia": 0.553286,
    "damping": 0.0,
    "Ra": 0.006543,
    "Ta": 0.05,
    "Xl": 0.066,
    "Xd": 1.77,
    "Xq": 1.052,
    "Xdp": 0.128,
    "Xqp": 0.2232003883,
    "Xdpp": 0.107,
    "Xqpp": 0.189,
    "Tdop": 1.748986,
    "Tqop": 0.448458,
    "Tdopp": 0.017013,
    "Tqopp": 0.016817,
    "Exciter_type": "SEXS",
    "SEXS_mode": "Q_V_DROOP",
    "SEXS_Q_V_droop": 0.05,
    "Vset_QV_droop": 1.0,
    "TA": 0.01,
    "TB": 0.02,
    "TC": 0.08,
    "KA": 50.0,
    "Vset": 1.0,
}

GOVERNOR: Properties = {
    "Governor_type": "GGOV1",
    "GGOV1_Load_Limit_enable": "false",
    "GGOV1_Acceleration_Limit_enable": "false",
    "GGOV1_PID_enable": "true",
    "GGOV1_R": 0.05,
    "GGOV1_Rselect": 1,
    "GGOV1_Tpelec": 1.0,
    "GGOV1_maxerr": 0.05,
    "GGOV1_minerr": -0.05,
    "GGOV1_Kpgov": 2.5,
    "GGOV1_Kigov": 6.5,
    "GGOV1_Kdgov": 0.0,
    "GGOV1_Tdgov": 1.0,
    "GGOV1_vmax": 1.0,
    "GGOV1_vmin": 0.15,
    "GGOV1_Tact": 0.05,
    "GGOV1_Kturb": 1.5,
    "GGOV1_wfnl": 0.2,
    "GGOV1_Tb": 0.01,
    "GGOV1_Tc": 0.2,
    "GGOV1_Fuel_lag": 1,
    "GGOV1_Teng": 0.0,
    "GGOV1_Tfload": 3.0,
    "GGOV1_Kpload": 2.0,
    "GGOV1_Kiload": 0.67,
    "GGOV1_Ldref": 1.0,
    "GGOV1_Dm": 0.0,
    "GGOV1_ropen": 50.0,
    "GGOV1_rclose": -50.0,
    "GGOV1_Kimw": 0.0,
    "GGOV1_Pmwset": 3.0,
    "GGOV1_aset": 0.01,
    "GGOV1_Ka": 10.0,
    "GGOV1_Ta": 0.1,
    "GGOV1_db": 0.0,
    "GGOV1_Tsa": 4.0,
    "GGOV1_Tsb": 5.0,
}


class Machine(NamedTuple):
    """A machine."""

    bus: str
    """Its bus."""
    S_rated: float
    """Rating (VA)."""
    S_start: complex
    """Power of each phase at the start (VA); that of the first, which holds the voltage, is a first guess."""
    own: Mapping[str, str | float]
    """Its properties beside those of `MACHINE`."""

    @property
    def properties(self) -> dict[str, str | float]:
        """All its properties, by GridLAB-D's names."""
        return {**MACHINE, **self.own}

    def admittance(self) -> NDArray[np.complex128]:
        """Return the admittance of its Norton equivalent (S, 3 x 3)."""
        base = RATED_V**2 / self.S_rated
        Z_1 = complex(float(self.properties["Ra"]), float(self.properties["Xdpp"]))
        sequences = np.column_stack([np.ones(3), PHASES, PHASES.conj()])
        Y: NDArray[np.complex128] = sequences @ np.diag(1.0 / (np.array([Z_0, Z_1, Z_2]) * base)) @ sequences.conj().T
        return Y / 3.0

    def power(self, V: NDArray[np.complex128], J: complex) -> complex:
        """Return what it delivers (VA) at its terminal's voltages (V) with its injection of phase A (A)."""
        return complex(np.vdot(J * PHASES - self.admittance() @ V, V))


MACHINES = {
    "Gen1": Machine("150", 3e6, 30e3 + 3e3j, GOVERNOR),
    "Gen2": Machine("50", 120e3, 26e3 + 20e3j, GOVERNOR),
    "Gen3": Machine(
        "300",
        500e3,
        0j,
        {
            "Ta": 0.06,
            "Xl": 0.016,
            "Xd": 1.67,
            "Xq": 1.082,
            "Xdp": 0.148,
            "Xqp": 0.2432003883,
            "TB": 0.03,
            "TC": 0.07,
            "KA": 45.0,
            **GOVERNOR,
            "Governor_type": "P_CONSTANT",
            "GGOV1_Tc": 0.0,
        },
    ),
    "Gen4": Machine(
        "197",
        500e3,
        110e3 + 62667j,
        {
            "Ra": 0.006743,
            "Ta": 0.062,
            "Xl": 0.074,
            "Xd": 1.69,
            "Xq": 1.084,
            "Xdp": 0.143,
            "Xdpp": 0.117,
            "Xqpp": 0.159,
            "Tdop": 1.648986,
            "Tdopp": 0.013013,
            "Tqopp": 0.018817,
            "TB": 0.03,
            "TC": 0.07,
            "KA": 45.0,
            **{key: value for key, value in GOVERNOR.items() if not key.endswith("_enable")},
            "GGOV1_R": 0.1,
            "GGOV1_Kigov": 6.0,
            "GGOV1_Tc": 0.0,
        },
    ),
}


def machine_blocks() -> list[str]:
    """Return the machines as GridLAB-D objects."""
    return [
        block(
            "diesel_dg",
            name=name,
            parent=f"n{machine.bus}",
            Rated_VA=machine.S_rated,
            **{f"power_out_{phase}": machine.S_start for phase in "ABC"},
            **machine.properties,
        )
        for name, machine in MACHINES.items()
    ]
