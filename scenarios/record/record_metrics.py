"""The measures of a run from its record alone, as in its report; those of a killed run end with its record."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import replace

import msgspec

from gridpeers.plant.equipment import Tables
from gridpeers.plant.tables import FeederError, read_feeder
from gridpeers.scenarios.checks.checked_case import CheckedCase
from gridpeers.scenarios.live.departures import compare
from gridpeers.scenarios.record.record_file import RecordFileError
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.results.findings import find
from gridpeers.scenarios.results.history import History, Window, as_they_came, messages_saved, windows
from gridpeers.scenarios.results.island_membership import taken_part
from gridpeers.scenarios.results.metrics import STEADY
from gridpeers.scenarios.results.recorded_events import law_failures
from gridpeers.scenarios.results.report import RunReport
from gridpeers.scenarios.schema import ScenarioError, ScenarioModel
from gridpeers.scenarios.schema.configs import as_in
from gridpeers.scenarios.schema.loading import read_tables
from gridpeers.scenarios.schema.scenario_errors import Problems

_Measured = tuple[History, Sequence[Window], list[str]]  # Rows and windows that are measured, and notes on them


def report_of(record: RunRecord) -> RunReport:
    """Return the report on a record: its measures in the windows of the events up to its end; no claim is judged.

    The scenario's own metrics are left out: their code may be elsewhere by now. Raise RecordFileError if it has no
    scenario, no rows, or its feeder is not there any more.
    """
    scenario, feeder = _scenario_of(record)
    case, events = record.info.case, record.events()
    history, opened, notes = (_simulated if record.info.simulated else _live)(record, scenario, feeder)
    quiet = [each for message in record.telemetry() for each in message.quiet]
    measured = CheckedCase(
        scenario=scenario,
        feeder=feeder,
        case=case,
        history=history,
        windows=opened,
        events=events,
        messages_saved=messages_saved(scenario, feeder, case, quiet, opened),
    )
    notes += [f"the run broke: {record.outcome}"] if record.outcome else []
    return RunReport(
        scenario=scenario.name,
        titles={case: scenario.cases[case].title},
        findings=find({case: measured}),
        verdicts=(),
        failures={case: law_failures(events)},
        notes=[f"case {case}: {note}" for note in (*notes, *record.damage)],
        folder="",
    )


def _scenario_of(record: RunRecord) -> tuple[ScenarioModel, Tables]:
    info = record.info
    if not info.toml or not info.case:
        raise RecordFileError(f"{record.path}: a live run without a scenario: it has no events to be measured after")
    problems = Problems(str(record.path), info.toml)
    try:
        scenario = read_tables(tomllib.loads(info.toml), problems)  # not checked: to measure needs no law
        problems.raise_if_any()
        case = scenario.cases[info.case]
        scenario = msgspec.structs.replace(scenario, cases={info.case: case}, metrics=())
        return scenario, as_in(scenario, read_feeder(scenario.plant.feeder, scenario.plant.load_set))
    except (ScenarioError, FeederError, OSError, ValueError, KeyError) as error:
        text = "; ".join(getattr(error, "problems", ())) or str(error)
        raise RecordFileError(f"{record.path}: what it says about its scenario cannot be read: {text}") from None


def _simulated(record: RunRecord, scenario: ScenarioModel, feeder: Tables) -> _Measured:
    """Return what is measured of a run in simulated time: windows end where the record does."""
    history = record.physics()
    end = min(float(history.t[-1]), scenario.time.end_s)
    came = windows(as_they_came(scenario, record.events()), scenario.time.end_s)
    reached = [replace(window, end=min(window.end, end)) for window in came if window.start < end]
    shortest = max(STEADY, 2.0 * scenario.time.record_s) - 1e-9
    kept = tuple(window for window in reached if window.end - window.start >= shortest)
    notes = []
    if end < scenario.time.end_s - 1e-9:
        notes.append(f"the record ends at {end:.2f} s of {scenario.time.end_s:g} s; what is measured ends there")
    if len(kept) < len(came):
        labels = {window.label for window in kept}
        notes.append(f"not measured: {', '.join(one.label for one in came if one.label not in labels)}")
    return history, kept, notes


def _live(record: RunRecord, scenario: ScenarioModel, feeder: Tables) -> _Measured:
    """Return what is measured of a run in real time: windows whose end it reached, those that people made too."""
    history, events = record.physics(), record.events()
    end = float(history.t[-1])
    departures = compare(scenario, feeder, events, end)
    left_out = departures.unmeasured
    notes = [f"the record ends at {end:.2f} s"] if end < scenario.time.end_s - 1e-9 else []
    notes += [f"not measured: {', '.join(window.label for window in left_out)}"] if left_out else []
    notes += [departures.note] if departures.note else []
    return taken_part(scenario, feeder, history), departures.measured, notes
