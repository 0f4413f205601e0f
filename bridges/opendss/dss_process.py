"""The OpenDSS engine in a process of its own: it is asked for circuits, and may crash."""

from __future__ import annotations

import atexit
import importlib.util
import os
import pickle
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import Any

from gridpeers.bridges.opendss.dss_circuit import DssCircuit, ImportRequest
from gridpeers.plant.request_process import ProcessEndedError, RequestProcess, TransientFolder, no_room, program
from gridpeers.plant.tables.read import FeederError
from gridpeers.wire.wording import damaged, printable

MISSING = "reading .dss files needs the OpenDSS engine; install it: pip install 'gridpeers[opendss]'"

USER = "the import of .dss files"

SERVER = "gridpeers.bridges.opendss.dss_server"

LONGEST = 600.0
"""Time (s) after which a script that does not end is given up."""

SHOWN = 100
"""Letters of a command that an error shows."""

_lock = threading.Lock()
"""The engine reads one script at a time."""

_processes: dict[int, DssProcess] = {}
"""The engine's process, by the process that started it: one that was forked has not inherited the right to ask it."""


class DssProcess:
    """The process of the engine (`dss_server`), which ends with this one, and its folder."""

    def __init__(self) -> None:
        self._folder = TransientFolder("gridpeers-opendss-")
        try:
            self._process = RequestProcess(program(SERVER), self._folder)
        except OSError:
            self._folder.close()
            raise

    @property
    def pid(self) -> int:
        return self._process.pid

    def send(self, request: ImportRequest) -> None:
        self._process.send(request._asdict() | {"path": str(request.path)})

    def circuit(self, path: Path) -> DssCircuit:
        """Return the circuit that was asked for; FeederError if the engine refuses it, cannot be loaded, or crashes."""
        try:
            answer = self._process.answer(monotonic() + LONGEST)
        except ProcessEndedError as how:  # while it loads the engine, or somebody ended it
            raise FeederError("OpenDSS", (damaged("dss", f"its process {how}", USER),)) from None
        if answer is None:
            problem = f"{path.name}: the OpenDSS engine did not end within {LONGEST:g} s; simplify the script"
            raise FeederError(path.name, (problem,))
        if "not_importable" in answer:
            raise FeederError("OpenDSS", (damaged("dss", answer["not_importable"], USER),))
        if "unwritten" in answer:
            problem = no_room("what the OpenDSS engine reads", answer["unwritten"])
            raise FeederError(path.name, (f"{path.name}: {problem}",))
        if "ended" in answer:
            raise FeederError(path.name, (crashed(path, answer["ended"], answer["at"]),))
        result = Path(answer["result"])
        found: Any = pickle.loads(result.read_bytes())
        result.unlink()
        if isinstance(found, str):
            raise RuntimeError(f"the import of {path} failed:\n{found}")
        if not isinstance(found, DssCircuit):
            raise FeederError(path.name, found)
        return found

    def close(self) -> None:
        self._process.close()
        self._folder.close()


@contextmanager
def reading(request: ImportRequest) -> Iterator[DssProcess]:
    """Let the engine read a script while the caller does other things; its process stays for the next one."""
    if importlib.util.find_spec("dss") is None:
        raise FeederError("OpenDSS", (MISSING,))
    with _lock:
        process = _processes.get(os.getpid()) or DssProcess()
        _processes[os.getpid()] = process
        process.send(request)
        answered = False
        try:
            yield process
            answered = True
        finally:
            if not answered:  # an error, or Ctrl-C: its next answer would be that of this request
                close_engine()


def close_engine() -> None:
    """End the engine's process, if this process has one; the next import starts another."""
    process = _processes.pop(os.getpid(), None)
    if process is not None:
        process.close()


atexit.register(close_engine)


def crashed(path: Path, status: int, at: str) -> str:
    """Return one line on an engine that ended while it read a script.

    Examples
    --------
    >>> crashed(Path("a/Master.dss"), -11, "lines.dss:3: New Line.x")
    'lines.dss:3: the OpenDSS engine itself crashes (SIGSEGV); change this, or take it out; if it is sound, take out \
what comes before it, half by half, to find the cause: New Line.x'
    """
    where, _, command = printable(at).partition(": ")
    how = f"exit status {status}" if status > 0 else signal.Signals(-status).name
    if status == -signal.SIGKILL:
        how += ", as where memory runs out"
    shown = command if len(command) <= SHOWN else f"{command[:SHOWN]}..."
    return (
        f"{where or path.name}: the OpenDSS engine itself crashes ({how}); change this, or take it out; if it is "
        f"sound, take out what comes before it, half by half, to find the cause: {shown}"
    )
