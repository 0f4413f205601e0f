"""The public names of gridpeers, each with the module that defines it; `__init__.py` finds them here on first use."""

from gridpeers.agents.carriers.law_registry import LAWS
from gridpeers.agents.graphs import GRAPHS
from gridpeers.agents.laws.law import Law as Law
from gridpeers.agents.laws.law import Neighbour as Neighbour
from gridpeers.agents.laws.law import Own as Own
from gridpeers.agents.laws.law import SetPoints as SetPoints
from gridpeers.agents.laws.law import Term as Term
from gridpeers.agents.laws.law import Terms as Terms
from gridpeers.feeder import Feeder as Feeder
from gridpeers.lab.predict import theory_parts
from gridpeers.lab.predict.prediction import Prediction as Prediction
from gridpeers.lab.predict.prediction import predict as predict
from gridpeers.lab.replay.counterfactual import Counterfactual as Counterfactual
from gridpeers.lab.replay.counterfactual import counterfactual as counterfactual
from gridpeers.lab.replay.replay import replay as replay
from gridpeers.netem.models.own_fault import FAULTS
from gridpeers.netem.models.own_fault import LinkFault as LinkFault
from gridpeers.plant.inverters.inverter_model import InverterModel as InverterModel
from gridpeers.plant.inverters.inverter_model import heun as heun
from gridpeers.plant.inverters.inverter_model import inject as inject
from gridpeers.plant.inverters.inverter_registry import INVERTERS
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
from gridpeers.wire.schema.table_schema import SHARED as SHARED
from gridpeers.wire.schema.table_schema import Plausible as Plausible
from gridpeers.wire.schema.table_schema import Range as Range
from gridpeers.wire.schema.table_schema import Unit as Unit

check = CHECKS.register
claim = CLAIMS.register
graph = GRAPHS.register
inverter = INVERTERS.register
law = LAWS.register
link_fault = FAULTS.register
metric = METRICS.register
figures = style
random_graphs = axes
sweep_files = sweep_reading
theory = theory_parts
__version__: str
