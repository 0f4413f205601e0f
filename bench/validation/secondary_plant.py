"""GridLAB-D's secondary-control autotest in our plant: it closes the loop of the law; the machines are replayed.

The law is GridLAB-D's secondary frequency control (`sec_control`): one controller for the island, as its source defines
it. From the frequency f at its bus and the powers P_i of its participants it forms the error (MW)

    e = B (f_nom - f) - sum_i (P_set,i - P_i),

f within a dead band giving no error of frequency. At every sample, T apart, an integrator with anti-windup takes

    x' = k_i e - (1 - u) y,

u being 1 where the output is published and f outside of the dead band, else 0, and y the integrator's value at the
sample before. At every publication, T_s apart, participant i's set-point is moved by alpha_i x, within its limits. Like
everything in GridLAB-D's delta mode it acts in both passes of a step, as predictor and as corrector (Heun).
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from bench.validation.delta_mode import START, RecordedRun
from bench.validation.secondary_feeder import INVERTERS, V_NOM, island_tables, with_impedances, write_tables
from bench.validation.secondary_gridlabd import (
    AUTOTEST,
    DEVICES,
    GFL,
    GFM,
    INJECTION,
    LEAST_OF_GEN4,
    MACHINES,
    NODE,
    PHASES,
    SHARES,
    START_POWER,
    SWITCH,
    H,
    SecondarySettings,
)
from bench.validation.validation_part import inverter_row
from gridpeers.plant.dynamics import Circuit, Dynamics, Inverter
from gridpeers.plant.dynamics.kernel.controller_pass import READING, advance_inverters, keep_start, turn_frames
from gridpeers.plant.dynamics.kernel.step import solve_within_limits
from gridpeers.plant.dynamics.live_network import TOLERANCE
from gridpeers.plant.equipment.imported_equipment import LinearElement
from gridpeers.plant.feeder.circuits import circuit_of
from gridpeers.plant.network import Network
from gridpeers.plant.tables import read_feeder


class Participant(NamedTuple):
    """An inverter or a machine whose set-point is moved."""

    share: float
    """alpha: its share of the output."""
    P_rated: float
    """Rating (MW), base of its per-unit values."""
    P_set0: float
    """Set-point at the start (pu)."""
    P_min: float = 0.0
    """Least set-point (pu)."""
    P_max: float = 1.0
    """Largest set-point (pu), and largest distance from the start."""


class SecondaryControl:
    """The controller between two steps.

    `start` is GridLAB-D's clock at the first step (s): when a sample is due is decided by rounding at this magnitude.
    `offsets`: change of each participant's set-point (pu).
    """

    def __init__(
        self, participants: Mapping[str, Participant], start: float, settings: SecondarySettings = AUTOTEST
    ) -> None:
        self._participants, self._settings = participants, settings
        self._next_sample, self._next_publication = start + settings.T, start + settings.T_s
        self.offsets = dict.fromkeys(participants, 0.0)
        self._moved = dict.fromkeys(participants, 0.0)
        self._integral = self._slope = self._shortfall = 0.0
        self._sampling = self._publishing = False

    def predict(self, end: float, f: float, P: Mapping[str, float]) -> None:
        """Act in the first pass of the step that ends at `end` (s), from the frequency (Hz) and the powers (MW)."""
        self._sampling, self._publishing = end >= self._next_sample, end >= self._next_publication
        self._next_sample += self._settings.T if self._sampling else 0.0
        self._next_publication += self._settings.T_s if self._publishing else 0.0
        if self._sampling:
            self._slope, publish = self._evaluate(f, P)
            self._move(self._integral + self._settings.T * self._slope, publish, second=False)

    def correct(self, f: float, P: Mapping[str, float]) -> None:
        """Act in the second pass of the same step."""
        if self._sampling:
            slope, publish = self._evaluate(f, P)
            self._integral += self._settings.T / 2.0 * (self._slope + slope)
            self._move(self._integral, publish, second=True)

    def _evaluate(self, f: float, P: Mapping[str, float]) -> tuple[float, bool]:
        """Return the integrator's slope (MW/s), and whether its value is published."""
        settings = self._settings
        error = settings.f_nom - f
        outside = abs(error) > settings.dead_band
        if self._publishing:
            self._shortfall = sum(
                (each.P_set0 + self.offsets[name]) * each.P_rated - P[name] for name, each in self._participants.items()
            )
        publish = self._publishing and outside
        slope = settings.k_i * (settings.bias * (error if outside else 0.0) - self._shortfall)
        return slope - (0.0 if publish else self._integral), publish

    def _move(self, x: float, publish: bool, *, second: bool) -> None:
        """Move the set-points by x (MW) in all; the second pass replaces what the first did."""
        for name, each in self._participants.items():
            wanted = each.share * x / each.P_rated if publish else 0.0
            before = self.offsets[name]
            after = before + wanted - (self._moved[name] if second else 0.0)
            after = min(max(after, -each.P_max), each.P_max)
            after = min(max(after, each.P_min - each.P_set0), each.P_max - each.P_set0)
            self.offsets[name], self._moved[name] = after, after - before


