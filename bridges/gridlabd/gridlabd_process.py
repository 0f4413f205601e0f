"""GridLAB-D in a process of its own that is stepped from outside, and what GridLAB-D prints as sentences."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from time import monotonic
from typing import Any

from gridpeers.plant.request_process import ProcessEndedError, RequestProcess, TransientFolder
from gridpeers.wire.wording import damaged, printable

PLACED = re.compile(r"^(?P<file>\S[^()]*)\((?P<line>\d+)\)\s*: (?P<text>.*)$")
"""A message of the loader: file, line, text."""

LEVELLED = re.compile(r"^(?:ERROR|FATAL)\s+\[[^\]]*\]\s*: (?P<text>.*)$")  # A message of the simulation that ends it
FOLLOWING = re.compile(  # messages that only repeat that something failed
    r"load failed at or near|unable to load '|failed to load model file|model initialization failed"
    r"|run_preparation\(\) returned|shutdown after simulation|last (error|warning) message was repeated"
    r"|Failed to initialize simulation|initialization failed$|dump complete to|tzinfo\.txt|environment startup failed"
)


def messages(printed: str) -> list[str]:
    r"""Return what GridLAB-D complains of, each message once; what only repeats that something failed if nothing else.

    >>> messages("x.glm(3): class 'foo' is not known\nx.glm(3): load failed at or near 'object foo'\n")
    ["x.glm:3: class 'foo' is not known"]
    >>> messages("ERROR    [INIT] : NR: no swing bus found\nWARNING  [INIT] : slow\n")
    ['GridLAB-D: NR: no swing bus found']
    """
    found: list[str] = []
    following: list[str] = []
    for line in printed.replace("\r", "\n").splitlines():
        placed, levelled = PLACED.match(line), LEVELLED.match(line)
        if placed:
            text = f"{Path(placed['file']).name}:{placed['line']}: {printable(placed['text'].strip())}"
        elif levelled:
            text = f"GridLAB-D: {printable(levelled['text'].strip())}"
        else:
            continue
        (following if FOLLOWING.search(line) else found).append(text)
    found.sort(key=lambda text: text.startswith("GridLAB-D: "))  # those with a file and a line come first
    return list(dict.fromkeys(found or following))


SHOWN = 2  # so many of GridLAB-D's own errors are in an error of ours; the first ones are the cause, the others follow
LONGEST = 600.0  # longest time (s) until a model is loaded and its first step done
KEPT_MEMORY = {"MALLOC_MMAP_THRESHOLD_": str(32 * 2**20), "MALLOC_TRIM_THRESHOLD_": str(2**30)}
"""Lets glibc keep the memory of one power flow for the next: GridLAB-D's solver takes and returns its matrices in every
iteration. Returned to the system each time, they take a quarter of the processor time. No number depends on it."""


class GridlabdError(RuntimeError):
    """GridLAB-D is missing, refuses its model, diverges, or has ended."""


class DeltaModeProcess:
    """GridLAB-D in a process of its own, which ends with this one; `deadline` is the longest wait for an answer (s)."""

    def __init__(self, deadline: float) -> None:
        self._deadline = deadline
        self._folder = TransientFolder("gridpeers-gridlabd-")  # GridLAB-D writes files of its own where it stands
        command = [sys.executable, "-P", str(Path(__file__).with_name("delta_mode.py")), str(os.getpid())]
        self._process = RequestProcess(command, self._folder, KEPT_MEMORY)

    @property
    def pid(self) -> int:
        return self._process.pid

    def load(self, model: str, inverters: Sequence[tuple[str, str, str, str]]) -> None:
        """Load the text of a model, and take its first step.

        `inverters` has the name, node, kind and phases of each inverter to read.
        """
        path = self._folder.path / "feeder.glm"
        path.write_text(model, encoding="utf-8")
        self._answer({"load": str(path), "inverters": inverters}, LONGEST)

    def ask(self, **request: Any) -> dict[str, Any]:
        """Return the answer to a request (`delta_mode`); GridlabdError has GridLAB-D's own errors."""
        return self._answer(request, self._deadline)

    def close(self) -> None:
        self._process.close()
        self._folder.close()

    def _answer(self, request: dict[str, Any], deadline: float) -> dict[str, Any]:
        self._process.send(request)
        try:
            answer = self._process.answer(monotonic() + deadline)
        except ProcessEndedError as how:
            raise GridlabdError(f"GridLAB-D's process {how}{self._complaints()}") from None
        if answer is None:
            raise GridlabdError(f"GridLAB-D has not answered for {deadline:g} s, so it was ended{self._complaints()}")
        if "not_importable" in answer:
            raise GridlabdError(damaged("gridlabd", answer["not_importable"], "GridLAB-D as the plant"))
        if "error" in answer:
            raise GridlabdError(f"GridLAB-D: {answer['error']}{self._complaints()}")
        return answer

    def _complaints(self) -> str:
        """Return GridLAB-D's first errors as the end of a sentence, on one line as all that goes over the wire."""
        first = [text.removeprefix("GridLAB-D: ").rstrip(".") for text in messages(self._process.printed())[:SHOWN]]
        return f"; its own words: {'; '.join(first)}" if first else "; it has printed no error"
