"""Predictions by theory of a case before it is run (docs/theory.md), as tables and as the command's text."""

from __future__ import annotations

from dataclasses import asdict
from functools import cached_property
from pathlib import Path

import pandas as pd

from gridpeers.agents.carriers.law_check import PAPER
from gridpeers.lab.predict.case_prediction import CasePrediction, predict_cases
from gridpeers.lab.predict.closed_form import DelayKind
from gridpeers.lab.predict.load_steps import LoadError
from gridpeers.lab.predict.prediction_table import case_text
from gridpeers.plant.equipment import Feeder
from gridpeers.runs.choices import with_cases
from gridpeers.scenario import Scenario, as_scenario
from gridpeers.scenarios.run_request import BrokenRunError
from gridpeers.scenarios.schema import ScenarioError
from gridpeers.scenarios.schema import scenario_model as model
from gridpeers.scenarios.schema.plugin_keys import law_of

_LIMITS: dict[DelayKind, str] = {
    "neighbours": "agent to agent",
    "disagreement": "agent to agent, own value as late",
    "local loop": "plant to agent or back",
}
"""Names of the delays whose limit is known."""


def predict(scenario: Scenario | str | Path, case: str, *, voltage: bool = True) -> Prediction:
    """Predict how a case will go, without running it.

    Parameters
    ----------
    scenario : Scenario, str or Path
        The experiment, or its name or path.
    case : str
        Its case.
    voltage : bool
        Whether the text has the modes of voltage and vars, which take a second or two.

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
        cases = predict_cases(spec, feeder, voltage=voltage)
    except LoadError as error:
        raise BrokenRunError(f"{spec.name}: {error}") from error
    return {name: Prediction(case) for name, case in cases.items()}


class Prediction:
    """Predictions by theory of one case; made by `gridpeers.predict`."""

    def __init__(self, case: CasePrediction) -> None:
        self._case = case
        self.title = case.title
        """Scenario and case."""

    @cached_property
    def modes(self) -> pd.Series:
        """Rates of the slow modes (1/s) and their causes: `links`, `lambda_2`, `kappa`, `sharing_rate`, ...

        Empty where nobody runs a secondary law.
        """
        found = asdict(self._case.modes) if self._case.has_law else {}
        return pd.Series(found, name=self.title, dtype=float)

    @cached_property
    def delay_limits(self) -> pd.DataFrame:
        """Longest delays (s) for which the case is stable: of the continuous equations, and of our law in its steps.

        Infinite: any delay; nan: unstable without one.
        """
        limits = self._case.delay_limits if self._case.has_law else {}
        rows = {_LIMITS[kind]: pair for kind, pair in limits.items()}
        frame = pd.DataFrame.from_dict(rows, orient="index", columns=["continuous", "discrete"], dtype=float)
        frame.attrs["units"] = {"continuous": "s", "discrete": "s"}
        return frame.rename_axis("delay")

    @cached_property
    def times(self) -> pd.DataFrame:
        """Times (s) after each event until frequency and sharing are restored, a row per (window, island).

        Columns: `restore_s` (abs(f - f_nom) < 0.01 Hz for good), `share_s` (MPSI < 0.01 for good), `t_restore_s`
        (both), nan where that never comes; `stable`; `note`.
        """
        numbers = ["restore_s", "share_s", "t_restore_s"]
        rows = [
            (
                step.label,
                ", ".join(step.members),
                times.restore_s,
                times.share_s,
                times.report_s,
                times.stable,
                times.note,
            )
            for (step, _), times in zip(self._case.islands, self._case.times, strict=True)
        ]
        frame = pd.DataFrame(rows, columns=["window", "island", *numbers, "stable", "note"])
        frame = frame.set_index(["window", "island"]).astype(dict.fromkeys(numbers, float))
        frame.attrs["units"] = dict.fromkeys(numbers, "s")
        return frame

    def __str__(self) -> str:
        """Return the text that the command `gridpeers predict` prints."""
        return case_text(self._case)

    def __repr__(self) -> str:
        return f"<Prediction {self.title}>"
