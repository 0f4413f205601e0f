"""Replay a recorded run, and ask what would have been."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from gridpeers.lab.replay.changes import ChangedRule, Changes, changed_rule
from gridpeers.lab.replay.counterfactual import CounterfactualRun, run_counterfactual
from gridpeers.lab.replay.replay import Replay
from gridpeers.lab.replay.replay import replay as replay_record
from gridpeers.lab.replay.replay_error import ReplayError
from gridpeers.runs.result import Result, shown_in_notebooks
from gridpeers.runs.run_folder import RunFolder, new_home
from gridpeers.runs.running import read, warn_of_laws
from gridpeers.scenario import plain
from gridpeers.scenarios.record.record_reader import RunRecord
from gridpeers.studies.comparison import Comparison

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from gridpeers.scenarios.run_request import Progress

RecordSource = Result | RunRecord | str | Path
"""A result, its record, or the folder of a case or its run.mcap."""


def replay(run: RecordSource) -> Replay:
    """Give the cores of a recorded run again what they got, and compare what they decide.

    Parameters
    ----------
    run : Result, RunRecord, str or Path
        The run, of any driver; its record may be cut off.

    Returns
    -------
    Replay
        `difference` is the first one, with agent, time, quantity, both values and unit; None if everything is the same
        within 1e-9.

    Raises
    ------
    RecordFileError
        If there is no record, or it cannot be read.
    ReplayError
        If it does not have what the cores got, or its law, graph or feeder is not here.
    """
    return replay_record(_record(run))


def counterfactual(
    run: RecordSource,
    *,
    without: str | Iterable[str] = (),
    without_loss: bool = False,
    without_link_commands: bool = False,
    law: Any = "",
    replace: Mapping[str, Any] | None = None,
    since: float = 0.0,
    folder: str | Path | None = None,
) -> Counterfactual:
    """Run a recorded run again, closed on our plant, with something changed.

    Parameters
    ----------
    run : Result, RunRecord, str or Path
        The run, of any driver.
    without : str or Iterable[str], optional
        Links to cut, as in scenarios: "inv4 -> inv7", "inv4 <-> inv7", "* -> inv2".
    without_loss : bool, optional
        Whether no message is lost by chance.
    without_link_commands : bool, optional
        Whether the commands that people gave to emulated links are left out.
    law : optional
        Another law: its name, `module:Class`, or a class.
    replace : Mapping[str, Any], optional
        Values of keys of agents and links, by their paths: `{"gains.k_p": 0.001}`.
    since : float, optional
        Run time (s) from which on; up to it everything is as it was.
    folder : str or Path, optional
        New or empty; takes the run folder. When left out, the files live as long as the result.

    Raises
    ------
    RecordFileError, ReplayError
        As `replay`; also if a link, a law, a key or a value is wrong, or the time is outside of the record.
    FolderError
        If there is something in the folder, or it cannot be written.
    """
    record = _record(run)
    try:
        keys = {key: plain(value) for key, value in (replace or {}).items()}
        changes = Changes(
            without=(without,) if isinstance(without, str) else tuple(without),
            without_loss=without_loss,
            without_link_commands=without_link_commands,
            law=law if isinstance(law, str) else plain(law),
            keys=keys,
            since=float(since),
        )
    except (ValueError, TypeError) as error:
        raise ReplayError(f"a change cannot be read: {error}") from None
    rule = changed_rule(record, changes)
    home = _temporary() if folder is None else new_home(folder)
    done = counterfactual_in(record, rule, home, temporary=folder is None)
    first = done.would_be.failures[:1]
    warn_of_laws({f"what would have been, {row.agent}": row.why for row in first.itertuples()}, depth=1)
    return done


def counterfactual_in(
    record: RunRecord, rule: ChangedRule, folder: Path, *, temporary: bool = False, tell: Progress | None = None
) -> Counterfactual:
    """Run a counterfactual into an empty folder, which goes with it if it is temporary; see `counterfactual`."""
    would_be, was = RunFolder(folder, temporary=temporary), RunFolder(_temporary(), temporary=True)
    done = run_counterfactual(record, rule, was.path, would_be.path, tell=tell)
    return Counterfactual(was, would_be, rule.changes, done)


def _temporary() -> Path:
    return Path(tempfile.mkdtemp(prefix="gridpeers-"))


def _record(run: RecordSource) -> RunRecord:
    if isinstance(run, RunRecord):
        return run
    return run.run_record if isinstance(run, Result) else RunRecord.open(run)


MISSING = (
    "-: no number: not steady at the end of the window, or never restored (f, and MPSI where it counts); metrics.json "
    "has the reasons. Where there are several islands, each shares for itself and has rows of its own"
)
"""Line below a table in which numbers are missing."""


class Counterfactual:
    """A recorded run and the run under changes, side by side; `gridpeers.counterfactual` makes it."""

    def __init__(
        self,
        was: RunFolder,
        would_be: RunFolder,
        changes: Changes,
        done: CounterfactualRun,
    ) -> None:
        self._folders = was, would_be  # they go with this
        self.was, self.would_be = _result(was.path), _result(would_be.path)
        self.changes = changes
        """The changes."""
        self.difference, self.compared, self.notes = done.difference, done.compared, done.notes
        """First difference from the record before the change, None if there is none; rows compared; what is left."""

    @property
    def folder(self) -> Path:
        """Run folder of what would have been."""
        return self._folders[1].path

    @cached_property
    def table(self) -> pd.DataFrame:
        """Metrics of both and their difference, a row per (window, metric)."""
        return self._comparison.table

    @property
    def _comparison(self) -> Comparison:
        return Comparison({"": (self.was, self.would_be)}, ("was", "would be"))

    def plot(self) -> Figure:
        """Draw f, P of every inverter and MPSI: what was in faint lines, what would have been in strong ones."""
        from gridpeers.lab.replay.counterfactual_figure import counterfactual_figure

        shown_in_notebooks()
        since = self.changes.since if self.changes else 0.0
        return counterfactual_figure(self.was.drawing(), self.would_be.drawing(), str(self.changes), since)

    def __str__(self) -> str:
        """Return the table as text; above it a line for each of both in which a law failed."""
        text: str = self.table.to_string(float_format=lambda value: f"{value:.5g}", na_rep="-")
        missing = [MISSING] if self.table.isna().any(axis=None) else []
        return "\n".join((*self._comparison.failures(), text, *missing))

    def __repr__(self) -> str:
        return f"<Counterfactual of {self.was.spec.name} {self.was.case}: {self.changes}>"


def _result(folder: Path) -> Result:
    found = read(folder)
    assert isinstance(found, Result)
    return found
