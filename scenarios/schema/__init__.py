"""The scenario file: its types, its reading with every problem at once, and the configurations of a run's processes."""

from gridpeers.scenarios.schema.loading import catalogue, find_scenario, load_scenario
from gridpeers.scenarios.schema.scenario_errors import ScenarioError
from gridpeers.scenarios.schema.scenario_model import Case, Event, ScenarioModel

__all__ = ["Case", "Event", "ScenarioError", "ScenarioModel", "catalogue", "find_scenario", "load_scenario"]
