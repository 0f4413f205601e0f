"""The last messages that an agent has heard, with their ages; and the agents that it meets in real time. Pure."""

from __future__ import annotations

from math import inf

from gridpeers.agents.agent import Agent
from gridpeers.wire.links import Links
from gridpeers.wire.messages import AnyMessage, Measurement, Nameplate, State
from gridpeers.wire.post import Handler, Post, Route


class Hearing:
    """What an agent has heard, through the emulated links if there are any: its measurement, its neighbours' states.

    Times are run time (s). Simulated time takes them from the ticks. In real time the agent counts them on its own
    clock, from an origin of its own.
    """

    def __init__(self, agent: Agent, links: Links | None) -> None:
        self.agent, self.links = agent, links
        self.states: dict[str, tuple[State, float]] = {}
        """Last state of each neighbour, and the time of its arrival."""
        self.measurement: Measurement | None = None
        self.measured_at = 0.0
        """Time at which the measurement arrived."""

    def keep(self, message: AnyMessage, at: float) -> None:
        """Use a message that came at this time."""
        if type(message) is State:
            if self.agent.hear(message):
                self.states[message.sender] = message, at
        elif type(message) is Measurement:
            self.measurement, self.measured_at = message, at

    @property
    def t(self) -> float:
        return 0.0 if self.measurement is None else self.measurement.t

    def age(self, name: str, at: float) -> float:
        """Return the age of a neighbour's last state (s); infinite if there is none.

        It is the greater of the time since its arrival, and of its own time before the own measurement's.
        """
        if name not in self.states:
            return inf
        state, arrived_at = self.states[name]
        return max(at - arrived_at, self.t - state.t)

    def clear(self) -> None:
        self.states.clear()
        self.measurement = None


class OpenMeeting:
    """The agents of a run without a roster: each that has a token and answers takes part. States go to `on_state`."""

    def __init__(self, post: Post, heard: Hearing, on_state: Handler) -> None:
        self._post, self._heard, self._on_state = post, heard, on_state
        self.neighbours: tuple[str, ...] = ()
        """In-neighbours by the run's graph among the agents that are met."""

    def on_nameplate(self, instance: str, nameplate: Nameplate, first: bool, now: float) -> None:
        if first:
            self._heard.agent.meet(nameplate)
            self.listen()

    def gone(self, name: str, instance: str) -> bool:
        """Note that a process is gone; return whether it counted."""
        if not self._post.process_gone(name, instance):
            return False
        self._heard.agent.forget(name)
        if (nameplate := self._post.members.nameplates.get(name)) is not None:  # another process counts from now on
            self._heard.agent.meet(nameplate)
        self.listen()
        return True

    def listen(self) -> None:
        post = self._post
        self.neighbours = self._heard.agent.in_neighbours((post.name, *sorted(post.members.nameplates)))
        for name in self.neighbours:
            post.listen(post.keys.state(name), Route(name, (State,), self._on_state))

    def clear(self) -> None:
        for name in self._post.members.nameplates:
            self._heard.agent.forget(name)
        self._post.members.clear()
        self.neighbours = ()
