"""The process of the OpenDSS engine: it loads the engine once, and forks a process for each script.

The engine may crash on a script. Then that process alone ends, and this one tells how. Requests are JSON objects, one
a line on standard input; each is answered by one on standard output, when its process has ended:

    {"path": ..., "f_nom": ..., "leave_out": [...], "switches": [...]}

    {"result": file}                       pickled: a `DssCircuit`, the problems of a `FeederError`, or a traceback
    {"ended": status, "at": text}          by a signal if status < 0, and what the engine was about to do
    {"unwritten": reason}                  the disk is full, say: there is no room for a result
    {"not_importable": reason}             the package dss is there and cannot be imported

The process, with what it has forked, ends when standard input does.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import json
import mmap
import os
import pickle
import select
import shutil
import signal
import sys
import tempfile
import traceback
from pathlib import Path
from typing import Any, NoReturn

from gridpeers.bridges.opendss.dss_circuit import ImportRequest, read_circuit
from gridpeers.plant.tables.read import FeederError

PLACE_SIZE = 1024
"""Longest text (bytes) of what the engine is about to do."""

PR_SET_PDEATHSIG = 1
"""Request of Linux's prctl: a signal to this process when its parent has ended."""


def main() -> None:
    """Serve until standard input ends; the working folder takes the results."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # the engine may print
    reason = _load_engine()
    gc.freeze()
    place = mmap.mmap(-1, PLACE_SIZE)  # shared with the processes that are forked
    for line in sys.stdin:
        answer = {"not_importable": reason} if reason else _answer(json.loads(line), place)
        print(json.dumps(answer), file=answers, flush=True)


def _load_engine() -> str:
    """Load what all the processes need; return why it cannot be."""
    try:
        from dss import DSS  # noqa: F401  once, before the forks
    except Exception as error:  # a damaged package may raise anything
        return f"{type(error).__name__}: {error}"
    return ""


def _answer(request: dict[str, Any], place: mmap.mmap) -> dict[str, Any]:
    place[:] = bytes(PLACE_SIZE)
    try:
        folder = Path(tempfile.mkdtemp(dir=Path.cwd()))
    except OSError as error:
        return {"unwritten": str(error)}
    result = folder.with_suffix(".pickle")
    reading, writing = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.close(reading)
        _read(request, folder, result, place)
    os.close(writing)
    ready, _, _ = select.select([reading, sys.stdin], [], [])
    if reading not in ready:  # whoever asks has ended: there is one request at a time
        os.kill(pid, signal.SIGKILL)
    status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    os.close(reading)
    shutil.rmtree(folder, ignore_errors=True)
    at = place[:].rstrip(b"\0").decode(errors="replace")
    if status == os.EX_CANTCREAT:
        result.unlink(missing_ok=True)
        return {"unwritten": at}
    if status:
        return {"ended": status, "at": at}
    return {"result": str(result)}


def _read(request: dict[str, Any], folder: Path, result: Path, place: mmap.mmap) -> NoReturn:
    """Read a script in a process of its own, write what comes out, and end."""
    with contextlib.suppress(AttributeError):  # where there is no prctl, this process goes on to its own end
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    found: Any

    def tell(text: str) -> None:
        place[:] = text.encode()[:PLACE_SIZE].ljust(PLACE_SIZE, b"\0")

    try:
        os.chdir(folder)
        found = read_circuit(
            ImportRequest(Path(request["path"]), request["f_nom"], request["leave_out"], request["switches"]),
            folder,
            tell,
        )
    except FeederError as error:
        found = error.problems
    except BaseException:
        found = traceback.format_exc()
    try:
        result.write_bytes(pickle.dumps(found, pickle.HIGHEST_PROTOCOL))
    except OSError as error:
        tell(str(error))  # in the place of what the engine was about to do
        os._exit(os.EX_CANTCREAT)
    os._exit(0)  # without what the parent has registered for its end


if __name__ == "__main__":
    main()
