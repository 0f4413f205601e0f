"""A recorded run again under changes, as a run folder beside one of the run as it was."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import pandas as pd

from gridpeers.lab.replay.changes import ChangedRule, Changes, changed_rule
from gridpeers.lab.replay.closed_loop import ClosedLoop
from gridpeers.lab.replay.recorded_process import ReplayError
from gridpeers.lab.replay.replay import ComparedRows, record_of, run_again
from gridpeers.plant.build import start_plant
from gridpeers.runs.comparison import Comparison
from gridpeers.runs.result import Result
from gridpeers.runs.run_folder import RunFolder, new_home
from gridpeers.runs.running import read, warn_of_laws
from gridpeers.scenario import plain
from gridpeers.scenarios.measured_run import write_measures
from gridpeers.scenarios.record.record_info import LIVE, RecordInfo
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.scenarios.results.plots.drawing import drawing_of
from gridpeers.scenarios.results.record import Recorded, Recorder, RecordError
from gridpeers.scenarios.results.run_files import broken_if_ended, set_status, shown, write_whole
from gridpeers.scenarios.run_request import Other, Progress, Request
from gridpeers.scenarios.schema.scenario_model import ScenarioModel
from gridpeers.scenarios.schema.scenario_writing import to_toml
from gridpeers.scenarios.versions import versions
from gridpeers.wire.messages import LinkReport, Telemetry

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Take = Callable[[Telemetry | Other], None]

MISSING = (
    "-: no number, as the value is not steady, or f or MPSI is never restored; metrics.json has the reasons. "
    "Several islands have rows of their own"
)


def counterfactual(
    run: Result | RunRecord | str | Path,
    *,
    without: str | Iterable[str] = (),
    law: Any = "",
    replace: Mapping[str, Any] | None = None,
    since: float = 0.0,
    folder: str | Path | None = None,
) -> Counterfactual:
    """Run a recorded run again in closed loop with the plant, with changes from a run time on.

    Raise RecordFileError and ReplayError as `replay` does, also for a wrong change or a time outside of the record, and
    FolderError if the folder is not empty or cannot be written.

    Parameters
    ----------
    without : str or list of str
        Links to cut, as in scenarios: "inv4 -> inv7", "inv4 <-> inv7", "* -> inv2".
    law : str or class
        Another law, by name, as `module:Class`, or as a class.
    replace : Mapping[str, Any], optional
        Values of keys of agents and links, by path: `{"gains.k_p": 0.001}`.
    since : float
        Run time (s) from which the changes hold.
    folder : str or Path, optional
        New or empty folder for the run. Without it the files disappear with the result.
    """
    record = record_of(run)
    try:
        changes = Changes(
            without=(without,) if isinstance(without, str) else tuple(without),
            law=law if isinstance(law, str) else plain(law),
            keys={key: plain(value) for key, value in (replace or {}).items()},
            since=float(since),
        )
    except (ValueError, TypeError) as error:
        raise ReplayError(f"a change cannot be read: {error}") from None
    done = counterfactual_in(record, changed_rule(record, changes), None if folder is None else new_home(folder))
    first = done.would_be.failures[:1]
    warn_of_laws({f"what would have been, {row.agent}": row.why for row in first.itertuples()}, depth=1)
    return done


def counterfactual_in(
    record: RunRecord, rule: ChangedRule, folder: Path | None, tell: Progress | None = None
) -> Counterfactual:
    would_be = RunFolder(folder or _temporary(), temporary=folder is None)
    was = RunFolder(_temporary(), temporary=True)
    with broken_if_ended(would_be.path):
        try:
            return Counterfactual(record, rule, was, would_be, tell)
        except RecordError as error:
            raise ReplayError(f"{record.path}: {error}") from None


def _temporary() -> Path:
    return Path(tempfile.mkdtemp(prefix="gridpeers-"))


class Counterfactual:
    """A recorded run and the run under changes, side by side; `gridpeers.counterfactual` returns it."""

    def __init__(
        self, record: RunRecord, rule: ChangedRule, was: RunFolder, would_be: RunFolder, tell: Progress | None
    ) -> None:
        self._folders = was, would_be  # they go with this
        self.changes = changes = rule.changes
        rows, effect = ComparedRows(record, changes.since if changes else inf), ComparedRows(record)
        run = _in_simulated_time if record.info.simulated else _in_real_time
        text = _scenario_text(record, rule, rule.scenario, would_be=True)
        with Recorder(would_be.path / rule.case, gaps=True, record=_physics(record, text)) as recorder:

            def take(message: Telemetry | Other) -> None:
                rows.take(message)
                effect.take(message)
                if isinstance(message, Telemetry | LinkReport):  # what else there is was never on a wire
                    recorder(message)
                if tell is not None and isinstance(message, Telemetry) and message.rows and message.rows[-1][0] > 0.0:
                    tell(rule.case, message.rows[-1][0], record.t_end)

            if tell is not None:
                tell(rule.case, 0.0, record.t_end)
            notes = run(record, rule, take)
            recorded = recorder.finish()
        if changes and effect.part.difference is None:
            notes = [*notes, f"the change made no difference: every row up to {effect.part.t_end:.2f} s is as recorded"]
        self.difference, self.compared, self.notes = rows.part.difference, rows.part.count, tuple(notes)
        """First row of the plant before the change that differs from the record (expected: none); number of compared
        rows; sentences on effects that are left out, or on a change without effect."""
        _write(record, rule, rule.scenario, would_be.path, text, recorded, figures=True)
        text = _scenario_text(record, rule, rule.recorded, would_be=False)
        before = _as_recorded(record, text, was.path / rule.case, recorded.ended)
        _write(record, rule, rule.recorded, was.path, text, before, figures=False)
        self.was, self.would_be = _result(was.path), _result(would_be.path)

    @property
    def folder(self) -> Path:
        return self._folders[1].path

    @cached_property
    def table(self) -> pd.DataFrame:
        return self._comparison.table

    @property
    def _comparison(self) -> Comparison:
        return Comparison({"": (self.was, self.would_be)}, ("was", "would be"))

    def plot(self) -> Figure:
        return self._comparison.plot()

    def __str__(self) -> str:
        text: str = self.table.to_string(float_format=lambda value: f"{value:.5g}", na_rep="-")
        missing = [MISSING] if self.table.isna().any(axis=None) else []
        return "\n".join((*self._comparison.failures(), text, *missing))

    def __repr__(self) -> str:
        return f"<Counterfactual of {self.was.spec.name} {self.was.case}: {self.changes}>"


def _result(folder: Path) -> Result:
    found = read(folder)
    assert isinstance(found, Result)
    return found


# -------------------------------------------------------------------- the run


def _in_real_time(record: RunRecord, rule: ChangedRule, take: Take) -> list[str]:
    loop = ClosedLoop(record, rule if rule.changes else None, take, start_plant)
    loop.run()
    return loop.notes


def _in_simulated_time(record: RunRecord, rule: ChangedRule, take: Take) -> list[str]:
    """Run a scenario in simulated time again: messages are late and lost by their numbers, so as they were."""
    links = {} if rule.links is None else {"links": rule.links}
    control = {} if rule.control is None else {"control": rule.control}
    broke = run_again(record, take, start_plant, of_agents=links | control, **links)
    return [f"the run would have broken: {broke}"] if broke else []


def _as_recorded(record: RunRecord, text: str, folder: Path, until: float) -> Recorded:
    with Recorder(folder, gaps=True, record=_physics(record, text)) as recorder:
        for message in record.telemetry():
            rows = tuple(row for row in message.rows if row[0] <= until + 1e-9)
            events = tuple(event for event in message.events if event.t <= until + 1e-9)
            recorder(msgspec.structs.replace(message, rows=rows, events=events))
        return recorder.finish()


def _physics(record: RunRecord, text: str) -> RecordInfo:
    """Return the run of a record that has rows, events and fates alone, made in this process."""
    return msgspec.structs.replace(record.info, level="physics", toml=text, driver="inprocess", versions=versions())


def _scenario_text(record: RunRecord, rule: ChangedRule, scenario: ScenarioModel, *, would_be: bool) -> str:
    info = record.info
    made = {"replayed": str(record.path.resolve()), "changes": str(rule.changes) if would_be else ""}
    as_run = {"driver": info.driver, "clock": info.clock, **made}
    remarks = rule.unwritten(clock=info.clock) if would_be else ()
    return to_toml(scenario, as_run | versions(), remarks)


def _write(
    record: RunRecord,
    rule: ChangedRule,
    scenario: ScenarioModel,
    folder: Path,
    text: str,
    recorded: Recorded,
    *,
    figures: bool,
) -> None:
    write_whole(folder / "scenario.toml", text)
    metrics = Request(
        scenario=scenario,
        feeder=rule.feeder,
        driver=LIVE,  # no claim is judged
        folder=folder,
        clock=record.info.clock,
        speed=record.info.plant.speed,
    )
    _, cases = write_measures(metrics, {rule.case: recorded}, {}, (), place=f"{shown(folder)}/")
    if figures:
        from gridpeers.scenarios.results.plots.run_figures import draw_all  # imports matplotlib

        draw_all(drawing_of(scenario, cases), folder / "plots")
    set_status(folder, "complete")
