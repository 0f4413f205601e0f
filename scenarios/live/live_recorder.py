"""Print what happens in a live run as lines in its terminal, and record the run on request, in a thread of its own."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Collection
from pathlib import Path
from queue import SimpleQueue
from time import monotonic

from gridpeers.plant.plant_config import PlantConfig
from gridpeers.scenarios.drivers.telemetry_client import RECORDER, TelemetryClient
from gridpeers.scenarios.drivers.telemetry_stream import Recordable
from gridpeers.scenarios.live.live_files import LinkLog
from gridpeers.scenarios.live.run_address import loopback_of
from gridpeers.scenarios.live.run_monitor import line_of
from gridpeers.scenarios.record.record_info import RecordInfo
from gridpeers.scenarios.results.record import Recorded, Recorder, RecordError
from gridpeers.wire.driver.machine import keep_out_of_the_heap
from gridpeers.wire.messages import LinkRequest, PlantEvent, Telemetry
from gridpeers.wire.timing import RateLimit

_STOP, _CRASH = "stop", "crash"

_ON = "; the run goes on without it"


class LiveRecorder:
    """Say the plant's events as they come, but for `silent` kinds, and feed the `Recorder` and `LinkLog` of the run.

    The plant waits for it before the start and at the end, so nothing of the run is missing. Use it as a context.
    Without a folder there is no record.
    """

    def __init__(
        self,
        config: PlantConfig,
        say: Callable[[str], None],
        folder: Path | None,
        link_log: LinkLog,
        record: RecordInfo,
        *,
        silent: Collection[str] = (),
    ) -> None:
        self._config, self._say, self._silent = config, say, silent
        self._link_log: LinkLog | None = link_log
        self._recorder = None if folder is None else Recorder(folder, gaps=True, record=record)
        self.recorded: Recorded | None = None
        """The record, once it is closed, if it is whole."""
        self.failure = ""
        """Why something could not be recorded: the first reason; "" if everything was."""
        self.failed_laws: dict[str, PlantEvent] = {}
        self.cut_short = ""
        """Why the plant's last message does not come, if that is known."""
        self._crashes: SimpleQueue[tuple[str, str]] = SimpleQueue()
        """Agent and end in words, one for each `_CRASH` that the thread is told."""
        self._limit = RateLimit()
        self.client: TelemetryClient
        self._thread = threading.Thread(target=self._follow, daemon=True)

    def __enter__(self) -> LiveRecorder:
        keep_out_of_the_heap()
        config = self._config
        endpoint = loopback_of(config.listen[0])
        self.client = TelemetryClient(RECORDER, config.run, endpoint, "wall", self._take, config.credentials)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Take in what has come, close the session, and give the files their names."""
        self.client.say(_STOP)
        self._thread.join()
        self.client.close()
        self._say_all(*self._limit.left_out(), *self.client.rejects.take_lines())
        if self._link_log is not None:
            try:
                self._say_all(*self._link_log.close(self.client.t))
            except OSError as error:
                self._fail("the link commands cannot be written", error)
        if self._recorder is not None:
            try:
                self._finish(self._recorder)
            except (RecordError, OSError) as error:
                self._fail("the record cannot be written", error)
                self._abandon(self._recorder)

    def note_crash(self, agent: str, end: str) -> None:
        """Note that the process of an agent crashed, with how it ended in words; from any thread."""
        self._crashes.put((agent, end))
        self.client.say(_CRASH)

    def _say_all(self, *lines: str) -> None:
        for line in lines:
            self._say(line)

    def _fail(self, what: str, why: object, consequence: str = "") -> None:
        """Say what is not recorded, why, and the consequence; keep the first reason."""
        text = f"{what}: {getattr(why, 'strerror', None) or why}"
        self._say(text + consequence)
        self.failure = self.failure or text

    def _finish(self, recorder: Recorder) -> None:
        """Give the files their names; those of a record that is not whole keep the partial ones."""
        if recorder.count < 2:
            self._say("nothing was recorded, so there are no numbers")
        elif not self.client.ended:
            self._fail(f"the record ends at {recorder.ended:.2f} s", self.cut_short or "then no word came of the plant")
        else:
            self.recorded = recorder.finish(recorder.ended, recorder.record_step)
            self._say_all(*self.recorded.link_lines)
        recorder.close()

    def _abandon(self, recorder: Recorder) -> None:
        """Leave a record as it is; the reason has been said."""
        self._recorder = None
        with contextlib.suppress(OSError):
            recorder.close()

    def _follow(self) -> None:
        while not self.client.ended:
            for word in self.client.take(None):
                if word == _STOP:
                    return
                self.client.note_crash(*self._crashes.get())
        self.client.close()  # with it goes the token: the plant knows that the last telemetry is here

    def _take(self, message: Recordable) -> None:
        """Say and record one message; an error in it must not end the recording of the others."""
        try:
            if isinstance(message, LinkRequest) and self._link_log is not None:
                try:
                    self._link_log(message)
                except OSError as error:
                    self._fail(f"the link commands end at {self.client.t:.2f} s", error, _ON)
                    self._link_log = None
            if isinstance(message, Telemetry):
                self._say_events(message)
            if self._recorder is not None:
                self._record(self._recorder, message)
        except Exception as error:
            self.client.rejects.failed("telemetry", error)

    def _say_events(self, telemetry: Telemetry) -> None:
        for event in telemetry.events:
            if event.kind == "law":
                self.failed_laws.setdefault(event.subject, event)
            if event.kind not in self._silent and (line := self._limit.admit(line_of(event), monotonic())) is not None:
                self._say(line)
        if telemetry.final:  # before the terminal says that the run has ended
            self._say_all(*self._limit.left_out())

    def _record(self, recorder: Recorder, message: Recordable) -> None:
        """Record one message; an error in writing ends the record, not the run."""
        known, sound = len(recorder.missing), not recorder.record_failure
        try:
            recorder(message)
        except (RecordError, OSError) as error:
            self._fail(f"the record ends at {recorder.ended:.2f} s", error, _ON)
            self._abandon(recorder)
        if sound and recorder.record_failure:
            self._say(recorder.record_failure + _ON)
        for before, after in recorder.missing[known:]:
            self._say(f"rows between {before:.2f} and {after:.2f} s are missing: for so long no word came of the plant")
