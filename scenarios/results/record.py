"""Record one case of a run, by any driver: into run.mcap while it runs, or in memory; tables at its end.

Nothing else keeps an account: the file has all that came until a kill, and what is read later is read from it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from struct import pack
from typing import TYPE_CHECKING

from gridpeers.netem.ledger import LinkTrace
from gridpeers.scenarios.results.case_tables import write_tables
from gridpeers.scenarios.results.link_record import LinkRecord
from gridpeers.wire.messages import Journal, LinkReport, LinkRequest, PlantEvent, Telemetry

if TYPE_CHECKING:
    from gridpeers.scenarios.record.record_info import RecordInfo
    from gridpeers.scenarios.record.record_reader import RunRecord
    from gridpeers.scenarios.record.record_writer import RecordWriter
    from gridpeers.scenarios.results.history import History


class RecordError(RuntimeError):
    """The record is not the whole run."""


def canonical(rows: Iterable[Sequence[float]]) -> bytes:
    """Return the bytes of rows, float64, little-endian, row by row: their SHA-256 is the fingerprint of a run."""
    return b"".join([pack(f"<{len(row)}d", *row) for row in rows])


@dataclass(kw_only=True)
class Recorded:
    """A case as recorded so far; its rows and the verdicts on its messages are in memory, or read from its file."""

    inverters: tuple[str, ...] = ()
    """Order of the columns."""
    table: bytes | bytearray = b""
    """Rows in memory, `canonical`."""
    file: RunRecord | None = None
    """The record with the rows and verdicts; None where they are in memory."""
    ended: float = 0.0
    missing: list[tuple[float, float]] = field(default_factory=list)
    """Times (s) of the last row before and of the first row after each interval of which no rows came."""
    events: list[PlantEvent] = field(default_factory=list)
    quiet: list[tuple[float, int]] = field(default_factory=list)
    """Run time (s), and number of states of that tick that were not sent to the neighbours."""
    links: LinkRecord = field(default_factory=LinkRecord)
    sha256: str = ""
    """Fingerprint: of the `canonical` bytes of the rows."""
    reproducible: bool = True
    """False once something unscripted, such as the death of an agent, has entered the run."""

    @cached_property
    def history(self) -> History:
        from gridpeers.scenarios.results.history import History  # numpy, which a run starts without

        return History.of(self.inverters, self.table) if self.file is None else self.file.physics()

    def traces(self) -> Iterator[LinkTrace]:
        yield from self.links.traces if self.file is None else self.file.links()


class Recorder:
    """Record one case: call it with every message that the plant publishes for recorders, then `finish()`.

    With a `record`, the run of a run.mcap in the folder, it keeps no rows, so that hours take no more memory than
    seconds; without one they are in memory. With a folder the tables are written at the end. The fingerprint is the
    same either way. Rows may be missing (`gaps`) in a run whose recorder was out of reach.

    Raise OSError if the file cannot be made, or takes no more.
    """

    def __init__(self, folder: Path | None = None, *, gaps: bool = False, record: RecordInfo | None = None) -> None:
        self._gaps, self._folder = gaps, folder
        self._hash = hashlib.sha256()
        self._file: RecordWriter | None = None
        if folder is not None:
            folder.mkdir(parents=True)
            if record is not None:
                from gridpeers.scenarios.record.record_writer import (
                    RecordWriter,  # imports mcap, which sweeps do without
                )

                self._file = RecordWriter(folder, record)
        self.case = Recorded(table=bytearray(), links=LinkRecord(keep=self._file is None))
        """The case so far."""
        self.count = 0
        self._step = 0.0
        """Distance of the first two rows (s); 0 while there are not two."""

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __call__(self, message: Telemetry | LinkReport | Journal | LinkRequest) -> None:
        if isinstance(message, Telemetry):
            self._take(message)
        elif isinstance(message, LinkReport):
            self.case.links(message)
        if self._file is not None:
            self._file(message)
            _require(self._file)

    def _take(self, telemetry: Telemetry) -> None:
        case = self.case
        case.inverters = case.inverters or telemetry.inverters
        for row in telemetry.rows:
            if self.count and row[0] <= case.ended:
                raise RecordError(f"telemetry: a row of {row[0]:g} s came after that of {case.ended:g} s")
            if self.count == 1:
                self._step = round(row[0] - case.ended, 9)
            elif self.count and row[0] - case.ended > 1.5 * self._step:
                case.missing.append((case.ended, row[0]))
            case.ended = row[0]
            self.count += 1
        rows = canonical(telemetry.rows)
        self._hash.update(rows)
        if self._file is None:
            case.table += rows
        case.events += telemetry.events
        case.quiet += telemetry.quiet
        case.reproducible = case.reproducible and telemetry.reproducible

    def finish(self, end: float | None = None, record_step: float | None = None) -> Recorded:
        """Close the record, and write the tables of the case into its folder.

        Raise RecordError if there are not all rows up to the end (s), by default those between the first and the last.
        """
        self.close()
        if self._file is not None:
            _require(self._file)
        case = self.case
        end = case.ended if end is None else end
        step = record_step or self._step or 1.0  # of a single row any
        expected = round(end / step) + 1
        absent = sum(round((after - before) / step) - 1 for before, after in case.missing)
        if self.count + (absent if self._gaps else 0) != expected:
            last = f"the last one is of {case.ended:g} s" if self.count else "none came"
            holes = "".join(f"; none between {before:g} and {after:g} s" for before, after in case.missing)
            raise RecordError(
                f"history has {self.count} rows, but {end:g} s in steps of {step:g} s are {expected}; {last}{holes}"
            )
        case.sha256 = self._hash.hexdigest()
        case.file = None if self._file is None else _opened(self._file.path)
        if self._folder is not None:
            write_tables(self._folder, case.history, case.events, case.traces() if case.links.sent else None)
            case.links.write(self._folder)
        return case

    def close(self) -> None:
        """End the record: what came of a case that was not finished is in its file."""
        if self._file is not None:
            self._file.close()


def _require(file: RecordWriter) -> None:
    if file.error is not None:
        raise file.error


def _opened(file: Path) -> RunRecord:
    from gridpeers.scenarios.record.record_reader import RunRecord  # decoders, which sweeps do without

    file.stat()  # OSError if somebody has removed it
    return RunRecord.open(file)
