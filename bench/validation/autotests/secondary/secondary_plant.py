"""The secondary-control autotest in our plant: it closes the loop of the law; the machines are replayed."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from bench.validation.autotests.delta_header import START
from bench.validation.autotests.recorded_run import RecordedRun
from bench.validation.autotests.secondary.bus_frequency import BusFrequency
from bench.validation.autotests.secondary.default_impedances import with_impedances
from bench.validation.autotests.secondary.island_tables import INVERTERS, V_NOM, island_tables, write_tables
from bench.validation.autotests.secondary.machines import MACHINES, PHASES
from bench.validation.autotests.secondary.replayed_machines import ReplayedMachines
from bench.validation.autotests.secondary.secondary_case import (
    DEVICES,
    GFL,
    GFM,
    LEAST_OF_GEN4,
    SHARES,
    START_POWER,
    SWITCH,
    H,
)
from bench.validation.autotests.secondary.secondary_gridlabd import INJECTION, NODE
from bench.validation.autotests.secondary.secondary_law import Participant, SecondaryControl
from plant.dynamics import Inverter
from plant.equipment import InverterRow
from plant.equipment.imported_equipment import LinearElement
from plant.feeder.circuits import circuit_of
from plant.network import Network
from plant.tables import read_feeder

CONTROLLED = DEVICES.index("Gen1")
"""The device at the controller's bus."""


class SecondaryRun(NamedTuple):
    """Our run: one value a step, from the step on in which the load comes on."""

    S: NDArray[np.complex128]
    """Power of each of `DEVICES` (VA); of a machine in the first solution of the step, where GridLAB-D reads it."""
    f: NDArray[np.float64]
    """Frequency of each inverter (Hz)."""
    f_bus: NDArray[np.float64]
    """Frequency measured at the controller's bus (Hz)."""
    offset: NDArray[np.float64]
    """How far each of `SHARES` is moved (pu)."""


