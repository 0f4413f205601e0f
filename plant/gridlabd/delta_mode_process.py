"""GridLAB-D's process: its start, one request and its answer at a time, and its end, whoever dies first."""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from time import monotonic
from typing import Any

from plant.imports.gridlabd.gridlabd_process import messages

DELTA_MODE = Path(__file__).with_name("delta_mode.py")

SHOWN = 2
"""So many of GridLAB-D's own errors are in an error of ours; the first ones are the cause, the others follow."""

START_DEADLINE = 600.0
"""Longest time (s) until a model is loaded and its first power flow solved."""

MISSING = (
    "GridLAB-D is not there: {python} has no package gridlabd; install it (Linux, x86-64): "
    "pip install 'gridpeers[gridlabd]'"
)


class GridlabdError(RuntimeError):
    """GridLAB-D is missing, refuses its model, diverges, or has ended."""


class DeltaModeProcess:
    """GridLAB-D in a process of its own, which ends with this one.

    Parameters
    ----------
    python
        Interpreter that has the package gridlabd.
    deadline
        Longest wait for an answer (s).

    Raises
    ------
    GridlabdError
        If there is no such interpreter.
    """

    def __init__(self, python: str, deadline: float) -> None:
        self._python, self._deadline = python, deadline
        self._folder = tempfile.TemporaryDirectory(prefix="gridpeers-gridlabd-")
        self._log = Path(self._folder.name) / "gridlabd.log"
        self._unread = b""
        try:
            with self._log.open("wb") as log:
                self._process = subprocess.Popen(
                    [python, "-P", str(DELTA_MODE), str(os.getpid())],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=log,
                    cwd=self._folder.name,  # GridLAB-D writes files of its own where it stands
                    start_new_session=True,  # Ctrl-C is this process's alone, which then ends GridLAB-D
                )
        except OSError as error:
            self._folder.cleanup()
            raise GridlabdError(MISSING.format(python=python)) from error

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    def load(self, model: str, inverters: Sequence[tuple[str, str, str, str]]) -> str:
        """Load a model and take its first step; return GridLAB-D's version.

        Parameters
        ----------
        model
            Text of the GLM.
        inverters
            Name, node, kind and phases of each inverter to read.
        """
        path = Path(self._folder.name) / "feeder.glm"
        path.write_text(model, encoding="utf-8")
        return str(self._answer({"load": str(path), "inverters": inverters}, START_DEADLINE)["version"])

    def ask(self, **request: Any) -> dict[str, Any]:
        """Return the answer to a request; see `delta_mode`.

        Raises
        ------
        GridlabdError
            If GridLAB-D cannot do it, does not answer in time, or has ended; with its own errors.
        """
        return self._answer(request, self._deadline)

    def close(self) -> None:
        """End the process, at any time and as often as you like."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
            with contextlib.suppress(BrokenPipeError):  # a request that it never read
                pipe.close()
        self._folder.cleanup()

    def _answer(self, request: dict[str, Any], deadline: float) -> dict[str, Any]:
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(request).encode() + b"\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            raise self._ended() from None
        line = self._read_line(monotonic() + deadline)
        if line is None:
            raise GridlabdError(f"GridLAB-D has not answered for {deadline:g} s, so it was ended{self._complaints()}")
        if not line:
            raise self._ended()
        answer: dict[str, Any] = json.loads(line)
        if "No module named 'gridlabd'" in answer.get("error", ""):
            raise GridlabdError(MISSING.format(python=self._python))
        if "error" in answer:
            raise GridlabdError(f"GridLAB-D: {answer['error']}{self._complaints()}")
        return answer

    def _read_line(self, until: float) -> bytes | None:
        """Return the next line; empty if there is none any more, None if it has not come by a time (s, monotonic)."""
        assert self._process.stdout is not None
        out = self._process.stdout.fileno()
        while b"\n" not in self._unread:
            if not select.select([out], [], [], max(0.0, until - monotonic()))[0]:
                return None
            piece = os.read(out, 1 << 20)
            if not piece:
                return b""
            self._unread += piece
        line, _, self._unread = self._unread.partition(b"\n")
        return line

    def _ended(self) -> GridlabdError:
        status = self._process.wait()
        how = f"was killed by {signal.Signals(-status).name}" if status < 0 else f"exited with status {status}"
        return GridlabdError(f"GridLAB-D's process {how}{self._complaints()}")

    def _complaints(self) -> str:
        """Return GridLAB-D's first errors as the end of a sentence, on one line as all that goes over the wire."""
        found = messages(self._log.read_text(encoding="utf-8", errors="replace"))
        first = [text.removeprefix("GridLAB-D: ").rstrip(".") for text in found[:SHOWN]]
        return f"; its own words: {'; '.join(first)}" if first else "; it has printed no error"
