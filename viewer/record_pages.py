"""Pages of a record: each asks for times, one after the other, and gets the frame of that time."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from pathlib import Path
from time import time  # noqa: TID251  # how long ago a file was written: whether to look again
from typing import TYPE_CHECKING, Any, Literal

import msgspec
from msgspec.structs import replace

from gridpeers.scenarios.record.record_info import FILE
from gridpeers.scenarios.record.record_reader import RecordFileError, RunRecord
from gridpeers.viewer.link_states import LinkView
from gridpeers.viewer.page_server import FASTEST, HEARTBEAT, SILENT, Talk, as_json, send, texts
from gridpeers.viewer.record_view import RecordView
from gridpeers.viewer.run_view import EventView
from gridpeers.wire.codec import decode_foreign
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.messages import Text
from gridpeers.wire.plugins.registry import ANYTHING, named

if TYPE_CHECKING:
    from starlette.websockets import WebSocket


class RecordQuestion(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    case: Text = ""
    at: float | None = None
    """Run time (s); None asks for the end, as far as the run has come."""
    since: float = -1.0
    """Run time (s) of the last point that the page has, and that is before `at`; -1 asks for all points."""
    agent: Text = ""


class RecordPage:
    def __init__(self) -> None:
        self.case = ""
        self.wanted = ""
        """Case that it asked for; "" for the latest."""
        self.events = 0
        self.links: dict[str, tuple[LinkView, ...]] = {}
        self.questions: asyncio.Queue[RecordQuestion] = asyncio.Queue(64)


class RecordPages:
    """Answer the questions of pages, one at a time, from the records of a run, which their thread alone uses."""

    def __init__(self, run: RecordedRun) -> None:
        self._run = run
        self._worker = ThreadPoolExecutor(1, "record")

    def close(self) -> None:
        self._worker.shutdown(cancel_futures=True)

    def talk(self, socket: WebSocket) -> tuple[Talk, Talk]:
        page = RecordPage()
        return self._send(socket, page), self._receive(socket, page)

    async def _send(self, socket: WebSocket, page: RecordPage) -> None:
        loop, told = asyncio.get_running_loop(), float("-inf")
        where = str(self._run.path)
        hello = {"run": where, "where": where, "control": False, "record": True, "silent_s": SILENT}
        await send(socket, as_json({"hello": hello}))
        while True:
            if (now := loop.time()) - told >= HEARTBEAT:
                told = now
                await self._tell(socket, partial(self.news, page))
            with contextlib.suppress(asyncio.TimeoutError):
                question = await asyncio.wait_for(page.questions.get(), HEARTBEAT)
                await self._tell(socket, partial(self.frame, page, question))
                await self._tell(socket, partial(self.decision, page, question))
                await asyncio.sleep(FASTEST / 4)

    async def _tell(self, socket: WebSocket, answer: Callable[[], Iterable[str]]) -> None:
        """Send an answer; a page that waits for it knows that its server is there."""

        def texts_of() -> list[str]:
            try:
                return list(answer())
            except RecordFileError as error:  # nothing there yet, or its folder is gone
                return [as_json({"problem": str(error)})]

        future = asyncio.get_running_loop().run_in_executor(self._worker, texts_of)
        while not (await asyncio.wait({future}, timeout=HEARTBEAT))[0]:
            await send(socket, as_json({"beat": True}))
        for text in future.result():
            await send(socket, text)

    async def _receive(self, socket: WebSocket, page: RecordPage) -> None:
        async for text in texts(socket):
            with contextlib.suppress(msgspec.DecodeError):
                await page.questions.put(decode_foreign(msgspec.json.Decoder(RecordQuestion).decode, text))

    def news(self, page: RecordPage) -> Iterator[str]:
        """Yield what is new of the record that a page shows, after the record itself if it is another one."""
        news = self._run.news(page.wanted, page.events if page.case else 0)
        if news.case != page.case:
            news = self._run.news(news.case, 0)
            view = self._run.view(news.case)
            page.case, page.links, page.events = news.case, {}, 0
            yield from (as_json({"record": _of(view)}), as_json({"map": view.map}))
        page.events += len(news.events)
        yield as_json({"news": news})

    def frame(self, page: RecordPage, question: RecordQuestion) -> Iterator[str]:
        if question.case != page.wanted:
            page.wanted = question.case
            yield from self.news(page)
        view = self._run.view(page.case)
        frame = view.frame(_time_of(question, view), question.since)
        known = {} if frame.reset else page.links
        page.links = dict(frame.links)
        links = {name: links for name, links in frame.links.items() if known.get(name) != links}
        yield as_json({"frame": replace(frame, links=links, names=frame.names if frame.reset else ())})

    def decision(self, page: RecordPage, question: RecordQuestion) -> Iterator[str]:
        if not question.agent:
            return
        view = self._run.view(page.case)
        t = _time_of(question, view)
        try:
            ok, text = True, view.decision(question.agent, t)
        except RecordFileError as error:
            ok, text = False, str(error).removeprefix(f"{view.record.path}: ")
        except ANYTHING as error:  # a law or graph is anybody's code
            ok, text = False, named(error)
        command = command_line("why", str(view.record.path.parent), question.agent, f"{t:.10g}")
        yield as_json({"decision": {"agent": question.agent, "t": t, "ok": ok, "text": text, "command": command}})


def _time_of(question: RecordQuestion, view: RecordView) -> float:
    return view.known_end if question.at is None else min(max(0.0, question.at), view.record.t_end)


def _of(view: RecordView) -> dict[str, Any]:
    info = view.record.info
    return {
        "scenario": info.scenario,
        "case": info.case,
        "clock": info.clock,
        "level": info.level,
        "T_c": info.T_c,
        "started": info.started,
        "gridpeers": info.versions.get("gridpeers", ""),
        "names": info.inverters,
        "agents": view.record.agents,
        "shared": [(quantity.name, quantity.unit) for quantity in view.shared],
        "f_nom": next((config.f_nom for config in info.agents), 0.0),
    }


STILL = 3.0
"""Time (s) after which a record that does not grow is no longer followed: its writer has a chunk every 0.25 s."""

Growth = Literal["waiting", "recording", "ended", "broken", "cut"]
"""Nothing is recorded yet; the run goes on; it has ended; it broke; its record was cut off, or the run is frozen."""


class RecordNews(msgspec.Struct, frozen=True, kw_only=True):
    case: str
    cases: tuple[str, ...]
    """All cases of the run that have a record, the latest last."""
    t_end: float
    growth: Growth
    text: str
    notes: tuple[str, ...] = ()
    """Sentences on what the record, or this host, does not have."""
    events: tuple[EventView, ...] = ()


class RecordedRun:
    """Open the records of a run, each when it is asked for, from the folder of a run or case, or a run.mcap.

    RecordFileError if there is no record, none is coming, or the only one is none of ours.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._views: dict[str, RecordView] = {}
        single = path if not path.is_dir() else path / FILE
        self._single = single if single.is_file() or not path.is_dir() else None
        files = self._files()
        if not files and not self._is_coming():
            raise RecordFileError(
                f"{path}: there is no {FILE}: the run was not recorded, or this is not the folder of a run"
            )
        if len(files) == 1:
            self.view(next(iter(files)))

    @property
    def cases(self) -> tuple[str, ...]:
        return tuple(self._files())

    def view(self, case: str = "") -> RecordView:
        """Return a record as it is now; without a case, the latest. RecordFileError if it cannot be read."""
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
        """Return what is new of a record, whose first events are known; of the latest without a case."""
        view = self.view(case)
        record, later = view.record, tuple(view.events[events:])  # to read them meets what is damaged
        growth, text = self._growth(record)
        damage = record.damage if growth != "recording" else ()
        return RecordNews(
            case=case or self.cases[-1],
            cases=self.cases,
            t_end=record.t_end,
            growth=growth,
            text=text,
            notes=(*view.missing, *(f"{each[:1].upper()}{each[1:]}." for each in damage)),
            events=later,
        )

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
        try:
            return (self.path / "status.txt").read_text(encoding="utf-8").startswith("running")
        except (OSError, UnicodeDecodeError):
            return False

    def _growth(self, record: RunRecord) -> tuple[Growth, str]:
        if record.index.file.damaged:
            return "cut", "The file is damaged, and read up to there."
        if record.complete:
            outcome = record.outcome
            if outcome:
                return "broken", f"The run broke: {outcome}"
            return "ended", "" if outcome is not None else "The recorder ended before the run."
        try:
            still = time() - record.path.stat().st_mtime
        except OSError:
            return "cut", "The file is gone."
        if still < STILL:
            return ("recording", "The run goes on.") if record.t_end else ("waiting", "The run begins.")
        if not record.t_end:
            return "waiting", "Nothing is recorded yet, or the run was killed before it began."
        return "cut", "The record has no end: the run was killed, or is frozen."
