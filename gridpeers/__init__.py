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
    from gridpeers.runs.comparison import Comparison, compare
    from gridpeers.runs.result import Result, Results
    from gridpeers.runs.running import read
    from gridpeers.runs.sweeping import sweep
    from gridpeers.scenario import Scenario, load
    from gridpeers.scenarios.checks.check_registry import CHECKS
    from gridpeers.scenarios.checks.check_verdict import Check, CheckVerdict, NotJudgedError, Violation
    from gridpeers.scenarios.checks.checked_case import CheckedCase
    from gridpeers.scenarios.results.claims import (
        CLAIMS,
        Benchmark,
        Claim,
        Judge,
        Published,
        Verdict,
        judge,
    )
    from gridpeers.scenarios.results.findings import Findings
    from gridpeers.scenarios.results.metric import METRICS
    from gridpeers.scenarios.results.plots import style as figures
    from gridpeers.scenarios.results.run_files import FolderError
    from gridpeers.scenarios.results.window_metrics import WindowData
    from gridpeers.scenarios.run_request import BrokenRunError
    from gridpeers.scenarios.schema.loading import catalogue
    from gridpeers.scenarios.schema.scenario_errors import ScenarioError
    from gridpeers.scenarios.sweep import axes as random_graphs
    from gridpeers.scenarios.sweep import sweep_reading as sweep_files
    from gridpeers.wire.schema.plausible import Plausible, Range, Unit

    claim, graph, law = CLAIMS.register, GRAPHS.register, LAWS.register  # one by one: each has a type of its own
    check, link_fault, metric = CHECKS.register, FAULTS.register, METRICS.register

_NAMES = {
    "gridpeers.agents.laws.law": ("Law", "Neighbour", "Own", "SetPoints", "Term", "Terms"),
    "gridpeers.feeder": ("Feeder",),
    "gridpeers.netem.models.own_fault": ("LinkFault",),
    "gridpeers.runs.comparison": ("Comparison", "compare"),
    "gridpeers.runs.result": ("Result", "Results"),
    "gridpeers.runs.running": ("read",),
    "gridpeers.runs.sweeping": ("sweep",),
    "gridpeers.scenario": ("Scenario", "load"),
    "gridpeers.scenarios.checks.check_verdict": ("Check", "CheckVerdict", "NotJudgedError", "Violation"),
    "gridpeers.scenarios.checks.checked_case": ("CheckedCase",),
    "gridpeers.scenarios.results.claims": ("Benchmark", "Claim", "Judge", "Published", "Verdict", "judge"),
    "gridpeers.scenarios.results.window_metrics": ("WindowData",),
    "gridpeers.scenarios.results.findings": ("Findings",),
    "gridpeers.scenarios.results.run_files": ("FolderError",),
    "gridpeers.scenarios.run_request": ("BrokenRunError",),
    "gridpeers.scenarios.schema.loading": ("catalogue",),
    "gridpeers.scenarios.schema.scenario_errors": ("ScenarioError",),
    "gridpeers.wire.schema.plausible": ("Plausible", "Range", "Unit"),
}
"""Public names by their module."""

_HOME = {name: f"{module}:{name}" for module, names in _NAMES.items() for name in names} | {
    "check": "gridpeers.scenarios.checks.check_registry:CHECKS.register",
    "claim": "gridpeers.scenarios.results.claims:CLAIMS.register",
    "graph": "gridpeers.agents.graphs:GRAPHS.register",
    "law": "gridpeers.agents.carriers.law_registry:LAWS.register",
    "link_fault": "gridpeers.netem.models.own_fault:FAULTS.register",
    "metric": "gridpeers.scenarios.results.metric:METRICS.register",
    "figures": "gridpeers.scenarios.results.plots.style",
    "random_graphs": "gridpeers.scenarios.sweep.axes",
    "sweep_files": "gridpeers.scenarios.sweep.sweep_reading",
}
"""`module:attributes` of each public name, or a module; it is imported when the name is first used (PEP 562)."""

_OF_ROOMS = ("Counterfactual", "Prediction", "counterfactual", "predict", "replay")
"""Public names that rooms above the face bring (`gridpeers.rooms`)."""

__all__ = [
    "Benchmark",
    "BrokenRunError",
    "Check",
    "CheckVerdict",
    "CheckedCase",
    "Claim",
    "Comparison",
    "Counterfactual",
    "Feeder",
    "Findings",
    "FolderError",
    "Judge",
    "Law",
    "LinkFault",
    "Neighbour",
    "NotJudgedError",
    "Own",
    "Plausible",
    "Prediction",
    "Published",
    "Range",
    "Result",
    "Results",
    "Scenario",
    "ScenarioError",
    "SetPoints",
    "Term",
    "Terms",
    "Unit",
    "Verdict",
    "Violation",
    "WindowData",
    "catalogue",
    "check",
    "claim",
    "compare",
    "counterfactual",
    "figures",
    "graph",
    "judge",
    "law",
    "link_fault",
    "load",
    "metric",
    "predict",
    "random_graphs",
    "read",
    "replay",
    "sweep",
    "sweep_files",
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
            found = import_module(module)
            found = attrgetter(attributes)(found) if attributes else found
        else:
            from gridpeers.wire.wording import suggestion

            raise AttributeError(f'gridpeers has no "{name}"; {suggestion(name, __all__, "names")}')
        globals()[name] = found
        return found


def __dir__() -> list[str]:
    """Return the public names, for completion in a notebook."""
    return [*__all__, "__version__"]
