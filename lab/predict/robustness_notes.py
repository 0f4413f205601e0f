"""Sentences on cases whose graph is not robust enough for the liars that their law should bear, for `gridpeers check`.

The rest of a prediction is of the paper's law alone; robustness is of the graph, whatever law runs on it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gridpeers.agents.laws.resilient import Resilient
from gridpeers.lab.predict.inverter_group import inverter_group_of
from gridpeers.lab.predict.robustness import robustness
from gridpeers.plant.equipment import Feeder
from gridpeers.scenarios.schema.plugin_keys import law_of
from gridpeers.scenarios.schema.scenario_model import ScenarioModel


def robustness_notes(scenario: ScenarioModel, feeder: Feeder) -> Iterator[str]:
    """Yield a sentence for each case with the law "resilient" whose F is more than its graph bears for certain."""
    for case in scenario.cases:
        law = law_of(scenario, case)
        F = int(law.parameters.get("F", Resilient.F)) if law.use == "resilient" else 0
        if not F:
            continue
        inverters = inverter_group_of(scenario, feeder, case)
        found = robustness(inverters.A[np.ix_(inverters.acts, inverters.acts)])
        if found.F < F:
            yield (
                f"case {case}: W-MSR with F = {F} asks for a graph with r {2 * F + 1}, and this one has {found}: even "
                f"without liars its agents may never agree; take more links, or F = {found.F} (docs/hostile.md)"
            )
