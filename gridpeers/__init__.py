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
    from gridpeers.agents.laws.law import Law as Law
    from gridpeers.agents.laws.law import Neighbour as Neighbour
    from gridpeers.agents.laws.law import Own as Own
    from gridpeers.agents.laws.law import SetPoints as SetPoints
    from gridpeers.agents.laws.law import Term as Term
    from gridpeers.agents.laws.law import Terms as Terms
    from gridpeers.feeder import Feeder as Feeder
    from gridpeers.lab.predict.prediction import Prediction as Prediction
    from gridpeers.lab.predict.prediction import predict as predict
    from gridpeers.lab.replay.counterfactual import Counterfactual as Counterfactual
    from gridpeers.lab.replay.counterfactual import counterfactual as counterfactual
    from gridpeers.lab.replay.replay import replay as replay
    from gridpeers.netem.models.own_fault import FAULTS
    from gridpeers.netem.models.own_fault import LinkFault as LinkFault
    from gridpeers.runs.comparison import Comparison as Comparison
    from gridpeers.runs.comparison import compare as compare
    from gridpeers.runs.result import Result as Result
    from gridpeers.runs.result import Results as Results
    from gridpeers.runs.running import read as read
    from gridpeers.runs.sweeping import sweep as sweep
    from gridpeers.scenario import Scenario as Scenario
    from gridpeers.scenario import load as load
    from gridpeers.scenarios.checks.check_registry import CHECKS
    from gridpeers.scenarios.checks.check_verdict import Check as Check
    from gridpeers.scenarios.checks.check_verdict import CheckVerdict as CheckVerdict
    from gridpeers.scenarios.checks.check_verdict import NotJudgedError as NotJudgedError
    from gridpeers.scenarios.checks.check_verdict import Violation as Violation
    from gridpeers.scenarios.checks.checked_case import CheckedCase as CheckedCase
    from gridpeers.scenarios.results.claims import CLAIMS
    from gridpeers.scenarios.results.claims import Benchmark as Benchmark
    from gridpeers.scenarios.results.claims import Claim as Claim
    from gridpeers.scenarios.results.claims import Judge as Judge
    from gridpeers.scenarios.results.claims import Published as Published
    from gridpeers.scenarios.results.claims import Verdict as Verdict
    from gridpeers.scenarios.results.claims import judge as judge
    from gridpeers.scenarios.results.findings import Findings as Findings
    from gridpeers.scenarios.results.metric import METRICS
    from gridpeers.scenarios.results.plots import style
    from gridpeers.scenarios.results.run_files import FolderError as FolderError
    from gridpeers.scenarios.results.window_metrics import WindowData as WindowData
    from gridpeers.scenarios.run_request import BrokenRunError as BrokenRunError
    from gridpeers.scenarios.schema.loading import catalogue as catalogue
    from gridpeers.scenarios.schema.scenario_errors import ScenarioError as ScenarioError
    from gridpeers.scenarios.sweep import axes, sweep_reading
    from gridpeers.wire.schema.table_schema import Plausible as Plausible
    from gridpeers.wire.schema.table_schema import Range as Range
    from gridpeers.wire.schema.table_schema import Unit as Unit

    claim, graph, law = CLAIMS.register, GRAPHS.register, LAWS.register  # one by one: each has a type of its own
    check, link_fault, metric = CHECKS.register, FAULTS.register, METRICS.register
    figures, random_graphs, sweep_files = style, axes, sweep_reading

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
    "gridpeers.wire.schema.table_schema": ("Plausible", "Range", "Unit"),
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

if not TYPE_CHECKING:
    __all__ = [*_HOME, *_OF_ROOMS]

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

            raise AttributeError(f'gridpeers has no "{name}"; {suggestion(name, __dir__(), "names")}')
        globals()[name] = found
        return found


def __dir__() -> list[str]:
    """Return the public names, for completion in a notebook."""
    return sorted([*_HOME, *_OF_ROOMS, "__version__"])
