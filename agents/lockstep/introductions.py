"""How an agent in simulated time finds the others: whom it has met, and from whom it is sure to hear. Pure.

Nothing tells an agent who exists. For every token of another agent it fetches the nameplate. Whom the rule makes its
in-neighbour it listens to, then fetches the nameplate once more: subscription and query take the same way in the same
order, so the answer proves that the neighbour's publications will come. For rules that look at pairs this happens at
once; for a ring, when `Prepare` has named the roster. `Ready` goes to the plant when all nameplates of the roster are
known and all in-neighbours proven.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from agents.agent import Agent
from agents.topology import is_pairwise
from wire.admission import Admission, is_news
from wire.codec import RejectedError
from wire.messages import Nameplate, Prepare


class Peer(NamedTuple):
    """One process of an agent."""

    name: str
    instance: str


class Ask(NamedTuple):
    """Fetch a nameplate."""

    peer: Peer


class Hear(NamedTuple):
    """Listen to somebody's states, from now on."""

    name: str


class Confirm(NamedTuple):
    """Tell the plant `Ready`."""

    roster: int
    """Number of the roster."""


Step = Ask | Hear | Confirm
"""What is to be done; in the order given, as later steps count on earlier ones."""


class Introductions:
    """What one agent knows of who the others are. Tokens, nameplates and rosters in, steps out.

    Parameters
    ----------
    agent : Agent
        Who is introduced to the others; it keeps their nameplates, and its rule says whom to listen to.
    instance : str
        Its process.
    admission : Admission
        Told in which epoch each of the others speaks.

    Examples
    --------
    >>> from agents.config import AgentConfig, Control
    >>> def agent(name: str) -> Agent:
    ...     return Agent(AgentConfig(run="demo", name=name, kind="GFM", microgrid="mg1", P_rated=6e5, V_nom=277.0,
    ...         f_nom=60.0, m_p=0.01, m_q=0.05, T_c=0.02, control=Control(secondary="all", graph="full"),
    ...         deadline=10.0, connect=()))
    >>> introductions = Introductions(agent("inv1"), "a", Admission())
    >>> other, plate = Peer("inv2", "b"), agent("inv2").nameplate
    >>> introductions.appeared(other)
    [Ask(peer=Peer(name='inv2', instance='b'))]
    >>> introductions.answered(other, plate)
    [Hear(name='inv2'), Ask(peer=Peer(name='inv2', instance='b'))]
    >>> introductions.prepare(
    ...     Prepare(sender="plant", incarnation=1, seq=0, t=0.0, roster=("inv1", "inv2"), instances=("a", "b")))
    []
    >>> introductions.missing()
    ['inv2']
    >>> introductions.answered(other, plate)
    [Confirm(roster=0)]
    """

    def __init__(self, agent: Agent, instance: str, admission: Admission) -> None:
        self._agent, self._admission = agent, admission
        self._own = Peer(agent.config.name, instance)
        self._pairwise = is_pairwise(agent.config.control)
        self.roster: int | None = None
        """Number of the last roster that this process is on; None before the first."""
        self.ready = False
        """Whether all is known that this roster needs. It stays so if somebody dies: the next roster tells."""
        self._members: dict[str, str] = {}
        """Names on that roster, and their instances."""
        self._asked: set[Peer] = set()
        self._plates: dict[Peer, Nameplate] = {}
        """Nameplate of each peer; it never changes."""
        self._believed: dict[str, Peer] = {}
        """Of each name the one that is taken to speak for it."""
        self._known: dict[Peer, bool] = {}
        """Peers whose nameplate is known; True once they have proven to hear our subscription."""
        self._proving: set[Peer] = set()
        self._heard: set[str] = set()
        """Names that are listened to."""
        self._gone: set[Peer] = set()
        """Peers whose token has vanished."""

    def appeared(self, peer: Peer) -> list[Step]:
        """Note the token of another agent's process."""
        self._gone.discard(peer)
        if peer in self._asked:
            return []
        self._asked.add(peer)
        return [Ask(peer)]

    def vanished(self, peer: Peer) -> None:
        """Note that a token is gone, and with it its holder."""
        self._gone.add(peer)
        self._asked.discard(peer)
        self._known.pop(peer, None)
        self._proving.discard(peer)
        self._plates.pop(peer, None)
        if self._believed.get(peer.name) == peer:
            del self._believed[peer.name]
            self._admission.release(peer.name)

    def answered(self, peer: Peer, plate: Nameplate) -> list[Step]:
        """Take a nameplate.

        Raises
        ------
        RejectedError
            If it contradicts what this peer has said before, or its token is gone.
        """
        steps: list[Step] = []
        if peer not in self._asked:
            raise RejectedError("ghost", f"the nameplate of {peer.name}, whose token is gone")
        if is_news(plate, self._plates.get(peer)):
            self._plates[peer] = plate
        if peer in self._proving:
            self._proving.discard(peer)
            self._known[peer] = True
        elif peer not in self._known:
            self._known[peer] = False
            if peer.name not in self._members or self._member(peer.name) in (peer, *self._gone):
                self._believe(peer)
                if self._pairwise and self._agent.in_neighbours((self._own.name, peer.name)):
                    steps += self._listen_to(peer)
        return steps + self._get_ready()

    def _believe(self, peer: Peer) -> None:
        """Take it that this process speaks for its name: until a roster names another one."""
        plate, self._believed[peer.name] = self._plates[peer], peer
        self._agent.meet(plate)
        self._admission.bind(peer.name, plate.incarnation)

    def prepare(self, message: Prepare) -> list[Step]:
        """Get ready for a roster.

        Raises
        ------
        RejectedError
            If it is not newer than the last one, or without this process.
        """
        if self.roster is not None and message.seq <= self.roster:
            raise RejectedError("stale", f"roster {message.seq}, {self.roster} is known")
        members = dict(zip(message.roster, message.instances, strict=True))
        if members.get(self._own.name) != self._own.instance:
            raise RejectedError("unexpected", f"roster {message.seq} is without this process")
        self.roster, self._members, self.ready = message.seq, members, False
        for peer in map(self._member, members):
            if peer in self._plates:
                self._believe(peer)
        return self._get_ready()

    def missing(self) -> list[str]:
        """Members whose nameplate is missing; when there is none, in-neighbours without proof."""
        unknown = [name for name, instance in self._members.items() if not self._has_met(Peer(name, instance))]
        neighbours = self._agent.in_neighbours(self._members)
        return unknown or [name for name in neighbours if not self._known[self._member(name)]]

    def living(self, names: Iterable[str]) -> dict[str, str]:
        """Those of these names whose token is there, and their instances on the roster."""
        members = {name: self._members.get(name, "") for name in names}
        if not self._gone:
            return members
        return {name: instance for name, instance in members.items() if (name, instance) not in self._gone}

    def _member(self, name: str) -> Peer:
        return Peer(name, self._members[name])

    def _has_met(self, peer: Peer) -> bool:
        return peer in self._known or peer.name == self._own.name

    def _listen_to(self, peer: Peer) -> list[Step]:
        """Listen to a peer whose nameplate is known, and have it prove that it hears the subscription."""
        self._proving.add(peer)
        if peer.name in self._heard:
            return [Ask(peer)]
        self._heard.add(peer.name)
        return [Hear(peer.name), Ask(peer)]

    def _get_ready(self) -> list[Step]:
        """Ask for proof of whom this roster makes in-neighbours; say so once nothing is missing any more."""
        if self.roster is None or self.ready:
            return []
        missing = self.missing()
        if not missing:
            self.ready = True
            return [Confirm(self.roster)]
        unproven = (peer for peer in map(self._member, missing) if self._has_met(peer) and peer not in self._proving)
        return [step for peer in unproven for step in self._listen_to(peer)]
