"""Runs the commands: tries them out where they can hurt nobody, sets them, and takes them off again."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Sequence
from types import TracebackType

from netem.relay.faults import Faults
from netem.tc.commands import Step, TcError, netem_steps

LONGEST = 10.0
"""Longest time (s) that a command may take; each takes some milliseconds."""

INSTEAD = (
    "tc can then still lose packets (loss) and limit the rate; for delays use python -m netem.relay between two "
    "endpoints, or faults on messages in the scenario"
)


def why_no_netem() -> str:
    """Why this kernel has no netem for us, and what to do instead; empty if it has.

    A kernel cannot be asked: so netem is set on a device in a network namespace that is thrown away again.
    """
    why = try_out(netem_steps("lo", Faults(delay=0.001)))
    return f"no tc netem here: {why}; {INSTEAD}" if why else ""


def try_out(steps: Sequence[Step]) -> str:
    """Do steps that are meant for "lo" in a new network namespace; why they failed, empty if they did not."""
    name = f"gptry{os.getpid()}"
    try:
        _run(("ip", "netns", "add", name))
        try:
            with Impaired("lo", steps, namespace=name):
                return ""
        finally:
            _run(("ip", "netns", "delete", name))
    except TcError as error:
        return str(error)


class Impaired:
    """A network device with faults. Use it as a context: leaving it takes them off.

    Nothing that stands on the device already is replaced: `tc` refuses to.

    Parameters
    ----------
    device : str
        Name of the device, for messages.
    steps : Sequence[Step]
        The commands.
    namespace : str, optional
        Network namespace in which the device is.

    Raises
    ------
    TcError
        On entering, if a command fails; those done before it are undone.
    """

    def __init__(self, device: str, steps: Sequence[Step], *, namespace: str = "") -> None:
        self._device, self._steps = device, steps
        self._prefix = ("ip", "netns", "exec", namespace) if namespace else ()
        self._done: list[Step] = []

    def __enter__(self) -> Impaired:
        try:
            for step in self._steps:
                _run((*self._prefix, *step.do))
                self._done.append(step)
        except TcError as error:
            self.heal()
            raise TcError(f"{self._device}: {error}") from None
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.heal()

    def heal(self) -> None:
        """Take the faults off."""
        while self._done:
            step = self._done.pop()
            if step.undo:
                _run((*self._prefix, *step.undo))


def _run(command: Sequence[str]) -> None:
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=LONGEST)
    except FileNotFoundError:
        raise TcError(f"there is no command {command[0]}; it comes with iproute2") from None
    if done.returncode != 0:
        said = done.stderr.strip().splitlines()
        raise TcError(f"{' '.join(command)}: {said[0] if said else f'exit status {done.returncode}'}")
