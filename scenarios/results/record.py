"""Record one case of a run, by any driver: history.csv, events.csv and the files of its links, or all in memory.

Rows go to `history.partial.csv` while the case runs, which gets its name when the last row is there, and keeps the
partial one if the case breaks.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import msgspec

from gridpeers.scenarios.results.link_record import LinkRecord
from gridpeers.scenarios.results.run_files import csv_text, write_whole
from gridpeers.wire.messages import Journal, LinkReport, LinkRequest, PlantEvent, Telemetry

if TYPE_CHECKING:
    from gridpeers.scenarios.record.record_info import RecordInfo
    from gridpeers.scenarios.record.record_writer import Recording

QUANTITIES = ("f_Hz", "P_W", "Q_var", "V_V", "P_set_W", "V_set_V")
"""Columns of each inverter, in the order of `gridpeers.wire.messages.Telemetry.rows`, with their units."""

PARTIAL = "history.partial.csv"  # Name of the history while it is incomplete


Row = tuple[float, ...]  # As in `gridpeers.wire.messages.Telemetry.rows`


class Recorded(msgspec.Struct, frozen=True, kw_only=True):
    inverters: tuple[str, ...]
    """Order of the columns."""
    rows: Sequence[Row] = ()
    """Rows in the order of time; empty where they are in a file."""
    file: Path | None = None
    """The history.csv with the rows; None where they are in memory."""
    ended: float
    missing: tuple[tuple[float, float], ...] = ()
    """Times (s) of the last row before and of the first row after each interval of which no rows came."""
    events: tuple[PlantEvent, ...]
    quiet: tuple[tuple[float, int], ...] = ()
    """Run time (s), and number of states of that tick that were not sent to the neighbours."""
    links: LinkRecord = msgspec.field(default_factory=LinkRecord)
    link_lines: tuple[str, ...] = ()
    """Lines for the report on the emulated links; none without a folder."""
    sha256: str
    """Of the bytes of history.csv."""
    reproducible: bool
    """True if the same scenario and seed give the same bytes again."""
    record_failure: str = ""
    """Sentence on why run.mcap ends early, or is not there; empty if it is whole, or was not asked for."""


class RecordError(RuntimeError):
    """The record is not the whole run."""


def header(inverters: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of the columns of history.csv."""
    return ("t_s", *(f"{name}_{quantity}" for name in inverters for quantity in QUANTITIES))


