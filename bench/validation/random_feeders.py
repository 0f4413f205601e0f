"""Part "random-feeders": random feeders beside OpenDSS, at the start, after a load step, and after a switching."""

from __future__ import annotations

import tempfile
from cmath import phase as angle_of
from functools import partial
from math import degrees
from pathlib import Path
from typing import NamedTuple, get_args

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from bench.validation.kirchhoff import kirchhoff_residual, solved_voltages
from bench.validation.opendss_engines import ENGINES, SolvedStates, solve_scripts
from bench.validation.random_script import RandomFeeder, Shape, random_feeder
from bench.validation.validation_part import CaseResult, ToleranceCheck, ValidationPart, inverter_row
from gridpeers.bridges.opendss import read_opendss
from gridpeers.plant.dynamics import Dynamics, PlantError
from gridpeers.plant.equipment import Tables
from gridpeers.plant.equipment.named_loads import with_powers
from gridpeers.plant.feeder.circuits import circuit_of
from gridpeers.plant.feeder.plant import installed_inverters
from gridpeers.plant.network import Network
from gridpeers.plant.plant_config import PlantSettings
from gridpeers.plant.tables import FeederError

STEPS = 10
"""Steps of 2 ms from an event to the state that is compared."""

HELD = "vminpu=0 vlowpu=0 vmaxpu=99"
"""An inverter of the engine keeps its power at any voltage."""

STIFF = "r1=1e-9 x1=1e-9 r0=1e-9 x0=1e-9"
"""Impedance (ohm) of the engine's source in an island."""


class FeederStates(NamedTuple):
    """What our plant finds in each state."""

    V: list[NDArray[np.complex128]]
    """Voltages of all nodes (V): at the start, after the load step, after the switching."""
    names: list[str]
    """The nodes as OpenDSS names them."""
    V_nom: NDArray[np.float64]
    commands: list[tuple[str, ...]]
    """Commands that lead the engine from each state to the next."""
    residual: float
    """Largest current that is left at a node in any state (A)."""
    asymmetry: float
    """Largest y_ij - y_ji (S)."""
    islanded: int
    """Inverters that have no substation after the switching, and deliver."""


def run_states(drawn: RandomFeeder, script: Path) -> FeederStates:
    """Run our plant through the states of a feeder whose script is written.

    FeederError, PlantError, ArithmeticError: the import or the plant refuses it, or an island has no solution.
    """
    return _Run(drawn, read_opendss(script, switches=[drawn.switch])).states()


class _Run:
    def __init__(self, drawn: RandomFeeder, feeder: Tables) -> None:
        V_nom = {bus.name: bus.V_nom for bus in feeder.buses}
        rows = [
            inverter_row(
                f"inv{k}",
                it.kind,
                it.bus,
                it.P_rated,
                V_nom[it.bus],
                phases=it.phases,
                neutral=it.neutral,
                microgrid="1",
            )
            for k, it in enumerate(drawn.inverters)
        ]
        self._drawn, self._rows = drawn, rows
        self._network = network = Network(replace(feeder, inverters=tuple(rows)))
        power = complex(*drawn.power) * 1e3
        self._stepped = network.with_loads(with_powers(network.feeder, {drawn.load: power}))
        self._circuit = circuit_of(network, network.closed0, network.loads())
        units = installed_inverters(network, PlantSettings())
        self._dynamics = Dynamics(self._circuit, units, 0.002)

    def states(self) -> FeederStates:
        """Run through them."""
        dynamics, network, n = self._dynamics, self._network, len(self._rows)
        dynamics.start(np.full(n, 0.2), V_set=np.full(n, 1.0))
        residual, V = kirchhoff_residual(dynamics), [self._voltages()]
        commands = [(*self._created(), *self._held())]

        kW, kvar = self._drawn.power
        closed = network.closed0
        for circuit, what in (
            (
                circuit_of(self._stepped, closed, self._stepped.loads()),
                f"edit {self._drawn.load} kw={kW!r} kvar={kvar!r}",
            ),
            (circuit_of(self._stepped, frozenset(), self._stepped.loads()), f"open {self._drawn.switch} 1"),
        ):
            dynamics.connect(circuit)
            residual = max(residual, kirchhoff_residual(dynamics))
            dynamics.run(STEPS)
            residual = max(residual, kirchhoff_residual(dynamics))
            if dynamics.take_trips():
                raise ArithmeticError(f"no solution after {what}")
            closed = network.closed0 if what.startswith("edit") else frozenset()
            V.append(self._voltages(closed))
            commands.append((what, *self._held()))
        reduction, Y = dynamics.network.reduction, self._circuit.Y
        return FeederStates(
            V=V,
            names=[f"{bus}.{'ABC456789'.index(phase) + 1}" for bus, phase in network.nodes],
            V_nom=network.V_nom,
            commands=commands,
            residual=residual,
            asymmetry=float(abs(Y - Y.T).max()),
            islanded=int(np.sum(reduction.online & ~reduction.has_source[reduction.inverter_island])),
        )

    def _voltages(self, closed: frozenset[str] | None = None) -> NDArray[np.complex128]:
        """Return the voltages of all nodes to earth (V)."""
        merge = self._network.merge(self._network.closed0 if closed is None else closed)
        V, _ = solved_voltages(self._dynamics)
        return merge.expand(self._dynamics.network.circuit.to_earth(V))

    def _phases(self) -> list[tuple[int, int, int]]:
        """Inverter, position of its terminal, and number of its node in OpenDSS, of every phase."""
        return [
            (i, k, "ABC".index(phase) + 1) for i, row in enumerate(self._rows) for k, phase in enumerate(row.phases)
        ]

    def _created(self) -> list[str]:
        """Return the commands that make the inverters: constant powers, and sources that hold a voltage."""
        commands = []
        for i, _, node in self._phases():
            row = self._rows[i]
            name, kV, back = f"{row.name}_{node}", row.V_nom / 1e3, row.neutral or "0"
            at = f"bus1={row.bus}.{node}"
            commands.append(f"New Load.{name} {at}.{back} phases=1 kv={kV!r} model=1 {HELD} kw=0 kvar=0")
            source = f"{at} bus2={row.bus}.{back} phases=1 basekv={kV!r} {STIFF} enabled=no"
            commands.append(f"New Vsource.{name} {source}")
        return commands

    def _held(self) -> list[str]:
        """Return the commands that have the inverters deliver what ours do; an island's leader holds its voltage."""
        units, reduction = self._dynamics.inverters, self._dynamics.network.reduction
        V_all, at = solved_voltages(self._dynamics)[0], self._dynamics.network.circuit.terminals
        commands = []
        for i, k, node in self._phases():
            name = f"{self._rows[i].name}_{node}"
            V = complex(V_all[at[i, k]])
            if reduction.leader[reduction.inverter_island[i]] == i:
                commands += [
                    f"edit Vsource.{name} enabled=yes basekv={abs(V) / 1e3!r} pu=1 angle={degrees(angle_of(V))!r}",
                    f"edit Load.{name} enabled=no",
                ]
            elif reduction.online[i]:
                S = V * np.conj(units.J[i, k] - units.y_f[i] * V)
                commands.append(f"edit Load.{name} kw={-float(S.real) / 1e3!r} kvar={-float(S.imag) / 1e3!r}")
            else:
                commands.append(f"edit Load.{name} enabled=no")
        return commands


