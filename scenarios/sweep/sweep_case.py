"""One run of a sweep: from a checked scenario to a row of numbers; an error, too, is a row that says why."""

from __future__ import annotations

import copy
import math
from dataclasses import asdict
from functools import lru_cache
from typing import Any, Literal

import msgspec
import numpy as np

from gridpeers.plant.build import build_plant
from gridpeers.plant.feeder import Plant
from gridpeers.plant.plant_config import PlantConfig
from gridpeers.plant.tables import read_feeder
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.results.findings import Findings, find
from gridpeers.scenarios.results.metrics import SHARING, SHARING_OF_ISLANDS
from gridpeers.scenarios.results.record import Recorder
from gridpeers.scenarios.results.recorded_events import ended_by_a_law, first_of, law_failures
from gridpeers.scenarios.results.run_files import JournalRow
from gridpeers.scenarios.schema import ScenarioModel
from gridpeers.scenarios.schema.configs import as_in, configs
from gridpeers.scenarios.schema.plugin_keys import judges_laws
from gridpeers.wire.wording import utf8

KEPT_PLANTS = 4  # Plants at t = 0 that a worker keeps; one is about 1 MB

_plants: dict[bytes, Plant] = {}  # Plants at t = 0 of this process, by their configuration

_feeder = lru_cache(maxsize=8)(read_feeder)


class SweepRow(JournalRow, frozen=True, kw_only=True):
    status: Literal["ran", "broke", "law failed"]
    """Where a law failed there are no measures, which would be droop's, unless the scenario has switched the check
    "law_failed" off: then the status is "ran"."""
    why: str = ""
    history_sha256: str = ""
    """Fingerprint of its rows, as `gridpeers run` has it."""
    links_sha256: str = ""
    """Of all verdicts of the emulated links; "" without."""
    trips: str = ""
    """Trips of inverters, with time and reason; "" without any. Measures are of those that are left."""
    metric_warnings: str = ""
    """The scenario's own metrics without a value, and why; "" when all have one."""
    link_warnings: str = ""
    """Accounts of emulated links that do not close, and plugged-in faults that failed; "" if there are none."""
    measures: dict[str, float | None] = msgspec.field(default_factory=dict)
    """Every index of every event's window, e.g. "event1.MPSI", None where it never came to be; "event1.steady", 1 where
    all of them are steady values, else 0; and messages over all emulated links, e.g. "links_dropped"."""


FATE = ("status", "why", "trips", "link_warnings", "history_sha256", "links_sha256", "metric_warnings")
"""Fields of a row that are columns between parameters and indexes."""


def run_one(number: int, scenario: ScenarioModel, case: str) -> SweepRow:
    try:
        return _run(number, scenario, case)
    except Exception as error:
        text = utf8(str(error))
        known = type(error).__name__ in ("PlantError", "RecordError")
        return SweepRow(number=number, status="broke", why=text if known else f"{type(error).__name__}: {text}")


def _run(number: int, scenario: ScenarioModel, case: str) -> SweepRow:
    feeder = as_in(scenario, _feeder(scenario.plant.feeder, scenario.plant.load_set))
    plant, agents = configs(scenario, feeder, case)
    recorder = Recorder()
    ready = plant_at_start(plant) if plant.settings.simulator == "gridpeers" else None
    outcome = run_inprocess(plant, agents, recorder, plant=ready, on_other=recorder)
    if outcome.broke:
        stopped = ended_by_a_law(plant.on_law_failure, outcome.events)
        return SweepRow(number=number, status="law failed" if stopped else "broke", why=outcome.broke)
    failed_laws = first_of(law_failures(outcome.events))
    failed_check = bool(failed_laws) and judges_laws(scenario)
    recorded = recorder.finish(scenario.time.end_s, scenario.time.record_s)
    links = recorded.links
    measured = CheckedCase.of(scenario, feeder, case, recorded)
    with np.errstate(all="ignore"):  # a value that is no number is None
        found = find({case: measured})
    measures: dict[str, float | None] = {}
    own = found.own.get(case, {})
    for label in found.results[case]:
        measures |= flat(label, _indexes(found, case, label))
    for label, metrics in own.items():
        measures |= flat(label, dict(metrics.values))
    if failed_check:
        measures = dict.fromkeys(measures)
    if books := links.counts.values():
        measures["links_sent"] = float(links.sent)
        measures["links_delivered"] = float(sum(book.delivered for book in books))
        measures["links_dropped"] = float(sum(sum(book.dropped.values()) for book in books))
    failed = [f"{label}: {name} {text}" for label, metrics in own.items() for name, text in metrics.reasons.items()]
    return SweepRow(
        number=number,
        status="law failed" if failed_check else "ran",
        why=failed_laws,
        metric_warnings="; ".join(failed),
        history_sha256=recorded.sha256,
        links_sha256=links.sha256,
        trips="; ".join(f"t = {event.t:g} s: {event.text}" for event in recorded.events if event.kind == "trip"),
        link_warnings="; ".join((*links.warnings, *sorted(links.failures))),
        measures=measures,
    )


def _indexes(found: Findings, case: str, label: str) -> dict[str, Any]:
    """Return the indexes of a window; where it ends with several islands, what is shared is each island's."""
    whole = found.results[case][label]
    islands = found.islands.get(case, {}).get(label, {})
    numbers = asdict(whole) | asdict(found.settled[case][label])
    if islands:
        numbers |= dict.fromkeys(SHARING)
        numbers["islands"] = {
            name: {key: getattr(island, key) for key in SHARING_OF_ISLANDS} for name, island in islands.items()
        }
    del numbers["reasons"]
    return numbers | {"steady": float(not any(one.reasons for one in islands.values() or (whole,)))}


def flat(label: str, values: dict[str, Any]) -> dict[str, float | None]:
    found: dict[str, float | None] = {}
    for name, value in values.items():
        if isinstance(value, dict):
            found |= flat(f"{label}.{name}", value)
        else:
            found[f"{label}.{name}"] = value if value is not None and math.isfinite(value) else None
    return found


def plant_at_start(config: PlantConfig) -> Plant:
    """Return a plant at t = 0, copied from one that this process has built before: that saves a fifth of a run."""
    key = msgspec.json.encode((config.settings, config.T_c, config.record_step))  # tables in it have no hash
    _plants[key] = _plants.pop(key) if key in _plants else build_plant(config)  # the latest is the last
    if len(_plants) > KEPT_PLANTS:
        del _plants[next(iter(_plants))]
    return copy.deepcopy(_plants[key])
