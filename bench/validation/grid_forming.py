"""Part "grid-forming": the microgrid feeder as an island behind one grid-forming storage, in OpenDSS and in our plant.

The storage is at 480 V behind a delta-wye transformer: OpenDSS's grid-forming source needs one, because its two
engines give it different impedances of zero sequence, and with `conn=wye` neither gives what `conn=delta` means.
"""

from __future__ import annotations

import tempfile
from functools import cache
from math import sqrt
from pathlib import Path

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from bench.validation.opendss_engines import ENGINES, SolvedStates, solve_scripts
from bench.validation.validation_part import CaseResult, ToleranceCheck, ValidationPart, inverter_row
from bench.validation.write_opendss import LIMITS, write_opendss
from gridpeers.plant.dynamics import Circuit, Dynamics, Inverter
from gridpeers.plant.dynamics.circuit import aligned_sum
from gridpeers.plant.equipment import Bus, Source, Tables
from gridpeers.plant.equipment.imported_equipment import LinearElement
from gridpeers.plant.feeder.circuits import circuit_of
from gridpeers.plant.inverters.gfm_droop import GfmDroop
from gridpeers.plant.network import Network, solve_power_flow
from gridpeers.plant.tables import read_feeder

BUS, EMF = "gfm", "emf"
"""Bus of the storage, and behind its impedance."""

AT = "160"
"""Where the transformer meets the feeder."""

V_LL = 480.0
"""V, line-to-line, nominal voltage of the storage."""

S_RATED = 4e6
"""Rating of storage and transformer (VA)."""

Z_T = 0.005 + 0.05j
"""Impedance of the transformer (pu)."""

X_GFM = 1e-3 / sqrt(1.0625)
"""Reactance of OpenDSS's grid-forming source (pu): kV^2/kVA, taken as ohm; its resistance is a quarter of it."""

Z_GFM = complex(X_GFM / 4.0, X_GFM)

FLOATING = 1e-9
"""Shunt that keeps the floating delta side in the matrix (S)."""

ISLANDING, SHEDDING = "13-152", "60-160"
"""The switch that islands the feeder, and the one that then sheds a zone."""

STATES = (
    (f"open line.{ISLANDING} 1", "edit storage.gfm state=discharging controlmode=gfm"),
    ("set mode=dynamics stepsize=0.001 number=500",),
    (f"open line.{SHEDDING} 1", "set stepsize=1e-6 number=1"),
    ("set stepsize=0.001 number=500",),
)
"""Commands that lead to each state; each is solved twice.

Islanded snapshot; 1 s of dynamics from zero voltage; a zone is shed, 2 us later; 1 s later.
"""


def island_script(feeder: Tables) -> str:
    """Return the script, connected to the substation and with the storage idle.

    Loads become impedances below 0.85 pu, so that OpenDSS's start from zero voltage has solutions; in the states that
    are compared no voltage is that low.
    """
    rating = f"{S_RATED / 1e3!r}"
    kV = V_LL / 1e3
    V_nom = {bus.name: bus.V_nom for bus in feeder.buses}[AT] * sqrt(3.0) / 1e3
    return f"""{write_opendss(feeder).replace(LIMITS, "vminpu=0.85 vlowpu=0.005 vmaxpu=9")}
New Transformer.stepup phases=3 xhl={Z_T.imag * 100!r} %loadloss={Z_T.real * 100!r} ppm_antifloat=0.001
~ buses=({BUS} {AT}) conns=(delta wye) kvs=({kV!r} {V_nom!r}) kvas=({rating} {rating})
New Storage.gfm phases=3 conn=delta bus1={BUS} kV={kV!r} kva={rating} kWrated={rating} kWhrated=1000000 %stored=100
~ %reserve=0 %EffCharge=100 %EffDischarge=100 %IdlingkW=0 state=idling kp=0.01 pitol=0.1 safevoltage=0
Set VoltageBases=({kV!r} {V_nom!r})
CalcVoltageBases
Solve
"""


