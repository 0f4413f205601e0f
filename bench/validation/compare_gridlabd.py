"""Our plant against GridLAB-D, step by step: an independent check of network, inverters and time stepping.

GridLAB-D 6.0.0 (its delta mode, `inverter_dyn`) reads a model that `plant.gridlabd.glm` writes from the feeder's tables
without the code of `plant.network`. Both plants start from their own equilibrium and go through the same run; f, P, Q,
V and the held set-points of all inverters are compared after every step of 2 ms. Closed loop: each has its own agents.

    .venv/bin/python -m bench.validation.compare_gridlabd --gridlabd ENVIRONMENT/bin/python [run ...]
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command does, before numpy is imported

import sys
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from agents.agent_config import AgentConfig
from plant.equipment import InverterRow
from plant.feeder import Plant
from plant.gridlabd.gridlabd_plant import GridlabdError, GridlabdPlant
from plant.network import Network
from plant.plant_config import GflParameters, PlantConfig, SwitchEvent
from plant.plant_interface import PlantLike
from scenarios.drivers.inprocess import run_inprocess
from scenarios.schema import load_scenario
from scenarios.schema.configs import configs

from .impedance import with_impedances

ONE_RATING = GflParameters(S_max=1.0, V_set_max=2.0)
"""GridLAB-D has one rating for a GFL's reference and its apparent power (ours: 1 and 1.2 pu), and no bound of V_set."""

GFL = ("inv2", "inv3", "inv5", "inv6", "inv8", "inv9")


class TimedSetPoints(NamedTuple):
    """Set-points that inverters are given in an open-loop run."""

    t: float
    """Time (s), a multiple of T_c."""
    inverters: tuple[str, ...]
    P_set: float
    """pu of the rating."""
    V_set: float
    """pu of the nominal voltage."""


class ComparedRun(NamedTuple):
    """One run: the events and limits that both plants go through."""

    text: str
    scenario: str
    case: str
    closed_loop: bool = False
    gfl: GflParameters | None = None
    """Instead of the scenario's."""
    events: tuple[SwitchEvent, ...] = ()
    """Instead of the scenario's."""
    orders: tuple[TimedSetPoints, ...] = ()
    impedances: bool = True
    """Whether our switches and regulators have GridLAB-D's impedances."""
    tolerance: float = 1e-8
    """Largest difference (Hz, pu) that passes."""


RUNS = {
    "open": ComparedRun("constant set-points, both events", "islanding", "I"),
    "closed": ComparedRun("agents, both events", "islanding", "IV", closed_loop=True),
    "islands": ComparedRun(
        "agents, three islands",
        "microgrid-switching",
        "IV",
        closed_loop=True,
        # GridLAB-D de-energises microgrid 1 if both switches between the microgrids open in the same step
        events=(
            SwitchEvent(t=1.0, switch="13-152", action="open"),
            SwitchEvent(t=4.0, switch="sw1_2", action="open"),
            SwitchEvent(t=4.004, switch="sw2_3", action="open"),
        ),
    ),
    "reclosing": ComparedRun(
        "constant set-points, the substation reclosed out of phase",
        "islanding",
        "I",
        events=(
            SwitchEvent(t=0.1, switch="13-152", action="open"),
            SwitchEvent(t=1.5, switch="13-152", action="close"),
        ),
    ),
    "clouds": ComparedRun("agents, available power below the reference", "wind-up", "clamp", closed_loop=True),
    "limits": ComparedRun(
        "GFL references at 1.3 and -1.3 pu, GFM beyond P_max",
        "islanding",
        "I",
        gfl=ONE_RATING,
        orders=(
            TimedSetPoints(1.5, ("inv2",), 1.3, 1.03),
            TimedSetPoints(2.0, ("inv2",), 0.647, 1.0),
            TimedSetPoints(2.5, GFL, 0.1, 1.0),  # the GFM are left with 1.8 pu
            TimedSetPoints(3.5, GFL, 0.647, 1.0),
            TimedSetPoints(5.0, ("inv3", "inv8"), 1.3, 1.0),  # f > f_nom: the droop starts from the clipped 1 pu
            TimedSetPoints(6.0, ("inv5",), -1.3, 1.0),
        ),
    ),
    "wind-up": ComparedRun("agents without anti-windup", "wind-up", "none", closed_loop=True, gfl=ONE_RATING),
    "ideal": ComparedRun("as open; ideal switches and regulators", "islanding", "I", impedances=False, tolerance=2e-4),
}


QUANTITIES = {"f": "Hz", "P": "pu", "Q": "pu", "V": "pu", "P_set": "pu", "V_set": "pu"}
"""Quantities of each inverter in a row, and their units of comparison: pu of rating and of nominal voltage."""


class Largest(NamedTuple):
    """The largest difference of a quantity over all inverters and steps."""

    value: float
    """Magnitude, in the unit of `QUANTITIES`; nan if any difference is not a number."""
    inverter: str
    """Where it is."""
    t: float
    """When it is (s)."""
    span: tuple[float, float]
    """Smallest and largest value that the quantity takes in the first plant."""


