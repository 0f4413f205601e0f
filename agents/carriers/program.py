"""A law that is any program: one JSON line a tick on its standard input, one on its standard output.

docs/how-to/law-programs.md has the lines. The program runs in the scenario's folder. Its standard error goes to the log
of its agent.
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import monotonic
from typing import Any

import msgspec

from gridpeers.agents.agent_config import LawChoice
from gridpeers.agents.carriers.time_limit import FIRST
from gridpeers.agents.laws.call import LawError
from gridpeers.agents.laws.law import NOTHING_SHARED, Law, Neighbour, Own, SetPoints, limits_in
from gridpeers.wire.codec import decode_foreign
from gridpeers.wire.wording import printable

LEAVING = 1.0  # Time (s) for a program to end after its input has ended

_GUARD = 'read -r _; sleep "$1"; test -z "$2" || rm -rf -- "$2"; kill -KILL 0'
"""Leader of the group. Its input ends with the process that started it, even by SIGKILL; then it ends the group."""


class ProcessGroup:
    """A program with pipes to its standard input and output, and all processes that it starts.

    Raise OSError if it cannot start. The whole group ends, also when the process that started it dies; the folder
    `litter` is then removed. Otherwise its maker removes it.
    """

    def __init__(self, command: Sequence[str], folder: str, litter: str = "") -> None:
        self._guard = subprocess.Popen(
            ["/bin/sh", "-c", _GUARD, "gridpeers-guard", f"{LEAVING:g}", litter],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            process_group=0,
        )
        try:
            self.program = subprocess.Popen(
                list(command),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                cwd=folder or None,
                bufsize=0,
                process_group=self._guard.pid,
            )
        except BaseException:
            self._end_group()
            raise

    def end_input(self) -> None:
        assert self.program.stdin is not None
        with contextlib.suppress(OSError):
            self.program.stdin.close()

    def wait(self, seconds: float) -> int | None:
        try:
            return self.program.wait(seconds)
        except subprocess.TimeoutExpired:
            return None

    def kill(self) -> None:
        self._end_group()
        self.program.wait()

    def _end_group(self) -> None:
        if self._guard.returncode is None:  # once it is reaped, its number may be another group's
            with contextlib.suppress(ProcessLookupError, PermissionError):  # macOS refuses a group that has ended
                os.killpg(self._guard.pid, signal.SIGKILL)
            self._guard.wait()
        assert self._guard.stdin is not None
        self._guard.stdin.close()


LONGEST_LINE = 100_000  # Most bytes of an answer

EXAMPLE = '{"P_set": 0.5, "V_set": 1.0}'


class ProgramAnswer(msgspec.Struct, frozen=True, kw_only=True):
    """Answer to a step; an answer to a start has `error` alone."""

    P_set: float | None = None
    V_set: float | None = None
    shared: dict[str, float] = {}
    send: bool = True
    error: str = ""


_decode = msgspec.json.Decoder(ProgramAnswer).decode


class ProgramLaw(Law):
    """A law carried by a program; `name` is for messages, and `litter` is a folder to remove if the agent dies.

    Raise ValueError if the program cannot be started, or a limit among the parameters is wrong.
    """

    def __init__(self, choice: LawChoice, name: str = "", litter: str = "") -> None:
        super().__init__(**limits_in(choice.parameters))
        self._choice = choice
        self._name = name or Path(choice.command[0]).name
        self._group: ProcessGroup | None = None
        self._input_ended = 0.0
        self._rest = b""
        command = list(choice.command)
        if choice.folder and (Path(choice.folder) / command[0]).exists():  # else it is on the PATH, or nowhere
            command[0] = str(Path(choice.folder) / command[0])
        try:
            self._group = ProcessGroup(command, choice.folder, litter)
        except OSError as error:
            text = f"{choice.command[0]}: {error.strerror}; give the path of an executable program, and name the "
            raise ValueError(f"law program {text}interpreter in the first line of a script") from None
        assert self._group.program.stdin is not None
        os.set_blocking(self._group.program.stdin.fileno(), False)
        self._patience = FIRST * choice.time_limit

    def start(self, own: Own) -> None:
        self._ask({"type": "start", "own": own._asdict(), "parameters": self._choice.parameters}, own.t)

    def step(self, own: Own, neighbours: Sequence[Neighbour], T: float) -> SetPoints:
        around = [other._asdict() | {"shared": dict(other.shared)} for other in neighbours]
        line = {"type": "step", "own": own._asdict(), "neighbours": around, "T": T}
        decision = self._ask(line, own.t)
        if decision.P_set is None or decision.V_set is None:
            missing = "P_set" if decision.P_set is None else "V_set"
            raise LawError(f"{self._name} answered a step at t = {own.t:.6g} s without {missing}; e.g. {EXAMPLE}")
        shared: Mapping[str, float] = decision.shared or NOTHING_SHARED
        return SetPoints(decision.P_set, decision.V_set, shared, decision.send)

    def end_input(self) -> None:
        if self._group is not None and not self._input_ended:
            self._input_ended = monotonic()
            self._group.end_input()

    def close(self) -> None:
        """End the input of the program; kill it, and the processes that it started, if they stay."""
        if self._group is None:
            return
        self.end_input()
        self._group.wait(max(0.0, self._input_ended + LEAVING - monotonic()))
        self._group.kill()
        assert self._group.program.stdout is not None
        self._group.program.stdout.close()
        self._group = None

    def _ask(self, line: dict[str, Any], t: float) -> ProgramAnswer:
        what = f"{line['type']} at t = {t:.6g} s"
        if self._group is None:
            raise LawError(f"{self._name} ended before the {what}")
        try:
            self._put(msgspec.json.encode(line) + b"\n", what)
            reply = self._line(what)
        except BrokenPipeError:
            raise LawError(self._ended(what)) from None
        try:
            decoded = decode_foreign(_decode, reply)
        except msgspec.DecodeError:
            shown = printable(reply.decode(errors="replace"), 100)
            raise LawError(f"{self._name} answered the {what} with {shown!r}; answer e.g. {EXAMPLE}") from None
        if decoded.error:
            raise LawError(f"{self._name} says: {printable(decoded.error, 300)} ({what})")
        self._patience = self._choice.time_limit
        return decoded

    def _put(self, line: bytes, what: str) -> None:
        """Write a line to the program; a program that does not read fills the pipe, and a write would block."""
        assert self._group is not None
        program = self._group.program
        assert program.stdin is not None
        assert program.stdout is not None
        end, file, out = monotonic() + self._patience, program.stdin.fileno(), program.stdout.fileno()
        if self._rest or _ready(out, select.POLLIN, 0.0):
            if self._rest or (piece := os.read(out, 65_536)):
                shown = printable((self._rest or piece).decode(errors="replace"), 100)
                self._group.kill()
                raise LawError(f"{self._name} printed {shown!r} before the {what}; print one line for each line read")
            raise LawError(self._ended(what))
        while line:
            if not _ready(file, select.POLLOUT, end - monotonic()):
                self._group.kill()
                raise LawError(f"{self._name} did not read the {what} within {self._patience:g} s")
            line = line[os.write(file, line) :]

    def _line(self, what: str) -> bytes:
        assert self._group is not None
        assert self._group.program.stdout is not None
        end, file = monotonic() + self._patience, self._group.program.stdout.fileno()
        while b"\n" not in self._rest:
            if not _ready(file, select.POLLIN, end - monotonic()):
                if self._group.program.poll() is not None:  # a process that it started may hold its output open
                    raise LawError(self._ended(what))
                self._group.kill()  # it may not notice the end of its input
                raise LawError(f"{self._name} did not answer the {what} within {self._patience:g} s")
            piece = os.read(file, 65_536)
            if not piece:
                raise LawError(self._ended(what))
            self._rest += piece
            if len(self._rest) > LONGEST_LINE:
                raise LawError(f"{self._name} answered the {what} with more than {LONGEST_LINE} bytes on one line")
        line, _, self._rest = self._rest.partition(b"\n")
        return line

    def _ended(self, what: str) -> str:
        assert self._group is not None
        code = self._group.wait(LEAVING)
        self._group.kill()  # processes that it started may still run
        if code is None:
            return f"{self._name} closed its input or its output at the {what}"
        return f"{self._name} ended at the {what} with " + (f"exit code {code}" if code >= 0 else f"signal {-code}")


def _ready(file: int, event: int, within: float) -> bool:
    """Wait until a file is ready, or has been closed; poll knows files beyond the 1024th, as select does not."""
    poll = select.poll()
    poll.register(file, event)
    return bool(poll.poll(max(0.0, 1000.0 * within)))
