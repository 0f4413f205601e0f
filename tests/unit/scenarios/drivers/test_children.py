"""The end of all processes of a run, in order."""

from __future__ import annotations

import signal
from typing import cast

import pytest

from gridpeers.scenarios.drivers.children import Child, Children


class Process:
    """A process that says what is done to it, and ends when it is waited for, or by the last signal alone."""

    def __init__(self, name: str, said: list[str], *, ends: bool = True) -> None:
        self.name, self.status = name, cast(int | None, None)
        self._said, self._ends = said, ends

    def signal(self, number: int) -> None:
        """Note the signal; the last one ends every process."""
        self._said.append(f"{signal.Signals(number).name} to {self.name}")
        if number == signal.SIGKILL:
            self.status = -number

    def join(self, until: float) -> bool:
        """End, if it does at all."""
        if self._ends and self.status is None:
            self._said.append(f"{self.name} ends")
            self.status = 0
        return self.status is not None

    def release(self) -> None:
        """Close nothing."""


def all_of(*processes: Process) -> Children:
    """The processes of a run."""
    children = Children()
    for process in processes:
        children.add(cast(Child, process))
    return children


def test_agents_are_asked_once_the_plant_has_gone() -> None:
    """One that is asked while its plant is there leaves, and the record has an inverter off the network at its end."""
    said: list[str] = []
    all_of(*(Process(name, said) for name in ("inv1", "plant", "inv2"))).end()

    asked = ["SIGTERM to plant", "plant ends", "SIGTERM to inv1", "SIGTERM to inv2"]
    assert said == [*asked, "inv1 ends", "inv2 ends"]


@pytest.mark.parametrize("plant", [(), ("plant",)])
def test_whoever_does_not_leave_is_killed(plant: tuple[str, ...]) -> None:
    """Whether there is a plant or not: every process is asked, and then ended."""
    said: list[str] = []
    all_of(*(Process(name, said, ends=False) for name in ("inv1", *plant))).end()

    asked = [*(f"SIGTERM to {name}" for name in plant), "SIGTERM to inv1"]
    assert said == [*asked, *(f"SIGKILL to {name}" for name in ("inv1", *plant))]