def behind_source(feeder: Tables) -> Tables:
    """Return our feeder, fed by 1 pu behind the storage's impedance instead of the substation."""
    V_nom = V_LL / sqrt(3.0)
    nodes = tuple((bus, phase) for bus in (EMF, BUS) for phase in "ABC")
    y = 1.0 / (Z_GFM * V_LL**2 / S_RATED)
    link = LinearElement(name="source", nodes=nodes, Y=_matrix(np.kron(np.array([[y, -y], [-y, y]]), np.eye(3))))
    buses = (*feeder.buses, Bus(name=BUS, phases="ABC", V_nom=V_nom), Bus(name=EMF, phases="ABC", V_nom=V_nom))
    source = Source(bus=EMF, V_pu=1.0, angle=0.0)
    return replace(feeder, buses=buses, elements=(link, _transformer(feeder)), inverters=(), source=source)


def behind_inverter(feeder: Tables) -> Tables:
    """Return our feeder with a grid-forming inverter as the storage; the substation stays behind its switch."""
    V_nom = V_LL / sqrt(3.0)
    unit = inverter_row("gfm", "GFM", BUS, S_RATED, V_nom)
    buses = (*feeder.buses, Bus(name=BUS, phases="ABC", V_nom=V_nom))
    return replace(feeder, buses=buses, elements=(_transformer(feeder),), inverters=(unit,))


def delivered(feeder: Tables, V_low: NDArray[np.complex128], V_high: NDArray[np.complex128]) -> complex:
    """Return the power into the transformer (VA) from the phasors at its two sides (V)."""
    Y = np.array(_transformer(feeder).Y)
    return complex(np.vdot((Y @ np.concatenate([V_low, V_high]))[:3], V_low))


def _transformer(feeder: Tables) -> LinearElement:
    """Return the transformer: winding k of the delta side is between phases k and k + 1."""
    V_nom = {bus.name: bus.V_nom for bus in feeder.buses}[AT]
    turns = V_LL / V_nom
    y = S_RATED / 3.0 / V_LL**2 / Z_T
    delta = np.eye(3) - np.roll(np.eye(3), 1, axis=1)
    windings = np.hstack([delta, -turns * np.eye(3)])
    Y = y * windings.T @ windings + 1j * FLOATING * np.diag([1, 1, 1, 0, 0, 0])
    return LinearElement(name="stepup", nodes=tuple((bus, phase) for bus in (BUS, AT) for phase in "ABC"), Y=_matrix(Y))


def _matrix(Y: NDArray[np.complex128]) -> tuple[tuple[complex, ...], ...]:
    return tuple(tuple(map(complex, row)) for row in Y)


LIMIT = 1e-6
"""Largest difference of a phasor (pu of nominal voltage) and of the storage's power (pu of its rating)."""

M_Q = 0.05
"""Q-V droop of our GFM (pu)."""

CASES = {
    "snapshot": "power flow, 1 pu behind the source's impedance",
    "settled": "dynamics mode, settled",
    "shed": "a zone is shed, internal voltage held",
    "regulated": "the same, our GFM settled under its own control",
}

ENGINE_STATE = {name: number for number, name in enumerate(CASES)}
"""Number in `STATES` of the state that a case is compared with."""


