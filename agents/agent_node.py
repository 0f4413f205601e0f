"""An agent as a node: the common part of both kinds of time. Pure.

The node meets the other agents by their tokens and nameplates, and listens to its in-neighbours by the run's graph. It
passes their states through the emulated links, if there are any, and reports these to the plant.
`gridpeers.agents.lockstep_agent` and `gridpeers.agents.realtime_agent` decide when it ticks.
"""

from __future__ import annotations

from math import inf

from gridpeers.agents.agent import Agent
from gridpeers.agents.agent_config import AgentConfig, check_nameplate
from gridpeers.agents.laws.law import Law
from gridpeers.wire.codec import RejectedError, encode
from gridpeers.wire.links import Links
from gridpeers.wire.membership import Membership, arrived, is_usable
from gridpeers.wire.messages import PLANT, Measurement, Nameplate, State, Stop
from gridpeers.wire.post import FollowedPlant, Post, Route


class NeighbourStates:
    """Keep the own last measurement and each neighbour's last state that the links delivered.

    Times are run time (s). Simulated time takes them from the ticks. In real time the agent counts them on its own
    clock, from an origin of its own.
    """

    def __init__(self) -> None:
        self._states: dict[str, tuple[State, float]] = {}
        self.measurement: Measurement | None = None
        self._measured_at = 0.0

    def keep(self, message: State | Measurement, at: float) -> None:
        if isinstance(message, State):
            self._states[message.sender] = message, at
        else:
            self.measurement, self._measured_at = message, at

    @property
    def t(self) -> float:
        return 0.0 if self.measurement is None else self.measurement.t

    def measured(self, at: float, max_age: float) -> Measurement | None:
        """Return the own measurement if it arrived at most `max_age` (s) ago, else None."""
        return None if round(at - self._measured_at, 9) > max_age else self.measurement

    def age(self, name: str, at: float) -> float:
        """Return the age of a neighbour's last state (s); infinite if there is none.

        It is the greater of the time since its arrival, and of its own time before the own measurement's.
        """
        if name not in self._states:
            return inf
        state, arrived_at = self._states[name]
        return max(at - arrived_at, self.t - state.t)

    def forget(self, name: str) -> None:
        self._states.pop(name, None)

    def clear(self) -> None:
        self._states.clear()
        self.measurement = None


_KEPT = State, Measurement
"""Messages that links deliver and a node keeps: as a tuple, for a union would be made anew for every message."""


class AgentNode:
    """One agent as a participant of a run.

    `instance` is the id of this process, unique in the run, and part of the agent's token. Without `links` none are
    emulated; without a law it is the paper's.
    """

    def __init__(
        self,
        config: AgentConfig,
        instance: str,
        links: Links | None,
        law: Law | None,
        members: Membership | None = None,
    ) -> None:
        post = self.post = Post(config.name, config.run, config.epoch, members)
        post.on_nameplate = self._on_nameplate
        self.plant = FollowedPlant(post, self._follow)
        self.keys, self.members, self.admission, self.rejects = post.keys, post.members, post.admission, post.rejects
        self.name, self.routes, self.watched = config.name, post.routes, post.keys.any_alive
        self.take_actions, self.take_rejects = post.take_actions, post.take_rejects
        self.is_known, self.lost = post.is_known, post.lost
        check_nameplate(config)
        self.stopped = ""
        self.failed = ""
        """Why the agent could not continue, or take part at all; empty otherwise."""
        self.plant_seen = False
        self.session_broken = False
        self._config, self._instance, self._links = config, instance, links
        self._agent = Agent(config, law)
        self._agent.rejects = self.rejects
        self.states = NeighbourStates()
        self.routes[self.keys.stop_request(config.name, instance)] = Route(PLANT, (Stop,), self._on_stop_request)
        self.routes[self.keys.measurement(config.name)] = Route(PLANT, (Measurement,), self._on_own_measurement)

    @property
    def token(self) -> str:
        return self.keys.alive_agent(self.name, self._instance)

    @property
    def tokens(self) -> tuple[str, ...]:
        return (self.token,)

    @property
    def nameplate(self) -> tuple[str, bytes]:
        """Key of the own queryable, and its answer."""
        return self.keys.nameplate(self.name, self._instance), encode(self._agent.nameplate)

    @property
    def subscriptions(self) -> tuple[str, ...]:
        return tuple(self.routes)

    @property
    def finished(self) -> bool:
        return bool(self.stopped or self.failed)

    def received(self, key: str, payload: bytes, now: float) -> None:
        if not self.finished:
            self.post.received(key, payload, now)

    def _follow(self, epoch: int) -> None:
        """Note that the node follows another plant, or the first."""

    def use_links(self, links: Links) -> None:
        self._links = links

    def note_siblings(self, names: frozenset[str]) -> None:
        """Note the agents of the same process, whose messages do not come from outside."""

    def work(self, now: float) -> bool:
        return False

    def appeared(self, key: str, now: float) -> None:
        match self.post.token(key, now, appeared=True):
            case ("alive", "plant", epoch) if self.plant.appeared(epoch):
                self.plant_seen = True
                self._plant_came(now)
            case ("alive", "agent", name, instance) if name != self.name:
                self.post.process_came(name, instance)

    def vanished(self, key: str, now: float) -> None:
        match self.post.token(key, now, appeared=False):
            case ("alive", "plant", epoch) if self.plant.vanished(epoch):
                self._plant_gone(now)
            case ("alive", "agent", name, instance) if self.post.process_gone(name, instance):
                self._agent_gone(name, instance, now)

    def _on_nameplate(self, instance: str, nameplate: Nameplate, first: bool, now: float) -> None:
        raise NotImplementedError

    def _plant_came(self, now: float) -> None:
        raise NotImplementedError

    def _plant_gone(self, now: float) -> None:
        raise NotImplementedError

    def _agent_gone(self, name: str, instance: str, now: float) -> None:
        raise NotImplementedError

    def _listen_to(self, name: str) -> None:
        self.post.listen(self.keys.state(name), Route(name, (State,), self._on_state))

    def _on_own_measurement(self, message: Measurement, payload: bytes, now: float) -> None:
        if message.to != self.name:
            raise RejectedError("unexpected", f"the measurement of {message.to}")
        self._on_measurement(message, payload, now)

    def _on_stop_request(self, message: Stop, payload: bytes, now: float) -> None:
        raise NotImplementedError

    def _on_measurement(self, message: Measurement, payload: bytes, now: float) -> None:
        raise NotImplementedError

    def _on_state(self, message: State, payload: bytes, now: float) -> None:
        raise NotImplementedError

    def _hear(self, message: State | Measurement, payload: bytes, at: float) -> None:
        """Use a message off the wire at this time (s of run time), unless an emulated link takes it."""
        if is_usable(self._links, message, payload, at, self.admission):
            self._keep(message, at)

    def _hear_late(self, at: float) -> None:
        """Use the messages that the emulated links have delivered by now (s of run time)."""
        for message in arrived(self._links, at, self.rejects, self.admission):
            if isinstance(message, _KEPT):
                self._keep(message, at)

    def _keep(self, message: State | Measurement, at: float) -> None:
        if type(message) is not State or self._agent.hear(message):
            self.states.keep(message, at)

    def _report_links(self, *, final: bool = False) -> None:
        for part in self.post.take_link_reports(self._links, instance=self._instance, last=final):
            self.post.publish(self.keys.report(self.name), encode(part))
