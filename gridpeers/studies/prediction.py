"""Predictions by theory of a case before it is run (docs/theory.md), as tables and as the command's text."""

from __future__ import annotations

from dataclasses import asdict
from functools import cached_property
from pathlib import Path

import pandas as pd

from agents.carriers.law_check import PAPER
from gridpeers.runs.choices import with_cases
from gridpeers.scenario import Scenario, as_scenario
from plant.equipment import Feeder
from scenarios.predict.closed_form import DelayKind, delay_limit_closed, modes
from scenarios.predict.delay_limits import delay_limit
from scenarios.predict.inverter_group import InverterGroup, inverter_group_of
from scenarios.predict.load_steps import IslandStep, LoadError, load_steps
from scenarios.predict.prediction_table import case_text
from scenarios.predict.times import predicted_times
from scenarios.predict.var_response import VarResponse, var_response
from scenarios.run import BrokenRunError
from scenarios.schema import ScenarioError
from scenarios.schema import scenario_model as model
from scenarios.schema.netem_tables import is_calm, netem_of
from scenarios.schema.plugin_keys import law_of

_LIMITS: dict[str, DelayKind] = {
    "agent to agent": "neighbours",
    "agent to agent, own value as late": "disagreement",
    "plant to agent or back": "local loop",
}
"""Delays whose limit is known, and their names in `scenarios.predict`."""


def predict(scenario: Scenario | str | Path, case: str, *, voltage: bool = True) -> Prediction:
    """Predict how a case will go, without running it.

    Parameters
    ----------
    scenario : Scenario, str or Path
        The experiment, or its name or path.
    case : str
        Its case.
    voltage : bool
        Whether the modes of voltage and vars are wanted in the text, which takes a second or two.

    Raises
    ------
    ScenarioError
        If there is no such case, or it runs another law than "consensus", of which theory tells nothing.
    BrokenRunError
        If the plant has no solution on droop alone.
    """
    known = as_scenario(scenario)
    return predictions(with_cases(known.spec, [case]), known.feeder, voltage=voltage)[case]


def predictions(spec: model.ScenarioModel, feeder: Feeder, *, voltage: bool) -> dict[str, Prediction]:
    """Predict all cases of a scenario; the plant is asked once for its loads."""
    others = {case: law.name for case in spec.cases if (law := law_of(spec, case)).name != PAPER}
    if others:
        raise ScenarioError(
            f'case {case}: runs the law {name}, and the predictions are of the law "{PAPER}" alone; run it instead'
            for case, name in others.items()
        )
    try:
        steps = load_steps(spec, feeder)
        plant = var_response(spec, feeder) if voltage else None
    except LoadError as error:
        raise BrokenRunError(f"{spec.name}: {error}") from error
    found = {}
    for name, rule in spec.cases.items():
        islands = [
            (step, inverter_group_of(spec, feeder, name, roster=step.roster, island=step.members)) for step in steps
        ]
        title = f"{spec.name}, case {name}" + (f" {rule.title}" if rule.title else "")
        if not is_calm(netem_of(spec, name)):
            title += "; without its faults of links and nodes, which these numbers leave out"
        found[name] = Prediction(title, inverter_group_of(spec, feeder, name), islands, plant)
    return found


class Prediction:
    """Predictions by theory of one case; made by `gridpeers.predict`.

    Parameters
    ----------
    title : str
        Scenario and case.
    inverters : InverterGroup
        The inverters at the start, and who listens to whom.
    islands : list of (IslandStep, InverterGroup)
        Islands after each event.
    plant : VarResponse or None
        How voltage and vars answer; None leaves them out.
    """

    def __init__(
        self,
        title: str,
        inverters: InverterGroup,
        islands: list[tuple[IslandStep, InverterGroup]],
        plant: VarResponse | None,
    ) -> None:
        self.title = title
        """Scenario and case."""
        self._inverters, self._islands, self._plant = inverters, islands, plant

    @cached_property
    def modes(self) -> pd.Series:
        """Rates of the slow modes (1/s) and their causes: `links`, `lambda_2`, `kappa`, `sharing_rate`, ...

        Empty where nobody runs a secondary law.
        """
        found = asdict(modes(self._inverters)) if self._acts else {}
        return pd.Series(found, name=self.title, dtype=float)

    @cached_property
    def delay_limits(self) -> pd.DataFrame:
        """Longest delays (s) for which the case is stable: of the continuous equations, and of our law in its steps.

        Infinite: any delay; nan: unstable without one.
        """
        kinds = _LIMITS if self._acts else {}
        rows = {
            words: {
                "continuous": delay_limit_closed(self._inverters, kind),
                "discrete": delay_limit(self._inverters, kind),
            }
            for words, kind in kinds.items()
        }
        frame = pd.DataFrame.from_dict(rows, orient="index", columns=["continuous", "discrete"], dtype=float)
        frame.attrs["units"] = {"continuous": "s", "discrete": "s"}
        return frame.rename_axis("delay")

    @cached_property
    def times(self) -> pd.DataFrame:
        """Times (s) after each event until frequency and sharing are restored, a row per (window, island).

        Columns: `restore_s` (abs(f - f_nom) < 0.01 Hz for good), `share_s` (MPSI < 0.01 for good), `t_restore_s`
        (both), nan where that never comes; `stable`; `note`.
        """
        rows = []
        for step, island in self._islands:
            row: dict[str, object] = {"window": step.label, "island": ", ".join(step.members)}
            if step.load is None or not island.GFM.any() or not self._acts:
                why = "there is no secondary law" if island.GFM.any() else "no grid-forming inverter: it is dead"
                row |= {"stable": False, "note": why if step.load else "islands join, which is not predicted"}
            else:
                found = predicted_times(island, load=step.load)
                row |= {"restore_s": found.restore_s, "share_s": found.share_s, "t_restore_s": found.report_s}
                row |= {"stable": found.stable, "note": found.note}
            rows.append(row)
        columns = ["window", "island", "restore_s", "share_s", "t_restore_s", "stable", "note"]
        frame = pd.DataFrame(rows, columns=columns).set_index(["window", "island"])
        numbers = ["restore_s", "share_s", "t_restore_s"]
        frame[numbers] = frame[numbers].astype(float)
        frame.attrs["units"] = dict.fromkeys(numbers, "s")
        return frame

    @property
    def _acts(self) -> bool:
        return bool(self._inverters.acts.any())

    def __str__(self) -> str:
        """Return the text that the command `gridpeers predict` prints."""
        return case_text(self.title, self._inverters, self._islands, self._plant)

    def __repr__(self) -> str:
        return f"<Prediction {self.title}>"