F_NOM = 60.0
K_P, K_I = 10.0, 100.0
"""Gains (rad/s per rad, rad/s^2 per rad): the defaults of GridLAB-D's nodes."""


class BusFrequency:
    """Three phase-locked loops that start locked at nominal frequency to phasors of a bus (V); `h` is the step (s)."""

    def __init__(self, V: NDArray[np.complex128], h: float) -> None:
        self._h, self._theta, self._w = h, np.angle(V), np.zeros(3)

    def measure(self, V: NDArray[np.complex128]) -> float:
        """Return the frequency (Hz) during a step, from the phasors (V) at the end of the step before."""
        error = np.imag(V * np.exp(-1j * self._theta)) / np.abs(V)
        w = K_P * error + self._w
        self._w = self._w + K_I * error * self._h
        self._theta = self._theta + w * self._h
        return float(F_NOM + w.mean() / (2.0 * np.pi))


class ReplayedMachines(Dynamics):
    """Dynamics that a caller takes from one network solution to the next.

    A machine is an inverter without a controller: whatever its injection is when the network is solved, it stays. The
    last `machines` of the inverters are machines, as current sources; their admittances are part of the circuit.
    """

    def __init__(self, circuit: Circuit, inverters: tuple[Inverter, ...], machines: int, h: float) -> None:
        super().__init__(circuit, inverters, h)
        self._machines = machines

    def solve(self, J: NDArray[np.complex128], *, second: bool) -> NDArray[np.float64]:
        """Solve the network with the machines' injections J (A, machines x 3), and pass the inverters' controllers.

        Readings are those of `Dynamics.run`, of this solution; 0 for the machines.
        """
        units, network, net = self.inverters, self.network, self.network.net
        n = len(units)
        arrays = self.arrays()
        controlled = arrays.online & (np.arange(n) < n - self._machines)  # only `start` needs the machines' controllers
        arrays = arrays._replace(online=controlled)
        if not second:
            keep_start(arrays)
        units.J[n - self._machines :] = J
        rotation = np.empty(net.leader.size, complex)
        turn_frames(arrays, net, rotation)
        tolerance, I_b = TOLERANCE * float(units.V_b.max()), np.empty(net.S.size, complex)
        if solve_within_limits(net, arrays, rotation, network.x, I_b, tolerance) < 0:
            raise RuntimeError("the network has no solution with the replayed machines")
        out = np.zeros((n, READING))
        advance_inverters(arrays, self.h, second, out)
        return out


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
    """Our plant with the controller, from where GridLAB-D's run starts, and with its machines' injections."""

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
        inverter_row(name, "GFL", machine.bus, machine.S_rated, V_NOM, m_p=1.0, m_q=1.0)
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
