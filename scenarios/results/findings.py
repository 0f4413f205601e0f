"""The measures of a run, from which claims, tables, reports and metrics.json are made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from gridpeers.plant.equipment import F_NOM
from gridpeers.scenarios.results.claims import Published
from gridpeers.scenarios.results.metric import Measured, label, measured, metric_of
from gridpeers.scenarios.results.metrics import Settling, Steady, measure
from gridpeers.scenarios.results.window_metrics import WindowData
from gridpeers.scenarios.schema.configs import limits_of
from gridpeers.scenarios.schema.participants import without_agent
from gridpeers.scenarios.schema.plugin_keys import metrics_of

if TYPE_CHECKING:
    from gridpeers.scenarios.checks.checked_case import CheckedCase

SteadyValues = Mapping[str, Mapping[str, Steady]]


@dataclass(frozen=True, kw_only=True)
class Findings:
    """The measures of one run, as a claim gets them."""

    results: SteadyValues
    """Steady values by case and event."""
    f_nom: float = F_NOM
    """Nominal frequency (Hz)."""
    P_set0: float = float("nan")
    """First P_set of every inverter (pu)."""
    GFL: tuple[str, ...] = ()
    settled: Mapping[str, Mapping[str, Settling]] = field(default_factory=dict)
    """Settling by case and event."""
    islands: Mapping[str, Mapping[str, Mapping[str, Steady]]] = field(default_factory=dict)
    """Steady values of each island at the end of a window, by case, event and first inverter; if there are several."""
    available: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Available power at the end, by case and inverter (pu of rating), where it was changed."""
    without_agent: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Inverters without an agent, by case; the sharing indices leave them out."""
    messages_saved: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Share of states that the laws did not send, by case and event; empty if they sent all states."""
    own: Mapping[str, Mapping[str, Measured]] = field(default_factory=dict)
    """Metrics of the scenario, by case and event, with `values` and `reasons` by name."""

    def apart(self, case: str, event: str) -> Mapping[str, Steady]:
        """Return the islands at the end of a window, if there are several."""
        return self.islands.get(case, {}).get(event, {})

    def parts(self, case: str, event: str) -> dict[str, Steady]:
        """Return the steady values of a window under "", and those of several islands under ", island of NAME"."""
        islands = {f", island of {name}": steady for name, steady in self.apart(case, event).items()}
        return {"": self.results[case][event]} | islands

    def value(self, cell: Published) -> float:
        return float(getattr(self._steady(cell), cell.quantity))

    def reason(self, cell: Published) -> str:
        """Return why our number there is no steady value; empty if it is one."""
        return self._steady(cell).reasons.get(cell.quantity, "")

    def _steady(self, cell: Published) -> Steady:
        if cell.island:
            return self.islands[cell.case][cell.event][cell.island]
        return self.results[cell.case][cell.event]

    def within(self, cell: Published) -> bool | None:
        """Return whether our number there is steady and within the tolerance; None without a tolerance."""
        return cell.within(float("nan") if self.reason(cell) else self.value(cell))

    def unsteady(self, cases: Sequence[str], events: Sequence[str], measures: Sequence[str]) -> list[str]:
        """Return a reason with its place for each measure that is not steady, island by island."""
        return [
            f"case {case}, {event}{where}: {label(name, self.f_nom)} {steady.reasons[name]}"
            for case in cases
            for event in events
            for where, steady in self.parts(case, event).items()
            if where or not self.apart(case, event)
            for name in measures
            if name in steady.reasons
        ]

    def has(self, cell: Published) -> bool:
        islands = self.apart(cell.case, cell.event)
        return cell.event in self.results.get(cell.case, {}) and (not cell.island or cell.island in islands)


def find(cases: Mapping[str, CheckedCase]) -> Findings:
    """Measure all cases of a run, live or not, with the metrics of every run and with the scenario's own."""
    first = next(iter(cases.values()))
    scenario, f_nom = first.scenario, first.f_nom
    results: dict[str, dict[str, Steady]] = {}
    settled: dict[str, dict[str, Settling]] = {}
    islands: dict[str, dict[str, dict[str, Steady]]] = {}
    available: dict[str, dict[str, float]] = {}
    own: dict[str, dict[str, Measured]] = {}
    metrics = [(name, metric_of(plugin)) for name, plugin in metrics_of(scenario)]
    for name, case in cases.items():
        results[name], settled[name], islands[name] = {}, {}, {}
        own |= {name: {}} if metrics else {}
        for window in case.windows:
            parts = case.parts[window]
            several = {
                part.nameplates.names[0]: measure(part.history, part.nameplates, window, f_nom)
                for part in parts
                if len(parts) > 1
            }
            islands[name] |= {window.label: several} if several else {}
            data = WindowData.cut(
                case.seen_by(window),
                window,
                case=name,
                islands=several,
                nameplates=case.nameplates,
                f_nom=f_nom,
                T_c=case.T_c,
                messages_saved=case.messages_saved.get(window.label, 0.0),
            )
            results[name][window.label], settled[name][window.label] = data.steady, data.settled
            if metrics:
                with np.errstate(all="ignore"):  # a value that is no number has its reason
                    own[name][window.label] = measured(metrics, data)
        rating = dict(zip(case.nameplates.names, case.nameplates.s.tolist(), strict=True))
        available[name] = {limit.inverter: limit.P_max / rating[limit.inverter] for limit in limits_of(scenario, name)}
    everybody = first.nameplates
    return Findings(
        results=results,
        f_nom=f_nom,
        P_set0=scenario.plant.P_set0_pu,
        GFL=tuple(name for name, GFM in zip(everybody.names, everybody.GFM, strict=True) if not GFM),
        settled=settled,
        islands=islands,
        available=available,
        without_agent={
            case: tuple(name for name in everybody.names if name in without)
            for case in cases
            if (without := without_agent(scenario, case))
        },
        messages_saved={name: case.messages_saved for name, case in cases.items()},
        own=own,
    )
