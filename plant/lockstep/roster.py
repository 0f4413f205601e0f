"""Who takes part in a run in simulated time: who may, who is there, who leaves and joins. Pure.

Of two processes of one name the first takes part. An agent that the scenario lets leave is told to stop, and its
inverter goes off the network; one that joins finds its inverter on the network again, at no load. One that the scenario
lets die is told to stop, but its inverter stays. One that dies of itself is taken off the roster and the run goes on,
marked not reproducible; one that dies before tick 0 ends the run: it would be another run.

Every change shows in the next `Prepare`.
"""

from __future__ import annotations

from typing import NamedTuple

from plant.schedule import Schedule
from wire.messages import PLANT, Nameplate, Prepare
from wire.patience import Awaited


class Ask(NamedTuple):
    """Fetch a nameplate."""

    name: str
    instance: str


class Refuse(NamedTuple):
    """Tell a process that it cannot take part."""

    name: str
    instance: str
    reason: str


class Dismiss(NamedTuple):
    """Forget what an agent has set, and tell its process, if there is one, to close."""

    name: str
    instance: str
    reason: str


class Note(NamedTuple):
    """Tell of an agent."""

    name: str
    text: str


class Connect(NamedTuple):
    """Put an inverter on the network, or take it off."""

    name: str
    on: bool


class Break(NamedTuple):
    """End the run."""

    reason: str


Step = Ask | Refuse | Dismiss | Note | Connect | Break
"""What is to be done, in the order given."""


STAYS = "its inverter stays on primary droop at its last set-points"
"""What becomes of the inverter of an agent that dies."""


class Roster:
    """Everybody who may take part in a run, and who does. Tokens, nameplates and the schedule in, steps out.

    Parameters
    ----------
    agents : tuple[str, ...]
        Who takes part from the start.
    inverters : tuple[str, ...]
        The plant's inverters.
    schedule : Schedule
        Who leaves, joins and dies later.

    Examples
    --------
    >>> from plant.config import Move, PlantConfig, PlantSettings
    >>> config = PlantConfig(run="demo", settings=PlantSettings(), agents=("inv1", "inv2"), T_c=0.02, end=5.0,
    ...     record_step=0.01, deadline=10.0, listen=(), moves=(Move(t=2.0, inverter="inv2", action="leave"),))
    >>> roster = Roster(config.agents, ("inv1", "inv2"), Schedule(config, ("inv1", "inv2")))
    >>> roster.appeared("inv2", "b", t=0.0, gathering=True), roster.appeared("inv1", "a", t=0.0, gathering=True)
    ([Ask(name='inv2', instance='b')], [Ask(name='inv1', instance='a')])
    >>> roster.prepare(incarnation=1, t=0.0).roster
    ('inv1', 'inv2')
    >>> steps, joining = roster.move(100, t=2.0)
    >>> for step in steps:
    ...     print(step)
    Note(name='inv2', text='inv2 leaves at t = 2 s, as the scenario says')
    Dismiss(name='inv2', instance='b', reason='inv2 leaves at t = 2 s, as the scenario says')
    Connect(name='inv2', on=False)
    >>> roster.changed, roster.prepare(incarnation=1, t=2.0).roster
    (True, ('inv1',))
    """

    def __init__(self, agents: tuple[str, ...], inverters: tuple[str, ...], schedule: Schedule) -> None:
        self._agents, self._schedule = agents, schedule
        later = schedule.joiners.difference(agents)
        self.everyone = (*agents, *(name for name in inverters if name in later))
        """All who may ever take part, in the order of the inverters."""
        self.instances: dict[str, str] = {}
        """The one instance of each agent that is there."""
        self.plates: dict[str, Nameplate] = {}
        """The nameplates of those."""
        self.names: tuple[str, ...] = ()
        """Who is on the roster that was sent last."""
        self.number = -1
        """Its number."""
        self.changed = False
        """Whether somebody has come or gone since."""
        self.joining: tuple[str, ...] = ()
        """Whom the tick is held for: they may appear although the run has begun."""

    def appeared(self, name: str, instance: str, *, t: float, gathering: bool) -> list[Step]:
        """Note the token of an agent's process at t (s); whether the run has not begun yet decides who is let in."""
        refusal = self._refusal(name, instance, t, gathering)
        if refusal:
            return [Refuse(name, instance, refusal)]
        if name in self.instances:
            return []
        self.instances[name] = instance
        return [Ask(name, instance)]

    def _refusal(self, name: str, instance: str, t: float, gathering: bool) -> str:
        if name not in self.everyone:
            return f"{name}: the plant waits for no agent of this name, only for {', '.join(self.everyone)}"
        if self.instances.get(name, instance) != instance:
            return f"{name}: another agent of this name takes part in the run already; give this one another name"
        if gathering and name not in self._agents:
            return f"{name}: the scenario lets it join later; start it when the plant awaits it"
        if not gathering and name not in self.instances and name not in self.joining:
            return f"{name}: the run has begun, at t = {t:g} s; an agent can join only before its start"
        return ""

    def absent(self, names: tuple[str, ...]) -> tuple[Awaited, ...]:
        """What is still to come of these: tokens and nameplates."""
        tokens = [Awaited("token", name) for name in names if name not in self.instances]
        plates = [Awaited("nameplate", name) for name in names if name in self.instances and name not in self.plates]
        return (*tokens, *plates)

    def died(self, name: str, *, t: float, begun: bool) -> list[Step]:
        """Note that somebody who takes part has died, at t (s); whether tick 0 had come by then."""
        self._lose(name)
        if not begun:
            return [Break(f"{name} died before the run began")]
        if name in self.joining:
            return [Break(f"{name} died at t = {t:g} s, before it had joined")]
        return [Note(name, f"{name} died at t = {t:g} s; {STAYS}")]

    def _lose(self, name: str) -> str:
        """Note that an agent no longer takes part; its instance, empty if it was not there."""
        self.changed = True
        self.plates.pop(name, None)
        return self.instances.pop(name, "")

    def move(self, tick: int, *, t: float) -> tuple[list[Step], tuple[str, ...]]:
        """Let leave who leaves at a tick, at t (s); also, who is to join and is not there."""
        leave, join, die = self._schedule.take(tick)
        when = f"at t = {t:g} s, as the scenario says"
        steps: list[Step] = []
        for name in leave:
            steps += [*self._dismiss(name, f"{name} leaves {when}"), Connect(name, False)]
        for name in die:
            steps += self._dismiss(name, f"{name} dies {when}; {STAYS}")
        awaited = tuple(name for name in join if name not in self.instances)
        return steps + [Note(name, f"{name} joins {when}") for name in awaited], awaited

    def _dismiss(self, name: str, text: str) -> list[Step]:
        return [Note(name, text), Dismiss(name, self._lose(name), text)]

    def admit(self) -> list[Step]:
        """Go on with those who have joined: their inverters are on the network, at no load."""
        joined, self.joining, self.changed = self.joining, (), True
        return [Connect(name, True) for name in joined]

    def prepare(self, *, incarnation: int, t: float) -> Prepare:
        """Draw up the next roster, at t (s), of all who are there."""
        self.names = tuple(name for name in self.everyone if name in self.instances)
        self.number += 1
        self.changed = False
        return Prepare(
            sender=PLANT,
            incarnation=incarnation,
            seq=self.number,
            t=t,
            roster=self.names,
            instances=tuple(self.instances[name] for name in self.names),
        )
