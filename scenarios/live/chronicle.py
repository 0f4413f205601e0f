"""Tells in a terminal what happens in a run, and records it if that is wanted. In a thread of its own."""

from __future__ import annotations

import threading
from collections.abc import Callable, Collection
from pathlib import Path
from time import monotonic

from scenarios.live.book import Book
from scenarios.live.show.events import line_of
from scenarios.results.record import Recorded, Recorder, RecordError
from wire.codec import RejectedError, decode
from wire.driver.session import Session
from wire.keys import Keys
from wire.messages import LinkOrder, LinkReport, Pacing, Telemetry

_STOP = "stop"


class Chronicle:
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
    book : Book, optional
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
        book: Book | None = None,
        on_whole: Callable[[Recorded, Pacing | None], None] | None = None,
    ) -> None:
        keys = Keys(run)
        self._tell, self._untold, self._book, self._on_whole = tell, untold, book, on_whole
        self._recorder = None if folder is None else Recorder(folder)
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
        self._trouble = ""
        self._session = Session(self.NAME, connect=(endpoint,), gossip=False, clock="wall")
        self._session.subscribe(keys.telemetry)
        self._session.hold_token(keys.alive_recorder(self.NAME))
        self._thread = threading.Thread(target=self._follow, daemon=True)

    def __enter__(self) -> Chronicle:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Take in what has come, close the session, and give the files their names."""
        self._session.inbox.put(("word", _STOP, b""))
        self._thread.join()
        self._session.close()
        if self._book is not None:
            try:
                for line in self._book.close(self.t):
                    self._tell(line)
            except OSError as error:
                self._lose(f"the record of links cannot be written: {error.strerror}")
        if self._recorder is not None:
            self._finish(self._recorder)
        if self._trouble:
            self._tell(self._trouble)

    def _lose(self, why: str) -> None:
        """Note why something is not recorded; the first reason is that of all others."""
        self.lost = self._trouble = self.lost or why

    def _finish(self, recorder: Recorder) -> None:
        """Give the files their names, and hand on the record; if it is not whole, they keep the partial ones."""
        rows = recorder.rows
        try:
            if len(rows) < 2:
                self._trouble = self._trouble or "nothing was recorded, so there are no numbers"
            elif not self.ended:
                self._trouble = (
                    self._trouble or f"the record ends at {rows[-1][0]:.2f} s: then no word came of the plant"
                )
            else:
                recorded = recorder.finish(rows[-1][0], round(rows[1][0] - rows[0][0], 9))
                if self._on_whole is not None:
                    self._on_whole(recorded, self.pacing)
            recorder.close()
        except RecordError as error:
            self._trouble = str(error)
            recorder.close()
        except OSError as error:
            self._lose(f"the record cannot be written: {error.strerror}")

    def _follow(self) -> None:
        while not self.ended:
            for kind, _, payload, _ in self._session.take(1, None):
                if kind == "word":
                    return
                if kind == "message" and not self._take(payload):
                    return
        self._session.close()  # with it goes the token: the plant knows that the last telemetry is here

    def _take(self, payload: bytes) -> bool:
        """Tell and write down one message; False if it cannot be gone on."""
        try:
            message = decode(payload)
        except RejectedError:
            return True
        if isinstance(message, LinkReport | LinkOrder) and self._book is not None:
            return self._noted(message)
        if not isinstance(message, Telemetry):
            return True
        if message.rows:
            self.told_at = monotonic()
        self.t, self.pacing = message.t, message.pacing or self.pacing
        self.ended = message.final
        for event in message.events:
            if event.kind not in self._untold:
                self._tell(line_of(event))
        try:
            if self._recorder is not None:
                self._recorder(message)
        except (RecordError, OSError) as error:
            self._lose(f"the record ends at {self.t:.2f} s: {getattr(error, 'strerror', None) or error}")
            return False
        return True

    def _noted(self, message: LinkReport | LinkOrder) -> bool:
        """Write down what was told of links; False if that is impossible."""
        assert self._book is not None
        try:
            self._book(message)
        except OSError as error:
            self._lose(f"the record of links ends at {self.t:.2f} s: {error.strerror}")
            return False
        return True