class GridFormingIsland:
    """Our island in the cases, beside an engine's voltages in `STATES`."""

    def __init__(self, feeder: Tables, theirs: SolvedStates) -> None:
        self._feeder, self._theirs = feeder, theirs
        self.network = Network(behind_inverter(feeder))
        self._islanded = self.network.closed0 - {ISLANDING}
        island = next(buses for buses in self.network.islands(self._islanded) if BUS in buses)
        self.nodes = [i for i, (bus, _) in enumerate(self.network.nodes) if bus in island]

    def engine_voltages(self, state: int) -> NDArray[np.complex128]:
        """Return the engine's phasors (V) at `nodes`."""
        found = self._theirs.state(state)
        names = [self.network.nodes[i] for i in self.nodes]
        return np.array([found[f"{bus}.{'ABC'.index(phase) + 1}"] for bus, phase in names])

    def power(self, V: NDArray[np.complex128]) -> complex:
        """Return the power (VA) that the storage delivers at phasors of `nodes` (V)."""
        by_node = dict(zip(self.nodes, V.tolist(), strict=True))
        low, high = (np.array([by_node[self.network.index(bus, phase)] for phase in "ABC"]) for bus in (BUS, AT))
        return delivered(self._feeder, low, high)

    def terminal(self, V: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return the storage's phasors (V) from those of `nodes`."""
        by_node = dict(zip(self.nodes, V.tolist(), strict=True))
        return np.array([by_node[self.network.index(BUS, phase)] for phase in "ABC"])

    def snapshot(self) -> NDArray[np.complex128]:
        """Return our phasors (V) behind a source of 1 pu."""
        network = Network(behind_source(self._feeder))
        V = solve_power_flow(network, network.closed0 - {ISLANDING})
        kept = [i for i, (bus, _) in enumerate(network.nodes) if bus != EMF]
        ours: NDArray[np.complex128] = V[kept][self.nodes]
        return ours

    def dynamics(self, case: str) -> tuple[NDArray[np.complex128], float]:
        """Return our phasors (V) and frequency (Hz) in a case of the dynamics."""
        dynamics = self._start(self.terminal(self.engine_voltages(ENGINE_STATE["settled"])))
        f = float(dynamics.run(500)[-1, 0, 0])
        if case == "settled":
            return self._phasors(dynamics, self._islanded), f
        shed = self._islanded - {SHEDDING}
        dynamics.connect(self._circuit(shed))
        if case == "shed":
            return self._phasors(dynamics, shed), f
        aim = self.engine_voltages(ENGINE_STATE[case])
        V_b = V_LL / sqrt(3.0)
        v, q = float(np.abs(self.terminal(aim)).mean()) / V_b, self.power(aim).imag / S_RATED
        dynamics.inverters.hold(0, float(dynamics.inverters.set_points[0, 0]), v + M_Q * q)
        f = float(dynamics.run(2500)[-1, 0, 0])
        V = self._phasors(dynamics, shed)
        turn = complex(aligned_sum(self.terminal(aim)) / aligned_sum(self.terminal(V)))
        return V * (turn / abs(turn)), f

    def _circuit(self, closed: frozenset[str]) -> Circuit:
        return circuit_of(self.network, closed, self.network.loads())

    def _start(self, V: NDArray[np.complex128]) -> Dynamics:
        """Return our plant at rest at these terminal phasors (V)."""
        V_b = V_LL / sqrt(3.0)
        # the limit is estimated at the last step's voltages, where so small an impedance shows more current than flows
        parameters = GfmDroop(R_f=Z_GFM.real, X_f=Z_GFM.imag, I_max=100.0)
        unit = Inverter(name="gfm", kind="GFM", S_b=S_RATED, V_b=V_b, m_p=0.01, m_q=M_Q, parameters=parameters)
        dynamics = Dynamics(self._circuit(self._islanded), (unit,), 0.002)
        dynamics.start(np.zeros(1), np.zeros(1), swing_voltage=V / V_b)
        return dynamics

    def _phasors(self, dynamics: Dynamics, closed: frozenset[str]) -> NDArray[np.complex128]:
        ours: NDArray[np.complex128] = self.network.merge(closed).expand(dynamics.voltages())[self.nodes]
        return ours


def _run(case: str) -> CaseResult:
    feeder = read_feeder("microgrid123", "main")
    checks, facts = [], {}
    for engine in ENGINES:
        island = GridFormingIsland(feeder, _solved(engine))
        V, f = (island.snapshot(), 60.0) if case == "snapshot" else island.dynamics(case)
        theirs = island.engine_voltages(ENGINE_STATE[case])
        gap = np.abs(V - theirs) / island.network.V_nom[island.nodes]
        S, S_theirs = island.power(V), island.power(theirs)
        checks += [
            ToleranceCheck(f"V, pu, {engine}", float(gap.max()), LIMIT),
            ToleranceCheck(f"S, pu, {engine}", abs(S - S_theirs) / S_RATED, LIMIT),
        ]
        live = np.abs(V) > 0.0  # the zone that is shed has no voltage, here or there
        facts = {
            "nodes with voltage": f"{live.sum()} of {gap.size}",
            "P + jQ": f"{S.real / 1e3:.1f} kW + {S.imag / 1e3:.1f} kvar",
            "f, ours": f"{f:.4f} Hz",
        }
    return CaseResult(case, tuple(checks), facts)


@cache
def _solved(engine: str) -> SolvedStates:
    """Return an engine's voltages in all states; they are the same for all cases."""
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder) / "island.dss"
        script.write_text(island_script(read_feeder("microgrid123", "main")), encoding="utf-8")
        return solve_scripts(engine, [(script, STATES)])[0]


GRID_FORMING = ValidationPart("grid-forming", ENGINES, CASES, _run)
