"""Tells in a terminal what happens in a run, and records it if that is wanted. In a thread of its own."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Collection
from pathlib import Path
from time import monotonic

from scenarios.drivers.telemetry_client import TelemetryClient, Word
from scenarios.live.link_log import LinkLog
from scenarios.live.show.events import line_of
from scenarios.results.record import Recorded, Recorder, RecordError
from wire.messages import LinkOrder, LinkReport, Pacing, Telemetry
from wire.rate_limit import RateLimit

_STOP = "stop"

_ON = "; the run goes on without it"


class LiveRecorder:
    """What a plant tells, as lines for a person and as files.

    The plant waits for it before the start and at the end, so nothing of the run is missing. Use it as a context.

    Parameters
    ----------
    run : str
        Name of the run.
    endpoint : str
        Where the plant listens.
    tell : Callable[[str], None]
        Told a line for everything that happens.
    folder : Path or None
        Folder for history.csv and events.csv; None records nothing.
    untold : Collection[str], optional
        Kinds of events that are told by others.
    book : LinkLog, optional
        Takes what the plant tells of emulated links.
    on_whole : Callable[[Recorded, Pacing | None], None], optional
        Called at the end with the record, if it is whole, and how well the plant kept pace.
    """

    NAME = "chronicle"
    """Name under which it is a recorder of the run."""

    def __init__(
        self,
        run: str,
        endpoint: str,
        tell: Callable[[str], None],
        folder: Path | None = None,
        *,
        untold: Collection[str] = (),
        book: LinkLog | None = None,
        on_whole: Callable[[Recorded, Pacing | None], None] | None = None,
    ) -> None:
        self._tell, self._untold, self._book, self._on_whole = tell, untold, book, on_whole
        self._recorder = None if folder is None else Recorder(folder, gaps=True)
        self.pacing: Pacing | None = None
        """How well the plant has kept pace so far."""
        self.t = 0.0
        """How far the run has come (s)."""
        self.told_at: float | None = None
        """When that was told (s, monotonic); None before the run began."""
        self.ended = False
        """Whether the last telemetry is in."""
        self.lost = ""
        """What could not be recorded, and why; "" if there was nothing of the kind."""
        self._limit = RateLimit()
        self._client = TelemetryClient(self.NAME, run, endpoint, "wall")
        self._thread = threading.Thread(target=self._follow, daemon=True)

    def __enter__(self) -> LiveRecorder:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Take in what has come, close the session, and give the files their names."""
        self._client.say(_STOP)
        self._thread.join()
        self._client.close()
        for line in (*self._limit.left_out(), *self._client.rejects.take_lines()):
            self._tell(line)
        if self._book is not None:
            try:
                for line in self._book.close(self.t):
                    self._tell(line)
            except OSError as error:
                self._lose(f"the record of links cannot be written: {error.strerror}")
        if self._recorder is not None:
            self._finish(self._recorder)

    def _lose(self, why: str, then: str = "") -> None:
        """Tell why something is not recorded, and what follows; the first reason is that of the run, too."""
        self._tell(why + then)
        self.lost = self.lost or why

    def _finish(self, recorder: Recorder) -> None:
        """Give the files their names, and hand on the record; if it is not whole, they keep the partial ones."""
        try:
            if recorder.count < 2:
                self._tell("nothing was recorded, so there are no numbers")
            elif not self.ended:
                self._lose(f"the record ends at {recorder.ended:.2f} s: then no word came of the plant")
            else:
                recorded = recorder.finish(recorder.ended, recorder.record_step)
                if self._on_whole is not None:
                    self._on_whole(recorded, self.pacing)
            recorder.close()
        except RecordError as error:
            self._lose(str(error))
            self._abandon(recorder)
        except OSError as error:
            self._lose(f"the record cannot be written: {error.strerror}")

    def _abandon(self, recorder: Recorder) -> None:
        """Leave a record as it is; what cannot be written even then has been told."""
        self._recorder = None
        with contextlib.suppress(OSError):
            recorder.close()

    def _follow(self) -> None:
        while not self.ended:
            for item in self._client.take(None):
                if isinstance(item, Word):
                    return
                try:
                    self._take(item)
                except Exception as error:  # whatever else is wrong with it is that message's end alone
                    self._client.rejects.failed("telemetry", error)
        self._client.close()  # with it goes the token: the plant knows that the last telemetry is here

    def _take(self, message: Telemetry | LinkReport | LinkOrder) -> None:
        """Tell and write down one message. What cannot be written any more ends its record, not the run."""
        if not isinstance(message, Telemetry):
            self._note_links(message)
            return
        if message.rows:
            self.told_at = monotonic()
        self.t, self.pacing = message.t, message.pacing or self.pacing
        self.ended = message.final
        for event in message.events:
            if event.kind not in self._untold:
                line = self._limit.admit(line_of(event), monotonic())
                if line is not None:
                    self._tell(line)
        if self.ended:  # before anybody says that the run has ended
            for line in self._limit.left_out():
                self._tell(line)
        recorder = self._recorder
        if recorder is None:
            return
        known = len(recorder.missing)
        try:
            recorder(message)
        except (RecordError, OSError) as error:
            why = getattr(error, "strerror", None) or error
            self._lose(f"the record ends at {recorder.ended:.2f} s: {why}", _ON)
            self._abandon(recorder)
        for before, after in recorder.missing[known:]:
            self._tell(
                f"rows between {before:.2f} and {after:.2f} s are missing: for so long no word came of the plant"
            )

    def _note_links(self, message: LinkReport | LinkOrder) -> None:
        if self._book is None:
            return
        try:
            self._book(message)
        except OSError as error:
            self._lose(f"the record of links ends at {self.t:.2f} s: {error.strerror}", _ON)
            self._book = None
