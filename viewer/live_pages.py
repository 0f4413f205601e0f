"""Pages of a live run: frames as the run goes on, and what their clicks do to it."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import msgspec

from gridpeers.scenarios.live.run_address import RunAddress, UsageError, check_name
from gridpeers.viewer.page_actions import ActionClient, PageAction, scenario_form
from gridpeers.viewer.page_server import FASTEST, HEARTBEAT, SILENT, Talk, as_json, send, texts
from gridpeers.viewer.run_follower import RunFollower
from gridpeers.viewer.run_view import Cursor
from gridpeers.wire.codec import decode_foreign
from gridpeers.wire.driver.command_line import command_line
from gridpeers.wire.trust.credentials import Credentials
from gridpeers.wire.trust.key_folder import COMMANDING

if TYPE_CHECKING:
    from starlette.websockets import WebSocket


class LivePages:
    """Send every page what is new of a run, and with `control` carry out what it asks for."""

    def __init__(self, follower: RunFollower, where: RunAddress, *, control: bool = False) -> None:
        self._follower, self._where, self._control = follower, where, control
        self._news: set[asyncio.Event] = set()
        self._worker = ThreadPoolExecutor(1, "actions")
        self._actions = ActionClient(where)
        self._looks_only = looks_only(where.credentials)
        self._agents = OwnAgents(where)

    def close(self) -> None:
        self._worker.shutdown(cancel_futures=True)
        self._actions.close()
        self._agents.close()

    def talk(self, socket: WebSocket) -> tuple[Talk, Talk]:
        loop = asyncio.get_running_loop()

        def wake() -> None:
            for event in self._news:
                event.set()

        def on_news() -> None:
            with contextlib.suppress(RuntimeError):  # the loop has just closed
                loop.call_soon_threadsafe(wake)

        self._follower.on_news(on_news)
        return self._send(socket), self._receive(socket)

    async def _send(self, socket: WebSocket) -> None:
        hello = {"run": self._where.run, "where": str(self._where), "control": self._control, "silent_s": SILENT}
        await send(socket, as_json({"hello": hello}))
        cursor, drawn, news = Cursor(), False, asyncio.Event()
        self._news.add(news)
        try:
            while True:
                news.clear()
                if not drawn and (diagram := self._follower.feeder_map()) is not None:
                    await send(socket, as_json({"map": diagram}))
                    drawn = True
                frame, cursor = self._follower.frame(cursor)
                if frame.reset:
                    drawn = False
                await send(socket, as_json({"frame": frame}))
                for text in self._agents.take_endings():
                    await send(socket, as_json({"done": {"ok": False, "text": text}}))
                await asyncio.sleep(FASTEST)
                with contextlib.suppress(asyncio.TimeoutError):
                    await asyncio.wait_for(news.wait(), HEARTBEAT)
        finally:
            self._news.discard(news)

    async def _receive(self, socket: WebSocket) -> None:
        loop = asyncio.get_running_loop()
        async for text in texts(socket):
            await send(socket, as_json({"done": await loop.run_in_executor(self._worker, self._do, text)}))

    def _do(self, text: str) -> dict[str, Any]:
        """Carry out an action; return the answer to its page."""
        try:
            action = decode_foreign(msgspec.json.Decoder(PageAction).decode, text)
        except msgspec.DecodeError as error:
            return {"ok": False, "text": f"no action: {error}"}
        command = command_line(*action.words(), *self._where.words)
        if not self._control:
            return {"ok": False, "command": command, "text": f"refused: {self._looks_only}"}
        try:
            done = self._agents.start(action.subject) if action.kind == "start" else self._actions.perform(action)
            return {"ok": True, "command": command, "text": done, "scenario": scenario_form(action)}
        except (ValueError, OSError) as error:  # refused, nobody there, bad usage, no memory for a process
            return {"ok": False, "command": command, "text": str(error)}


LEAVING = 5.0  # Time (s) that an agent has to leave by itself


class OwnAgents:
    """Start agents as `gridpeers agent` does in a terminal: processes that leave when the page's server ends."""

    def __init__(self, where: RunAddress) -> None:
        self._where = where
        self._started: dict[str, tuple[subprocess.Popen[bytes], IO[bytes]]] = {}

    def start(self, name: str) -> str:
        """Start an agent, unless it was started here and still runs; return a sentence."""
        check_name("INVERTER", name)
        self.take_endings()
        if name in self._started:
            raise UsageError(f"{name}: its agent was started here already, process {self._started[name][0].pid}")
        log = tempfile.TemporaryFile()  # noqa: SIM115  closed with its process
        words = ["agent", name, *self._where.words]
        command = [sys.executable, "-P", "-m", "gridpeers", *words]
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT, start_new_session=True
        )
        self._started[name] = process, log
        return f"{name}: its agent starts, process {process.pid}; it leaves when this view ends"

    def take_endings(self) -> list[str]:
        """Return a sentence for each agent that has ended by itself since the last call."""
        endings = []
        for name, (process, log) in list(self._started.items()):
            if process.poll() is None:
                continue
            log.seek(0)
            lines = log.read()[-2000:].decode(errors="replace").strip().splitlines()
            log.close()
            del self._started[name]
            if process.returncode:
                endings.append(f"{name}: its agent ended, exit code {process.returncode}: {lines[-1] if lines else ''}")
        return endings

    def close(self) -> None:
        for process, _ in self._started.values():
            process.send_signal(signal.SIGTERM)
        for process, log in self._started.values():
            try:
                process.wait(LEAVING)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
            log.close()
        self._started.clear()


def looks_only(credentials: Credentials | None) -> str:
    """Return that a page without `--control` is read-only, and how the same person could act."""
    if credentials is None or credentials.own.role in COMMANDING:
        return "the page is read-only (--control lets it act)"
    folder = Path(credentials.certificate).parent
    may = (member.name for member in credentials.members if member.role in COMMANDING and not member.revoked)
    here = next((name for name in may if (folder / f"{name}.key").is_file()), None)
    way = f"--as {here} --control lets it act" if here else f"to act takes --control and the key of an {COMMANDING[0]}"
    return f"the page is read-only, as {credentials.own.name} has the role {credentials.own.role} ({way})"
