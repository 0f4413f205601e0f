"""GridLAB-D as a plant: what `plant.feeder.Plant` does, done by GridLAB-D's own network and inverters."""

from __future__ import annotations

import json
import subprocess
import tempfile
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from plant.feeder import Plant
from plant.feeder.plant import Reading
from plant.inverter_parameters import GflParameters
from plant.plant_config import PlantSettings
from wire.messages import PlantEvent

from .glm import write_glm

DELTA_MODE = Path(__file__).with_name("delta_mode.py")
FEEDERS = Path(__file__).parents[1] / "data"

REST = 0.5
"""Time (s) that GridLAB-D rests before t = 0, holding the set-points of the start: its own equilibrium, not ours."""

MISSING = """GridLAB-D is not there: {python} is no interpreter that has the package "gridlabd".
Install its wheel (Linux, x86-64): pip install 'gridpeers[gridlabd]'"""


class GridlabdError(RuntimeError):
    """GridLAB-D is missing, or it ended."""


class GridlabdPlant:
    """A plant whose numbers are GridLAB-D's, to be controlled by the same agents (`plant.plant_interface.PlantLike`).

    Parameters
    ----------
    ours
        Our plant of the same run, at its start. GridLAB-D begins its initial power flow from the powers found there;
        what comes out after `REST` is its own.
    settings
        Everything that decides the numbers. Inverters that come and go have no counterpart in GridLAB-D.
    T_c
        Control period (s).
    end
        Duration of the run (s).
    python
        Interpreter that has the wheel `gridlabd`.

    Raises
    ------
    GridlabdError
        If the wheel is missing or the model does not run.
    """

    def __init__(self, ours: Plant, settings: PlantSettings, T_c: float, end: float, python: str) -> None:
        self.inverters = ours.inverters
        self.tick = 0
        self._h, self._steps, self._python = settings.h, round(T_c / settings.h), python
        self._network = ours.network
        self._units = {unit.name: unit for unit in ours.network.inverters}
        self._parameters = {
            unit.name: ours.network.feeder.parameters_of(unit, settings.gfm, settings.gfl)
            for unit in ours.network.inverters
        }
        self._closed = ours.network.closed0
        self._writes = self._scheduled(settings)
        self._folder = tempfile.TemporaryDirectory()
        model, self._log = (Path(self._folder.name) / name for name in ("feeder.glm", "gridlabd.log"))
        start = {name: complex(reading.P, reading.Q) for name, reading in ours.measure().items()}
        seconds = round(REST + end + 2.0)
        model.write_text(
            write_glm(FEEDERS / settings.feeder, settings.load_set, start, self._parameters, settings.h, seconds),
            encoding="utf-8",
        )
        with self._log.open("w") as log:
            try:
                self._process = subprocess.Popen(
                    [python, str(DELTA_MODE)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log, text=True
                )
            except OSError:
                raise GridlabdError(MISSING.format(python=python)) from None
        units = [(unit.name, f"n{unit.bus}", unit.kind) for unit in self._units.values()]
        try:
            self.version = self._ask(load=str(model), inverters=units)["version"]
            # GridLAB-D chose set-points that give the powers it was started with; now the run's own take over
            for name, unit in self._units.items():
                self.hold(name, settings.P_set0 * unit.P_rated, settings.V_set0 * unit.V_nom)
                if unit.kind == "GFL":
                    self._ask(write=[(name, "Qref", 0.0)])
            self._now = self._ask(advance=round(REST / self._h))["steps"][-1]
        except GridlabdError:
            self.__exit__(None, None, None)
            raise
        self._rows = [self._as_row(0, self._now)]

    def __enter__(self) -> Self:
        """Give the plant; leaving the context ends GridLAB-D's process."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End GridLAB-D's process."""
        self.close()

    def close(self) -> None:
        """End GridLAB-D's process."""
        self._process.kill()
        self._process.communicate()
        self._folder.cleanup()

    def measure(self) -> dict[str, Reading]:
        """Read every inverter's sensors at t = tick * T_c."""
        source = self._network.feeder.source
        islands = self._network.islands(self._closed)
        first: dict[frozenset[str], str] = {}
        readings = {}
        for (name, unit), reading in zip(self._units.items(), self._now, strict=True):
            buses = next(island for island in islands if unit.bus in island)
            fed = source is not None and source.bus in buses
            f, P, Q, V, P_set, V_set = self._in_units(name, reading)
            readings[name] = Reading(P, Q, V, f, P_set, V_set, fed, "grid" if fed else first.setdefault(buses, name))
        return readings

    def phasors(self, bus: str) -> tuple[complex, ...]:
        """Return the voltages (V) of phases A, B and C at a bus."""
        return tuple(complex(*phase) for phase in self._ask(phasors=f"n{bus}")["phasors"])

    def hold(self, name: str, P_set: float, V_set: float) -> None:
        """Take set-points (W, V), in force from the next step on."""
        unit = self._units[name]
        P = ("Pset", P_set / unit.P_rated) if unit.kind == "GFM" else ("Pref", P_set)
        self._ask(write=[(name, *P), (name, "Vset", V_set / unit.V_nom)])

    def connect(self, name: str, on: bool) -> None:
        """Refuse: an inverter that comes or goes has no counterpart in GridLAB-D's delta mode."""
        raise NotImplementedError(f"{name} comes or goes: GridLAB-D's delta mode has nothing like it")

    def advance(self) -> None:
        """Go to the next tick; what is scheduled happens on the way."""
        first, last = self.tick * self._steps, (self.tick + 1) * self._steps
        step = first
        for stop in sorted({at for at in self._writes if first < at < last} | {last}):
            if step in self._writes:
                self._operate(step)
            steps = self._ask(advance=stop - step)["steps"]
            self._rows += [self._as_row(step + k + 1, readings) for k, readings in enumerate(steps)]
            self._now = steps[-1]
            step = stop
        self.tick += 1

    def take_rows(self) -> tuple[tuple[float, ...], ...]:
        """Return the rows of every step since the last call, laid out as those of `Plant.take_rows`."""
        rows, self._rows = tuple(self._rows), []
        return rows

    def take_events(self) -> tuple[PlantEvent, ...]:
        """Give none; our plant tells them."""
        return ()

    def _scheduled(self, settings: PlantSettings) -> dict[int, list[tuple[str, str, Any]]]:
        """Writes by step: (switch, "status", action) or (inverter, "Pref_max", pu)."""
        writes: dict[int, list[tuple[str, str, Any]]] = {}
        for event in settings.events:
            name = self._network.switch_name(event.switch)
            writes.setdefault(round(event.t / settings.h), []).append((name, "status", event.action))
        for limit in settings.limits:
            parameters = self._parameters[limit.inverter]
            assert isinstance(parameters, GflParameters), "the plant limits the power of a GFL alone"
            P_max = limit.P_max / (self._units[limit.inverter].P_rated * parameters.S_max)
            writes.setdefault(round(limit.t / settings.h), []).append((limit.inverter, "Pref_max", P_max))
        return writes

    def _operate(self, step: int) -> None:
        writes = []
        for name, key, value in self._writes[step]:
            if key == "status":
                self._closed = self._closed - {name} if value == "open" else self._closed | {name}
            writes.append((f"s{name}" if key == "status" else name, key, value))
        self._ask(write=writes)

    def _in_units(self, name: str, reading: list[float]) -> tuple[float, ...]:
        """Convert a reading to Hz, W, var, V, W, V."""
        unit, (*measured, P_set, V_set) = self._units[name], reading
        return (*measured, P_set * (unit.P_rated if unit.kind == "GFM" else 1.0), V_set * unit.V_nom)

    def _as_row(self, step: int, readings: list[list[float]]) -> tuple[float, ...]:
        values = [
            value
            for name, reading in zip(self.inverters, readings, strict=True)
            for value in self._in_units(name, reading)
        ]
        return (round(step * self._h, 9), *values)

    def _ask(self, **request: Any) -> dict[str, Any]:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(json.dumps(request) + "\n")
            self._process.stdin.flush()
            line = self._process.stdout.readline()
        except BrokenPipeError:
            line = ""
        answer: dict[str, Any] = json.loads(line or '{"error": "its process ended"}')
        if "error" not in answer:
            return answer
        if "No module named 'gridlabd'" in answer["error"]:
            raise GridlabdError(MISSING.format(python=self._python))
        raise GridlabdError(f"GridLAB-D: {answer['error']}. Its last words:\n{self._log.read_text()[-1500:]}")
