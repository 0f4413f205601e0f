"""What `gridpeers check` says of cases that trim more than their graph bears."""

from __future__ import annotations

import gridpeers as gp
from gridpeers.lab.predict.robustness import robustness_notes


def notes(law: dict[str, object], graph: str) -> list[str]:
    """Return what is said of islanding IV with another law and graph."""
    scenario = gp.load("islanding").replace({"case.IV.law": law, "case.IV.graph": graph, "paper": ""})
    return list(robustness_notes(scenario.spec, scenario.feeder))


def test_a_graph_that_does_not_bear_F_is_named() -> None:
    """Nine agents: a full graph (r 5) bears F = 2, a ring (r 1 or 2) none; without F nothing is said."""
    (said,) = notes({"use": "resilient", "F": 3}, "full")
    assert said.startswith(
        "case IV: W-MSR with F = 3 asks for a graph with r 7, and this one has r 5: even without liars"
    )
    assert said.endswith("take more links, or F = 2 (docs/hostile.md)")
    assert notes({"use": "resilient", "F": 2}, "full") == []
    assert len(notes({"use": "resilient"}, "ring")) == 1  # F is 1 unless said
    assert notes({"use": "resilient", "F": 0, "tolerance": 0.1}, "ring") == []
    assert notes({"use": "consensus"}, "ring") == []
