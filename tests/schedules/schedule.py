"""A schedule of faults, drawn from a seed: kills, freezes, link faults and switchings, then one heal. Pure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from random import Random
from typing import Any, NamedTuple

from gridpeers.netem.fault_schedule import Heal
from gridpeers.netem.models.delay import Uniform
from gridpeers.netem.schema.fault import Fault
from gridpeers.scenarios.emulation.link_data import EVERYTHING, LinkCommand

BEGIN = 2.0
"""Run time (s) of the earliest fault: the feeder has islanded at 1 s."""

HEAL = 8.0
"""Run time (s) at which every fault ends. Switches stay as they are."""

SWITCHES = ("13-152", "sw1_2", "sw2_3", "60-160")
"""Switches that are operated; the first connects the feeder to the grid."""


class Action(NamedTuple):
    """One thing that is done to the run."""

    t: float
    """Run time (s)."""
    kind: str
    """kill, start, freeze, thaw (of an agent's process), link (an order to emulated links), open, close."""
    subject: str | dict[str, Any]
    """The inverter, the switch, or the command to links."""

    def __str__(self) -> str:
        shown = self.subject if isinstance(self.subject, str) else LinkCommand.of_tree(self.subject)
        return f"{self.t:.2f} s {self.kind} {shown}"


def draw(seed: int, microgrids: Mapping[str, str], *, switchings: bool = True) -> tuple[Action, ...]:
    """Draw a schedule.

    Parameters
    ----------
    seed : int
        The same seed gives the same schedule.
    microgrids : Mapping[str, str]
        Microgrid of each inverter whose agent takes part.
    switchings : bool
        Whether switches are operated too.
    """
    random = Random(seed)
    names = list(microgrids)
    busy: dict[str, float] = {}
    """Until when a process is dead or frozen (s)."""
    actions: list[Action] = []
    draws: list[Callable[[float], list[Action]]] = [
        lambda t: _process(random, t, names, busy, "kill", "start", (0.2, 6.0)),
        lambda t: _process(random, t, names, busy, "freeze", "thaw", (0.05, 6.0)),
        lambda t: [_link(random, t, names, sorted(set(microgrids.values())))],
    ]
    if switchings:
        draws.append(lambda t: _switch(random, t))
    for t in sorted(round(random.uniform(BEGIN, HEAL - 0.2), 2) for _ in range(random.randint(10, 20))):
        actions += random.choice(draws)(t)
    actions.append(Action(HEAL, "link", LinkCommand(heal=Heal(on=EVERYTHING, from_s=0.0)).to_tree()))
    return tuple(sorted(actions, key=lambda action: action.t))


def _process(
    random: Random,
    t: float,
    names: Sequence[str],
    busy: dict[str, float],
    begin: str,
    end: str,
    lasts: tuple[float, float],
) -> list[Action]:
    """A fault of one process and its end, at the latest at the heal; nothing if the drawn one is not well."""
    name = random.choice(names)
    until = min(round(t + random.uniform(*lasts), 2), HEAL)
    if busy.get(name, 0.0) >= t:
        return []
    busy[name] = until
    return [Action(t, begin, name), Action(until, end, name)]


def _link(random: Random, t: float, names: Sequence[str], microgrids: Sequence[str]) -> Action:
    one, other = random.sample(names, 2)
    first, second = random.sample(list(microgrids), 2)
    on = random.choice(
        [
            f"{one} <-> {other}",
            f"{one} -> *",
            f"* -> {one}",
            f"plant -> {one}",
            f"{one} -> plant",
            f"{first.upper()} <-> {second.upper()}",
            "* <-> *",
            "* <-> *",
        ]
    )
    low = random.uniform(0.0, 0.5)
    fault = random.choice(
        [
            Fault(on=on, cut=True),
            Fault(on=on, loss=round(random.uniform(0.05, 0.9), 2)),
            Fault(on=on, delay=Uniform(low_s=round(low, 3), high_s=round(low + random.uniform(0.01, 0.2), 3))),
            Fault(on=on, duplicate=0.3, corrupt=0.1),
        ]
    )
    return Action(t, "link", LinkCommand(fault=fault).to_tree())


def _switch(random: Random, t: float) -> list[Action]:
    """Open a switch and close it after a while, or leave it open; closing does not look at the angle."""
    switch = random.choice(SWITCHES)
    first, then = ("close", "open") if switch == SWITCHES[0] else ("open", "close")  # the grid's is open when it begins
    back = round(t + random.uniform(0.1, 3.0), 2)
    return [Action(t, first, switch), *([Action(back, then, switch)] if back < HEAL else [])]
