"""Writes what the plant tells: history.csv and events.csv of one case.

Nothing is ever half-written under its own name: rows go to `history.partial.csv` while the case runs, and the file
gets its name when the last row is there. What a broken case leaves keeps the partial name.
"""

from __future__ import annotations

import csv
import hashlib
from pathlib import Path
from types import TracebackType

import msgspec

from wire.messages import PlantEvent, Telemetry

QUANTITIES = ("f_Hz", "P_W", "Q_var", "V_V", "P_set_W", "V_set_V")
"""Columns of each inverter, in the order of `wire.messages.Telemetry.rows`, with their units."""

PARTIAL = "history.partial.csv"
"""Name of the history while it is incomplete."""


class Recorded(msgspec.Struct, frozen=True, kw_only=True):
    """One case as recorded."""

    inverters: tuple[str, ...]
    """Order of the columns."""
    rows: list[tuple[float, ...]]
    """As in `wire.messages.Telemetry.rows`."""
    events: tuple[PlantEvent, ...]
    """What happened, in the order of time."""
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
    """

    def __init__(self) -> None:
        self._hash = hashlib.sha256()
        self._inverters: tuple[str, ...] = ()
        self.rows: list[tuple[float, ...]] = []
        self.events: list[PlantEvent] = []
        self.reproducible = True
        """False once something unscripted, as a dead agent, has entered the run."""

    def __call__(self, telemetry: Telemetry) -> None:
        """Take the rows of one telemetry message."""
        if not self._inverters:
            self._inverters = telemetry.inverters
            self._write(",".join(header(telemetry.inverters)) + "\n")
        for row in telemetry.rows:
            if self.rows and row[0] <= self.rows[-1][0]:
                raise RecordError(f"telemetry: a row of {row[0]:g} s came after that of {self.rows[-1][0]:g} s")
            self.rows.append(row)
            self._write(",".join(map(repr, row)) + "\n")
        self.events.extend(telemetry.events)
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
        if len(self.rows) != expected:
            last = f"the last one is of {self.rows[-1][0]:g} s" if self.rows else "none came"
            raise RecordError(
                f"history has {len(self.rows)} rows, but {end:g} s in steps of {record_step:g} s are {expected}; {last}"
            )
        return Recorded(
            inverters=self._inverters,
            rows=self.rows,
            events=tuple(self.events),
            sha256=self._hash.hexdigest(),
            reproducible=self.reproducible,
        )

    def _write(self, text: str) -> bytes:
        bytes_ = text.encode("ascii")
        self._hash.update(bytes_)
        return bytes_


class Recorder(Tape):
    """A tape that writes down what it takes: history.csv and events.csv.

    Parameters
    ----------
    folder : Path
        Folder of the case; it is made.
    """

    def __init__(self, folder: Path) -> None:
        super().__init__()
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
            self._file.close()
            self._write_events()

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