class Recorder:
    """Record one case: call it with every message that the plant publishes for recorders, then `finish()`.

    With a folder it writes history.csv, events.csv, links.csv and links.json and keeps no rows, so that hours take no
    more memory than seconds; without one it keeps the rows and writes nothing. The hash is the same either way. Rows
    may be missing (`gaps`) in a run whose recorder was out of reach. `record` is the run of a run.mcap beside.
    """

    def __init__(self, folder: Path | None = None, *, gaps: bool = False, record: RecordInfo | None = None) -> None:
        self._gaps, self._folder = gaps, folder
        self._hash = hashlib.sha256()
        self._file: BinaryIO | None = None
        if folder is not None:
            folder.mkdir(parents=True)
            self._file = (folder / PARTIAL).open("wb")
        self._recording: Recording | None = None
        self._not_recorded = ""
        """Why there is no run.mcap though one was asked for."""
        if folder is not None and record is not None:
            from gridpeers.scenarios.record.record_writer import Recording  # imports mcap, which a sweep does without

            try:
                self._recording = Recording(folder, record, QUANTITIES)
            except OSError as error:
                self._not_recorded = f"there is no run.mcap: it cannot be made: {error.strerror}"
        self._finished = False
        self._inverters: tuple[str, ...] = ()
        self._first: list[float] = []
        """Times of the first two rows (s)."""
        self.rows: list[Row] = []
        self.count = 0
        self.ended = 0.0
        self.missing: list[tuple[float, float]] = []
        self._events: list[PlantEvent] = []
        self.quiet: list[tuple[float, int]] = []
        self.reproducible = True
        """False once something unscripted, such as the death of an agent, has entered the run."""
        self.links = LinkRecord(folder)

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __call__(self, message: Telemetry | LinkReport | Journal | LinkRequest) -> None:
        if isinstance(message, Telemetry):
            self._take(message)
        elif isinstance(message, LinkReport):
            self.links(message)
        if self._recording is not None:
            self._recording(message)

    @property
    def events(self) -> tuple[PlantEvent, ...]:
        return tuple(self._events)

    @property
    def record_failure(self) -> str:
        return self._not_recorded if self._recording is None else self._recording.failure

    def _take(self, telemetry: Telemetry) -> None:
        if not self._inverters:
            self._inverters = telemetry.inverters
            self._write((",".join(header(telemetry.inverters)) + "\n").encode("ascii"))
        for row in telemetry.rows:
            if self.count and row[0] <= self.ended:
                raise RecordError(f"telemetry: a row of {row[0]:g} s came after that of {self.ended:g} s")
            if len(self._first) < 2:
                self._first.append(row[0])
            elif row[0] - self.ended > 1.5 * self.record_step:
                self.missing.append((self.ended, row[0]))
            self.ended = row[0]
            self.count += 1
            if self._file is None:
                self.rows.append(row)
            self._write((",".join(map(repr, row)) + "\n").encode("ascii"))  # `repr` reads back to the same bits
        self._events.extend(telemetry.events)
        self.quiet.extend(telemetry.quiet)
        self.reproducible = self.reproducible and telemetry.reproducible
        if self._file is not None:
            self._file.flush()

    def finish(self, end: float, record_step: float) -> Recorded:
        """Give the files their names; raise RecordError if rows are missing: then they keep PARTIAL."""
        if self._recording is not None:
            self._recording.close()
        if self._file is not None:
            self._file.close()
        expected = round(end / record_step) + 1
        absent = sum(round((after - before) / record_step) - 1 for before, after in self.missing)
        if self.count + (absent if self._gaps else 0) != expected:
            last = f"the last one is of {self.ended:g} s" if self.count else "none came"
            holes = "".join(f"; none between {before:g} and {after:g} s" for before, after in self.missing)
            raise RecordError(
                f"history has {self.count} rows, but {end:g} s in steps of {record_step:g} s are {expected}; "
                f"{last}{holes}"
            )
        file, link_lines = None, []
        if self._folder is not None:
            self._write_events(self._folder)
            link_lines = self.links.write(self._folder)
            file = (self._folder / PARTIAL).rename(self._folder / "history.csv")
        self._finished = True
        return Recorded(
            inverters=self._inverters,
            rows=self.rows,
            file=file,
            ended=self.ended,
            missing=tuple(self.missing),
            events=self.events,
            quiet=tuple(self.quiet),
            links=self.links,
            link_lines=tuple(link_lines),
            sha256=self._hash.hexdigest(),
            reproducible=self.reproducible,
            record_failure=self.record_failure,
        )

    def close(self) -> None:
        """End the record. What came of a case that was not finished stays, under the partial name."""
        if self._recording is not None:
            self._recording.close()
        if self._folder is not None and self._file is not None and not self._finished:
            # On a full disk both may fail: what is in the files stays, and the caller has the first error already.
            with contextlib.suppress(OSError):
                self._file.close()
            with contextlib.suppress(OSError):
                self._write_events(self._folder)
                self.links.write(self._folder)

    @property
    def record_step(self) -> float:
        """Distance of the first two rows (s); 0 while there are not two."""
        return round(self._first[1] - self._first[0], 9) if len(self._first) == 2 else 0.0

    def _write(self, bytes_: bytes) -> None:
        self._hash.update(bytes_)
        if self._file is not None:
            self._file.write(bytes_)

    def _write_events(self, folder: Path) -> None:
        rows = ((repr(event.t), event.kind, event.subject, event.text) for event in self._events)
        write_whole(folder / "events.csv", csv_text([("t_s", "kind", "subject", "text"), *rows]))
