"""GridLAB-D as a plant: the interface of `gridpeers.plant.feeder.Plant` on GridLAB-D's own network and inverters."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gridpeers.bridges.gridlabd.glm import write_glm
from gridpeers.bridges.gridlabd.glm_text import messages
from gridpeers.plant.dynamics.reduction import Reduction
from gridpeers.plant.feeder import Plant
from gridpeers.plant.feeder.circuits import Circuits
from gridpeers.plant.feeder.islands import Islands
from gridpeers.plant.feeder.limit_events import SetPointLimits
from gridpeers.plant.feeder.protection import Relays
from gridpeers.plant.feeder.switchboard import Switchboard
from gridpeers.plant.inverters.gfl import Gfl
from gridpeers.plant.plant_config import PlantSettings, PowerLimit
from gridpeers.plant.plant_interface import Reading, RecordedPlant
from gridpeers.plant.request_process import ProcessEndedError, RequestProcess
from gridpeers.plant.tables.read import DATA
from gridpeers.wire.messages import PlantEvent
from gridpeers.wire.timing import time_of
from gridpeers.wire.wording import damaged

REST = 0.5
"""Time (s) that GridLAB-D rests before t = 0, holding the set-points of the start: its own equilibrium, not ours."""


class GridlabdPlant(RecordedPlant):
    """A plant with GridLAB-D's numbers, controlled by the same agents (`gridpeers.plant.plant_interface.PlantLike`).

    GridLAB-D's initialisation takes the powers of the inverters and chooses set-points that give them; a scenario gives
    the set-points. So GridLAB-D begins its initial power flow from the powers of `ours`, our plant of the same run at
    its start; what comes out after `REST` is its own. Periods are in s.
    """

    def __init__(
        self,
        ours: Plant,
        settings: PlantSettings,
        T_c: float,
        end: float,
        *,
        record_step: float | None = None,
        deadline: float = 60.0,
    ) -> None:
        self.inverters = ours.inverters
        self.tick = 0  # k: the plant is at k T_c
        self._T_c, self._h = T_c, settings.h
        self._steps, self._record = round(T_c / self._h), round((record_step or self._h) / self._h)
        network = self._network = ours.network
        self._units = {unit.name: unit for unit in network.inverters}
        self._parameters = {
            unit.name: network.feeder.parameters_of(unit, settings.gfm, settings.gfl) for unit in network.inverters
        }
        self._V_nom = np.array([unit.V_nom for unit in network.inverters])
        self._switchboard = Switchboard(network, settings.events, settings.h)
        self._circuits, self._islands = Circuits(network), Islands(network)
        self._state = self._switch_state()
        self._limits: dict[int, list[PowerLimit]] = {}
        for limit in settings.limits:
            self._limits.setdefault(round(limit.t / settings.h), []).append(limit)
        self._set_points = SetPointLimits()
        self._relays = Relays(settings.protection, len(self.inverters), self._h, network.feeder.f_nom)
        self._events = self._islands.report_dead(0.0, self._switchboard.closed, self._state)
        self._events += [event for event in ours.take_events() if event.kind == "warning"]
        self._writes: list[tuple[str, str, Any]] = []  # values for GridLAB-D's next step: object, property, value
        start = {name: complex(reading.P, reading.Q) for name, reading in ours.measure().items()}
        seconds = round(REST + end + 2.0)
        model = write_glm(DATA / settings.feeder, settings.load_set, start, self._parameters, self._h, seconds)
        self.process = DeltaModeProcess(deadline)  # GridLAB-D
        try:
            units = [(unit.name, f"n{unit.bus}", unit.kind, unit.phases) for unit in self._units.values()]
            self.process.load(model, units)
            # GridLAB-D chose set-points that give the powers it was started with; now the run's own take over
            for name, unit in self._units.items():
                self.hold(name, settings.P_set0 * unit.P_rated, settings.V_set0 * unit.V_nom)
                if unit.kind == "GFL":
                    self._writes.append((name, "Qref", 0.0))
            self._now = self._run(round(REST / self._h))[-1]
        except BaseException:
            self.close()
            raise
        self._rows = [self._as_row(0, self._now)]

    def close(self) -> None:
        self.process.close()

    def measure(self) -> dict[str, Reading]:
        island, fed = self._islands.names(self._state)
        readings = {}
        for i, name in enumerate(self.inverters):
            f, P, Q, V, P_set, V_set = self._in_units(name, self._now[i])
            readings[name] = Reading(P, Q, V, f, P_set, V_set, fed[i], island[i])
        return readings

    def phasors(self, bus: str) -> tuple[complex, ...]:
        """Return the voltages (V) of phases A, B and C at a bus."""
        return tuple(complex(*phase) for phase in self.process.ask(phasors=f"n{bus}")["phasors"])

    def hold(self, name: str, P_set: float, V_set: float) -> None:
        """Take set-points (W, V), in force from the next step on, within the inverter's bounds.

        A value beyond its bounds is limited, and one that is not finite is ignored; each is an event, once per spell.
        """
        t = time_of(self.tick, self._T_c)
        if not (isfinite(P_set) and isfinite(V_set)):
            self._events += self._set_points.refused(name, t)
            return
        unit, own = self._units[name], self._parameters[name]
        P = min(max(P_set / unit.P_rated, -own.P_set_lim), own.P_set_lim)
        V = min(max(V_set / unit.V_nom, own.V_set_min), own.V_set_max)
        self._events += self._set_points.held(name, t, "P_set", P_set / 1e3, P * unit.P_rated / 1e3)
        self._events += self._set_points.held(name, t, "V_set", V_set, V * unit.V_nom)
        if not isinstance(own, Gfl):
            self._writes.append((name, "Pset", P))
        else:  # GridLAB-D bounds it at S_max itself
            self._writes.append((name, "Pref", P_set if own.P_set_lim == own.S_max else P * unit.P_rated))
        self._writes.append((name, "Vset", V))

    def connect(self, name: str, on: bool) -> None:
        """Do nothing if an inverter comes that is there; RuntimeError if it goes: GridLAB-D's inverters stay."""
        if not on:
            raise GridlabdError(f"{name} leaves, and GridLAB-D's delta mode cannot disconnect an inverter")

    def advance(self) -> None:
        """Advance to the next tick, with the scheduled switches and limits on the way.

        GridlabdError if GridLAB-D ends or diverges, or if an inverter would trip, which GridLAB-D's cannot.
        """
        step, last = self.tick * self._steps, (self.tick + 1) * self._steps
        while step < last:
            self._happen(step)
            later = (at for at in (*self._switchboard.steps, *self._limits) if at > step)
            stop = min(last, step + self._relays.quiet, *later)
            try:
                steps = self._run(stop - step)
            except GridlabdError as error:
                raise GridlabdError(f"plant after t = {time_of(step, self._h):g} s: {error}") from error
            for k in range(stop - step):
                if (step + k + 1) % self._record == 0:
                    self._rows.append(self._as_row(step + k + 1, steps[k]))
            self._now = steps[-1]
            self._watch(stop, steps)
            step = stop
        self.tick += 1

    def _happen(self, step: int) -> None:
        """Operate what is due at a step.

        GridLAB-D loses an island if two switches that part it open in one step: the others wait for the next steps.
        """
        t = time_of(step, self._h)
        due = self._switchboard.due(step)
        for operation in due[1:]:
            self._switchboard.drop(step, operation)
            self._switchboard.put(step + 1, operation.switch, operation.action)
            switch = self._switchboard.switch(operation.switch)
            text = f"GridLAB-D operates one switch a step: {switch.full_name} follows {self._h * 1e3:g} ms later"
            self._events.append(PlantEvent(t=t, kind="warning", subject=switch.event_name, text=text))
        if due:
            self._writes.append((f"s{due[0].switch}", "status", due[0].action))
            self._events += self._switchboard.operate(step)
            self._state = self._switch_state()
            self._events += self._islands.report(t, self._switchboard.closed, self._state)
        for limit in self._limits.pop(step, ()):
            name, own = limit.inverter, self._parameters[limit.inverter]
            assert isinstance(own, Gfl), "a scenario limits the power of a GFL alone"
            self._writes.append((name, "Pref_max", limit.P_max / (self._units[name].P_rated * own.S_max)))
            text = f"{name} has {limit.P_max / 1e3:g} kW available"
            self._events.append(PlantEvent(t=round(limit.t, 9), kind="limit", subject=name, text=text))

    def _switch_state(self) -> Reduction:
        circuit = self._circuits.of(self._switchboard.closed)
        forming = np.array([unit.kind == "GFM" for unit in self._units.values()])
        return Reduction(circuit, np.zeros(forming.size, complex), forming, np.ones(forming.size, bool))

    def _in_units(self, name: str, reading: NDArray[np.float64]) -> tuple[float, ...]:
        unit, (f, P, Q, V, P_set, V_set, *_) = self._units[name], reading.tolist()
        return f, P, Q, V, P_set * (unit.P_rated if unit.kind == "GFM" else 1.0), V_set * unit.V_nom

    def _as_row(self, step: int, readings: NDArray[np.float64]) -> tuple[float, ...]:
        own = (self._in_units(name, reading) for name, reading in zip(self.inverters, readings, strict=True))
        return (time_of(step, self._h), *(value for values in own for value in values))

    def _run(self, steps: int) -> NDArray[np.float64]:
        """Write the pending values, advance, and return the readings after each step: steps x inverters x values."""
        writes, self._writes = self._writes, []
        readings = np.array(self.process.ask(write=writes, advance=steps)["steps"])
        if not np.isfinite(readings).all():
            k, i = np.argwhere(~np.isfinite(readings).all(axis=2))[0].tolist()
            raise GridlabdError(
                f"GridLAB-D diverges: {self.inverters[i]} has no finite values {(k + 1) * self._h:g} s later"
            )
        return readings

    def _watch(self, step: int, steps: NDArray[np.float64]) -> None:
        """End the run where protection of ours would trip an inverter, because GridLAB-D's goes on."""
        f, low, high = steps[:, :, 0], steps[:, :, 6] / self._V_nom, steps[:, :, 7] / self._V_nom
        if trips := self._relays.watch(f, low, high, np.ones(len(self.inverters), bool)):
            names = "; ".join(f"{self.inverters[trip.inverter]}: {trip}" for trip in trips)
            raise GridlabdError(
                f"plant at t = {time_of(step, self._h):g} s: protection trips {names}. GridLAB-D's inverter has none, "
                'so the run ends here; write [protection] category = "off", or simulator = "gridpeers"'
            )