class SecondaryPlant:
    """Our plant with the controller.

    Parameters
    ----------
    theirs
        GridLAB-D's run: where to start, and the machines' injections.
    """

    def __init__(self, theirs: RecordedRun) -> None:
        J = [np.array([values[NODE[name], INJECTION] for name in MACHINES]).T for values in theirs]
        self._J_after, self._J_between = J
        self._network = _network()
        self._dynamics = _dynamics(self._network)
        V = {name: [theirs.after[NODE[name], f"voltage_{phase}"][0] for phase in "ABC"] for name in DEVICES}
        self._start({name: np.array(phasors) for name, phasors in V.items()})

    def run(self) -> SecondaryRun:
        """Connect the load and run to the end of GridLAB-D's run."""
        loaded = circuit_of(self._network, self._network.closed0 | {SWITCH}, self._network.loads())
        self._dynamics.connect(loaded)
        steps = [self._step(k) for k in range(1, len(self._J_after))]
        return SecondaryRun(*(np.array(column) for column in zip(*steps, strict=True)))

    def _start(self, V: Mapping[str, NDArray[np.complex128]]) -> None:
        """Find the equilibrium: the first GFM holds GridLAB-D's phasors, and all else delivers what it does there."""
        dynamics, J = self._dynamics, self._J_after[0]
        S = dict(START_POWER)
        for i, name in enumerate(MACHINES):  # to their admittances and to the network together
            S[name] = complex(np.vdot(J[i] * PHASES, V[name]))
        power = np.array([S[name] for name in DEVICES]) / dynamics.inverters.S_b
        dynamics.start(power.real, power.imag, swing_voltage=V["Inv2"] / V_NOM)
        dynamics.release()
        self._inverters = dict(START_POWER)
        self._machines = self._machine_powers(J)
        P_set0 = {**_per_unit(START_POWER), **_per_unit(self._machines)}
        participants = {
            name: Participant(share, _rating(name) / 1e6, P_set0[name], LEAST_OF_GEN4 if name == "Gen4" else 0.0)
            for name, share in SHARES.items()
        }
        self._clock = START + 1.0
        self._control = SecondaryControl(participants, self._clock)
        self._P_set0 = P_set0
        self._V_bus = dynamics.inverters.V[CONTROLLED].copy()
        self._frequency = BusFrequency(self._V_bus, H)
        self._frequency.measure(self._V_bus)  # GridLAB-D's first step, at rest

    def _step(self, k: int) -> tuple[list[complex], list[float], float, list[float]]:
        f_bus = self._frequency.measure(self._V_bus)
        self._control.predict((self._clock + k * H) + H, f_bus, self._megawatts())
        self._solve(self._J_after[k - 1], second=False)
        self._machines = self._machine_powers(self._J_after[k - 1])
        self._control.correct(f_bus, self._megawatts())
        f = self._solve(self._J_between[k], second=True)
        self._V_bus = self._dynamics.inverters.V[CONTROLLED].copy()
        S = [*self._inverters.values(), *self._machines.values()]
        return S, f, f_bus, list(self._control.offsets.values())

    def _solve(self, J: NDArray[np.complex128], *, second: bool) -> list[float]:
        """Take one network solution with the present set-points; returns the inverters' frequencies (Hz)."""
        for i, name in enumerate(START_POWER):
            if name in SHARES:
                self._dynamics.inverters.set_points[i, 0] = self._P_set0[name] + self._control.offsets[name]
        readings = self._dynamics.solve(J[:, None] * PHASES, second=second)
        self._inverters = {name: complex(*readings[i, 1:3]) for i, name in enumerate(START_POWER)}
        return [float(f) for f in readings[: len(START_POWER), 0]]

    def _machine_powers(self, J: NDArray[np.complex128]) -> dict[str, complex]:
        V = self._dynamics.inverters.V[len(START_POWER) :]
        return {name: machine.power(V[i], J[i]) for i, (name, machine) in enumerate(MACHINES.items())}

    def _megawatts(self) -> dict[str, float]:
        return {name: S.real / 1e6 for name, S in {**self._inverters, **self._machines}.items()}


def _rating(name: str) -> float:
    """Return the rating (VA) of a device."""
    return MACHINES[name].S_rated if name in MACHINES else INVERTERS[name][2] * 1e3


def _per_unit(S: Mapping[str, complex]) -> dict[str, float]:
    return {name: value.real / _rating(name) for name, value in S.items()}


def _network() -> Network:
    """Return the network with the machines' admittances, and with the machines as its last inverters."""
    with tempfile.TemporaryDirectory() as folder:
        write_tables(island_tables(), Path(folder))
        feeder = read_feeder(folder)
    nodes = {name: tuple((machine.bus, phase) for phase in "ABC") for name, machine in MACHINES.items()}
    elements = tuple(
        LinearElement(name=name, nodes=nodes[name], Y=tuple(map(tuple, machine.admittance().tolist())))
        for name, machine in MACHINES.items()
    )
    rows = tuple(
        InverterRow(
            name=name, kind="GFL", bus=machine.bus, microgrid="", P_rated=machine.S_rated, V_nom=V_NOM, m_p=1.0, m_q=1.0
        )
        for name, machine in MACHINES.items()
    )
    feeder = replace(feeder, source=None, elements=elements, inverters=feeder.inverters + rows)
    return Network(with_impedances(feeder), line_charging=False)


def _dynamics(network: Network) -> ReplayedMachines:
    units = tuple(
        Inverter(
            name=row.name,
            kind=row.kind,
            S_b=row.P_rated,
            V_b=row.V_nom,
            m_p=row.m_p,
            m_q=row.m_q,
            parameters=GFM if row.kind == "GFM" else GFL,
        )
        for row in network.inverters
    )
    return ReplayedMachines(circuit_of(network, network.closed0, network.loads()), units, len(MACHINES), H)
