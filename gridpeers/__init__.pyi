"""The public names, each by the one line that brings it; `__init__.py` reads this file, as type checkers do."""

from gridpeers.agents.carriers.law_registry import LAWS as _LAWS
from gridpeers.agents.graphs import GRAPHS as _GRAPHS
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
from gridpeers.netem.models.own_fault import FAULTS as _FAULTS
from gridpeers.netem.models.own_fault import LinkFault as LinkFault
from gridpeers.runs.comparison import Comparison as Comparison
from gridpeers.runs.comparison import compare as compare
from gridpeers.runs.result import Result as Result
from gridpeers.runs.result import Results as Results
from gridpeers.runs.running import read as read
from gridpeers.runs.sweeping import sweep as sweep
from gridpeers.scenario import Scenario as Scenario
from gridpeers.scenario import load as load
from gridpeers.scenarios.checks.check_registry import CHECKS as _CHECKS
from gridpeers.scenarios.checks.check_verdict import Check as Check
from gridpeers.scenarios.checks.check_verdict import CheckVerdict as CheckVerdict
from gridpeers.scenarios.checks.check_verdict import NotJudgedError as NotJudgedError
from gridpeers.scenarios.checks.check_verdict import Violation as Violation
from gridpeers.scenarios.checks.checked_case import CheckedCase as CheckedCase
from gridpeers.scenarios.results.claims import CLAIMS as _CLAIMS
from gridpeers.scenarios.results.claims import Benchmark as Benchmark
from gridpeers.scenarios.results.claims import Claim as Claim
from gridpeers.scenarios.results.claims import Judge as Judge
from gridpeers.scenarios.results.claims import Published as Published
from gridpeers.scenarios.results.claims import Verdict as Verdict
from gridpeers.scenarios.results.claims import judge as judge
from gridpeers.scenarios.results.findings import Findings as Findings
from gridpeers.scenarios.results.metric import METRICS as _METRICS
from gridpeers.scenarios.results.plots import style as _style
from gridpeers.scenarios.results.run_files import FolderError as FolderError
from gridpeers.scenarios.results.window_metrics import WindowData as WindowData
from gridpeers.scenarios.run_request import BrokenRunError as BrokenRunError
from gridpeers.scenarios.schema.loading import catalogue as catalogue
from gridpeers.scenarios.schema.scenario_errors import ScenarioError as ScenarioError
from gridpeers.scenarios.sweep import axes as _axes
from gridpeers.scenarios.sweep import sweep_reading as _sweep_reading
from gridpeers.wire.schema.table_schema import Plausible as Plausible
from gridpeers.wire.schema.table_schema import Range as Range
from gridpeers.wire.schema.table_schema import Unit as Unit

check = _CHECKS.register
claim = _CLAIMS.register
graph = _GRAPHS.register
law = _LAWS.register
link_fault = _FAULTS.register
metric = _METRICS.register
figures = _style
random_graphs = _axes
sweep_files = _sweep_reading
__version__: str
