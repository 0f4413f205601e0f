"""Recognise silences that faults of links and nodes in the scenario cause."""

from __future__ import annotations

import re
from math import inf

from gridpeers.netem.models.loss import Bernoulli
from gridpeers.netem.schema.fault import Span
from gridpeers.netem.schema.pattern import Link
from gridpeers.plant.equipment import Feeder
from gridpeers.scenarios.schema import ScenarioModel
from gridpeers.scenarios.schema.netem_tables import netem_of, setup_of
from gridpeers.wire.messages import PLANT, PlantEvent

_NOTICED = 1.0
"""Time (s) after the end of a fault until which a silence is its doing: states have to come and to be reported."""

_RECOVERED = 10.0
"""Time (s) after a pause until which its links may yet have to be made anew."""

_RARE = 0.3
"""Probability of independent losses at which a dozen in a row come once in two million."""

_SILENT = re.compile(r"\S+ is silent: (?:.* (no measurement))?")
_DEAF = re.compile(r"\S+ does not hear ([^:]+):")
_AGAIN = re.compile(r"\S+ (is heard again|hears .* again)")


class ExpectedSilence:
    """Recognise events of silence (`gridpeers.plant.realtime.silence_detector`) that the scenario itself causes.

    Parameters
    ----------
    scenario : ScenarioModel
        With its one case.
    feeder : Feeder
        Its feeder.
    """

    def __init__(self, scenario: ScenarioModel, feeder: Feeder) -> None:
        (case,) = scenario.cases
        setup = setup_of(netem_of(scenario, case), scenario, feeder, real_nodes=True)
        self._netem, self._microgrids = setup.netem, setup.microgrids

    def __call__(self, event: PlantEvent) -> bool:
        """Return whether an event ends a silence, or begins one that a fault of the scenario causes."""
        if _AGAIN.match(event.text):
            return True
        name, t = event.subject, event.t
        if match := _SILENT.match(event.text):
            return self._hurt(name, t) or (bool(match[1]) and self._cut_off(PLANT, name, t))
        if match := _DEAF.match(event.text):
            others = match[1].split(", ")
            return self._hurt(name, t) or all(self._hurt(one, t) or self._cut_off(one, name, t) for one in others)
        return False

    def _hurt(self, name: str, t: float) -> bool:
        """Whether an agent is paused, slow or dead at t (s), or was shortly before."""
        return any(
            node.name == name
            and (node.kill or node.pause or node.slow_s > 0.0)
            and node.from_s <= t < (inf if node.to_s is None else node.to_s + _RECOVERED)
            for node in self._netem.nodes
        )

    def _cut_off(self, src: str, dst: str, t: float) -> bool:
        """Whether a fault that can keep back all messages acts on a link at t (s) or shortly before."""
        spans = self._netem.spans(Link(src, dst), self._microgrids)
        return any(_silences(span) and span.from_s <= t < span.to_s + _NOTICED for span in spans)


def _silences(span: Span) -> bool:
    """Whether a fault can keep back or delay a dozen messages one after the other."""
    if isinstance(span.model, Bernoulli):
        return span.model.p > _RARE
    return span.kind not in ("duplicate", "corrupt")
