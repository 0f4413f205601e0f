"""gridpeers as a library: scenarios, runs, results, sweeps and predictions in Python.

>>> import gridpeers as gp
>>> scenario = gp.load("islanding").replace({"gains.k_p": 0.001})
>>> list(scenario.cases)
['I', 'II', 'III', 'IV']

`scenario.run("IV")` gives a `Result`: its `history`, `metrics`, `events` and `links` are pandas tables, `plot()` draws
it, and `save(folder)` writes the folder that the command `gridpeers run` writes. docs/python.md has the whole face.

Nothing heavy is imported before it is used: the command line and every agent's process start through this package.
"""

from __future__ import annotations

from importlib import import_module
from operator import attrgetter
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gridpeers.agents.carriers.law_registry import LAWS
    from gridpeers.agents.graphs import GRAPHS
    from gridpeers.agents.laws.law import Law, Neighbour, Own, SetPoints, Term, Terms
    from gridpeers.feeder import Feeder
    from gridpeers.lab.predict.prediction import Prediction, predict
    from gridpeers.lab.replay.counterfactual import Counterfactual, counterfactual
    from gridpeers.lab.replay.replay import replay
    from gridpeers.netem.models.own_fault import FAULTS, LinkFault
    from gridpeers.runs.result import Result, Results
    from gridpeers.runs.running import read
    from gridpeers.scenario import Scenario, load
    from gridpeers.scenarios.checks.check_registry import CHECKS
    from gridpeers.scenarios.checks.check_verdict import Check, CheckVerdict, NotJudgedError, Violation
    from gridpeers.scenarios.checks.checked_case import CheckedCase
    from gridpeers.scenarios.results.claims import CLAIMS, Claim
    from gridpeers.scenarios.results.metric import METRICS
    from gridpeers.scenarios.results.run_files import FolderError
    from gridpeers.scenarios.results.window_metrics import WindowData
    from gridpeers.scenarios.run_request import BrokenRunError
    from gridpeers.scenarios.schema.loading import catalogue
    from gridpeers.scenarios.schema.scenario_errors import ScenarioError
    from gridpeers.studies.comparison import Comparison, compare
    from gridpeers.studies.sweeping import sweep
    from gridpeers.wire.schema.plausible import Plausible, Range, Unit

    claim, graph, law = CLAIMS.register, GRAPHS.register, LAWS.register  # one by one: each has a type of its own
    check, link_fault, metric = CHECKS.register, FAULTS.register, METRICS.register

_HOME = {
    "BrokenRunError": "gridpeers.scenarios.run_request",
    "Check": "gridpeers.scenarios.checks.check_verdict",
    "CheckVerdict": "gridpeers.scenarios.checks.check_verdict",
    "CheckedCase": "gridpeers.scenarios.checks.checked_case",
    "Claim": "gridpeers.scenarios.results.claims",
    "Comparison": "gridpeers.studies.comparison",
    "Feeder": "gridpeers.feeder",
    "FolderError": "gridpeers.scenarios.results.run_files",
    "Law": "gridpeers.agents.laws.law",
    "LinkFault": "gridpeers.netem.models.own_fault",
    "Neighbour": "gridpeers.agents.laws.law",
    "NotJudgedError": "gridpeers.scenarios.checks.check_verdict",
    "Own": "gridpeers.agents.laws.law",
    "Plausible": "gridpeers.wire.schema.plausible",
    "Range": "gridpeers.wire.schema.plausible",
    "Result": "gridpeers.runs.result",
    "Results": "gridpeers.runs.result",
    "Scenario": "gridpeers.scenario",
    "ScenarioError": "gridpeers.scenarios.schema.scenario_errors",
    "SetPoints": "gridpeers.agents.laws.law",
    "Term": "gridpeers.agents.laws.law",
    "Terms": "gridpeers.agents.laws.law",
    "Unit": "gridpeers.wire.schema.plausible",
    "Violation": "gridpeers.scenarios.checks.check_verdict",
    "WindowData": "gridpeers.scenarios.results.window_metrics",
    "catalogue": "gridpeers.scenarios.schema.loading",
    "check": "gridpeers.scenarios.checks.check_registry:CHECKS.register",
    "claim": "gridpeers.scenarios.results.claims:CLAIMS.register",
    "compare": "gridpeers.studies.comparison",
    "graph": "gridpeers.agents.graphs:GRAPHS.register",
    "law": "gridpeers.agents.carriers.law_registry:LAWS.register",
    "link_fault": "gridpeers.netem.models.own_fault:FAULTS.register",
    "load": "gridpeers.scenario",
    "metric": "gridpeers.scenarios.results.metric:METRICS.register",
    "read": "gridpeers.runs.running",
    "sweep": "gridpeers.studies.sweeping",
}
"""Module of each public name, or `module:attributes`; it is imported when the name is first used (PEP 562)."""

_OF_ROOMS = ("Counterfactual", "Prediction", "counterfactual", "predict", "replay")
"""Public names that rooms above the face bring (`gridpeers.rooms`)."""

__all__ = [
    "BrokenRunError",
    "Check",
    "CheckVerdict",
    "CheckedCase",
    "Claim",
    "Comparison",
    "Counterfactual",
    "Feeder",
    "FolderError",
    "Law",
    "LinkFault",
    "Neighbour",
    "NotJudgedError",
    "Own",
    "Plausible",
    "Prediction",
    "Range",
    "Result",
    "Results",
    "Scenario",
    "ScenarioError",
    "SetPoints",
    "Term",
    "Terms",
    "Unit",
    "Violation",
    "WindowData",
    "catalogue",
    "check",
    "claim",
    "compare",
    "counterfactual",
    "graph",
    "law",
    "link_fault",
    "load",
    "metric",
    "predict",
    "read",
    "replay",
    "sweep",
]

if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        """Import a public name on its first use."""
        if name == "__version__":
            from importlib.metadata import version

            return version("gridpeers")
        if name in _OF_ROOMS:
            from gridpeers.rooms import ROOMS

            found = ROOMS.resolve(name)
        elif name in _HOME:
            module, _, attributes = _HOME[name].partition(":")
            found = attrgetter(attributes or name)(import_module(module))
        else:
            from gridpeers.wire.wording import suggestion

            raise AttributeError(f'gridpeers has no "{name}"; {suggestion(name, __all__, "names")}')
        globals()[name] = found
        return found


def __dir__() -> list[str]:
    """Return the public names, for completion in a notebook."""
    return [*__all__, "__version__"]
