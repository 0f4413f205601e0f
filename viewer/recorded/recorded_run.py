"""The records of a run folder, also while the run goes on and more of them come."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from time import time
from typing import Literal

import msgspec

from gridpeers.scenarios.record.record_info import FILE
from gridpeers.scenarios.record.record_reader import RecordFileError, RunRecord
from gridpeers.viewer.recorded.record_view import RecordView
from gridpeers.viewer.run_view import EventView

STILL = 3.0
"""Time (s) after which a record that does not grow is no longer followed: its writer has a chunk every 0.25 s."""

Growth = Literal["waiting", "recording", "ended", "broken", "cut"]
"""Nothing is recorded yet; the run goes on; it has ended; it broke; its record was cut off, or the run is frozen."""


class RecordNews(msgspec.Struct, frozen=True, kw_only=True):
    """What is new of a record."""

    case: str
    cases: tuple[str, ...]
    """All cases of the run that have a record, the latest last."""
    t_end: float
    """Latest run time in it (s)."""
    growth: Growth
    text: str
    """The state of the run, in a sentence."""
    notes: tuple[str, ...] = ()
    """Sentences on what the record, or this host, does not have."""
    events: tuple[EventView, ...] = ()
    """New events."""


class RecordedRun:
    """Open the records of a run, each when it is asked for.

    Parameters
    ----------
    path : Path
        Folder of a run, folder of a case, or run.mcap.

    Raises
    ------
    RecordFileError
        If there is no record, none is coming, or the only one is none of ours.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._views: dict[str, RecordView] = {}
        single = path if not path.is_dir() else path / FILE
        self._single = single if single.is_file() or not path.is_dir() else None
        files = self._files()
        if not files and not self._is_coming():
            raise RecordFileError(
                f"{path}: there is no {FILE}: the run was not recorded, or this is no folder of a run"
            )
        if len(files) == 1:
            self.view(next(iter(files)))

    @property
    def cases(self) -> tuple[str, ...]:
        """Cases that have a record, in the order in which they ran."""
        return tuple(self._files())

    def view(self, case: str = "") -> RecordView:
        """Return a record as it is now; without a case, the latest.

        Raises
        ------
        RecordFileError
            If there is no such record, or it cannot be read.
        """
        files = self._files()
        if not files:
            known = self._views and not self.path.exists()
            raise RecordFileError(f"{self.path}: {'the folder is gone' if known else 'nothing is recorded yet'}")
        case = case or list(files)[-1]
        if case not in files:
            raise RecordFileError(f"{self.path}: no record of case {case}; there are {', '.join(files)}")
        if case not in self._views:
            self._views[case] = RecordView(RunRecord.open(files[case]))
        view = self._views[case]
        view.record.refresh()
        return view

    def news(self, case: str, events: int) -> RecordNews:
        """Return what is new of a record, whose first events are known; of the latest without a case.

        Raises
        ------
        RecordFileError
            As `view`.
        """
        view = self.view(case)
        record = view.record
        growth, text = self._growth(record)
        damage = record.damage if growth != "recording" else ()
        return RecordNews(
            case=case or self.cases[-1],
            cases=self.cases,
            t_end=record.t_end,
            growth=growth,
            text=text,
            notes=(*view.missing, *(f"{each[:1].upper()}{each[1:]}." for each in damage)),
            events=tuple(view.events[events:]),
        )

    # ---------------------------------------------------------------- inner

    def _files(self) -> dict[str, Path]:
        """Return the file of each case, the latest last."""
        if self._single is not None:
            return {self._single.resolve().parent.name: self._single}
        files = {}
        for file in self.path.glob(f"*/{FILE}"):
            with suppress(OSError):
                files[file.parent.name] = (file.stat().st_mtime, file)
        return {case: file for case, (_, file) in sorted(files.items(), key=lambda each: (each[1][0], each[0]))}

    def _is_coming(self) -> bool:
        """Return whether the folder says that its run goes on."""
        try:
            return (self.path / "status.txt").read_text(encoding="utf-8").startswith("running")
        except (OSError, UnicodeDecodeError):
            return False

    def _growth(self, record: RunRecord) -> tuple[Growth, str]:
        if record.complete:
            outcome = record.outcome
            if outcome:
                return "broken", f"The run broke: {outcome}"
            return "ended", "" if outcome is not None else "The recorder was ended before the run."
        try:
            still = time() - record.path.stat().st_mtime
        except OSError:
            return "cut", "The file is gone."
        if still < STILL:
            return ("recording", "The run goes on.") if record.t_end else ("waiting", "The run begins.")
        if not record.t_end:
            return "waiting", "Nothing is recorded yet, or the run was killed before it began."
        return "cut", "The record has no end: the run was killed, or is frozen."
