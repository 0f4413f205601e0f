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
    from agents.carriers.law_registry import LAWS
    from agents.graphs import GRAPHS
    from agents.laws.law import Law, Neighbour, Own, SetPoints, Term, Terms
    from gridpeers.feeder import Feeder
    from gridpeers.runs.result import Result, Results
    from gridpeers.runs.running import read
    from gridpeers.scenario import Scenario, load
    from gridpeers.studies.comparison import Comparison, compare
    from gridpeers.studies.prediction import Prediction, predict
    from gridpeers.studies.replaying import Counterfactual, counterfactual, replay
    from gridpeers.studies.sweeping import sweep
    from netem.models.own_fault import FAULTS, LinkFault
    from scenarios.checks.check_registry import CHECKS
    from scenarios.checks.check_verdict import Check, CheckVerdict, NotJudgedError, Violation
    from scenarios.checks.checked_case import CheckedCase
    from scenarios.results.evaluation.benchmark_registry import CLAIMS
    from scenarios.results.evaluation.claims import Claim
    from scenarios.results.evaluation.metric import METRICS
    from scenarios.results.evaluation.window_metrics import WindowData
    from scenarios.results.run_files import FolderError
    from scenarios.run_request import BrokenRunError
    from scenarios.schema.loading import catalogue
    from scenarios.schema.scenario_errors import ScenarioError
    from wire.schema.plausible import Plausible, Range, Unit

    claim, graph, law = CLAIMS.register, GRAPHS.register, LAWS.register  # one by one: each has a type of its own
    check, link_fault, metric = CHECKS.register, FAULTS.register, METRICS.register

_HOME = {
    "BrokenRunError": "scenarios.run_request",
    "Check": "scenarios.checks.check_verdict",
    "CheckVerdict": "scenarios.checks.check_verdict",
    "CheckedCase": "scenarios.checks.checked_case",
    "Claim": "scenarios.results.evaluation.claims",
    "Comparison": "gridpeers.studies.comparison",
    "Counterfactual": "gridpeers.studies.replaying",
    "Feeder": "gridpeers.feeder",
    "FolderError": "scenarios.results.run_files",
    "Law": "agents.laws.law",
    "LinkFault": "netem.models.own_fault",
    "Neighbour": "agents.laws.law",
    "NotJudgedError": "scenarios.checks.check_verdict",
    "Own": "agents.laws.law",
    "Prediction": "gridpeers.studies.prediction",
    "Plausible": "wire.schema.plausible",
    "Range": "wire.schema.plausible",
    "Result": "gridpeers.runs.result",
    "Results": "gridpeers.runs.result",
    "Scenario": "gridpeers.scenario",
    "ScenarioError": "scenarios.schema.scenario_errors",
    "SetPoints": "agents.laws.law",
    "Term": "agents.laws.law",
    "Terms": "agents.laws.law",
    "Unit": "wire.schema.plausible",
    "Violation": "scenarios.checks.check_verdict",
    "WindowData": "scenarios.results.evaluation.window_metrics",
    "catalogue": "scenarios.schema.loading",
    "check": "scenarios.checks.check_registry:CHECKS.register",
    "claim": "scenarios.results.evaluation.benchmark_registry:CLAIMS.register",
    "compare": "gridpeers.studies.comparison",
    "counterfactual": "gridpeers.studies.replaying",
    "graph": "agents.graphs:GRAPHS.register",
    "law": "agents.carriers.law_registry:LAWS.register",
    "link_fault": "netem.models.own_fault:FAULTS.register",
    "load": "gridpeers.scenario",
    "metric": "scenarios.results.evaluation.metric:METRICS.register",
    "predict": "gridpeers.studies.prediction",
    "read": "gridpeers.runs.running",
    "replay": "gridpeers.studies.replaying",
    "sweep": "gridpeers.studies.sweeping",
}
"""Module of each public name, or `module:attributes`; it is imported when the name is first used (PEP 562)."""

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
        if name not in _HOME:
            from wire.schema.suggestion import suggestion

            raise AttributeError(f'gridpeers has no "{name}"; {suggestion(name, _HOME, "names")}')
        module, _, attributes = _HOME[name].partition(":")
        found = globals()[name] = attrgetter(attributes or name)(import_module(module))
        return found


def __dir__() -> list[str]:
    """Return the public names, for completion in a notebook."""
    return [*__all__, "__version__"]
