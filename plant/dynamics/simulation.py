"""Inverters on a circuit, advanced in time: the state arrays around the compiled inner loop."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from gridpeers.plant.dynamics.circuit import PHASES, Circuit, NoSolutionError, aligned_sum
from gridpeers.plant.dynamics.equilibrium import OperatingPoint, equilibrium, set_equilibrium
from gridpeers.plant.dynamics.inverters import Inverter, Inverters
from gridpeers.plant.dynamics.island_parts import is_large
from gridpeers.plant.dynamics.kernel.compiled import Complex, Flags, Real
from gridpeers.plant.dynamics.kernel.controller_pass import READING, Units
from gridpeers.plant.dynamics.kernel.model_pass import W, address_of
from gridpeers.plant.dynamics.kernel.second_order_step import run_second_order_steps
from gridpeers.plant.dynamics.kernel.step import FAILURES, run_steps, run_steps_unlocked
from gridpeers.plant.dynamics.live_network import TOLERANCE, LiveNetwork, unsettled_island
from gridpeers.plant.inverters.inverter_model import Method

MOST_RENEWALS = 20  # tangents of one network solution, while its limited currents shrink; two or three are enough


class Trip(NamedTuple):
    """Sources disconnected because their island has no solution."""

    step: int  # number of steps of the present `Dynamics.run` before it
    inverters: tuple[int, ...]  # disconnected inverters
    substation: bool  # whether the substation was disconnected too
    V_min: float  # their lowest terminal voltage before (pu); inf where only the substation was left


class Dynamics:
    """Inverters and network, stepped with fixed h: `start` once; then `run`, `connect`, `switch_inverters`."""

    def __init__(
        self,
        circuit: Circuit,
        inverters: tuple[Inverter, ...],
        h: float,
        connected: Sequence[bool] | None = None,
        method: Method = "first-order",
    ) -> None:
        self.h, self._method = h, method
        self.inverters = Inverters(inverters, connected, method)
        self._tolerance = TOLERANCE * float(self.inverters.V_b.max(initial=1.0))  # of a network solution (V)
        self.network = LiveNetwork(circuit, self.inverters)
        self._single = np.flatnonzero(self.inverters.single)
        self._trips: list[Trip] = []
        self._slope_0 = np.zeros_like(self.inverters.state)

    def start(
        self, P: Real, Q: Real | None = None, V_set: Real | None = None, *, swing_voltage: Complex = PHASES
    ) -> OperatingPoint:
        """Start from the equilibrium at real powers `P` (pu), and at reactive powers `Q` or set-points `V_set` (pu).

        With `Q` the droops are shifted to give it, as in GridLAB-D: V_set := v + m_q q for a GFM; V_set := v, Q_set :=
        q for a GFL. With `V_set` q follows from the droop and its dead band. PlantError if there is no such
        equilibrium.
        """
        units, network = self.inverters, self.network
        first = np.zeros(P.size) if Q is None else Q
        point = equilibrium(network.circuit, units, P, first, V_set, swing_voltage=swing_voltage)
        set_equilibrium(units, point, network.reduction.online, P, V_set)
        network.V_branch[network.reduction.branches] = point.V_branch
        self.connect(network.circuit)
        return point

    # ---------------------------------------------------------------- switching

    def connect(self, circuit: Circuit, step: int = 0) -> None:
        """Continue with another network from the present injections; islands without solution trip, at this step.

        Inverters that lose their source of voltage stop; those that regain it start at zero current, in step with it.
        """
        units, network = self.inverters, self.network
        before = network.reduction.online
        network.change(circuit)
        while True:
            online = network.reduction.online
            regained = online & ~before
            units.J[~online] = 0.0
            try:
                for i in np.flatnonzero(regained & units.forming).tolist():
                    self._black_start(i)
                followers = regained & ~units.forming
                if (behind_filter := followers & (units.y_f != 0.0)).any():
                    self._solve_without(behind_filter)
                units.J[followers] = units.y_f[followers, None] * units.V[followers]
                network.guess()
                network.solve()
                for i in np.flatnonzero(followers).tolist():
                    units.I[i] = 0.0
                    units.rest(i, 0.0, self._mean_voltage(i))
                return
            except NoSolutionError as error:
                self._trip(error.islands, step)
                network.change(circuit)

    def switch_inverters(self, which: Sequence[int], on: bool) -> None:
        """Disconnect inverters all at once, or reconnect them at zero current, in step with the voltage there.

        A reconnected inverter gets the set-points at which it rests: V_set is the terminal's voltage, and P_set the
        value whose droop gives no power at the island's frequency. Control decides the rest.
        """
        units = self.inverters
        moved = [i for i in which if on != bool(units.connected[i])]
        if not moved:
            return
        speed = {i: self._island_speed(i) for i in moved}
        units.connected[moved] = on
        w_nom = 2.0 * np.pi * units.f_nom
        for i in moved if on else ():
            v = self._mean_voltage(i)
            if units.positive_sequence[i] or units.direct[i]:
                v = float(abs(aligned_sum(units.V[i]))) / 3.0 / float(units.V_b[i])
            units.set_points[i] = speed[i] / (units.m_p[i] * w_nom), v if v > 0.1 else 1.0, 0.0
        self.connect(self.network.circuit)
        for i, w in speed.items() if on else ():
            units.lock(i, w)  # a PLL has locked to the island's frequency before the contactor closes

    def _trip(self, islands: Iterable[int], step: int) -> None:
        """Disconnect all inverters of these islands; where there are none, the substation, which stays off.

        An island with the substation thus first loses only its inverters: the grid may be able to feed it without them.
        """
        units, reduction, numbers = self.inverters, self.network.reduction, list(islands)
        lost = reduction.online & np.isin(reduction.inverter_island, numbers)
        bare = [k for k in numbers if not lost[reduction.inverter_island == k].any()]
        v = np.abs(units.V[lost]) / units.V_b[lost, None]
        units.connected[lost] = False
        if bare:
            self.network.substation_on = False
        lowest = float(np.min(v, initial=np.inf))
        self._trips.append(Trip(step, tuple(np.flatnonzero(lost).tolist()), bool(bare), lowest))

    def _solve_without(self, away: Flags) -> None:
        """Find the voltages at the open terminals of inverters that are about to return.

        At zero current the internal voltage is that of the open terminal, in each phase.
        """
        units, network = self.inverters, self.network
        connected = units.connected.copy()
        units.connected[away] = False
        try:
            network.change(network.circuit)
            network.guess()
            network.solve()
        finally:
            units.connected[:] = connected
            network.change(network.circuit)

    def _black_start(self, i: int) -> None:
        units = self.inverters
        V_1 = complex(aligned_sum(units.V[i])) / 3.0
        if abs(V_1) < 0.1 * units.V_b[i]:
            V_1 = complex(units.set_points[i, 1] * units.V_b[i] * PHASES[units.phase[i]])
        units.J[i], units.I[i] = V_1 * PHASES * units.y_f[i], 0.0
        units.rest(i, 0.0, abs(V_1) / units.V_b[i])

    def _island_speed(self, i: int) -> float:
        """Return the speed (rad/s, relative to nominal) of inverter i's island; 0 with a source or if dead."""
        units, reduction = self.inverters, self.network.reduction
        leader = reduction.leader[reduction.inverter_island[i]]
        return 0.0 if leader < 0 else float(units.state[leader, W])

    def _mean_voltage(self, i: int) -> float:
        return float(np.mean(np.abs(self.inverters.V[i]))) / float(self.inverters.V_b[i])

    def take_trips(self) -> list[Trip]:
        trips, self._trips = self._trips, []
        return trips

    # ---------------------------------------------------------------- steps

    def run(self, steps: int) -> Real:
        """Advance by `steps` steps; return steps x n_inv x `kernel.controller_pass.READING`, all finite.

        Where the frozen tangent leads to no solution it is renewed. An island without solution is de-energised before
        the step, and the others take it. PlantError if a model gives what is no finite number. With 0 steps the inner
        loop is only compiled or loaded.
        """
        units, network = self.inverters, self.network
        out = np.zeros((steps, len(self.inverters), READING))
        begin, renewed = 0, -1
        limited: list[Complex] = []
        """Injections (A) at which the tangent of one solution was renewed: they differ where currents are limited."""
        while (status := self._advance(begin, steps, out)) < 0:
            units.require_finite()
            step, what = divmod(-1 - status, FAILURES)
            solution = 2 * step + what
            if solution == renewed and (
                len(limited) == MOST_RENEWALS or np.array_equal(limited[-1], units.J)
            ):  # rounding at the largest load, or limited currents that do not settle
                islands = {unsettled_island(network.net, self.arrays(), network.x, self._tolerance)}
            else:
                try:
                    network.renew()
                    limited = [*(limited if solution == renewed else ()), units.J.copy()]
                    begin = renewed = solution
                    continue
                except NoSolutionError as error:
                    islands = set(error.islands)
            units.state[:], units.J[:] = units.start, units.J_0  # go back to the start of the step that failed
            self._trip(sorted(islands), step)
            self.connect(network.circuit, step)
            begin, renewed = 2 * step, -1
        if not np.isfinite(units.state.sum()):  # also where no current shows it
            units.require_finite()
        network.refresh(status, 2 * steps - begin)
        if self._single.size:
            out[:, self._single, 1:3] /= 3.0  # the kernel's powers are those of three equal phases
        return out

    def arrays(self) -> Units:
        """Return the tables of the inverters; the first time a model is compiled, or its machine code loaded."""
        units = self.inverters
        if not units.passes.all():
            units.passes[:] = [address_of(type(unit.parameters)) for unit in units.units]
        units.online = self.network.reduction.online
        return Units._make(getattr(units, name) for name in Units._fields)

    def _advance(self, begin: int, steps: int, out: Real) -> int:
        units, network, arrays, tolerance = self.inverters, self.network, self.arrays(), self._tolerance
        if self._method == "first-order":
            if steps == 0 and is_large(network.net):
                run_steps_unlocked(0, 0, self.h, tolerance, network.net, arrays, network.x, out)
            if begin == 0 and (parts := network.parts(arrays)):
                iterations = parts.advance(steps, self.h, tolerance, arrays, network.x, out)
                if iterations >= 0:
                    return iterations
                network.join_parts()
            return run_steps(begin, steps, self.h, tolerance, network.net, arrays, network.x, out)
        present = arrays._replace(start=units.state)
        own = self._slope_0, units.feed_forward, network.x, out
        return run_second_order_steps(begin, steps, self.h, tolerance, network.net, arrays, present, *own)

    def voltages(self) -> Complex:
        """Return the voltages to earth of all nodes (V); 0 in dead islands and at nodes without any admittance."""
        network, reduction = self.network, self.network.reduction
        return reduction.circuit.to_earth(
            reduction.node_voltages(self.inverters.J, network.V_branch[reduction.branches], network.source_voltage)
        )

    def frequency(self, island: int) -> float:
        """Return an island's frequency (Hz): nominal at a source, else its GFM's mean by rating; 0 if it is dead."""
        units, reduction = self.inverters, self.network.reduction
        if reduction.has_source[island]:
            return units.f_nom
        here = units.forming & reduction.online & (reduction.inverter_island == island)
        if not here.any():
            return 0.0
        speed = np.average(units.state[here, W], weights=units.S_b[here])
        return units.f_nom + float(speed) / (2.0 * np.pi)

    def readings(self) -> Real:
        return self.inverters.readings(self.network.reduction.online)
