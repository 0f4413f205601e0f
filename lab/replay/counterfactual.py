"""What would have been: a recorded run again under changes, as a run folder beside one of what was."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from pathlib import Path

from msgspec.structs import replace

from gridpeers.lab.replay.changed_scenario import unwritten
from gridpeers.lab.replay.changes import ChangedRule
from gridpeers.lab.replay.closed_loop import ClosedLoop
from gridpeers.lab.replay.difference import Difference
from gridpeers.lab.replay.no_difference import no_difference
from gridpeers.lab.replay.replay import ComparedRows
from gridpeers.lab.replay.replay_error import ReplayError
from gridpeers.lab.replay.replayed_process import MakePlant, start_plant_of
from gridpeers.plant.build import start_plant
from gridpeers.scenarios.drivers.inprocess import run_inprocess
from gridpeers.scenarios.live.live_report import write_report
from gridpeers.scenarios.record.record_info import LIVE
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.results.metrics_file import RunMetrics
from gridpeers.scenarios.results.record import Recorded, Recorder, RecordError
from gridpeers.scenarios.results.run_files import broken_if_ended, set_status, write_whole
from gridpeers.scenarios.run_request import Other, Progress
from gridpeers.scenarios.schema.scenario_model import ScenarioModel
from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.scenarios.versions import versions
from gridpeers.wire.messages import Telemetry


@dataclass(frozen=True, kw_only=True)
class CounterfactualRun:
    """What became of a counterfactual."""

    difference: Difference | None
    """First row of the plant before the change that is not as in the record; None if all are. It should be None."""
    compared: int
    """Number of rows that were compared."""
    t_end: float
    """Run time of its last row (s)."""
    notes: tuple[str, ...]
    """Sentences on what it leaves out, and why the change made no difference if it made none."""


def run_counterfactual(
    record: RunRecord,
    rule: ChangedRule,
    was: Path,
    would_be: Path,
    make_plant: MakePlant = start_plant,
    tell: Progress | None = None,
) -> CounterfactualRun:
    """Run a counterfactual, and write two run folders.

    Parameters
    ----------
    record : RunRecord
        The run, of any driver.
    rule : ChangedRule
        The run under changes, as `changed_rule` gives it.
    was, would_be : Path
        Empty folders: for what was, without figures, and for what would have been.
    make_plant : MakePlant, optional
        Starts the plant.
    tell : Progress, optional
        Takes the progress.

    Raises
    ------
    ReplayError
        If the record cannot be replayed.
    RecordFileError
        If the record cannot be read.
    """
    with broken_if_ended(would_be):
        try:
            return _both(record, rule, was, would_be, make_plant, tell)
        except RecordError as error:
            raise ReplayError(f"{record.path}: {error}") from None


def _both(
    record: RunRecord, rule: ChangedRule, was: Path, would_be: Path, make_plant: MakePlant, tell: Progress | None
) -> CounterfactualRun:
    """Run the record under the rule; write what was and what would have been."""
    changes = rule.changes
    rows, effect = ComparedRows(record, changes.since if changes else inf), ComparedRows(record)
    run = _in_simulated_time if record.info.simulated else _in_real_time
    with Recorder(would_be / rule.case, gaps=True) as recorder:

        def take(message: Telemetry | Other) -> None:
            rows.take(message)
            effect.take(message)
            recorder(message)
            if tell is not None and isinstance(message, Telemetry) and message.rows and message.rows[-1][0] > 0.0:
                tell(rule.case, message.rows[-1][0], record.t_end)

        if tell is not None:
            tell(rule.case, 0.0, record.t_end)
        notes = run(record, rule, take, make_plant)
        recorded = recorder.finish(recorder.ended, recorder.record_step)
    if changes and effect.difference is None:
        notes = [*notes, no_difference(record, rule, effect.t)]
    _write(record, rule, rule.scenario, would_be, recorded, would_be=True)
    _write(record, rule, rule.recorded, was, _as_recorded(record, was / rule.case, recorded.ended), would_be=False)
    return CounterfactualRun(difference=rows.difference, compared=rows.count, t_end=recorded.ended, notes=tuple(notes))


Take = Callable[[Telemetry | Other], None]


def _in_real_time(record: RunRecord, rule: ChangedRule, take: Take, make_plant: MakePlant) -> list[str]:
    loop = ClosedLoop(record, rule if rule.changes else None, take, make_plant)
    loop.run()
    return loop.notes


def _in_simulated_time(record: RunRecord, rule: ChangedRule, take: Take, make_plant: MakePlant) -> list[str]:
    """Run a scenario in simulated time again: messages are late and lost by their numbers, so as they were."""
    info = record.info
    links = {} if rule.links is None else {"links": rule.links}
    control = {} if rule.control is None else {"control": rule.control}
    plant = start_plant_of(info, make_plant)
    try:
        outcome = run_inprocess(
            replace(info.plant, record="physics", **links),
            [replace(agent, record="physics", **links, **control) for agent in info.agents],
            take,
            on_other=take,
            plant=plant,
        )
    except ValueError as error:
        raise ReplayError(f"the run cannot be made again here: {error}") from None
    finally:
        plant.close()
    return [f"the run would have broken: {outcome.broke}"] if outcome.broke else []


def _as_recorded(record: RunRecord, folder: Path, until: float) -> Recorded:
    """Write the rows of a record up to a time (s) as the driver did."""
    with Recorder(folder, gaps=True) as recorder:
        for message in record.telemetry():
            rows = tuple(row for row in message.rows if row[0] <= until + 1e-9)
            events = tuple(event for event in message.events if event.t <= until + 1e-9)
            recorder(replace(message, rows=rows, events=events))
        return recorder.finish(recorder.ended, recorder.record_step)


def _write(
    record: RunRecord, rule: ChangedRule, scenario: ScenarioModel, folder: Path, recorded: Recorded, *, would_be: bool
) -> None:
    """Write what a run folder has beside the files of its case."""
    info = record.info
    made = {"replayed": str(record.path.resolve()), "changes": str(rule.changes) if would_be else ""}
    as_run = {"driver": info.driver, "clock": info.clock, **made}
    remarks = unwritten(record, rule) if would_be else ()
    write_whole(folder / "scenario.toml", to_toml(scenario, as_run | versions(), remarks))
    metrics = RunMetrics(
        scenario=scenario,
        feeder=rule.feeder,
        driver=LIVE,  # its windows are those of what happened
        folder=folder,
        clock=info.clock,
        speed=info.plant.speed,
    )
    write_report(metrics, recorded, None, figures=would_be)
    set_status(folder, "complete")
