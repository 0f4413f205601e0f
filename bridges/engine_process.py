"""A reader of another program's files, in a process of its own: the program may crash, print, and keep a global state.

Requests are JSON objects, one a line on standard input, answered one a line on standard output: {} when the result,
pickled, is in the file `RESULT` of the process's folder, {"problems": [...]} of a refused file, {"error": traceback}.
"""

from __future__ import annotations

import contextlib
import importlib.util
import json
import os
import pickle
import shutil
import sys
import tempfile
import threading
import traceback
from collections.abc import Callable
from pathlib import Path
from time import monotonic
from typing import Any, NoReturn

from gridpeers.plant.request_process import ProcessEndedError, RequestProcess, program
from gridpeers.plant.tables.read import FeederError
from gridpeers.wire.driver.command_line import pip_install

RESULT, PLACE = "result.pickle", "place"  # Files in the folder of the process: its result, and what it is about to do

LONGEST = 600.0  # time (s) after which a file that is not read is given up

Tell = Callable[[str], None]  # takes what a reader is about to do, with file and line


class EngineError(RuntimeError):
    """The process ended, or an exception ended its work; then the text is its traceback."""

    def __init__(self, text: str, at: str = "", *, ended: bool = False) -> None:
        super().__init__(text)
        self.ended = ended
        self.at = at  # what the process that ended was about to do


class EngineProcess:
    """The process that runs `main` of a module of ours, once it is asked; it stays for the next file.

    `package`: of the other program; `name`: what people call it; `files`: the end of its files' names; `extra`: what to
    install.
    """

    def __init__(self, module: str, package: str, name: str, files: str, extra: str) -> None:
        self._module, self._package, self._name = module, package, name
        self._missing = f"reading {files} files needs {name}; install it: {pip_install(extra)}"
        self._lock = threading.Lock()  # it reads one file at a time
        self._running: dict[int, tuple[RequestProcess, Path]] = {}
        """By the process that started it: a fork has not inherited the right to ask it."""
        self.printed = ""  # output of the process until its last answer

    def read(self, path: Path, **request: Any) -> Any:
        """Return the result for a file; FeederError if it is refused, EngineError."""
        if importlib.util.find_spec(self._package) is None:
            raise FeederError(path.name, (self._missing,))
        with self._lock:
            if os.getpid() not in self._running:
                folder = Path(tempfile.mkdtemp(prefix=f"gridpeers-{self._package}-"))
                self._running[os.getpid()] = RequestProcess(program(self._module), folder), folder
            process, folder = self._running[os.getpid()]
            try:
                process.send({"path": str(path), **request})
                answer = process.answer(monotonic() + LONGEST)
                self.printed = process.printed()
                if answer is None:
                    problem = f"{path.name}: {self._name} did not end within {LONGEST:g} s; simplify the file"
                    raise FeederError(path.name, (problem,))
            except ProcessEndedError as how:
                place = folder / PLACE
                at = place.read_text(errors="replace").strip() if place.exists() else ""
                self.printed = process.printed()
                self.close()
                raise EngineError(str(how), at, ended=True) from None
            except BaseException:  # Ctrl-C, say: the next answer would be that of this request
                self.close()
                raise
            if "problems" in answer:
                raise FeederError(path.name, tuple(answer["problems"]))
            if "error" in answer:
                raise EngineError(answer["error"])
            result = folder / RESULT
            found = pickle.loads(result.read_bytes())
            result.unlink()
        return found

    def close(self) -> None:
        """End the process, if there is one."""
        if running := self._running.pop(os.getpid(), None):
            process, folder = running
            process.close()
            shutil.rmtree(folder, ignore_errors=True)


def serve(name: str, read: Callable[[dict[str, Any], Tell], Any]) -> NoReturn:
    """Answer requests until standard input ends, then remove the folder of this process.

    `read` returns the result for a request, or raises FeederError.
    """
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # the other program may print
    folder = Path.cwd()
    for line in sys.stdin:
        print(json.dumps(_answer(name, read, json.loads(line), folder)), file=answers, flush=True)
    shutil.rmtree(folder, ignore_errors=True)
    sys.stdout.flush()
    os._exit(0)  # the end of another program may be slow, and may fail


def _answer(
    name: str, read: Callable[[dict[str, Any], Tell], Any], request: dict[str, Any], folder: Path
) -> dict[str, Any]:
    place = os.open(folder / PLACE, os.O_CREAT | os.O_TRUNC | os.O_WRONLY)

    def tell(text: str) -> None:
        with contextlib.suppress(OSError):  # the disk is full
            os.pwrite(place, text.encode()[:1000].ljust(1000), 0)

    try:
        (folder / RESULT).write_bytes(pickle.dumps(read(request, tell), pickle.HIGHEST_PROTOCOL))
    except FeederError as error:
        return {"problems": error.problems}
    except Exception:
        return {"error": traceback.format_exc()}
    finally:
        os.close(place)
        (folder / PLACE).unlink()
    return {}
