"""Writes what the plant tells: history.csv and events.csv of one case.

Nothing is ever half-written under its own name: rows go to `history.partial.csv` while the case runs, and the file
gets its name when the last row is there. What a broken case leaves keeps the partial name. A recorder keeps no rows:
a run that lasts for hours takes no more memory than a short one.
"""

from __future__ import annotations

import contextlib
import csv
import hashlib
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Protocol

import msgspec

from wire.messages import PlantEvent, Telemetry

QUANTITIES = ("f_Hz", "P_W", "Q_var", "V_V", "P_set_W", "V_set_V")
"""Columns of each inverter, in the order of `wire.messages.Telemetry.rows`, with their units."""

PARTIAL = "history.partial.csv"
"""Name of the history while it is incomplete."""


Row = tuple[float, ...]
"""As in `wire.messages.Telemetry.rows`."""


class Rows(Protocol):
    """Rows in the order of time, in memory or in a file."""

    def __len__(self) -> int: ...
    def __iter__(self) -> Iterator[Row]: ...


class RowFile:
    """Rows of a history.csv, read anew each time they are looked through.

    Parameters
    ----------
    path : Path
        The file.
    count : int
        Number of its rows.
    """

    def __init__(self, path: Path, count: int) -> None:
        self._path, self._count = path, count

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Row]:
        with self._path.open(encoding="ascii") as file:
            next(file)  # the header
            for line in file:
                yield tuple(map(float, line.split(",")))


class Recorded(msgspec.Struct, frozen=True, kw_only=True):
    """One case as recorded."""

    inverters: tuple[str, ...]
    """Order of the columns."""
    rows: Rows
    """What was recorded, in the order of time."""
    ended: float
    """Time of the last row (s)."""
    missing: tuple[tuple[float, float], ...] = ()
    """Times (s) of the last row before and of the first row after each interval of which no rows came."""
    events: tuple[PlantEvent, ...]
    """What happened, in the order of time."""
    quiet: tuple[tuple[float, int], ...] = ()
    """Run time (s), and how many states of that tick the neighbours were not told of."""
    sha256: str
    """Of the bytes of history.csv."""
    reproducible: bool
    """Whether the same scenario and seed give the same bytes again."""


class RecordError(RuntimeError):
    """What was recorded is not the whole run."""


