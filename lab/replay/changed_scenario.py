"""The scenario of what would have been, as a file can say it, and sentences on what no file can say."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from msgspec.structs import replace

from gridpeers.netem.schema.netem import Netem
from gridpeers.scenarios.schema.scenario_model import ScenarioModel

if TYPE_CHECKING:
    from gridpeers.lab.replay.changes import ChangedRule
    from gridpeers.scenarios.record.record_reader import RunRecord


def with_links(scenario: ScenarioModel, case: str, netem: Netem) -> ScenarioModel:
    """Return a scenario whose case has all faults of links, with their times, as entries of its own."""
    common = replace(scenario.netem, links=(), partitions=())
    own = replace(scenario.cases[case].netem, links=netem.links, partitions=netem.partitions)
    return replace(scenario, netem=common, cases={case: replace(scenario.cases[case], netem=own)})


def with_title(scenario: ScenarioModel, case: str, title: str) -> ScenarioModel:
    """Return a scenario whose case has this title in tables and figures."""
    return replace(scenario, cases={case: replace(scenario.cases[case], title=title)})


def unwritten(record: RunRecord, rule: ChangedRule) -> Iterator[str]:
    """Yield sentences on what the scenario file of a counterfactual does not say."""
    changes = rule.changes
    if not rule.links_written:
        yield "The changes of links are not in this file: their entries would contradict others."
    if rule.control is not None and changes.since > 0.0:
        yield f"Law, gains and graph hold from the start here; in what would have been, from {changes.since:g} s on."
    if record.info.clock == "wall":
        yield "Not in this file: delays and losses on the wire, and what people did; a run of it has its own."
