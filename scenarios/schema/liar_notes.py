"""Sentences on the agents of a scenario that lie, for `gridpeers check`."""

from __future__ import annotations

from collections.abc import Iterator

from netem.models.lie import lie_in_words
from scenarios.schema.netem_tables import netem_of
from scenarios.schema.scenario_model import ScenarioModel


def liar_notes(scenario: ScenarioModel) -> Iterator[str]:
    """Yield a sentence for each agent that lies, with the cases in which it does."""
    cases: dict[str, list[str]] = {}
    for case in scenario.cases:
        for node in netem_of(scenario, case).nodes:
            if node.lies is not None:
                end = "the end" if node.to_s is None else f"{node.to_s:g} s"
                text = f"{node.name} lies from {node.from_s:g} s to {end}: {lie_in_words(node.lies)}"
                cases.setdefault(text, []).append(case)
    for text, of in cases.items():
        yield text + ("" if len(of) == len(scenario.cases) else f" (in {', '.join(of)})")
