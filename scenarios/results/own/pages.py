"""The reference pages of what can be plugged in: laws, metrics, claims, link faults, graphs."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from typing import Any

from agents import graphs
from agents.carriers.law_registry import LAWS
from agents.graphs import GRAPHS
from netem.models import own_fault as faults
from netem.models.own_fault import FAULTS
from scenarios.field_docs import field_table
from scenarios.results import claims
from scenarios.results.benchmark_registry import CLAIMS
from scenarios.results.own import metric
from scenarios.results.own.metric import METRICS
from wire.registry import PluginError, Registry

_LAW = """A class derived from gridpeers.Law; `docs/laws.md` has the contract.

    @gridpeers.law("mine")
    class Mine(gridpeers.Law):
        gain: Annotated[float, Unit("1/s"), Range(0, 100), "Rate."] = 5.0
        def step(self, own, neighbours, T):
            return gridpeers.SetPoints(P_set=own.P_set, V_set=own.V_set)
"""

PAGES: dict[str, tuple[Registry[Any], str, str]] = {
    "laws": (LAWS, _LAW, 'law = "mine:Mine", or law = { use = "mine:Mine", gain = 2.0 }, for all cases or in one'),
    "metrics": (METRICS, metric.__doc__ or "", 'metrics = ["mine:nadir_Hz", { use = "mine:Within", band_Hz = 0.05 }]'),
    "claims": (CLAIMS, claims.__doc__ or "", 'claims = ["mine:restored"]'),
    "faults": (FAULTS, faults.__doc__ or "", '"mine:Jammer" = { share = 0.2 } in an entry [[link]]'),
    "graphs": (GRAPHS, graphs.__doc__ or "", 'graph = "mine:star", or graph = { use = "mine:Nearest", k = 3 }'),
}
"""By topic: the registry, how one is written, and how a scenario names one."""


def page(topic: str) -> Iterator[str]:
    """Lines of the page of one registry: how one is written and named, and those that there are."""
    registry, how, key = PAGES[topic]
    title, _, rest = how.strip().partition("\n")
    yield f"# {registry.plural[:1].upper()}{registry.plural[1:]}"
    yield ""
    yield title
    yield from rest.rstrip().split("\n")
    yield ""
    yield f"In a scenario: {key}. A module is looked for beside the scenario's file, then on the Python path. A"
    yield f"distribution adds its own under the entry points `{registry.group}`."
    if not registry.names:
        yield ""
        yield "None come with gridpeers."
    for name in registry.names:
        yield ""
        yield f"## {name}"
        yield ""
        yield from _entry(registry, name)


def _entry(registry: Registry[Any], name: str) -> Iterator[str]:
    """Yield the sentence and the parameters of one."""
    try:
        it = registry.resolve(name)
    except PluginError as error:  # an entry point of somebody's that is broken
        yield f"Cannot be used: {error}"
        return
    yield (inspect.getdoc(it) or "").partition("\n\n")[0].replace("\n", " ") or "Its author tells nothing of it."
    if not isinstance(it, type):
        return
    if lines := list(field_table(it)):
        yield from ("", *lines)