def differences(
    first: Sequence[tuple[float, ...]], second: Sequence[tuple[float, ...]], units: Sequence[InverterRow]
) -> dict[str, Largest]:
    """Compare two plants step by step.

    Parameters
    ----------
    first, second
        Rows of `Plant.take_rows`, of the same times.
    units
        The inverters, in the rows' order.

    Raises
    ------
    ValueError
        If the rows are not of the same times.
    """
    t, ours = _arranged(first, units)
    t_second, theirs = _arranged(second, units)
    if not np.array_equal(t, t_second):
        raise ValueError(f"rows of {t.size} and {t_second.size} steps are not of the same times")
    largest_by_quantity = {}
    for k, quantity in enumerate(QUANTITIES):
        gap = np.abs(ours[:, :, k] - theirs[:, :, k])
        step, i = np.unravel_index(np.argmax(gap), gap.shape)  # the first nan, if there is any
        span = float(ours[:, :, k].min()), float(ours[:, :, k].max())
        largest_by_quantity[quantity] = Largest(float(gap[step, i]), units[int(i)].name, float(t[step]), span)
    return largest_by_quantity


def _arranged(
    rows: Sequence[tuple[float, ...]], units: Sequence[InverterRow]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the times (s), and steps x inverters x quantities in the units of `QUANTITIES`."""
    table = np.array(rows)
    P, V = (np.array([getattr(unit, name) for unit in units]) for name in ("P_rated", "V_nom"))
    bases = np.column_stack([np.ones(len(units)), P, P, V, P, V])
    return table[:, 0], table[:, 1:].reshape(len(table), len(units), len(QUANTITIES)) / bases


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare and print; returns 0 if all differences are within their tolerances."""
    parser = argparse.ArgumentParser(prog="compare_gridlabd", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("runs", nargs="*", metavar="run", help=f"which runs: {', '.join(RUNS)}; all by default")
    parser.add_argument("--gridlabd", default=sys.executable, metavar="PYTHON", help="interpreter with the wheel")
    given = parser.parse_args(arguments)
    for name in given.runs:
        if name not in RUNS:
            parser.error(f'run "{name}": there is no such run; choose from {", ".join(RUNS)}')
    sound = True
    for name in given.runs or RUNS:
        run = RUNS[name]
        try:
            version, largest_by_quantity = compare(run, given.gridlabd)
        except GridlabdError as error:
            print(error, file=sys.stderr)
            return 2
        passed = all(largest.value <= run.tolerance for largest in largest_by_quantity.values())
        sound = sound and passed
        verdict = "within" if passed else "BEYOND"
        print(f"\n{name}: {run.text} (GridLAB-D {version}); {verdict} {run.tolerance:g}")
        for quantity, largest in largest_by_quantity.items():
            print(_line(quantity, largest), flush=True)
    return 0 if sound else 1


def compare(run: ComparedRun, python: str) -> tuple[str, dict[str, Largest]]:
    """Let both plants go through a run.

    Parameters
    ----------
    run
        What to go through.
    python
        Interpreter with GridLAB-D.

    Returns
    -------
    (str, dict of str to Largest)
        GridLAB-D's version; the largest difference of each quantity.

    Raises
    ------
    GridlabdError
        If GridLAB-D is missing, or ended.
    """
    scenario, feeder = load_scenario(run.scenario)
    config, agents = configs(scenario, feeder, run.case)
    settings = replace(config.settings, gfl=run.gfl or config.settings.gfl, events=run.events or config.settings.events)
    config = replace(config, settings=settings, record_step=settings.h)
    network = Network(with_impedances(feeder) if run.impedances else feeder)
    ours = Plant(network, settings, config.T_c, config.record_step)
    assert config.end is not None
    with GridlabdPlant(ours, settings, config.T_c, config.end, python) as theirs:
        first, second = (_rows(plant, run, config, agents) for plant in (ours, theirs))
        return theirs.version, differences(first, second, network.inverters)


def _rows(
    plant: Plant | GridlabdPlant, run: ComparedRun, config: PlantConfig, agents: tuple[AgentConfig, ...]
) -> list[tuple[float, ...]]:
    """Return the rows of every step of a run."""
    return _closed_loop(plant, config, agents) if run.closed_loop else _open_loop(plant, run, config)


def _closed_loop(plant: PlantLike, config: PlantConfig, agents: tuple[AgentConfig, ...]) -> list[tuple[float, ...]]:
    rows: list[tuple[float, ...]] = []
    outcome = run_inprocess(config, agents, lambda telemetry: rows.extend(telemetry.rows), plant=plant)
    if outcome.broke:
        raise RuntimeError(outcome.broke)
    return rows


def _open_loop(plant: Plant | GridlabdPlant, run: ComparedRun, config: PlantConfig) -> list[tuple[float, ...]]:
    assert config.end is not None
    units = {unit.name: unit for unit in load_scenario(run.scenario)[1].inverters}
    orders = {round(order.t / config.T_c): order for order in run.orders}
    for tick in range(round(config.end / config.T_c)):
        if tick in orders:
            order = orders[tick]
            for name in order.inverters:
                plant.hold(name, order.P_set * units[name].P_rated, order.V_set * units[name].V_nom)
        plant.advance()
    return list(plant.take_rows())


def _line(quantity: str, largest: Largest) -> str:
    low, high = largest.span
    return (
        f"  {quantity:5s} {largest.value:8.1e} {QUANTITIES[quantity]:2s}  at {largest.inverter}, {largest.t:.3f} s"
        f"    (the run spans {low:.3f} to {high:.3f})"
    )


if __name__ == "__main__":
    sys.exit(main())