LIMIT = 1e-6
"""Largest difference of a phasor (pu of nominal voltage), and largest current that is left at a node (A)."""

ALL, IN_TESTS = 250, 12
"""Feeders of a case."""

CASES = {"radial": f"{ALL} radial feeders", "meshed": f"{ALL} feeders with meshes"}


def _run(case: str, count: int = ALL) -> CaseResult:
    shape = next(shape for shape in get_args(Shape) if shape == case)
    with tempfile.TemporaryDirectory() as folder:
        scripts, found, refused = list[Path](), list[FeederStates](), list[Path]()
        for seed in range(count):
            drawn, script = random_feeder(seed, shape), Path(folder) / f"{case}{seed}.dss"
            script.write_text(drawn.script, encoding="utf-8")
            try:
                found.append(run_states(drawn, script))
                scripts.append(script)
            except (FeederError, PlantError, ArithmeticError):
                refused.append(script)
        checks = list[ToleranceCheck]()
        falsely = set[Path]()
        for engine in ENGINES:
            theirs = solve_scripts(engine, [(script, s.commands) for script, s in zip(scripts, found, strict=True)])
            largest = float(np.max([_largest(*pair) for pair in zip(found, theirs, strict=True)]))
            checks.append(ToleranceCheck(f"V, pu, {engine}", largest, LIMIT))
            plain = solve_scripts(engine, [(script, [()]) for script in refused])
            falsely |= {script for script, each in zip(refused, plain, strict=True) if np.isfinite(each.V).all()}
    checks += [
        ToleranceCheck("current left, A", max(states.residual for states in found), LIMIT),
        ToleranceCheck("refused, but solved by an engine", float(len(falsely)), 0.0),
    ]
    facts = {
        "feeders": str(count),
        "refused": str(len(refused)),
        "asymmetric": str(sum(states.asymmetry > 1e-3 for states in found)),
        "with an island": str(sum(states.islanded > 0 for states in found)),
        "nodes": str(sum(len(states.names) for states in found)),
    }
    return CaseResult(case, tuple(checks), facts)


def _largest(ours: FeederStates, theirs: SolvedStates) -> float:
    """Return the largest difference (pu) at any node of the engine in any state; nan where it found none."""
    at = [ours.names.index(name) for name in theirs.nodes]
    gaps = [np.abs(V[at] - theirs.V[k]) / ours.V_nom[at] for k, V in enumerate(ours.V)]
    return float(np.max(gaps))


RANDOM_FEEDERS = ValidationPart("random-feeders", ENGINES, CASES, _run, partial(_run, count=IN_TESTS))
