"""The OpenDSS engine in a process of its own, as it may crash on a script.

The process loads the engine once, and stays for the next script. Requests are JSON objects, one a line on standard
input (the fields of `ImportRequest`), answered one a line on standard output: {} when the circuit, pickled, is in the
file `CIRCUIT` of its folder, {"problems": [...]} of a refused script, or {"error": traceback}.
"""

from __future__ import annotations

import atexit
import contextlib
import importlib.util
import json
import os
import pickle
import signal
import sys
import threading
import traceback
from pathlib import Path
from time import monotonic
from typing import Any

from gridpeers.bridges.opendss.dss_circuit import DssCircuit, ImportRequest, read_circuit
from gridpeers.plant.request_process import ProcessEndedError, RequestProcess, TransientFolder, no_room, program
from gridpeers.plant.tables.read import FeederError
from gridpeers.wire.wording import damaged, printable

USER = "the import of .dss files"
CIRCUIT, PLACE = "circuit.pickle", "place"
"""Files in the folder of the process: its answer, and what the engine is about to do."""

LONGEST = 600.0  # time (s) after which a script that does not end is given up
SHOWN = 100  # letters of a command that an error shows

_lock = threading.Lock()  # the engine reads one script at a time
_processes: dict[int, tuple[RequestProcess, TransientFolder]] = {}
"""The engine's process and folder, by the process that started it: a fork has not inherited the right to ask it."""


def circuit_of(request: ImportRequest) -> DssCircuit:
    """Return the circuit of a script; FeederError if the engine refuses it, cannot be loaded, or crashes."""
    if importlib.util.find_spec("dss") is None:
        missing = "reading .dss files needs the OpenDSS engine; install it: pip install 'gridpeers[opendss]'"
        raise FeederError("OpenDSS", (missing,))
    name = Path(request.path).name
    with _lock:
        if os.getpid() not in _processes:
            folder = TransientFolder("gridpeers-opendss-")
            _processes[os.getpid()] = RequestProcess(program(__name__), folder), folder
        process, folder = _processes[os.getpid()]
        try:
            process.send(request._asdict())
            # meanwhile: loading it takes longer than the engine takes to read a small script
            import gridpeers.plant.network  # noqa: F401

            answer = process.answer(monotonic() + LONGEST)
            if answer is None:
                problem = f"{name}: the OpenDSS engine did not end within {LONGEST:g} s; simplify the script"
                raise FeederError(name, (problem,))
        except ProcessEndedError as how:
            place = folder.path / PLACE
            at = place.read_text(errors="replace").strip() if place.exists() else ""
            close_engine()
            problem = crashed(how, at, name) if at else damaged("dss", f"its process {how}", USER)
            raise FeederError(name, (problem,)) from None
        except BaseException:  # Ctrl-C, say: the next answer would be that of this request
            close_engine()
            raise
        if "problems" in answer:
            raise FeederError(name, tuple(answer["problems"]))
        if "error" in answer:
            raise RuntimeError(f"the import of {request.path} failed:\n{answer['error']}")
        circuit: DssCircuit = pickle.loads((folder.path / CIRCUIT).read_bytes())
        (folder.path / CIRCUIT).unlink()
    return circuit


def close_engine() -> None:
    """End the engine's process, if this process has one; the next import starts another."""
    if running := _processes.pop(os.getpid(), None):
        process, folder = running
        process.close()
        folder.close()


atexit.register(close_engine)


def crashed(how: ProcessEndedError, at: str, name: str) -> str:
    """Return one line on an engine that ended while it read a script.

    >>> crashed(ProcessEndedError("was killed by SIGSEGV"), "lines.dss:3: New Line.x", "Master.dss")
    'lines.dss:3: the OpenDSS engine itself crashes (its process was killed by SIGSEGV); change this, or take it out; \
if it is sound, take out what comes before it, half by half, to find the cause: New Line.x'
    """
    where, _, command = printable(at).partition(": ")
    memory = ", as where memory runs out" if signal.SIGKILL.name in str(how) else ""
    shown = command if len(command) <= SHOWN else f"{command[:SHOWN]}..."
    return (
        f"{where or name}: the OpenDSS engine itself crashes (its process {how}{memory}); change this, or take it out; "
        f"if it is sound, take out what comes before it, half by half, to find the cause: {shown}"
    )


def main() -> None:
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # the engine may print
    for line in sys.stdin:
        print(json.dumps(_answer(json.loads(line))), file=answers, flush=True)


def _answer(request: dict[str, Any]) -> dict[str, Any]:
    try:
        from dss import DSS  # noqa: F401
    except Exception as error:  # a damaged package may raise anything
        return {"problems": [damaged("dss", f"{type(error).__name__}: {error}", USER)]}
    place = os.open(PLACE, os.O_CREAT | os.O_TRUNC | os.O_WRONLY)

    def tell(text: str) -> None:
        with contextlib.suppress(OSError):  # the disk is full
            os.pwrite(place, text.encode()[:1000].ljust(1000), 0)

    try:
        circuit = read_circuit(ImportRequest(**request), tell)
        try:
            Path(CIRCUIT).write_bytes(pickle.dumps(circuit, pickle.HIGHEST_PROTOCOL))
        except OSError as error:
            Path(CIRCUIT).unlink(missing_ok=True)
            problem = no_room("what the OpenDSS engine reads", str(error))
            return {"problems": [f"{Path(request['path']).name}: {problem}"]}
    except FeederError as error:
        return {"problems": error.problems}
    except Exception:
        return {"error": traceback.format_exc()}
    finally:
        os.close(place)
        Path(PLACE).unlink()
    return {}


if __name__ == "__main__":
    main()
