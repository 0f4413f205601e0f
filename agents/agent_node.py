"""An agent as a node: what it does alike under both kinds of time. Pure.

It meets the other agents by their tokens and nameplates, listens to those whom the run's graph makes its in-neighbours,
passes what it hears through the emulated links, if there are any, and tells the plant what these did. When it ticks,
`agents.lockstep_agent` and `agents.realtime.realtime_agent` decide.
"""

from __future__ import annotations

from math import inf

from agents.agent import Agent
from agents.agent_config import AgentConfig
from agents.laws.law import Law
from agents.neighbour_states import NeighbourStates
from agents.own_nameplate import check_nameplate
from wire.actions import Listen
from wire.codec import RejectedError, encode
from wire.links import Links, arrived, is_usable
from wire.messages import PLANT, Measurement, Nameplate, State, Stop
from wire.node import Route
from wire.plant_follower import PlantFollower


class AgentNode(PlantFollower):
    """One agent in a run.

    Parameters
    ----------
    config : AgentConfig
        Who it is and the run's rule.
    instance : str
        Which process this is, unique in the run; part of the agent's token.
    links : Links or None
        What the links to it do to its messages.
    law : Law or None
        What decides its set-points; None is the paper's.
    rate : float, optional
        Most messages of one sender per s of run time; see `wire.admission`.
    """

    def __init__(
        self, config: AgentConfig, instance: str, links: Links | None, law: Law | None, rate: float = inf
    ) -> None:
        super().__init__(config.name, config.run, rate)
        check_nameplate(config)
        self.stopped = ""
        """Why it closes; empty as long as it goes on."""
        self.failed = ""
        """Why this agent could not go on, or take part at all; empty unless so."""
        self.plant_seen = False
        """Whether the plant's token was ever there."""
        self._config, self._instance, self._links = config, instance, links
        self._agent = Agent(config, law)
        self.states = NeighbourStates()
        """The last measurement and the last states that it heard."""
        self.routes[self.keys.stop_request(config.name, instance)] = Route(PLANT, (Stop,), self._on_stop_request)
        self.routes[self.keys.measurement(config.name)] = Route(PLANT, (Measurement,), self._on_own_measurement)

    # ---------------------------------------------------------------- what the driver needs

    @property
    def token(self) -> str:
        """Key of the own liveliness token."""
        return self.keys.alive_agent(self._name, self._instance)

    @property
    def nameplate(self) -> tuple[str, bytes]:
        """Key of the own queryable, and its answer."""
        return self.keys.nameplate(self._name, self._instance), encode(self._agent.nameplate)

    @property
    def subscriptions(self) -> tuple[str, ...]:
        """Keys to subscribe to before the token is declared."""
        return tuple(self.routes)

    @property
    def finished(self) -> bool:
        """Whether the driver should close."""
        return bool(self.stopped or self.failed)

    def work(self, now: float) -> bool:
        """Nothing: an agent computes when a message makes it possible, or its tick is due."""
        return False

    # ---------------------------------------------------------------- the others

    def appeared(self, key: str, now: float) -> None:
        """Note that a token appeared."""
        match self.keys.parts(key):
            case ("alive", "plant", epoch) if self._plant_appeared(epoch):
                self.plant_seen = True
                self._plant_came(now)
            case ("alive", "agent", name, instance) if name != self._name:
                self.members.appeared(name, instance)
                self._ask(name, instance)

    def vanished(self, key: str, now: float) -> None:
        """Note that a token is gone, and with it its holder."""
        match self.keys.parts(key):
            case ("alive", "plant", epoch) if self._plant_vanished(epoch):
                self._plant_gone(now)
            case ("alive", "agent", name, instance) if self._forget_process(name, instance):
                self._agent_gone(name, instance, now)

    def _met(self, nameplate: Nameplate, now: float) -> None:
        self._agent.meet(nameplate)

    def _plant_came(self, now: float) -> None:
        raise NotImplementedError

    def _plant_gone(self, now: float) -> None:
        raise NotImplementedError

    def _agent_gone(self, name: str, instance: str, now: float) -> None:
        raise NotImplementedError

    def _listen_to(self, name: str) -> None:
        """Subscribe to the states of an agent, unless that is done."""
        key = self.keys.state(name)
        if key not in self.routes:
            self.routes[key] = Route(name, (State,), self._on_state)
            self._actions.append(Listen(key))

    # ---------------------------------------------------------------- messages

    def _on_own_measurement(self, message: Measurement, payload: bytes, now: float) -> None:
        if message.to != self._name:
            raise RejectedError("unexpected", f"the measurement of {message.to}")
        self._on_measurement(message, payload, now)

    def _on_stop_request(self, message: Stop, payload: bytes, now: float) -> None:
        raise NotImplementedError

    def _on_measurement(self, message: Measurement, payload: bytes, now: float) -> None:
        raise NotImplementedError

    def _on_state(self, message: State, payload: bytes, now: float) -> None:
        raise NotImplementedError

    def _hear(self, message: State | Measurement, payload: bytes, at: float) -> None:
        """Use what came off the wire at this time (s of run time), unless an emulated link takes it, or keeps it."""
        if is_usable(self._links, message, payload, at, self.admission):
            self._keep(message, at)

    def _hear_late(self, at: float) -> None:
        """Use what the emulated links have let through by now (s of run time)."""
        for message in arrived(self._links, at, self.rejects, self.admission):
            if isinstance(message, State | Measurement):
                self._keep(message, at)

    def _keep(self, message: State | Measurement, at: float) -> None:
        if isinstance(message, State):
            self._agent.hear(message)
        self.states.keep(message, at)

    # ---------------------------------------------------------------- reports

    def _report_links(self, *, final: bool = False) -> None:
        """Send what the emulated links did since the last report."""
        key, epoch = self.keys.report(self._name), self._config.epoch
        self._publish_link_reports(key, self._links, epoch, instance=self._instance, last=final)