SHOWN = 2  # so many of GridLAB-D's own errors are in an error of ours; the first ones are the cause, the others follow
LONGEST = 600.0  # longest time (s) until a model is loaded and its first step done
KEPT_MEMORY = {"MALLOC_MMAP_THRESHOLD_": str(32 * 2**20), "MALLOC_TRIM_THRESHOLD_": str(2**30)}
"""Lets glibc keep the memory of one power flow for the next: GridLAB-D's solver takes and returns its matrices in every
iteration. Returned to the system each time, they take a quarter of the processor time. No number depends on it."""


class GridlabdError(RuntimeError):
    """GridLAB-D is missing, refuses its model, diverges, or has ended."""


class DeltaModeProcess:
    """GridLAB-D in a process of its own, which ends with this one; `deadline` is the longest wait for an answer (s)."""

    def __init__(self, deadline: float) -> None:
        self._deadline = deadline
        self._folder = TemporaryDirectory(prefix="gridpeers-gridlabd-")  # GridLAB-D writes files where it stands
        command = [sys.executable, "-P", str(Path(__file__).with_name("delta_mode.py"))]
        self._process = RequestProcess(command, Path(self._folder.name), KEPT_MEMORY)

    @property
    def pid(self) -> int:
        return self._process.pid

    def load(self, model: str, inverters: Sequence[tuple[str, str, str, str]]) -> None:
        """Load the text of a model, and take its first step.

        `inverters` has the name, node, kind and phases of each inverter to read.
        """
        path = Path(self._folder.name) / "feeder.glm"
        path.write_text(model, encoding="utf-8")
        self._answer({"load": str(path), "inverters": inverters}, LONGEST)

    def ask(self, **request: Any) -> dict[str, Any]:
        """Return the answer to a request (`delta_mode`); GridlabdError has GridLAB-D's own errors."""
        return self._answer(request, self._deadline)

    def close(self) -> None:
        self._process.close()
        self._folder.cleanup()

    def _answer(self, request: dict[str, Any], deadline: float) -> dict[str, Any]:
        self._process.send(request)
        try:
            answer = self._process.answer(monotonic() + deadline)
        except ProcessEndedError as how:
            raise GridlabdError(f"GridLAB-D's process {how}{self._complaints()}") from None
        if answer is None:
            raise GridlabdError(f"GridLAB-D has not answered for {deadline:g} s, so it was ended{self._complaints()}")
        if "not_importable" in answer:
            raise GridlabdError(damaged("gridlabd", answer["not_importable"], "GridLAB-D as the plant"))
        if "error" in answer:
            raise GridlabdError(f"GridLAB-D: {answer['error']}{self._complaints()}")
        return answer

    def _complaints(self) -> str:
        """Return GridLAB-D's first errors as the end of a sentence, on one line as all that goes over the wire."""
        first = [text.removeprefix("GridLAB-D: ").rstrip(".") for text in messages(self._process.printed())[:SHOWN]]
        return f"; its own words: {'; '.join(first)}" if first else "; it has printed no error"
