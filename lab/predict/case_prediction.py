"""Predictions of the cases of a scenario, each number computed once when it is first asked for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from gridpeers.lab.predict.closed_form import DelayKind, Modes, delay_limit_closed, modes
from gridpeers.lab.predict.delay_limits import delay_limit
from gridpeers.lab.predict.inverter_group import InverterGroup, inverter_group_of
from gridpeers.lab.predict.load_steps import IslandStep, load_steps
from gridpeers.lab.predict.times import Times, predicted_times
from gridpeers.lab.predict.var_response import VarResponse, var_response
from gridpeers.plant.equipment import Feeder
from gridpeers.scenarios.schema import ScenarioModel
from gridpeers.scenarios.schema.participants import is_calm, netem_of

KINDS: tuple[DelayKind, ...] = ("neighbours", "disagreement", "local loop")
"""Delays with a limit."""


@dataclass(frozen=True)
class CasePrediction:
    """Predictions of one case."""

    title: str
    """Scenario and case."""
    inverters: InverterGroup
    """The inverters at the start."""
    islands: tuple[tuple[IslandStep, InverterGroup], ...]
    """Islands after each event, and their inverters."""
    plant: VarResponse | None
    """Response of voltage and vars; None leaves them out."""

    @property
    def has_law(self) -> bool:
        """Whether any inverter runs the secondary law."""
        return bool(self.inverters.acts.any())

    @cached_property
    def modes(self) -> Modes:
        """The modes of the secondary law, if there is one."""
        return modes(self.inverters)

    @cached_property
    def delay_limits(self) -> dict[DelayKind, tuple[float, float]]:
        """Longest delays (s) for which the case is stable: by the continuous equations, and of our law in its steps."""
        return {kind: (delay_limit_closed(self.inverters, kind), delay_limit(self.inverters, kind)) for kind in KINDS}

    @cached_property
    def times(self) -> tuple[Times, ...]:
        """Times after each event, by island; a note says why there are none."""
        return tuple(self._times_of(step, island) for step, island in self.islands)

    def _times_of(self, step: IslandStep, island: InverterGroup) -> Times:
        if step.load is None:
            note = "islands join, which is not predicted"
        elif not island.GFM.any():
            note = "no grid-forming inverter, so the island is de-energised"
        elif not self.has_law:
            note = "there is no secondary law"
        else:
            return predicted_times(island, load=step.load)
        return Times(restore_s=None, share_s=None, stable=False, note=note)


def predict_cases(scenario: ScenarioModel, feeder: Feeder, *, voltage: bool) -> dict[str, CasePrediction]:
    """Return the predictions of all cases; the plant is asked once for its loads.

    Parameters
    ----------
    scenario : ScenarioModel
        Checked.
    feeder : Feeder
        Its feeder.
    voltage : bool
        Whether voltage and vars are predicted too, which takes a second or two.

    Raises
    ------
    LoadError
        If the plant has no solution on droop alone.
    """
    steps = load_steps(scenario, feeder)
    plant = var_response(scenario, feeder) if voltage else None
    found = {}
    for name, rule in scenario.cases.items():
        title = f"{scenario.name}, case {name}" + (f" {rule.title}" if rule.title else "")
        if not is_calm(netem_of(scenario, name)):
            title += "; without its faults of links and nodes, which these numbers leave out"
        islands = tuple(
            (step, inverter_group_of(scenario, feeder, name, roster=step.roster, island=step.members)) for step in steps
        )
        found[name] = CasePrediction(title, inverter_group_of(scenario, feeder, name), islands, plant)
    return found
