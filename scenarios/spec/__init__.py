"""The scenario file: its types, its reading with every mistake at once, and what it starts processes with."""

from scenarios.spec.loading import catalogue, find_scenario, load_scenario
from scenarios.spec.scenario_errors import ScenarioError
from scenarios.spec.scenario_model import Case, Event, Scenario

__all__ = ["Case", "Event", "Scenario", "ScenarioError", "catalogue", "find_scenario", "load_scenario"]
