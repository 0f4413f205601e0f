"""The other agents, as one agent in wall-clock time knows them: who is there, who that is, whom it listens to. Pure."""

from __future__ import annotations

from collections.abc import Iterator

from agents.agent import Agent
from agents.freerun.claims import Claims
from wire.admission import Admission, is_news
from wire.codec import RejectedError
from wire.messages import Nameplate


class Peers:
    """Agents whose tokens are there, and their nameplates.

    Parameters
    ----------
    agent : Agent
        The own one, who is told of each nameplate and applies the run's rule to them.
    admission : Admission
        Told in which epoch each of the others speaks.

    Examples
    --------
    >>> from agents.config import AgentConfig, Control
    >>> config = AgentConfig(run="demo", name="inv1", kind="GFM", microgrid="mg1", P_rated=6e5, V_nom=277.0,
    ...     f_nom=60.0, m_p=0.01, m_q=0.05, T_c=0.02, control=Control(secondary="all", graph="full"), deadline=10.0,
    ...     connect=())
    >>> agent = Agent(config)
    >>> peers = Peers(agent, Admission())
    >>> peers.appeared("inv2", "a"), list(peers.unknown)
    (True, [('inv2', 'a')])
    >>> from msgspec.structs import replace
    >>> peers.meet("a", replace(agent.nameplate, sender="inv2"))
    >>> peers.neighbours, list(peers.unknown)
    (('inv2',), [])
    >>> peers.vanished("inv2", "a"), peers.neighbours
    (True, ())
    """

    def __init__(self, agent: Agent, admission: Admission) -> None:
        self._agent, self._admission = agent, admission
        self._claims = Claims()
        self._met: dict[str, Nameplate] = {}
        """The nameplate of each, once it is known."""
        self.neighbours: tuple[str, ...] = ()
        """Whom the rule names among those that have been met."""

    def appeared(self, name: str, instance: str) -> bool:
        """Note a token; whether it counts, so that its holder's nameplate is to be asked for."""
        return self._claims.appeared(name, instance)

    def vanished(self, name: str, instance: str) -> bool:
        """Note that a token is gone; whether it counted, so that its holder is forgotten."""
        if not self._claims.vanished(name, instance):
            return False
        self._forget(name)
        self._apply_rule()
        return True

    def meet(self, instance: str, plate: Nameplate) -> None:
        """Note who somebody is, as its process has answered; that is learnt once.

        Raises
        ------
        RejectedError
            If another process counts, or this one has said something else before.
        """
        name = plate.sender
        if self._claims.instance(name) != instance:
            raise RejectedError("ghost", f"{name} is spoken for by another process")
        if not is_news(plate, self._met.get(name)):
            return
        self._met[name] = plate
        self._agent.meet(plate)
        self._admission.bind(name, plate.incarnation)
        self._apply_rule()

    def has_met(self, name: str) -> bool:
        """Whether somebody is there whose nameplate is known."""
        return name in self._met

    @property
    def unknown(self) -> Iterator[tuple[str, str]]:
        """Name and instance of those who are there and whose nameplate is not known."""
        return ((name, self._claims.instance(name)) for name in self._claims if name not in self._met)

    def forget_all(self) -> None:
        """Know nobody any more, as before the first session."""
        for name in sorted(self._met):
            self._forget(name)
        self._claims, self.neighbours = Claims(), ()

    def _forget(self, name: str) -> None:
        self._met.pop(name, None)
        self._admission.release(name)
        self._agent.forget(name)

    def _apply_rule(self) -> None:
        self.neighbours = self._agent.in_neighbours((self._agent.config.name, *sorted(self._met)))