def header(inverters: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the columns of history.csv.

    Examples
    --------
    >>> header(("inv1",))
    ('t_s', 'inv1_f_Hz', 'inv1_P_W', 'inv1_Q_var', 'inv1_V_V', 'inv1_P_set_W', 'inv1_V_set_V')
    """
    return ("t_s", *(f"{name}_{quantity}" for name in inverters for quantity in QUANTITIES))


class Tape:
    """Takes the telemetry of one case as it comes, and keeps the hash of the bytes of its history.csv.

    Call it with every `Telemetry`, then `finish()`. Floats are written as the shortest text that reads back to the
    same number, and lines end in a line feed on every system, so equal runs give equal bytes.

    Parameters
    ----------
    gaps : bool, optional
        Whether rows may be missing, as of a run whose recorder was out of reach for too long; else that is an error.
    """

    def __init__(self, *, gaps: bool = False) -> None:
        self._hash = hashlib.sha256()
        self._gaps = gaps
        self._inverters: tuple[str, ...] = ()
        self._first: list[float] = []
        """Times of the first two rows (s)."""
        self.rows: list[Row] = []
        """What is kept in memory."""
        self.count = 0
        """Rows so far."""
        self.ended = 0.0
        """Time of the last row (s)."""
        self.missing: list[tuple[float, float]] = []
        """See `Recorded.missing`."""
        self.events: list[PlantEvent] = []
        self.quiet: list[tuple[float, int]] = []
        """See `Recorded.quiet`."""
        self.reproducible = True
        """False once something unscripted, as a dead agent, has entered the run."""

    def __call__(self, telemetry: Telemetry) -> None:
        """Take the rows of one telemetry message."""
        if not self._inverters:
            self._inverters = telemetry.inverters
            self._write(",".join(header(telemetry.inverters)) + "\n")
        for row in telemetry.rows:
            if self.count and row[0] <= self.ended:
                raise RecordError(f"telemetry: a row of {row[0]:g} s came after that of {self.ended:g} s")
            self._note_time(row[0])
            self._keep(row)
            self._write(",".join(map(repr, row)) + "\n")
        self.events.extend(telemetry.events)
        self.quiet.extend(telemetry.quiet)
        self.reproducible = self.reproducible and telemetry.reproducible

    def finish(self, end: float, record_step: float) -> Recorded:
        """Check that the whole run is there.

        Parameters
        ----------
        end : float
            Duration of the run (s).
        record_step : float
            Distance of the rows (s).

        Raises
        ------
        RecordError
            If rows are missing.
        """
        expected = round(end / record_step) + 1
        absent = sum(round((after - before) / record_step) - 1 for before, after in self.missing)
        if self.count + (absent if self._gaps else 0) != expected:
            last = f"the last one is of {self.ended:g} s" if self.count else "none came"
            holes = "".join(f"; none between {before:g} and {after:g} s" for before, after in self.missing)
            raise RecordError(
                f"history has {self.count} rows, but {end:g} s in steps of {record_step:g} s are {expected}; "
                f"{last}{holes}"
            )
        return Recorded(
            inverters=self._inverters,
            rows=self._all_rows(),
            ended=self.ended,
            missing=tuple(self.missing),
            events=tuple(self.events),
            quiet=tuple(self.quiet),
            sha256=self._hash.hexdigest(),
            reproducible=self.reproducible,
        )

    @property
    def record_step(self) -> float:
        """Distance of the first two rows (s); 0 while there are not two."""
        return round(self._first[1] - self._first[0], 9) if len(self._first) == 2 else 0.0

    def _note_time(self, t: float) -> None:
        if len(self._first) < 2:
            self._first.append(t)
        elif t - self.ended > 1.5 * self.record_step:
            self.missing.append((self.ended, t))
        self.ended = t
        self.count += 1

    def _keep(self, row: Row) -> None:
        self.rows.append(row)

    def _all_rows(self) -> Rows:
        return self.rows

    def _write(self, text: str) -> bytes:
        bytes_ = text.encode("ascii")
        self._hash.update(bytes_)
        return bytes_


class Recorder(Tape):
    """A tape that writes down what it takes, history.csv and events.csv, and keeps no rows.

    Parameters
    ----------
    folder : Path
        Folder of the case; it is made.
    gaps : bool, optional
        As of a `Tape`.
    """

    def __init__(self, folder: Path, *, gaps: bool = False) -> None:
        super().__init__(gaps=gaps)
        folder.mkdir(parents=True)
        self._folder = folder
        self._file = (folder / PARTIAL).open("wb")
        self._finished = False

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __call__(self, telemetry: Telemetry) -> None:
        """Take the rows of one telemetry message; they are in the file when this returns."""
        super().__call__(telemetry)
        self._file.flush()

    def finish(self, end: float, record_step: float) -> Recorded:
        """Check that the whole run is there, and give the files their names; if not, they keep the partial one."""
        self._file.close()
        recorded = super().finish(end, record_step)
        self._write_events()
        (self._folder / PARTIAL).rename(self._folder / "history.csv")
        self._finished = True
        return recorded

    def close(self) -> None:
        """End the record. What came of a case that was not finished stays, under the partial name."""
        if not self._finished:
            with contextlib.suppress(OSError):  # of a full disk: what is in the file stays, and who wrote last knows
                self._file.close()
            self._write_events()

    def _keep(self, row: Row) -> None:
        pass

    def _all_rows(self) -> Rows:
        return RowFile(self._folder / "history.csv", self.count)

    def _write(self, text: str) -> bytes:
        bytes_ = super()._write(text)
        self._file.write(bytes_)
        return bytes_

    def _write_events(self) -> None:
        partial = self._folder / "events.partial.csv"
        with partial.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(("t_s", "kind", "subject", "text"))
            writer.writerows((repr(event.t), event.kind, event.subject, event.text) for event in self.events)
        partial.rename(self._folder / "events.csv")
